//! Our own method on masks: a skeleton graph per view proposes walks, epipolar angles pair them,
//! and the fit of one 3D spline to both outlines judges the pairs.

mod candidates;
mod choice;
mod evidence;
mod exchange;
mod finalists;
mod fitting;
mod frame;
mod grey_levels;
mod hairpins;
mod joint;
mod look;
mod other_ways;
mod pairs;
mod repair;
mod reroute;
mod restart;
mod ring;
mod score;
mod search;
mod shape;
mod start;
mod strays;
mod suspicion;
mod tails;
mod upright;

pub(crate) use candidates::ViewCandidates;
pub use evidence::Evidence;
pub(crate) use finalists::SAME_PX;
pub(crate) use frame::Turn;
pub(crate) use joint::{JointResult, Searched, search_masks};
pub use joint::{RobustParams, SecondLook};
pub(crate) use shape::px_per_unit;
pub(crate) use strays::without_strays;
pub(crate) use suspicion::calls_for_a_careful_look;
pub use suspicion::{DoubtLimits, Suspicion};
pub(crate) use upright::upright;
