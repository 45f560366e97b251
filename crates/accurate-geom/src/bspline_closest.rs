use nalgebra::Point;

use crate::BSpline;

/// Samples per knot span among which local minima are sought. A cubic piece has at most five
/// stationary distances.
const SAMPLES_PER_SPAN: usize = 8;

const MAX_NEWTON_STEPS: usize = 40;

/// The point of a curve nearest to a given one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestOnCurve<const D: usize> {
    /// Parameter of the nearest point.
    pub parameter: f64,
    /// The nearest point.
    pub point: Point<f64, D>,
    /// Its distance, in the unit of the points.
    pub distance: f64,
}

impl<const D: usize> BSpline<D> {
    /// The nearest point of the whole curve; the first of equally near ones.
    ///
    /// Spans whose control points' bounding box is farther than the best point so far are left
    /// out; in the others eight samples are taken and every local minimum is polished by Newton's
    /// method. Exact unless one eighth of a knot span holds two minima.
    ///
    /// # Cost
    /// O(n) boxes and about 16 evaluations for each span that is not ruled out.
    pub fn closest(&self, query: &Point<f64, D>) -> ClosestOnCurve<D> {
        let breakpoints = self.breakpoints();
        let mut best = self.candidate(breakpoints[0], query);
        for t in &breakpoints[1..] {
            best = nearer(best, self.candidate(*t, query));
        }
        for span in breakpoints.windows(2) {
            if self.box_distance(span[0], query) <= best.distance {
                best = self.closest_in_span(span[0], span[1], query, best);
            }
        }
        best
    }

    /// The nearest point within `[from, to]`, found as in [`closest`](Self::closest).
    pub fn closest_between(&self, query: &Point<f64, D>, from: f64, to: f64) -> ClosestOnCurve<D> {
        let (start, end) = self.domain();
        let from = from.max(start).min(end);
        let to = to.max(from).min(end);
        let mut cuts = vec![from];
        cuts.extend(self.breakpoints().into_iter().filter(|b| *b > from && *b < to));
        cuts.push(to);
        let mut best = self.candidate(from, query);
        for span in cuts.windows(2) {
            best = nearer(best, self.candidate(span[1], query));
            best = self.closest_in_span(span[0], span[1], query, best);
        }
        best
    }

    fn closest_in_span(
        &self,
        start: f64,
        end: f64,
        query: &Point<f64, D>,
        mut best: ClosestOnCurve<D>,
    ) -> ClosestOnCurve<D> {
        let at = |i: usize| start + (end - start) * i as f64 / SAMPLES_PER_SPAN as f64;
        let distances: [f64; SAMPLES_PER_SPAN + 1] =
            std::array::from_fn(|i| (self.at(at(i)) - query).norm_squared());
        for i in 0..=SAMPLES_PER_SPAN {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(SAMPLES_PER_SPAN));
            if distances[i] <= distances[before] && distances[i] <= distances[after] {
                let t = self.polish(at(before), at(i), at(after), query);
                best = nearer(best, self.candidate(t, query));
            }
        }
        best
    }

    /// Newton on half the derivative of the squared distance, inside a bracket.
    fn polish(&self, low: f64, start: f64, high: f64, query: &Point<f64, D>) -> f64 {
        let (mut low, mut high, mut t) = (low, high, start);
        for _ in 0..MAX_NEWTON_STEPS {
            let jet = self.jet(t);
            let offset = jet.point - query;
            let slope = offset.dot(&jet.first);
            let curvature = jet.first.norm_squared() + offset.dot(&jet.second);
            if slope == 0.0 {
                break;
            }
            if slope > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let newton = t - slope / curvature;
            let next = if curvature > 0.0 && newton >= low && newton <= high {
                newton
            } else {
                0.5 * (low + high)
            };
            if (next - t).abs() <= f64::EPSILON * t.abs().max(next.abs()) {
                break;
            }
            t = next;
        }
        t
    }

    fn candidate(&self, parameter: f64, query: &Point<f64, D>) -> ClosestOnCurve<D> {
        let point = self.at(parameter);
        ClosestOnCurve { parameter, point, distance: (point - query).norm() }
    }

    /// Distance to the bounding box of the four control points of the span that starts at `t`:
    /// the curve lies in their convex hull.
    fn box_distance(&self, t: f64, query: &Point<f64, D>) -> f64 {
        let first = self.basis(t).first;
        let control = &self.control_points()[first..first + 4];
        let mut squared = 0.0;
        for axis in 0..D {
            let low = control.iter().fold(f64::INFINITY, |m, p| m.min(p[axis]));
            let high = control.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[axis]));
            let outside = (low - query[axis]).max(query[axis] - high).max(0.0);
            squared += outside * outside;
        }
        squared.sqrt()
    }
}

fn nearer<const D: usize>(best: ClosestOnCurve<D>, other: ClosestOnCurve<D>) -> ClosestOnCurve<D> {
    if other.distance < best.distance { other } else { best }
}
