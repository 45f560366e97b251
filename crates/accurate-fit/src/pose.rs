use accurate_geom::{Curve3, Pixel, Point3, Rig, View1, View2};

use crate::bridges::Bridges;
use crate::curve::{dense_points, from_curve};
use crate::outline_problem::OutlineProblem;
use crate::outside::FARTHEST_OUTSIDE_PX;
use crate::projector::Projector;
use crate::uniform_spline::UniformSpline;
use crate::{FitError, Outline};

/// Both outlines, and where the curve is allowed to leave them.
#[derive(Debug, Clone)]
pub struct OutlinePair<'a> {
    outline1: &'a Outline<View1>,
    outline2: &'a Outline<View2>,
    bridges: [Bridges; 2],
}

impl<'a> OutlinePair<'a> {
    /// The outlines of view 1 and view 2.
    pub fn new(outline1: &'a Outline<View1>, outline2: &'a Outline<View2>) -> Self {
        Self { outline1, outline2, bridges: Default::default() }
    }

    /// Allows the curve to run outside the masks within 4 px of these straight stretches: gaps that
    /// a tracer bridged.
    pub fn with_bridges(
        mut self,
        bridges1: &[(Pixel<View1>, Pixel<View1>)],
        bridges2: &[(Pixel<View2>, Pixel<View2>)],
    ) -> Self {
        self.bridges = [
            Bridges::new(bridges1, self.outline1.data.size, FARTHEST_OUTSIDE_PX),
            Bridges::new(bridges2, self.outline2.data.size, FARTHEST_OUTSIDE_PX),
        ];
        self
    }
}

/// The problem of a curve and its outlines, and the curve with knots of the asked spacing.
pub(crate) fn pose<'a>(
    start: &Curve3,
    outlines: &'a OutlinePair<'_>,
    rig: &Rig,
    knot_spacing_px: f64,
) -> Result<(OutlineProblem<'a>, UniformSpline), FitError> {
    let projectors = Projector::pair(rig);
    let (spline, px_per_unit) = respaced(start, &projectors, knot_spacing_px)?;
    let problem = OutlineProblem {
        outlines: [&outlines.outline1.data, &outlines.outline2.data],
        bridges: [&outlines.bridges[0], &outlines.bridges[1]],
        projectors,
        steps: (knot_spacing_px / 1.5).ceil().clamp(2.0, 64.0) as usize,
        px_per_unit,
        calibrating: false,
        local_smoothness: Vec::new(),
    };
    Ok((problem, spline))
}

/// The curve as a uniform spline with knots `knot_spacing_px` apart, and the px per world unit.
pub(crate) fn respaced(
    curve: &Curve3,
    projectors: &[Projector; 2],
    knot_spacing_px: f64,
) -> Result<(UniformSpline, f64), FitError> {
    let points = dense_points(curve, 0);
    let px_per_unit = px_per_unit(&points, projectors)?;
    let length: f64 = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let spans = spans_for(length * px_per_unit, knot_spacing_px)?;
    if let Some(same) = from_curve(curve) {
        let spacing_px = length * px_per_unit / same.spans() as f64;
        if (spacing_px / knot_spacing_px - 1.0).abs() < 0.15 {
            return Ok((same, px_per_unit));
        }
    }
    // A curve of few knots is long between them.
    let points = dense_points(curve, POINTS_PER_SPAN * spans);
    Ok((UniformSpline::through(&points, spans)?, px_per_unit))
}

/// Points that a spline is drawn through for each of its spans, at least.
pub(crate) const POINTS_PER_SPAN: usize = 4;

/// Number of spans for a curve of `length_px`.
pub(crate) fn spans_for(length_px: f64, knot_spacing_px: f64) -> Result<usize, FitError> {
    // No image is larger than 2^16 px; a curve may wind, but not that much.
    if !(length_px > 1.0 && length_px < 1e6) {
        return Err(FitError::BadLength { length_px });
    }
    Ok((length_px / knot_spacing_px).round().clamp(3.0, 20_000.0) as usize)
}

/// Mean magnification of both views over the points.
pub(crate) fn px_per_unit(points: &[Point3], projectors: &[Projector; 2]) -> Result<f64, FitError> {
    let mut sum = 0.0;
    for point in points {
        for (projector, view) in projectors.iter().zip(1..) {
            let depth = projector.depth(&point.coords);
            if !(depth > 0.0) {
                return Err(FitError::NotInFront { view, depth });
            }
            sum += projector.px_per_unit(&point.coords);
        }
    }
    Ok(sum / (2 * points.len().max(1)) as f64)
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
    use accurate_geom::{Camera, ImageSize, LengthUnit};

    use super::*;

    /// A straight wire given by its four control points, a thousand units from the origin, is the same wire
    /// with 250 spans: damping must not draw to the origin what no point holds.
    #[test]
    fn a_curve_of_few_knots_stays_where_it_is() {
        let k = Matrix3::new(1000.0, 0.0, 256.0, 0.0, 1000.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        let one = Camera::new(k, Matrix3::identity(), Vector3::zeros(), size).unwrap();
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), 0.6).into_inner();
        let back = Vector3::new(0.0, 0.0, 1000.0);
        let two = Camera::new(k, turn, back - turn * back, size).unwrap();
        let rig = Rig::new(one, two, LengthUnit::Millimetre).unwrap();
        let points =
            [-250.0, -80.0, 90.0, 250.0].map(|x| Point3::new(x, 0.3 * x, 1000.0 + 0.1 * x));
        let curve = Curve3::interpolate(&points).unwrap();
        let (spline, px_per_unit) = respaced(&curve, &Projector::pair(&rig), 2.0).unwrap();
        assert!(spline.spans() > 200);
        for k in 0..=1000 {
            let u = spline.spans() as f64 * f64::from(k) / 1000.0;
            let off = curve.closest(&Point3::from(spline.point(u))).distance * px_per_unit;
            assert!(off < 1e-3, "{off} px at {u}");
        }
        let end = (spline.point(0.0) - points[0].coords).norm() * px_per_unit;
        assert!(end < 1e-2, "{end} px");
    }
}
