//! Two ordered curves to correspondences to 3D points, by monotone dynamic programming over
//! epipolar distances (ECDP).
//!
//! [`Ecdp`] is the whole method. Its stages can be used alone: [`CostModel`] gives epipolar
//! distances in O(1) per pair of points, [`align`] and [`align_rows`] find the cheapest monotone
//! path through any costs, [`refine`] makes one-to-many matches unique, [`triangulate_pairs`] turns
//! pairs of pixels into a 3D curve. Every method that does this job is a [`CurveMatcher`].
//!
//! Conventions are those of [`accurate_geom`]: pixels with x to the right and y down, `f64`
//! throughout, undistorted coordinates.
//!
//! # Source
//! ACCURATE, section 2.3.

mod angle_signal;
mod cost;
mod cyclic_dp;
mod dp;
mod ecdp;
mod ends;
mod error;
mod free_dp;
mod free_ends;
mod interval_dp;
mod matcher;
mod pairs;
mod propose;
mod ray_image;
mod refine;
mod tangency;
mod zero_set;

pub use angle_signal::{AngleProfile, AngleSignal};
pub use cost::{CostModel, DistanceKind, validate_curve};
pub use cyclic_dp::{CyclicAlignment, align_cyclic};
pub use dp::{Alignment, MAX_ALIGNMENT_BYTES, TieOrder, align, align_rows};
pub use ecdp::{Ecdp, EcdpParams};
pub use ends::FreeEnds;
pub use error::MatchError;
pub use free_dp::{FreeAlignment, MovePrices, OpenEnds, align_free};
pub use free_ends::{FreeMatch, FreeMatchParams, FreeMatcher};
pub use interval_dp::{IntervalPrices, interval_energy};
pub use matcher::{CurveMatcher, CurvePoint, CurveReconstruction};
pub use pairs::{PixelPair, triangulate_pairs};
pub use propose::{Proposal, ProposeParams, SignalCurve, propose_pairs};
pub use refine::{
    ON_LINE_PX, RefineDirections, RefineRule, horizontal_runs, longest_run, refine, vertical_runs,
};
pub use tangency::{PointFlag, TangencyParams, tangency_sines1, tangency_sines2};
pub use zero_set::{MatchedPosition, zero_crossings};
