use ndarray::{ArrayView2, Zip};

use crate::EvalError;
use crate::nearest::PolylineIndex;

/// Dice coefficient `2 |P ∩ T| / (|P| + |T|)` of a prediction and a truth of the same shape.
///
/// # Errors
/// [`EvalError::ShapeMismatch`]; [`EvalError::Empty`] if neither has a pixel: there is nothing to
/// agree on.
///
/// # Source
/// Dice 1945; Sørensen 1948.
pub fn dice(predicted: ArrayView2<bool>, truth: ArrayView2<bool>) -> Result<f64, EvalError> {
    same_shape("truth", predicted.dim(), truth.dim())?;
    let (p, t) = (count(predicted), count(truth));
    if p + t == 0 {
        return Err(EvalError::Empty { which: "prediction and truth" });
    }
    Ok(2.0 * shared(predicted, truth) as f64 / (p + t) as f64)
}

/// Dice coefficient of probabilities, `2 Σ p t / (Σ p + Σ t)`, with nothing added to either sum.
///
/// # Errors
/// [`EvalError::ShapeMismatch`]; [`EvalError::InvalidArgument`] for a probability outside 0 to 1
/// (NaN included); [`EvalError::Empty`] if both sums are 0.
pub fn soft_dice(predicted: ArrayView2<f32>, truth: ArrayView2<bool>) -> Result<f64, EvalError> {
    same_shape("truth", predicted.dim(), truth.dim())?;
    if let Some(bad) = predicted.iter().find(|p| !(0.0..=1.0).contains(*p)) {
        return Err(EvalError::InvalidArgument {
            name: "probability",
            value: f64::from(*bad),
            expected: "0 to 1",
        });
    }
    let (mut both, mut sum) = (0.0, 0.0);
    Zip::from(predicted).and(truth).for_each(|&p, &t| {
        let (p, t) = (f64::from(p), f64::from(u8::from(t)));
        both += p * t;
        sum += p + t;
    });
    if sum == 0.0 {
        return Err(EvalError::Empty { which: "prediction and truth" });
    }
    Ok(2.0 * both / sum)
}

/// Centreline Dice of two masks and their skeletons, all of one shape: the harmonic mean of the
/// topology precision `|S_P ∩ V_T| / |S_P|` and the topology sensitivity `|S_T ∩ V_P| / |S_T|`.
///
/// The skeletons are the caller's: another thinning gives another value.
///
/// # Errors
/// [`EvalError::ShapeMismatch`]; [`EvalError::Empty`] for a skeleton without a pixel, whose
/// quotient does not exist.
///
/// # Source
/// Shit et al., CVPR 2021, equations 1 and 2.
pub fn cl_dice(
    predicted: ArrayView2<bool>,
    truth: ArrayView2<bool>,
    predicted_skeleton: ArrayView2<bool>,
    truth_skeleton: ArrayView2<bool>,
) -> Result<f64, EvalError> {
    same_shape("truth", predicted.dim(), truth.dim())?;
    same_shape("predicted skeleton", predicted.dim(), predicted_skeleton.dim())?;
    same_shape("true skeleton", predicted.dim(), truth_skeleton.dim())?;
    let precision =
        shared(predicted_skeleton, truth) as f64 / some("predicted skeleton", predicted_skeleton)?;
    let sensitivity =
        shared(truth_skeleton, predicted) as f64 / some("true skeleton", truth_skeleton)?;
    // Neither skeleton touches the other's mask: the limit of the harmonic mean.
    if precision + sensitivity == 0.0 {
        return Ok(0.0);
    }
    Ok(2.0 * precision * sensitivity / (precision + sensitivity))
}

/// How much of each skeleton lies near the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkeletonAgreement {
    /// Part of the true skeleton's pixels with a predicted one within the tolerance.
    pub recall: f64,
    /// Part of the predicted skeleton's pixels with a true one within the tolerance.
    pub precision: f64,
}

/// Skeleton recall and precision at a tolerance, px: Euclidean distance between pixel centres, the
/// tolerance included.
///
/// # Errors
/// [`EvalError::ShapeMismatch`]; [`EvalError::InvalidArgument`] for a tolerance that is negative
/// or not finite; [`EvalError::Empty`] for a skeleton without a pixel.
///
/// # Cost
/// About O(n log n) in the pixels of thin skeletons, O(n²) at worst.
pub fn skeleton_agreement(
    predicted_skeleton: ArrayView2<bool>,
    truth_skeleton: ArrayView2<bool>,
    tolerance_px: f64,
) -> Result<SkeletonAgreement, EvalError> {
    same_shape("true skeleton", predicted_skeleton.dim(), truth_skeleton.dim())?;
    if !(tolerance_px.is_finite() && tolerance_px >= 0.0) {
        return Err(EvalError::InvalidArgument {
            name: "tolerance_px",
            value: tolerance_px,
            expected: "0 or more, finite",
        });
    }
    some("predicted skeleton", predicted_skeleton)?;
    some("true skeleton", truth_skeleton)?;
    let (found, truth) = (pixels(predicted_skeleton), pixels(truth_skeleton));
    let near = |from: &[[f64; 2]], to: &[[f64; 2]]| {
        let index = PolylineIndex::of_pieces(to.iter().map(std::slice::from_ref));
        // Squared distances of pixels are integers: a tolerance of sqrt(2) means diagonal
        // neighbours, whatever its last bit.
        let limit = tolerance_px * (1.0 + 4.0 * f64::EPSILON);
        let hits = index.distances(from).into_iter().filter(|&d| d <= limit).count();
        hits as f64 / from.len() as f64
    };
    Ok(SkeletonAgreement { recall: near(&truth, &found), precision: near(&found, &truth) })
}

/// Number of 8-connected components of the foreground: Betti number 0.
///
/// # Cost
/// O(pixels).
pub fn betti_0(mask: ArrayView2<bool>) -> usize {
    let (rows, columns) = mask.dim();
    let mut open = mask.to_owned();
    let mut stack = Vec::new();
    let mut components = 0;
    for row in 0..rows {
        for column in 0..columns {
            if !std::mem::take(&mut open[[row, column]]) {
                continue;
            }
            components += 1;
            stack.push((row, column));
            while let Some((r, c)) = stack.pop() {
                for next_row in r.saturating_sub(1)..=(r + 1).min(rows - 1) {
                    for next_column in c.saturating_sub(1)..=(c + 1).min(columns - 1) {
                        if std::mem::take(&mut open[[next_row, next_column]]) {
                            stack.push((next_row, next_column));
                        }
                    }
                }
            }
        }
    }
    components
}

/// Betti-0 error: by how many components a prediction has too many or too few.
///
/// # Errors
/// [`EvalError::ShapeMismatch`].
pub fn betti_0_error(
    predicted: ArrayView2<bool>,
    truth: ArrayView2<bool>,
) -> Result<usize, EvalError> {
    same_shape("truth", predicted.dim(), truth.dim())?;
    Ok(betti_0(predicted).abs_diff(betti_0(truth)))
}

fn same_shape(
    which: &'static str,
    expected: (usize, usize),
    found: (usize, usize),
) -> Result<(), EvalError> {
    if expected == found {
        Ok(())
    } else {
        Err(EvalError::ShapeMismatch { which, found, expected })
    }
}

fn count(mask: ArrayView2<bool>) -> usize {
    mask.iter().filter(|set| **set).count()
}

/// Number of pixels, which must not be 0.
fn some(which: &'static str, mask: ArrayView2<bool>) -> Result<f64, EvalError> {
    match count(mask) {
        0 => Err(EvalError::Empty { which }),
        n => Ok(n as f64),
    }
}

fn shared(a: ArrayView2<bool>, b: ArrayView2<bool>) -> usize {
    a.iter().zip(b.iter()).filter(|(a, b)| **a && **b).count()
}

/// Centres of the foreground pixels, (x, y).
fn pixels(mask: ArrayView2<bool>) -> Vec<[f64; 2]> {
    mask.indexed_iter().filter(|(_, set)| **set).map(|((r, c), _)| [c as f64, r as f64]).collect()
}
