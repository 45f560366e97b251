//! Two ordered curves to correspondences to 3D points.

mod error;
mod matcher;

pub use error::MatchError;
pub use matcher::{CurveMatcher, CurvePoint, CurveReconstruction};
