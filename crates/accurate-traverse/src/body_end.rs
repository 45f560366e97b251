//! Where the mask ends ahead of a point.

use accurate_geom::Point2;
use nalgebra::Vector2;
use ndarray::Array2;

/// Nothing looks farther ahead than this, px: thinning takes at most a few pixels more than half a
/// thickness from a tip.
pub(crate) const MAX_STRETCH_PX: f64 = 16.0;

/// Step of the search, px.
pub(crate) const STEP_PX: f64 = 0.25;

/// Kept off the borders between pixels: from a pixel's centre along a row or column, a multiple of
/// [`STEP_PX`] would lie on one, and rounding would then tell left from right.
const OFF_BORDER_PX: f64 = 0.01;

/// Whether the pixel nearest to a point is in the mask: where the distance to the background is not
/// 0.
pub(crate) fn inside(radii: &Array2<f64>, at: Point2) -> bool {
    let (x, y) = (at.x.round(), at.y.round());
    x >= 0.0 && y >= 0.0 && radii.get((y as usize, x as usize)).is_some_and(|&r| r > 0.0)
}

/// Length of the ray from `from` in the unit direction `ahead` that is in the mask, at most `most`.
pub(crate) fn free_up_to(radii: &Array2<f64>, from: Point2, ahead: Vector2<f64>, most: f64) -> f64 {
    let mut free = 0.0;
    while free < most && inside(radii, from + ahead * (free + STEP_PX - OFF_BORDER_PX)) {
        free += STEP_PX;
    }
    free
}

/// As [`free_up_to`], with [`MAX_STRETCH_PX`].
pub(crate) fn free_length(radii: &Array2<f64>, from: Point2, ahead: Vector2<f64>) -> f64 {
    free_up_to(radii, from, ahead, MAX_STRETCH_PX)
}
