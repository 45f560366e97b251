//! Two ordered curves to correspondences to 3D points, by monotone dynamic programming over
//! epipolar distances.
//!
//! Three levels:
//!
//! - [`Ecdp`] is the published method, corner to corner. Its stages can be used alone:
//!   [`CostModel`] gives epipolar distances in O(1) per pair of points, [`align`] and [`align_rows`]
//!   find the cheapest monotone path through any costs, [`refine`] makes one-to-many matches unique,
//!   [`triangulate_pairs`] turns pairs of pixels into a 3D curve.
//! - [`FreeMatcher`] matches curves of which either view may see more: open ends and gaps
//!   ([`align_free`]), closed curves ([`align_cyclic`]), positions between the points
//!   ([`zero_crossings`]), stretches along epipolar lines bridged and flagged ([`PointFlag`]).
//! - [`propose_pairs`] ranks many candidate curves of both views by their epipolar angles, a few
//!   microseconds per pair ([`interval_energy`]).
//!
//! Every method that turns two curves into one is a [`CurveMatcher`].
//!
//! Conventions are those of [`accurate_geom`]: pixels with x to the right and y down, `f64`
//! throughout, undistorted coordinates.
//!
//! # Source
//! ACCURATE, section 2.3; what goes beyond it says so.

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
mod longest_chain;
mod matcher;
mod pairs;
mod propose;
mod ray_image;
mod refine;
mod tangency;
mod wavefront;
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
pub use longest_chain::longest_chain;
pub use matcher::{CurveMatcher, CurvePoint, CurveReconstruction};
pub use pairs::{PixelPair, triangulate_pairs};
pub use propose::{Proposal, ProposeParams, SignalCurve, propose_pairs};
pub use refine::{
    ON_LINE_PX, RefineDirections, RefineRule, horizontal_runs, longest_run, refine, vertical_runs,
};
pub use tangency::{PointFlag, TangencyParams, tangency_sines1, tangency_sines2};
pub use wavefront::align_curves;
pub use zero_set::{MatchedPosition, zero_crossings};
