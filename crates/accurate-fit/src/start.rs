use accurate_geom::{Curve3, Point3};

use crate::FitError;
use crate::curve::to_curve;
use crate::pose::spans_for;
use crate::uniform_spline::UniformSpline;

/// The smooth curve from which a fit starts: a penalised least-squares spline through matched and
/// triangulated points.
///
/// `arc_px` is the place of each point along the body, px, never falling: the mean arc length of
/// both views is steadier than the chords of noisy points. Knots are `knot_spacing_px` apart;
/// second and third differences of the control points are weighed like one point each, which
/// carries the curve over stretches where the points scatter in depth.
///
/// # Errors
/// [`FitError::TooFewPoints`] for fewer than 4 points, [`FitError::NotFinite`],
/// [`FitError::BadLength`] for a body without length, [`FitError::BadParameter`].
///
/// # Cost
/// O(points).
pub fn start_curve(
    points: &[Point3],
    arc_px: &[f64],
    knot_spacing_px: f64,
) -> Result<Curve3, FitError> {
    let needed = 4;
    let found = points.len().min(arc_px.len());
    if found < needed || points.len() != arc_px.len() {
        return Err(FitError::TooFewPoints { what: "points of a start curve", found, needed });
    }
    if !(knot_spacing_px > 0.0 && knot_spacing_px.is_finite()) {
        return Err(FitError::BadParameter { name: "knot_spacing_px", value: knot_spacing_px });
    }
    let bad = |(p, s): (&Point3, &f64)| !(s.is_finite() && p.iter().all(|c| c.is_finite()));
    if let Some(index) = points.iter().zip(arc_px).position(bad) {
        return Err(FitError::NotFinite { what: "point of a start curve", index });
    }
    let (first, last) = (arc_px[0], arc_px[found - 1]);
    let spans = spans_for(last - first, knot_spacing_px)?;
    let to_u = spans as f64 / (last - first);
    // Relative to the middle, so that nothing is lost of points far from the origin.
    let centre = points.iter().map(|p| p.coords).sum::<accurate_geom::nalgebra::Vector3<f64>>()
        / found as f64;
    let data = points.iter().zip(arc_px).map(|(p, s)| ((s - first) * to_u, p.coords - centre));
    let mut spline = UniformSpline::least_squares(spans, data, 1.0, 1.0)?;
    for control in &mut spline.control {
        *control += centre;
    }
    to_curve(&spline)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A parabola has no third difference, and its second ones are constant and small here.
        #[test]
        fn points_of_a_gentle_curve_come_back(bend in -1e-4..1e-4f64, shift in -1e3..1e3f64) {
            let arc: Vec<f64> = (0..200).map(f64::from).collect();
            let points: Vec<Point3> =
                arc.iter().map(|s| Point3::new(*s + shift, bend * s * s, shift)).collect();
            let curve = start_curve(&points, &arc, 10.0).unwrap();
            // The second-difference weight (1, beside 10 points per knot) flattens by at most the
            // second difference itself, 2 bend (10 px)², times that share at the ends.
            let tolerance = 200.0 * bend.abs() + 1e-6;
            for p in &points {
                prop_assert!(curve.closest(p).distance <= tolerance);
            }
        }
    }

    #[test]
    fn unusable_points_are_refused() {
        let p = Point3::origin();
        assert!(matches!(
            start_curve(&[p; 3], &[0.0, 1.0, 2.0], 10.0),
            Err(FitError::TooFewPoints { .. })
        ));
        assert!(matches!(start_curve(&[p; 4], &[5.0; 4], 10.0), Err(FitError::BadLength { .. })));
        let nan = Point3::new(f64::NAN, 0.0, 0.0);
        assert!(matches!(
            start_curve(&[p, p, nan, p], &[0.0, 5.0, 9.0, 20.0], 10.0),
            Err(FitError::NotFinite { index: 2, .. })
        ));
    }
}
