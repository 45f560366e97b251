//! One 3D B-spline fitted to both views: to two outlines, two ordered curves, or two pictures.
//!
//! Curves and their covariances are in the world frame and unit of the [`Rig`](accurate_geom::Rig) (the
//! covariance in its square). Lengths in images, residuals and knot spacings are in px, misfits in px².
//! Input that shows no curve (too few points, numbers that are not finite, a match that is no basis for
//! a fit) is an [`FitError`] with the values; a curve that explains its data badly is no error and is
//! told by its [`Judgement`].

mod adaptive;
mod boundary_fit;
mod boundary_rows;
mod bridges;
mod bucket_grid;
mod calibration;
mod chords;
mod covariance;
mod curve;
mod distance_map;
mod error;
mod extrapolation;
mod intensity;
mod judgement;
mod minimise;
mod nearest;
mod normal;
mod occam;
mod outline;
mod outline_map;
mod outline_params;
mod outline_problem;
mod outside;
mod point_data;
mod point_fit;
mod point_problem;
mod pool;
mod pose;
mod projector;
mod selected_inverse;
mod side_by_side;
mod span_blocks;
mod start;
mod uniform_spline;

pub use adaptive::{AdaptiveParams, fit_outlines_adaptively};
pub use boundary_fit::{OutlineFit, fit_outlines, judge_curve};
pub use calibration::{
    CalibratedFit, CalibrationEstimate, CalibrationPriors, fit_outlines_and_calibration,
};
pub use covariance::CurveCovariance;
pub use error::FitError;
pub use intensity::{
    CurveEnd, CurveEnds, IntensityFit, IntensityFitParams, IntensityPair, ShownPiece,
    fit_intensities,
};
pub use judgement::{Judgement, UnexplainedStretch};
pub use outline::{BoundaryPoint, Outline};
pub use outline_params::OutlineFitParams;
pub use point_fit::{PointFit, PointFitParams, fit_points};
pub use pose::OutlinePair;
pub use side_by_side::side_by_side;
pub use start::start_curve;
