//! One 3D B-spline fitted to both views: to two outlines or to two ordered curves.

mod boundary_fit;
mod bucket_grid;
mod chords;
mod curve;
mod distance_map;
mod error;
mod judgement;
mod minimise;
mod normal;
mod outline;
mod outline_problem;
mod projector;
mod uniform_spline;

pub use boundary_fit::{OutlineFit, OutlineFitParams, OutlinePair, fit_outlines, judge_curve};
pub use error::FitError;
pub use judgement::{Judgement, UnexplainedStretch};
pub use outline::{BoundaryPoint, Outline};
