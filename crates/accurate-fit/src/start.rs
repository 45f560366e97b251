use accurate_geom::{Curve3, GeomError, Point3};

use crate::FitError;
use crate::curve::to_curve;
use crate::pose::spans_for;
use crate::uniform_spline::UniformSpline;

/// The smooth curve from which a fit starts: a penalised least-squares spline through matched and
/// triangulated points.
///
/// `arc_px` is the place of each point along the body, px, one a point, never falling: the mean arc length of
/// both views is steadier than the chords of noisy points. Knots are `knot_spacing_px` apart;
/// second and third differences of the control points are weighed like one point each, which
/// carries the curve over stretches where the points scatter in depth.
///
/// # Errors
/// [`FitError::TooFewPoints`] for fewer than 4 points, [`FitError::NotFinite`],
/// [`FitError::BadLength`] for a body without length, [`FitError::BadParameter`], also for arc lengths that
/// fall; [`FitError::Geometry`] if their number is not that of the points.
///
/// # Cost
/// O(points).
pub fn start_curve(
    points: &[Point3],
    arc_px: &[f64],
    knot_spacing_px: f64,
) -> Result<Curve3, FitError> {
    let needed = 4;
    let found = points.len();
    if arc_px.len() != found {
        let (what, expected) = ("arc lengths of a start curve", found);
        return Err(GeomError::LengthMismatch { what, expected, found: arc_px.len() }.into());
    }
    if found < needed {
        return Err(FitError::TooFewPoints { what: "points of a start curve", found, needed });
    }
    if !(knot_spacing_px > 0.0 && knot_spacing_px.is_finite()) {
        return Err(FitError::BadParameter { name: "knot_spacing_px", value: knot_spacing_px });
    }
    let bad = |(p, s): (&Point3, &f64)| !(s.is_finite() && p.iter().all(|c| c.is_finite()));
    if let Some(index) = points.iter().zip(arc_px).position(bad) {
        return Err(FitError::NotFinite { what: "point of a start curve", index });
    }
    if let Some(pair) = arc_px.windows(2).find(|pair| pair[1] < pair[0]) {
        return Err(FitError::BadParameter { name: "arc_px", value: pair[1] });
    }
    let (first, last) = (arc_px[0], arc_px[found - 1]);
    let spans = spans_for(last - first, knot_spacing_px)?;
    let to_u = spans as f64 / (last - first);
    let data: Vec<_> =
        points.iter().zip(arc_px).map(|(p, s)| ((s - first) * to_u, p.coords)).collect();
    to_curve(&UniformSpline::least_squares(spans, &data, 1.0, 1.0)?)
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
        assert!(matches!(
            start_curve(&[p; 5], &[5.0; 4], 10.0),
            Err(FitError::Geometry(GeomError::LengthMismatch { expected: 5, found: 4, .. }))
        ));
        assert!(matches!(
            start_curve(&[p; 4], &[0.0, 50.0, 20.0, 100.0], 10.0),
            Err(FitError::BadParameter { name: "arc_px", .. })
        ));
        let nan = Point3::new(f64::NAN, 0.0, 0.0);
        assert!(matches!(
            start_curve(&[p, p, nan, p], &[0.0, 5.0, 9.0, 20.0], 10.0),
            Err(FitError::NotFinite { index: 2, .. })
        ));
    }
}
