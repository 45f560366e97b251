//! Scores of a reconstructed 3D curve against its truth.
//!
//! - [`table_scores`]: the four columns of the paper's table, between point sets.
//! - [`curve_scores`], [`reprojection_rms`]: between curves, whatever their sampling.
//! - [`dice`], [`cl_dice`], [`skeleton_agreement`], [`betti_0_error`], [`centreline_distance`]: of a
//!   segmentation, from masks and the caller's skeletons.
//! - [`bootstrap_mean`], [`median`], [`quantile`], [`fraction_below`]: over the cases of a set.
//! - [`align_similarity`]: for methods that know neither scale nor pose.
//! - [`published`]: the paper's own numbers, as data.
//!
//! Every number is in the unit of the points handed in, unless its name says px. What cannot be
//! scored is an [`EvalError`], never a zero.
//!
//! ```
//! use accurate_eval::table_scores;
//! use accurate_geom::Point3;
//!
//! let truth: Vec<Point3> = (0..5).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect();
//! let found: Vec<Point3> = (0..4).map(|k| Point3::new(f64::from(k), 0.5, 0.0)).collect();
//! let scores = table_scores(&found, &truth)?;
//! assert_eq!(scores.accuracy, 0.5);
//! assert_eq!(scores.max_error, 1.25_f64.sqrt()); // the end that was not found
//! # Ok::<(), accurate_eval::EvalError>(())
//! ```

mod centreline;
mod check;
mod curve_scores;
mod error;
mod frechet;
mod interval;
mod mask_scores;
mod nearest;
mod polyline_distances;
mod published;
mod quantile;
mod reprojection;
mod resample;
mod scores;
mod umeyama;

pub use centreline::{CentrelineDistance, centreline_distance};
pub use curve_scores::{CurveScores, curve_scores};
pub use error::EvalError;
pub use frechet::discrete_frechet;
pub use interval::{DEFAULT_RESAMPLES, MeanInterval, bootstrap_mean};
pub use mask_scores::{
    SkeletonAgreement, betti_0, betti_0_error, cl_dice, dice, skeleton_agreement, soft_dice,
};
pub use polyline_distances::polyline_distances;
pub use published::{
    Dataset, Metric, PUBLISHED_ROWS, PublishedCell, PublishedInput, PublishedRow, published,
    published_cells, published_table,
};
pub use quantile::{
    Proportion, QuantileInterval, fraction_below, median, quantile, quantile_interval,
    wilson_interval,
};
pub use reprojection::{ReprojectionRms, reprojection_rms};
pub use scores::{TableScores, accuracy, completeness, table_scores};
pub use umeyama::{Alignment, LEAST_SPREAD_RATIO, Similarity, align_rigid, align_similarity};
