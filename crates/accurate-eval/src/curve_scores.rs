use accurate_geom::Point3;

use crate::frechet::coupling_distance;
use crate::nearest::PolylineIndex;
use crate::quantile::sorted_quantile;
use crate::resample::{check_spacing, length, resample};
use crate::{EvalError, check};

/// Distances between two *curves*, in the unit of the world.
///
/// Both curves are resampled densely at equal arc length, and distances are measured from the
/// samples of one to the polyline of the other, so that neither the number nor the spacing of the
/// points given matters. "Given" below means the polyline as handed in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurveScores {
    /// Mean distance of the reconstruction to the truth.
    pub accuracy: f64,
    /// Mean distance of the truth to the reconstruction.
    pub completeness: f64,
    /// Mean of the two.
    pub overall: f64,
    /// Largest distance of the reconstruction to the truth.
    pub max_reconstruction_to_truth: f64,
    /// Largest distance of the truth to the reconstruction.
    pub max_truth_to_reconstruction: f64,
    /// Symmetric Hausdorff distance: the larger of the two maxima.
    pub hausdorff: f64,
    /// The larger of the two one-sided 95th percentiles.
    pub percentile_95: f64,
    /// Discrete Fréchet (coupling) distance of the samples, in that direction of the reconstruction
    /// which gives the smaller value. At most one spacing above the continuous distance.
    pub frechet: f64,
    /// Whether that is the direction opposite to the one given.
    pub frechet_reversed: bool,
    /// Length of the reconstruction as given.
    pub reconstruction_length: f64,
    /// Length of the truth as given.
    pub truth_length: f64,
    /// Length of the reconstruction minus that of the truth.
    pub length_error: f64,
    /// `length_error` over the length of the truth.
    pub relative_length_error: f64,
}

/// Scores a reconstructed curve against its truth, both in order along the body.
///
/// `spacing_world` is the largest distance of neighbouring samples along the curves, in the unit of
/// the world; a quarter of a pixel's size there is fine enough.
///
/// # Errors
/// [`EvalError::InvalidArgument`] if the spacing is not positive, [`EvalError::NoLength`] if a curve
/// has no two different points, [`EvalError::TooManySamples`] beyond 65 536 samples,
/// [`EvalError::Overflow`] if the lengths are too far apart for a ratio, and as
/// [`table_scores`](crate::table_scores).
///
/// # Cost
/// O(n m) time for the coupling distance of n and m samples, O((n + m) log(n + m)) for the rest;
/// O(n + m) memory.
pub fn curve_scores(
    reconstruction: &[Point3],
    truth: &[Point3],
    spacing_world: f64,
) -> Result<CurveScores, EvalError> {
    check_spacing(spacing_world)?;
    let dense_reconstruction = resample("reconstruction", reconstruction, spacing_world)?;
    let dense_truth = resample("truth", truth, spacing_world)?;
    let to_truth = sorted_distances(&dense_reconstruction, truth);
    let to_reconstruction = sorted_distances(&dense_truth, reconstruction);
    let (accuracy, completeness) = (mean(&to_truth), mean(&to_reconstruction));
    let max_reconstruction_to_truth = sorted_quantile(&to_truth, 1.0);
    let max_truth_to_reconstruction = sorted_quantile(&to_reconstruction, 1.0);

    let as_given = coupling_distance(dense_reconstruction.iter(), &dense_truth);
    let reversed = coupling_distance(dense_reconstruction.iter().rev(), &dense_truth);
    let (reconstruction_length, truth_length) = (length(reconstruction), length(truth));
    let length_error = reconstruction_length - truth_length;
    let relative_length_error =
        check::result("relative length error", length_error / truth_length)?;
    Ok(CurveScores {
        accuracy,
        completeness,
        overall: (accuracy + completeness) / 2.0,
        max_reconstruction_to_truth,
        max_truth_to_reconstruction,
        hausdorff: max_reconstruction_to_truth.max(max_truth_to_reconstruction),
        percentile_95: sorted_quantile(&to_truth, 0.95)
            .max(sorted_quantile(&to_reconstruction, 0.95)),
        frechet: as_given.min(reversed),
        frechet_reversed: reversed < as_given,
        reconstruction_length,
        truth_length,
        length_error,
        relative_length_error,
    })
}

/// Distances of points to a polyline, ascending.
fn sorted_distances(from: &[Point3], polyline: &[Point3]) -> Vec<f64> {
    let mut distances = PolylineIndex::new(polyline).distances(from);
    distances.sort_by(f64::total_cmp);
    distances
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
