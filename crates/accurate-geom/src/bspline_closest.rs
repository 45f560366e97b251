use nalgebra::Point;

use crate::BSpline;
use crate::bspline_piece::Piece;

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
    /// The nearest point of the whole curve.
    ///
    /// Spans whose control points' bounding box is farther than the best point so far are left
    /// out; in the others eight samples are taken and every local minimum is polished by Newton's
    /// method. Exact unless one eighth of a knot span holds two minima.
    ///
    /// # Cost
    /// O(n) boxes and about 16 evaluations for each span that is not ruled out.
    pub fn closest(&self, query: &Point<f64, D>) -> ClosestOnCurve<D> {
        let (start, end) = self.domain();
        self.closest_between(query, start, end)
    }

    /// The nearest point within `[from, to]`, found as in [`closest`](Self::closest).
    pub fn closest_between(&self, query: &Point<f64, D>, from: f64, to: f64) -> ClosestOnCurve<D> {
        let (start, end) = self.domain();
        let from = from.max(start).min(end);
        let to = to.max(from).min(end);
        let knots = self.knots();
        let boxes: Vec<(usize, f64)> = self
            .spans()
            .filter(|span| knots[*span] < to && knots[span + 1] > from)
            .map(|span| (span, self.box_distance(span, query)))
            .collect();
        let mut best = self.candidate(from, query);
        best = nearer(best, self.candidate(to, query));
        // The likeliest span first: its best point rules out most others.
        let likeliest = boxes.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|b| b.0);
        let rest = boxes.iter().filter(|b| Some(b.0) != likeliest);
        for (span, distance) in boxes.iter().filter(|b| Some(b.0) == likeliest).chain(rest) {
            if *distance <= best.distance {
                let piece = self.piece(*span);
                let t = piece.closest(query, from.max(piece.start), to.min(piece.end));
                best = nearer(best, self.candidate(t, query));
            }
        }
        best
    }

    fn candidate(&self, parameter: f64, query: &Point<f64, D>) -> ClosestOnCurve<D> {
        let point = self.at(parameter);
        ClosestOnCurve { parameter, point, distance: (point - query).norm() }
    }

    /// Distance to the bounding box of the four control points of a span.
    fn box_distance(&self, span: usize, query: &Point<f64, D>) -> f64 {
        let control = &self.control_points()[span - 3..=span];
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

impl<const D: usize> Piece<D> {
    /// Parameter of the nearest point within `[start, end]`.
    fn closest(&self, query: &Point<f64, D>, start: f64, end: f64) -> f64 {
        let at = |i: usize| start + (end - start) * i as f64 / SAMPLES_PER_SPAN as f64;
        let distance = |t: f64| (self.at(t) - query).norm_squared();
        let distances: [f64; SAMPLES_PER_SPAN + 1] = std::array::from_fn(|i| distance(at(i)));
        let mut best = (f64::INFINITY, start);
        for i in 0..=SAMPLES_PER_SPAN {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(SAMPLES_PER_SPAN));
            if distances[i] <= distances[before] && distances[i] <= distances[after] {
                let t = self.polish(at(before), at(i), at(after), query);
                // The sample itself stays in the race: the bracket may hold a maximum too.
                for candidate in [(distances[i], at(i)), (distance(t), t)] {
                    if candidate.0 < best.0 {
                        best = candidate;
                    }
                }
            }
        }
        best.1
    }

    /// Newton on half the derivative of the squared distance, inside a bracket.
    fn polish(&self, low: f64, start: f64, high: f64, query: &Point<f64, D>) -> f64 {
        let (mut low, mut high, mut t) = (low, high, start);
        for _ in 0..MAX_NEWTON_STEPS {
            let offset = self.at(t) - query;
            let velocity = self.velocity(t);
            let slope = offset.dot(&velocity);
            let curvature = velocity.norm_squared() + offset.dot(&self.acceleration(t));
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
}

fn nearer<const D: usize>(best: ClosestOnCurve<D>, other: ClosestOnCurve<D>) -> ClosestOnCurve<D> {
    if other.distance < best.distance { other } else { best }
}
