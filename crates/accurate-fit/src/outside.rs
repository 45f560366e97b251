//! What a curve is told that leaves the mask.

use accurate_geom::nalgebra::Vector2;

use crate::outline_problem::{Evaluation, OutlineProblem, Row};
use crate::projector::Projector;
use crate::uniform_spline::basis;

/// A curve sample so near to the mask is taken to be inside, px ...
const NEAREST_OUTSIDE_PX: f64 = 1.2;
/// ... and one farther than this is left alone, px.
pub(crate) const FARTHEST_OUTSIDE_PX: f64 = 25.0;
/// A curve sample outside the mask is left alone where the probability map doubts that it is, more
/// than so much.
const LEAST_DOUBT: f64 = 0.5;

impl OutlineProblem<'_> {
    /// Adds the rows of curve samples outside one view's mask, about one per chord.
    pub(crate) fn outside_rows(&self, e: &mut Evaluation, view: usize, projector: &Projector) {
        let spline = &e.state.spline;
        let chords = &e.chords[view];
        for (k, p) in chords.points.iter().enumerate() {
            // The pull needs a direction, not the last tenth of a pixel: it acts beyond 1.2 px.
            let seen = self.outlines[view].outside.nearest(p.x, p.y);
            let Some((distance, target)) = self.outside_from(view, p, seen) else { continue };
            if distance <= NEAREST_OUTSIDE_PX || distance > FARTHEST_OUTSIDE_PX {
                continue;
            }
            if self.doubt(view, p) < LEAST_DOUBT {
                continue;
            }
            // More than the distance where the target is the middle of a bridge.
            let length = (target - p).norm();
            let u = chords.parameter(k);
            let (span, t) = spline.locate(u);
            let (p, jacobian) = projector.project_with_jacobian(&spline.combine(span, basis(t)));
            let towards = (target - p) / length;
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
    /// or outside the image; farther than [`FARTHEST_OUTSIDE_PX`] perhaps too large a distance.
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
        for (to_bridge, place) in self.bridges[view].near(p) {
            if to_bridge < distance {
                (distance, target) = (to_bridge, place);
            }
        }
        (distance > 0.0).then_some((distance, target))
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::Vector3;
    use accurate_geom::{Curve3, Pixel, View1, View2};
    use accurate_synth::{CaseOptions, Family, generate};

    use crate::outline_problem::{Settings, State};
    use crate::pose::pose;
    use crate::projector::{Nuisance, Projector};
    use crate::{Outline, OutlinePair};

    /// Off the mask and off a bridge, a row's gradient is the derivative of its distance.
    #[test]
    fn the_pull_towards_masks_and_bridges_is_the_slope_of_the_distance() {
        let case = generate(Family::Medium, 1900, 0, &CaseOptions::default()).unwrap();
        let one = Outline::<View1>::from_mask(case.masks[0].view()).unwrap();
        let two = Outline::<View2>::from_mask(case.masks[1].view()).unwrap();
        let (p1, p2) = &case.exact_points;
        let last = p1.len().min(p2.len()) - 1;
        // Across the field: most samples of the curve below are nearer to the body, some to these.
        let bridges1: Vec<(Pixel<View1>, Pixel<View1>)> =
            (0..6).map(|k| (p1[k * last / 6], p1[last - k * last / 8])).collect();
        let bridges2: Vec<(Pixel<View2>, Pixel<View2>)> =
            (0..6).map(|k| (p2[k * last / 6], p2[last - k * last / 8])).collect();
        let pair = OutlinePair::new(&one, &two).with_bridges(&bridges1, &bridges2);
        let points: Vec<_> = case.truth.iter().step_by(25).copied().collect();
        let truth = Curve3::interpolate(&points).unwrap();
        let (problem, mut spline) = pose(&truth, &pair, &case.rig, 10.0).unwrap();
        for (k, c) in spline.control.iter_mut().enumerate() {
            *c += Vector3::new(8.0, 6.0, -7.0) * ((k as f64).sin() / problem.px_per_unit);
        }
        let settings = Settings {
            reach_px: 3.0,
            scale_px: 0.7,
            stride: 1,
            lambda2: 0.0,
            lambda3: 0.0,
            outside_weight: 1.0,
            judged: false,
        };
        let state = State { spline, half_px: [1.5, 1.5], nuisance: Nuisance::default() };
        let mut e = problem.evaluation(state);
        problem.evaluate(&mut e, &settings).unwrap();

        let projectors = Projector::pair(&case.rig);
        let (mut beside_bridges, mut beside_masks) = (0, 0);
        for row in e.rows.iter().filter(|row| row.outside) {
            let at = e.state.spline.combine(row.span, row.basis);
            let distance = |x: &Vector3<f64>| {
                let p = projectors[row.view].project(x);
                problem
                    .outside(row.view, &p)
                    .map(|(distance, target)| (distance, (target - p).norm()))
            };
            let Some((_, to_target)) = distance(&at) else { continue };
            let is_bridge = to_target > row.distance + 1.0;
            for axis in 0..3 {
                // A thousandth of a px: far below the curvature of these distances.
                let mut step = Vector3::zeros();
                step[axis] = 1e-3 / problem.px_per_unit;
                let (Some((ahead, _)), Some((behind, _))) =
                    (distance(&(at + step)), distance(&(at - step)))
                else {
                    continue;
                };
                let numeric = (ahead - behind) / (2.0 * step[axis]);
                // Where the nearest place jumps within the step the slope lies between two.
                let tolerance = 0.02 * problem.px_per_unit;
                if (numeric - row.gradient[axis]).abs() > tolerance {
                    let jumps = (ahead + behind - 2.0 * row.distance).abs() > 1e-6;
                    assert!(jumps, "view {} axis {axis}: {numeric} {:?}", row.view, row.gradient);
                }
            }
            *(if is_bridge { &mut beside_bridges } else { &mut beside_masks }) += 1;
        }
        assert!(beside_bridges > 20 && beside_masks > 20, "{beside_bridges} {beside_masks}");
    }
}
