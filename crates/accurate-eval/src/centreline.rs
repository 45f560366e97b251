use accurate_geom::Point2;

use crate::EvalError;
use crate::nearest::PolylineIndex;

/// Distances between two centrelines in an image, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentrelineDistance {
    /// Mean distance of the predicted vertices to the true centreline.
    pub predicted_to_truth: f64,
    /// Mean distance of the true vertices to the predicted centreline.
    pub truth_to_predicted: f64,
    /// Mean of the two.
    pub mean: f64,
    /// Largest distance of either direction: Hausdorff's, over vertices.
    pub max: f64,
}

/// Sub-pixel distance between a predicted and a true centreline, both ways, each from the vertices
/// of one to the nearest point of the segments of the other.
///
/// Each side is a list of polylines; a polyline of one vertex is a point, so that a set of points
/// is a list of such. Every vertex weighs the same: sample both evenly.
///
/// # Errors
/// [`EvalError::Empty`] for a side without a vertex; [`EvalError::NotFinite`];
/// [`EvalError::TooLarge`] beyond 1e150.
///
/// # Cost
/// O((n + m) log(n + m)) in the vertices of curves, O(n m) at worst.
pub fn centreline_distance(
    predicted: &[Vec<Point2>],
    truth: &[Vec<Point2>],
) -> Result<CentrelineDistance, EvalError> {
    let predicted = checked("predicted centreline", predicted)?;
    let truth = checked("true centreline", truth)?;
    let (to_truth, far_1) = directed(&predicted, &truth);
    let (to_predicted, far_2) = directed(&truth, &predicted);
    Ok(CentrelineDistance {
        predicted_to_truth: to_truth,
        truth_to_predicted: to_predicted,
        mean: 0.5 * (to_truth + to_predicted),
        max: far_1.max(far_2),
    })
}

/// Mean and largest distance of the vertices of `from` to `to`.
fn directed(from: &[Vec<[f64; 2]>], to: &[Vec<[f64; 2]>]) -> (f64, f64) {
    let index = PolylineIndex::of_pieces(to.iter().map(Vec::as_slice));
    let distances = index.distances(&from.concat());
    let sum: f64 = distances.iter().sum();
    (sum / distances.len() as f64, distances.iter().copied().fold(0.0, f64::max))
}

fn checked(which: &'static str, pieces: &[Vec<Point2>]) -> Result<Vec<Vec<[f64; 2]>>, EvalError> {
    const LARGEST: f64 = 1e150;
    let mut index = 0;
    for point in pieces.iter().flatten() {
        if !(point.x.is_finite() && point.y.is_finite()) {
            return Err(EvalError::NotFinite { which, index });
        }
        let value = point.x.abs().max(point.y.abs());
        if value > LARGEST {
            return Err(EvalError::TooLarge { which, index, value, limit: LARGEST });
        }
        index += 1;
    }
    if index == 0 {
        return Err(EvalError::Empty { which });
    }
    Ok(pieces.iter().map(|piece| piece.iter().map(|p| [p.x, p.y]).collect()).collect())
}
