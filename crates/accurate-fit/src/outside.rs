//! What a curve is told that leaves the mask.

use accurate_geom::nalgebra::Vector2;

use crate::outline_problem::{Evaluation, OutlineProblem, Row};
use crate::projector::Projector;
use crate::uniform_spline::basis;

/// Distances beyond which a curve sample outside the mask is left alone, and within which it is
/// taken to be inside, px.
const OUTSIDE_PX: [f64; 2] = [1.2, 25.0];
/// A curve sample outside the mask is left alone where the probability map doubts that it is, more
/// than so much.
const LEAST_DOUBT: f64 = 0.5;
/// Half width of a bridge, px.
const BRIDGE_HALF_PX: f64 = 4.0;

impl OutlineProblem<'_> {
    /// Adds the rows of curve samples outside one view's mask, about one per chord.
    pub(crate) fn outside_rows(&self, e: &mut Evaluation, view: usize, projector: &Projector) {
        let spline = &e.state.spline;
        let chords = &e.chords[view];
        for (k, p) in chords.points.iter().enumerate() {
            // The pull needs a direction, not the last tenth of a pixel: it acts beyond 1.2 px.
            let seen = self.outlines[view].outside.nearest(p.x, p.y);
            let Some((distance, target)) = self.outside_from(view, p, seen) else { continue };
            if distance <= OUTSIDE_PX[0] || distance > OUTSIDE_PX[1] {
                continue;
            }
            if self.doubt(view, p) < LEAST_DOUBT {
                continue;
            }
            let u = chords.parameter(k);
            let (span, t) = spline.locate(u);
            let (p, jacobian) = projector.project_with_jacobian(&spline.combine(span, basis(t)));
            let towards = (target - p) / distance;
            let gradient = -(towards.transpose() * jacobian);
            e.rows.push(Row {
                view,
                span,
                basis: basis(t),
                gradient: [gradient.x, gradient.y, gradient.z],
                nuisance: if self.calibrating && view == 1 {
                    projector.nuisance_derivative(&p, towards)
                } else {
                    [0.0; 3]
                },
                distance,
                precision: 1.0,
                passes: true,
                held: true,
                share: 1.0,
                outside: true,
                point: usize::MAX,
            });
        }
    }

    /// Distance and nearest allowed position of a curve sample that is not on the mask, on a bridge
    /// or outside the image.
    pub(crate) fn outside(&self, view: usize, p: &Vector2<f64>) -> Option<(f64, Vector2<f64>)> {
        let seen = self.outlines[view].outside.nearest_around(p.x, p.y);
        self.outside_from(view, p, seen)
    }

    /// How sure the probability map of a view is that there is no body around `p`; 1 without a map.
    pub(crate) fn doubt(&self, view: usize, p: &Vector2<f64>) -> f64 {
        self.outlines[view].map.as_ref().map_or(1.0, |map| map.doubt(p.x, p.y))
    }

    /// The same, with the foreground pixel `seen` nearest to the sample.
    fn outside_from(
        &self,
        view: usize,
        p: &Vector2<f64>,
        seen: [f64; 2],
    ) -> Option<(f64, Vector2<f64>)> {
        let outline = self.outlines[view];
        let (width, height) = (f64::from(outline.size.width), f64::from(outline.size.height));
        // What the image does not show cannot be judged.
        if !(p.x > -0.5 && p.y > -0.5 && p.x < width - 0.5 && p.y < height - 0.5) {
            return None;
        }
        let mut target = Vector2::new(seen[0], seen[1]);
        let mut distance = (target - p).norm();
        for &[x0, y0, x1, y1] in self.bridges[view] {
            let (a, b) = (Vector2::new(x0, y0), Vector2::new(x1, y1));
            let e = b - a;
            let t = (p - a).dot(&e) / e.norm_squared().max(f64::MIN_POSITIVE);
            let q = a + e * t.clamp(0.0, 1.0);
            let to_bridge = (q - p).norm() - BRIDGE_HALF_PX;
            if to_bridge < distance {
                (distance, target) = (to_bridge, q);
            }
        }
        (distance > 0.0).then_some((distance, target))
    }
}
