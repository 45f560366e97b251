use nalgebra::Point;

use crate::BSpline;
use crate::bspline_piece::Piece;

/// Nodes and weights of the 8-point Gauss-Legendre rule on `[-1, 1]`, positive half.
const GAUSS_LEGENDRE: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
];

/// Relative accuracy of arc lengths.
const RELATIVE_TOLERANCE: f64 = 1e-12;

/// Halvings of a span; cusps, where the speed has a kink, end here.
const MAX_DEPTH: usize = 24;

impl<const D: usize> BSpline<D> {
    /// Length of the curve, in the unit of its points, to a relative accuracy of about 1e-12.
    pub fn arc_length(&self) -> f64 {
        let (start, end) = self.domain();
        self.arc_length_between(start, end)
    }

    /// Length of the curve between two parameters; negative if `to < from`.
    ///
    /// # Cost
    /// A few Gauss-Legendre rules of 8 points per knot span.
    pub fn arc_length_between(&self, from: f64, to: f64) -> f64 {
        let (start, end) = self.domain();
        let (from, to) = (clamped(from, start, end), clamped(to, start, end));
        if to < from {
            return -self.arc_length_between(to, from);
        }
        self.spans()
            .map(|span| self.piece(span))
            .map(|piece| (from.max(piece.start), to.min(piece.end), piece))
            .filter(|(left, right, _)| left < right)
            .map(|(left, right, piece)| piece.length(left, right))
            .sum()
    }

    /// `count` parameters at equal arc lengths, the first and the last parameter included; fewer
    /// than 2 gives the first only.
    pub fn uniform_parameters(&self, count: usize) -> Vec<f64> {
        let (start, end) = self.domain();
        if count < 2 {
            return vec![start];
        }
        let pieces: Vec<_> = self.spans().map(|span| self.piece(span)).collect();
        let lengths: Vec<f64> = pieces.iter().map(|p| p.length(p.start, p.end)).collect();
        let total: f64 = lengths.iter().sum();
        let mut parameters = vec![start];
        let (mut current, mut passed) = (0, 0.0);
        // Continue from the last parameter found, so that each integral is short.
        let (mut t, mut reached) = (start, 0.0);
        for index in 1..count - 1 {
            let target = total * index as f64 / (count - 1) as f64;
            while current + 1 < lengths.len() && passed + lengths[current] < target {
                passed += lengths[current];
                current += 1;
                (t, reached) = (pieces[current].start, passed);
            }
            let piece = &pieces[current];
            let (found, length) = piece.advance(t, target - reached, RELATIVE_TOLERANCE * total);
            (t, reached) = (found, reached + length);
            parameters.push(t);
        }
        parameters.push(end);
        parameters
    }

    /// `count` points at equal arc lengths, both ends included.
    pub fn sample(&self, count: usize) -> Vec<Point<f64, D>> {
        self.uniform_parameters(count).into_iter().map(|t| self.at(t)).collect()
    }
}

impl<const D: usize> Piece<D> {
    /// The parameter that lies `length` beyond `from`, at most the end of the piece, and how far it
    /// does: Newton inside a shrinking bracket.
    fn advance(&self, from: f64, length: f64, tolerance: f64) -> (f64, f64) {
        let (mut low, mut high) = (from, self.end);
        let speed = self.speed(from);
        let mut t = from + if speed > 0.0 { length / speed } else { 0.5 * (high - low) };
        for _ in 0..60 {
            if !(t > low && t < high) {
                t = 0.5 * (low + high);
            }
            let reached = self.length(from, t);
            let excess = reached - length;
            if excess.abs() <= tolerance || high - low <= f64::EPSILON * high.abs() {
                return (t, reached);
            }
            if excess > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let speed = self.speed(t);
            t = if speed > 0.0 { t - excess / speed } else { 0.5 * (low + high) };
        }
        let t = t.clamp(from, self.end);
        (t, self.length(from, t))
    }

    fn speed(&self, t: f64) -> f64 {
        self.velocity(t).norm()
    }

    fn length(&self, from: f64, to: f64) -> f64 {
        let whole = self.quadrature(from, to);
        self.refine(from, to, whole, RELATIVE_TOLERANCE * whole, MAX_DEPTH)
    }

    fn refine(&self, from: f64, to: f64, whole: f64, tolerance: f64, depth: usize) -> f64 {
        let middle = 0.5 * (from + to);
        let (left, right) = (self.quadrature(from, middle), self.quadrature(middle, to));
        // What overflows is no nearer the truth in halves.
        let error = (left + right - whole).abs();
        if depth == 0 || error <= tolerance || error.is_nan() {
            return left + right;
        }
        self.refine(from, middle, left, tolerance, depth - 1)
            + self.refine(middle, to, right, tolerance, depth - 1)
    }

    fn quadrature(&self, from: f64, to: f64) -> f64 {
        let (centre, half) = (0.5 * (from + to), 0.5 * (to - from));
        let sum: f64 = GAUSS_LEGENDRE
            .iter()
            .map(|(x, w)| w * (self.speed(centre - half * x) + self.speed(centre + half * x)))
            .sum();
        half * sum
    }
}

fn clamped(t: f64, start: f64, end: f64) -> f64 {
    if t > start { t.min(end) } else { start }
}
