use accurate_geom::Point3;

use crate::interval::bootstrap_mean;
use crate::quantile::median;
use crate::{EvalError, MeanInterval, TableScores, check};

/// What became of one case.
#[derive(Debug, Clone, PartialEq)]
pub enum CaseOutcome<S = TableScores> {
    /// It was reconstructed and scored.
    Scored(S),
    /// It was not; it stays in the count.
    Failed {
        /// Why, for the reader of the table.
        reason: String,
    },
}

/// One case of a set.
#[derive(Debug, Clone, PartialEq)]
pub struct Case<S = TableScores> {
    /// Its name, e.g. `case_017`.
    pub name: String,
    /// What became of it.
    pub outcome: CaseOutcome<S>,
    /// Diagonal of the truth's bounding box, world unit: the error charged for a failure in
    /// [`penalised_means`], and there only. See [`bounding_box_diagonal`].
    pub truth_diagonal: Option<f64>,
}

/// A case without scores.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// Its name.
    pub case: String,
    /// Why it has none.
    pub reason: String,
}

/// One metric over the scored cases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MetricSummary {
    /// Mean with its bootstrap interval; `n` is the number of scored cases.
    pub mean: MeanInterval,
    /// Median.
    pub median: f64,
}

/// The table's metrics over the scored cases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableSummary {
    /// [`TableScores::accuracy`].
    pub accuracy: MetricSummary,
    /// [`TableScores::completeness`].
    pub completeness: MetricSummary,
    /// [`TableScores::overall`].
    pub overall: MetricSummary,
    /// [`TableScores::max_error`].
    pub max_error: MetricSummary,
}

/// A set of cases: means over those that were scored, and the names of those that were not.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Cases in the set, failures included.
    pub cases: usize,
    /// Cases without scores, in the order given.
    pub failures: Vec<Failure>,
    /// The metrics, or `None` if no case was scored.
    pub metrics: Option<TableSummary>,
}

impl Summary {
    /// Cases with scores.
    pub fn scored(&self) -> usize {
        self.cases - self.failures.len()
    }
}

/// Summarises the table's metrics over a set of cases, every case weighing the same.
///
/// # Errors
/// [`EvalError::Empty`] if there is no case; otherwise as [`bootstrap_mean`], whose arguments
/// `resamples` and `seed_name` are.
pub fn summarise(
    cases: &[Case<TableScores>],
    resamples: usize,
    seed_name: &str,
) -> Result<Summary, EvalError> {
    if cases.is_empty() {
        return Err(EvalError::Empty { which: "cases" });
    }
    let failures: Vec<_> = cases
        .iter()
        .filter_map(|case| match &case.outcome {
            CaseOutcome::Scored(_) => None,
            CaseOutcome::Failed { reason } => {
                Some(Failure { case: case.name.clone(), reason: reason.clone() })
            }
        })
        .collect();
    let metrics = if failures.len() == cases.len() {
        None
    } else {
        // One seed for all metrics: they are resampled jointly, case by case.
        let of =
            |metric: fn(&TableScores) -> f64| summarise_metric(cases, metric, resamples, seed_name);
        Some(TableSummary {
            accuracy: of(|s| s.accuracy)?,
            completeness: of(|s| s.completeness)?,
            overall: of(|s| s.overall)?,
            max_error: of(|s| s.max_error)?,
        })
    };
    Ok(Summary { cases: cases.len(), failures, metrics })
}

/// Summarises any one number of the scores over the scored cases.
///
/// # Errors
/// [`EvalError::Empty`] if no case was scored; otherwise as [`bootstrap_mean`].
pub fn summarise_metric<S>(
    cases: &[Case<S>],
    metric: impl Fn(&S) -> f64,
    resamples: usize,
    seed_name: &str,
) -> Result<MetricSummary, EvalError> {
    let values: Vec<f64> = cases
        .iter()
        .filter_map(|case| match &case.outcome {
            CaseOutcome::Scored(scores) => Some(metric(scores)),
            CaseOutcome::Failed { .. } => None,
        })
        .collect();
    if values.is_empty() {
        return Err(EvalError::Empty { which: "scored cases" });
    }
    Ok(MetricSummary {
        mean: bootstrap_mean(&values, resamples, seed_name)?,
        median: median(&values)?,
    })
}

/// Means over *all* cases in which every metric of a failed case is the diagonal of its truth's
/// bounding box: a separate number, to be printed beside the means over the scored cases.
///
/// # Errors
/// [`EvalError::Empty`] if there is no case; [`EvalError::NoPenalty`] if a failed case carries no
/// diagonal; [`EvalError::NotFinite`] with the index of the case.
pub fn penalised_means(cases: &[Case<TableScores>]) -> Result<TableScores, EvalError> {
    if cases.is_empty() {
        return Err(EvalError::Empty { which: "cases" });
    }
    let mut sums = [0.0; 4];
    for (index, case) in cases.iter().enumerate() {
        let scores = match (&case.outcome, case.truth_diagonal) {
            (CaseOutcome::Scored(s), _) => [s.accuracy, s.completeness, s.overall, s.max_error],
            (CaseOutcome::Failed { .. }, Some(diagonal)) => [diagonal; 4],
            (CaseOutcome::Failed { .. }, None) => {
                return Err(EvalError::NoPenalty { case: case.name.clone() });
            }
        };
        if !scores.iter().all(|v| v.is_finite()) {
            return Err(EvalError::NotFinite { which: "cases", index });
        }
        for (sum, score) in sums.iter_mut().zip(scores) {
            *sum += score;
        }
    }
    let [accuracy, completeness, overall, max_error] = sums.map(|sum| sum / cases.len() as f64);
    Ok(TableScores { accuracy, completeness, overall, max_error })
}

/// Diagonal of the axis-parallel bounding box of `points`, world unit.
///
/// # Errors
/// [`EvalError::Empty`], [`EvalError::NotFinite`] or [`EvalError::TooLarge`].
pub fn bounding_box_diagonal(points: &[Point3]) -> Result<f64, EvalError> {
    check::points("points", points)?;
    let (mut low, mut high) = (points[0].coords, points[0].coords);
    for point in points {
        low = low.inf(&point.coords);
        high = high.sup(&point.coords);
    }
    Ok((high - low).norm())
}
