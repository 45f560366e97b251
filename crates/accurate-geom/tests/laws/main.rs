//! Laws of the vocabulary: properties over random rigs and curves, with brute force as the oracle.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bspline;
mod bspline_fit;
mod bspline_queries;
mod camera;
mod distortion;
mod epipolar;
mod epipolar_angle;
mod generators;
mod polyline;
mod refusals;
mod triangulation;
