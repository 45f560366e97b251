use accurate_geom::Point3;

use crate::nearest::PolylineIndex;
use crate::{EvalError, check};

/// Distance of every point to the nearest place of a polyline, vertices and segments alike, in the
/// order of `points` and in the unit of the world.
///
/// # Errors
/// [`EvalError::Empty`], [`EvalError::NotFinite`] or [`EvalError::TooLarge`], naming the list.
///
/// # Cost
/// O((n + m) log m) for n points that run along a curve and m vertices: as many as a vector of the
/// machine holds are searched for together, starting where the last were found. O(n m) at worst.
pub fn polyline_distances(points: &[Point3], polyline: &[Point3]) -> Result<Vec<f64>, EvalError> {
    check::points("points", points)?;
    check::points("polyline", polyline)?;
    Ok(PolylineIndex::new(polyline).distances(points))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_beside_a_segment_is_nearer_to_it_than_to_its_ends() {
        let line = [Point3::new(0.0, 0.0, 0.0), Point3::new(4.0, 0.0, 0.0)];
        let points = [Point3::new(2.0, 1.0, 0.0), Point3::new(7.0, 0.0, 4.0)];
        assert_eq!(polyline_distances(&points, &line), Ok(vec![1.0, 5.0]));
    }

    #[test]
    fn nothing_and_nan_are_refused() {
        let point = Point3::origin();
        assert_eq!(polyline_distances(&[], &[point]), Err(EvalError::Empty { which: "points" }));
        assert_eq!(polyline_distances(&[point], &[]), Err(EvalError::Empty { which: "polyline" }));
        let nan = Point3::new(0.0, f64::NAN, 0.0);
        let error = EvalError::NotFinite { which: "points", index: 1 };
        assert_eq!(polyline_distances(&[point, nan], &[point]), Err(error));
    }
}
