use nalgebra::Point;

use crate::BSpline;
use crate::bspline_piece::Piece;

/// Halvings of a span: below 2⁻⁵⁰ of it parameters are no longer told apart.
const MAX_DEPTH: usize = 50;

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
    /// The squared distance to a span is a polynomial of degree 6. Its Bernstein coefficients bound
    /// it from below and count its minima; a span is halved until it is ruled out or holds one
    /// minimum, which Newton's method finds. No minimum is missed.
    ///
    /// # Cost
    /// O(n) bounding boxes of control points, and a few hundred operations for each span that
    /// these do not rule out.
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
                let (left, right) = (from.max(piece.start), to.min(piece.end));
                let mut found = (best.distance * best.distance, best.parameter);
                let distance = piece.squared_distance(query, left, right);
                piece.search(query, left, right, &distance, MAX_DEPTH, &mut found);
                best = nearer(best, self.candidate(found.1, query));
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
    /// Bernstein coefficients over `[start, end]` of the squared distance to `query`.
    fn squared_distance(&self, query: &Point<f64, D>, start: f64, end: f64) -> [f64; 7] {
        let h = end - start;
        let offset = self.at(start) - query;
        let (first, second) = (self.velocity(start) * h, self.acceleration(start) * (h * h));
        let corners = [
            offset,
            offset + first / 3.0,
            offset + first * (2.0 / 3.0) + second / 6.0,
            self.at(end) - query,
        ];
        // Product of two Bernstein polynomials of degree 3.
        const CHOOSE_3: [f64; 4] = [1.0, 3.0, 3.0, 1.0];
        const CHOOSE_6: [f64; 7] = [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0];
        let mut product = [0.0; 7];
        for i in 0..4 {
            for j in 0..4 {
                product[i + j] += CHOOSE_3[i] * CHOOSE_3[j] * corners[i].dot(&corners[j]);
            }
        }
        std::array::from_fn(|k| product[k] / CHOOSE_6[k])
    }

    /// Lowers `best` (squared distance, parameter) to the minimum over `[start, end]`, where the
    /// squared distance has the Bernstein coefficients `distance`.
    fn search(
        &self,
        query: &Point<f64, D>,
        start: f64,
        end: f64,
        distance: &[f64; 7],
        depth: usize,
        best: &mut (f64, f64),
    ) {
        let mut offer = |t: f64| {
            let squared = (self.at(t) - query).norm_squared();
            if squared < best.0 {
                *best = (squared, t);
            }
        };
        offer(start);
        offer(end);
        let least = distance.iter().copied().fold(f64::INFINITY, f64::min);
        let most = distance.iter().copied().fold(0.0, f64::max);
        // The coefficients are known to the rounding of the largest.
        if least > best.0 + 16.0 * f64::EPSILON * most {
            return;
        }
        // The slope has no more zeros than its coefficients, the differences, have sign changes.
        let mut changes = 0;
        let mut sign = 0.0;
        for pair in distance.windows(2) {
            let rise = pair[1] - pair[0];
            if rise * sign < 0.0 {
                changes += 1;
            }
            if rise != 0.0 {
                sign = rise.signum();
            }
        }
        let middle = 0.5 * (start + end);
        if changes == 0 {
            return; // monotone: the ends were offered
        }
        if changes == 1 || depth == 0 || !(start < middle && middle < end) {
            let t = self.polish(start, middle, end, query);
            let squared = (self.at(t) - query).norm_squared();
            if squared < best.0 {
                *best = (squared, t);
            }
            return;
        }
        let (left, right) = halves(distance);
        self.search(query, start, middle, &left, depth - 1, best);
        self.search(query, middle, end, &right, depth - 1, best);
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

/// De Casteljau: the Bernstein coefficients over the left and the right half.
fn halves(whole: &[f64; 7]) -> ([f64; 7], [f64; 7]) {
    let mut row = *whole;
    let (mut left, mut right) = ([0.0; 7], [0.0; 7]);
    for level in 0..7 {
        left[level] = row[0];
        right[6 - level] = row[6 - level];
        for k in 0..6 - level {
            row[k] = 0.5 * (row[k] + row[k + 1]);
        }
    }
    (left, right)
}

fn nearer<const D: usize>(best: ClosestOnCurve<D>, other: ClosestOnCurve<D>) -> ClosestOnCurve<D> {
    if other.distance < best.distance { other } else { best }
}
