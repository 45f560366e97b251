use accurate_geom::Point3;
use nalgebra::{Matrix3, Vector3};

use crate::{EvalError, check};

/// `x -> scale * rotation * x + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Scale, positive.
    pub scale: f64,
    /// Rotation, determinant +1.
    pub rotation: Matrix3<f64>,
    /// Translation, in the unit of the target.
    pub translation: Vector3<f64>,
}

impl Similarity {
    /// The image of a point.
    pub fn apply(&self, point: &Point3) -> Point3 {
        Point3::from(self.scale * (self.rotation * point.coords) + self.translation)
    }
}

/// A transform fitted to point pairs, and how well the pairs fix it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment {
    /// Target from source.
    pub target_from_source: Similarity,
    /// Root of the weighted mean squared distance that remains, in the unit of the target.
    pub rms: f64,
    /// Spread of the points off their best line relative to that along it, both sets together: 0 on
    /// a line, where a rotation about it cannot be seen. Below 1e-3 (a nearly straight wire) the
    /// roll is noise.
    pub spread_ratio: f64,
}

/// Below this [`Alignment::spread_ratio`] rounding decides the rotation, and the fit is refused: the
/// ratio is the root of one of singular values, of which the smaller is wrong by the machine epsilon
/// (1.5e-8 after the root).
pub const LEAST_SPREAD_RATIO: f64 = 1e-6;

/// The similarity that maps `source` onto `target`, point by point, at the least weighted sum of
/// squared distances. `weights` are not negative; `None` weighs all pairs the same.
///
/// # Errors
/// [`EvalError::LengthMismatch`]; [`EvalError::Empty`], [`EvalError::NotFinite`],
/// [`EvalError::TooLarge`]; [`EvalError::InvalidArgument`] for a negative weight or all zero;
/// [`EvalError::Collinear`] if the points lie on a line; [`EvalError::Overflow`] if the sets are so
/// different in size that the scale, or what remains, is no number.
///
/// # Source
/// Umeyama, Least-squares estimation of transformation parameters between two point patterns, 1991,
/// eqs. 40 to 42, with weights in the means and the covariance.
pub fn align_similarity(
    source: &[Point3],
    target: &[Point3],
    weights: Option<&[f64]>,
) -> Result<Alignment, EvalError> {
    align(source, target, weights, true)
}

/// The rigid motion (scale 1) that maps `source` onto `target`; otherwise as [`align_similarity`].
///
/// # Errors
/// As [`align_similarity`].
pub fn align_rigid(
    source: &[Point3],
    target: &[Point3],
    weights: Option<&[f64]>,
) -> Result<Alignment, EvalError> {
    align(source, target, weights, false)
}

fn align(
    source: &[Point3],
    target: &[Point3],
    weights: Option<&[f64]>,
    scaled: bool,
) -> Result<Alignment, EvalError> {
    check::points("source", source)?;
    check::points("target", target)?;
    let expected = source.len();
    if target.len() != expected {
        return Err(EvalError::LengthMismatch { which: "target", found: target.len(), expected });
    }
    let weights = normalised_weights(weights, expected)?;
    let mean = |points: &[Point3]| {
        points.iter().zip(&weights).fold(Vector3::zeros(), |sum, (p, w)| sum + p.coords * *w)
    };
    let (source_mean, target_mean) = (mean(source), mean(target));
    let largest = |points: &[Point3], mean: &Vector3<f64>| {
        points.iter().map(|p| (p.coords - mean).amax()).fold(0.0, f64::max)
    };
    let (source_size, target_size) = (largest(source, &source_mean), largest(target, &target_mean));
    let collinear =
        |spread_ratio| Err(EvalError::Collinear { spread_ratio, needed: LEAST_SPREAD_RATIO });
    if source_size == 0.0 || target_size == 0.0 {
        return collinear(0.0);
    }

    // Both sets are brought to size 1, so that no product over- or underflows.
    let mut covariance = Matrix3::zeros();
    let mut source_variance = 0.0;
    for ((s, t), w) in source.iter().zip(target).zip(&weights) {
        let s = (s.coords - source_mean) / source_size;
        let t = (t.coords - target_mean) / target_size;
        covariance += t * s.transpose() * *w;
        source_variance += s.norm_squared() * w;
    }
    let [(first, u0, v0), (second, u1, v1)] = singular_pairs(&covariance);
    let spread_ratio = if first > 0.0 { (second / first).sqrt() } else { 0.0 };
    if spread_ratio < LEAST_SPREAD_RATIO {
        return collinear(spread_ratio);
    }
    // The third axes follow from the others, for a rotation mirrors nothing.
    let axes = |a: Vector3<f64>, b: Vector3<f64>| Matrix3::from_columns(&[a, b, a.cross(&b)]);
    let rotation = axes(u0, u1) * axes(v0, v1).transpose();
    let scale = if scaled {
        rotation.dot(&covariance) / source_variance * (target_size / source_size)
    } else {
        1.0
    };
    check::result("scale", scale)?;
    let translation = target_mean - scale * (rotation * source_mean);
    let target_from_source = Similarity { scale, rotation, translation };
    let squared: f64 = source
        .iter()
        .zip(target)
        .zip(&weights)
        .map(|((s, t), w)| w * (target_from_source.apply(s) - t).norm_squared())
        .sum();
    let rms = check::result("root mean square of an alignment", squared.sqrt())?;
    Ok(Alignment { target_from_source, rms, spread_ratio })
}

/// The two largest singular values of a matrix with their left and right unit vectors.
///
/// By one-sided Jacobi rotations, which find small singular values as exactly as the matrix holds them; a
/// decomposition by the matrix's square leaves noise where the second is below 1e-6 of the first.
fn singular_pairs(matrix: &Matrix3<f64>) -> [(f64, Vector3<f64>, Vector3<f64>); 2] {
    /// Each sweep squares what is left; four are enough.
    const MOST_SWEEPS: usize = 30;
    let mut columns = [0, 1, 2].map(|k| matrix.column(k).into_owned());
    let mut right = [Vector3::x(), Vector3::y(), Vector3::z()];
    for _ in 0..MOST_SWEEPS {
        let mut at_rest = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b) = (columns[p], columns[q]);
            let shared = a.dot(&b);
            if shared.abs() <= f64::EPSILON * a.norm() * b.norm() {
                continue;
            }
            at_rest = false;
            let zeta = (b.norm_squared() - a.norm_squared()) / (2.0 * shared);
            let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            let sine = cosine * tangent;
            for pair in [&mut columns, &mut right] {
                let (a, b) = (pair[p], pair[q]);
                pair[p] = cosine * a - sine * b;
                pair[q] = sine * a + cosine * b;
            }
        }
        if at_rest {
            break;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| columns[b].norm_squared().total_cmp(&columns[a].norm_squared()));
    [order[0], order[1]].map(|k| {
        let norm = columns[k].norm();
        (norm, columns[k] / norm.max(f64::MIN_POSITIVE), right[k])
    })
}

/// Weights with sum 1.
fn normalised_weights(weights: Option<&[f64]>, expected: usize) -> Result<Vec<f64>, EvalError> {
    let Some(weights) = weights else {
        return Ok(vec![1.0 / expected as f64; expected]);
    };
    if weights.len() != expected {
        return Err(EvalError::LengthMismatch { which: "weights", found: weights.len(), expected });
    }
    check::values("weights", weights)?;
    let refuse =
        |value, expected| Err(EvalError::InvalidArgument { name: "weights", value, expected });
    if let Some(&negative) = weights.iter().find(|w| **w < 0.0) {
        return refuse(negative, "not negative");
    }
    let largest = weights.iter().copied().fold(0.0, f64::max);
    if largest == 0.0 {
        return refuse(0.0, "not all zero");
    }
    // By the largest first: the sum of huge weights could overflow.
    let sum: f64 = weights.iter().map(|w| w / largest).sum();
    Ok(weights.iter().map(|w| w / largest / sum).collect())
}
