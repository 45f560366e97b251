//! Ordered pixels to a sub-pixel centreline.

use accurate_geom::{BSpline, Pixel, Point2, View};
use nalgebra::Vector2;
use ndarray::Array2;

use crate::TraverseError;
use crate::body_end::free_length;

/// How pixels become a centreline. [`CentrelineParams::DEFAULT`] is for pixels at integers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentrelineParams {
    /// Standard deviation of the points per coordinate, px. Rounding to integers: 1/sqrt(12).
    pub sigma_px: f64,
    /// Distance of the points of the result, px, along the chords of the given points: in tight bends some
    /// are up to two fifths farther apart (0.4 radians a px).
    pub spacing_px: f64,
}

impl CentrelineParams {
    /// For pixels at integer coordinates.
    pub const DEFAULT: Self = Self { sigma_px: 0.288_675_134_594_812_9, spacing_px: 0.5 };
}

impl Default for CentrelineParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The smoothest curve that the noise of the points allows, as points about
/// [`CentrelineParams::spacing_px`] apart.
///
/// `points` are in order; equal neighbours count once. Fewer than four different points come back as
/// they are. The residual of the curve is what noise of [`CentrelineParams::sigma_px`] would leave
/// (chi-square equal to the number of coordinates), so that a wire bent sharply is not smoothed more
/// than one that is straight.
///
/// # Errors
/// [`TraverseError::Geometry`] for coordinates that are not finite or a bad `sigma_px`,
/// [`TraverseError::InvalidParameter`] for a spacing that is not positive.
///
/// # Source
/// Reinsch, Smoothing by spline functions, Numer. Math. 10, 1967.
///
/// # Cost
/// O(points), about 50 banded solves.
pub fn smooth_centreline<V: View>(
    points: &[Pixel<V>],
    params: &CentrelineParams,
) -> Result<Vec<Pixel<V>>, TraverseError> {
    if !(params.spacing_px > 1e-6 && params.spacing_px.is_finite()) {
        let (name, value) = ("spacing_px", params.spacing_px);
        let expected = "finite and above 1e-6 px";
        return Err(TraverseError::InvalidParameter { name, value, expected });
    }
    let mut different: Vec<Point2> = points.iter().map(|p| p.point()).collect();
    different.dedup();
    if different.len() < 4 && points.iter().all(|p| p.is_finite()) {
        return Ok(different.into_iter().map(Pixel::from).collect());
    }
    let curve = BSpline::smoothing(&different, params.sigma_px)?;
    let (start, end) = curve.domain();
    // The parameter is the chord length of the points, a little more than that of the curve.
    let steps = ((end - start) / params.spacing_px).ceil().clamp(1.0, 1e7) as usize;
    Ok((0..=steps)
        .map(|k| Pixel::from(curve.at(start + (end - start) * (k as f64 / steps as f64))))
        .collect())
}

/// Moves each point across the line to the middle of the mask, where a single strand is seen.
///
/// `radii` is the distance to the background, px, shape (height, width), 0 outside of the mask. A
/// point moves to the centroid of the pixels around it, weighted by their radius and tapered to 0 at
/// `w/2 + 2` px from it, along the normal of the line only; at most 1 px, twice. Points where the mask is
/// more than 1 px wider than `mask_thickness_px` (crossings, strands side by side) stay, and so do those
/// that see no mask from where they are; from just outside of it they are drawn in. Thick masks gain most: their skeleton wavers by a pixel, their middle does not.
///
/// # Errors
/// [`TraverseError::InvalidParameter`] for a thickness that is not positive.
///
/// # Cost
/// O(points · w²).
pub fn recentre<V: View>(
    points: &[Pixel<V>],
    radii: &Array2<f64>,
    mask_thickness_px: f64,
) -> Result<Vec<Pixel<V>>, TraverseError> {
    check_thickness(mask_thickness_px)?;
    let reach = mask_thickness_px / 2.0 + 2.0;
    let mut line = points.to_vec();
    // The window moves with the point: the second time it is centred.
    for _ in 0..2 {
        let before = line.clone();
        for (k, point) in line.iter_mut().enumerate() {
            let chord =
                before[(k + 3).min(before.len() - 1)].point() - before[k.saturating_sub(3)].point();
            let Some(along) = chord.try_normalize(0.0) else { continue };
            let normal = Vector2::new(-along.y, along.x);
            if let Some(shift) = shift(point.point(), normal, radii, reach, mask_thickness_px) {
                *point = (point.point() + normal * shift.clamp(-1.0, 1.0)).into();
            }
        }
    }
    Ok(line)
}

fn shift(
    at: Point2,
    normal: Vector2<f64>,
    radii: &Array2<f64>,
    reach: f64,
    mask_thickness_px: f64,
) -> Option<f64> {
    let (mut total, mut moment, mut widest) = (0.0, 0.0, 0.0_f64);
    let low = |x: f64| (x - reach).ceil().max(0.0) as usize;
    let high = |x: f64| (x + reach).floor().max(-1.0) + 1.0;
    let (height, width) = radii.dim();
    for y in low(at.y)..(high(at.y) as usize).min(height) {
        for x in low(at.x)..(high(at.x) as usize).min(width) {
            let offset = Point2::new(x as f64, y as f64) - at;
            let taper = 1.0 - offset.norm_squared() / (reach * reach);
            let radius = radii[[y, x]];
            if taper > 0.0 && radius > 0.0 {
                let weight = taper * radius;
                total += weight;
                moment += weight * offset.dot(&normal);
                widest = widest.max(radius);
            }
        }
    }
    // A strand w thick has radius (w + 1) / 2 in its middle, centre to centre.
    let single = 2.0 * widest - 1.0 <= mask_thickness_px + 1.0;
    (total > 0.0 && single).then(|| moment / total)
}

/// The line with both ends drawn out along their tangents until they are half a thickness from where
/// the mask ends: the middle of a round cap, where the body's centreline ends.
///
/// `radii` as in [`recentre`]. An end moves by at most 16 px and never back. New points are at most 1
/// px apart. Ends outside of the mask, and lines of fewer than two points, stay as they are.
///
/// # Errors
/// [`TraverseError::InvalidParameter`] for a thickness that is not positive.
pub fn extend_to_body_ends<V: View>(
    points: &[Pixel<V>],
    radii: &Array2<f64>,
    mask_thickness_px: f64,
) -> Result<Vec<Pixel<V>>, TraverseError> {
    /// Part of the line that gives the tangent, px: a few pixels of noise must not turn it.
    const TANGENT_PX: f64 = 8.0;
    check_thickness(mask_thickness_px)?;
    let mut line = points.to_vec();
    if line.len() < 2 {
        return Ok(line);
    }
    for _ in 0..2 {
        line.reverse();
        let tip = line[line.len() - 1].point();
        let back = line.iter().rev().find(|p| (p.point() - tip).norm() >= TANGENT_PX);
        let ahead = tip - back.copied().unwrap_or(line[0]).point();
        let Some(ahead) = ahead.try_normalize(0.0) else { continue };
        let stretch = free_length(radii, tip, ahead) - mask_thickness_px / 2.0;
        if stretch > 0.0 {
            let steps = stretch.ceil() as usize;
            line.extend(
                (1..=steps)
                    .map(|k| Pixel::<V>::from(tip + ahead * (stretch * k as f64 / steps as f64))),
            );
        }
    }
    Ok(line)
}

fn check_thickness(value: f64) -> Result<(), TraverseError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    let (name, expected) = ("mask_thickness_px", "a positive finite number");
    Err(TraverseError::InvalidParameter { name, value, expected })
}
