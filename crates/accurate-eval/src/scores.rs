use accurate_geom::Point3;

use crate::nearest::PointIndex;
use crate::{EvalError, check};

/// The four numbers of the paper's Table 1, in the unit of the world.
///
/// They compare two point *sets*: neither is resampled, so a truth of 2000 points leaves about half
/// its spacing even to a perfect curve. [`CurveScores`](crate::CurveScores) does not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableScores {
    /// Mean distance of the reconstructed points to their nearest truth point (Acc.).
    pub accuracy: f64,
    /// Mean distance of the truth points to their nearest reconstructed point (Comp.).
    pub completeness: f64,
    /// Mean of the two (Overall).
    pub overall: f64,
    /// Largest distance of a truth point to its nearest reconstructed point (Max Err.); one-sided.
    pub max_error: f64,
}

/// Scores a reconstruction as the paper's table does.
///
/// # Errors
/// [`EvalError::Empty`], [`EvalError::NotFinite`] or [`EvalError::TooLarge`], naming the list.
///
/// # Source
/// ACCURATE, section 3 and Table 1. The paper does not define the columns; these definitions
/// reproduce its figures.
///
/// # Cost
/// O((n + m) log(n + m)) for n reconstructed and m truth points.
pub fn table_scores(reconstruction: &[Point3], truth: &[Point3]) -> Result<TableScores, EvalError> {
    let (accuracy, _) = nearest_distances(("reconstruction", reconstruction), ("truth", truth))?;
    let (completeness, max_error) =
        nearest_distances(("truth", truth), ("reconstruction", reconstruction))?;
    Ok(TableScores { accuracy, completeness, overall: (accuracy + completeness) / 2.0, max_error })
}

/// Mean distance of the reconstructed points to their nearest truth point, world unit.
///
/// # Errors
/// As [`table_scores`].
pub fn accuracy(reconstruction: &[Point3], truth: &[Point3]) -> Result<f64, EvalError> {
    Ok(nearest_distances(("reconstruction", reconstruction), ("truth", truth))?.0)
}

/// Mean distance of the truth points to their nearest reconstructed point, world unit.
///
/// # Errors
/// As [`table_scores`].
pub fn completeness(reconstruction: &[Point3], truth: &[Point3]) -> Result<f64, EvalError> {
    Ok(nearest_distances(("truth", truth), ("reconstruction", reconstruction))?.0)
}

/// Mean and maximum of the distances of `from` to the nearest of `to`.
fn nearest_distances(
    from: (&'static str, &[Point3]),
    to: (&'static str, &[Point3]),
) -> Result<(f64, f64), EvalError> {
    check::points(from.0, from.1)?;
    check::points(to.0, to.1)?;
    let distances = PointIndex::new(to.1).distances(from.1);
    let sum: f64 = distances.iter().sum();
    Ok((sum / distances.len() as f64, distances.into_iter().fold(0.0, f64::max)))
}
