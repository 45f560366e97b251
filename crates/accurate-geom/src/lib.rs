//! The vocabulary of `accurate`: pixels that know their view, cameras, rigs, epipolar lines,
//! triangulation, polylines and B-spline curves.
//!
//! # Conventions
//! - Pixel: x to the right, y down, centres at integer coordinates; the centre of the top-left
//!   pixel is `(0, 0)`.
//! - World to camera: `x_cam = R X + t`; projection `p ~ K [R | t] X`. `K` is upper triangular with
//!   a non-zero diagonal of any sign.
//! - Two views: [`View1`] and [`View2`]. A [`Fundamental<View1, View2>`](Fundamental) satisfies
//!   `p1ᵀ F p2 = 0`: it turns a pixel of view 2 into its epipolar line in view 1.
//! - Everything is `f64`. A value that left a constructor is finite and not degenerate.

// `!(x > limit)` refuses NaN together with too small values; `x <= limit` would let it through.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod banded;
mod bspline;
mod bspline_closest;
mod bspline_fit;
mod bspline_length;
mod bspline_line;
mod bspline_piece;
mod camera;
mod distortion;
mod epipolar;
mod epipolar_angle;
mod error;
pub mod number;
mod pixel;
mod polyline;
mod projection_matrix;
mod rig;
mod triangulate;
mod unit;

pub use bspline::{BSpline, Basis, Curve2, Curve3, Jet};
pub use bspline_closest::ClosestOnCurve;
pub use camera::{Camera, ImageSize, nearest_rotation};
pub use distortion::Distortion;
pub use epipolar::{
    EpipolarLine, Fundamental, epipolar_distance, sampson_distance, symmetric_epipolar_distance,
};
pub use epipolar_angle::{AngleSample, EpipolarAngle};
pub use error::GeomError;
pub use nalgebra;
pub use pixel::{Pixel, View, View1, View2};
pub use polyline::{ClosestOnPolyline, Polyline, Polyline2, Polyline3};
pub use rig::Rig;
pub use triangulate::{Triangulated, Triangulation, Triangulator, UnknownTriangulation};
pub use unit::{LengthUnit, UnknownUnit};

/// A point of an image plane, in px.
pub type Point2 = nalgebra::Point2<f64>;
/// A point of the world, in the rig's [`LengthUnit`].
pub type Point3 = nalgebra::Point3<f64>;
