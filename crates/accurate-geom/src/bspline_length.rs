use nalgebra::Point;

use crate::BSpline;

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
        let mut total = 0.0;
        let mut left = from;
        let breakpoints = self.breakpoints();
        let first = breakpoints.partition_point(|b| *b <= from);
        for right in breakpoints[first..].iter().map(|b| b.min(to)) {
            if right > left {
                total += self.length_within_span(left, right);
            }
            left = right;
            if right >= to {
                break;
            }
        }
        total
    }

    /// `count` parameters at equal arc lengths, the first and the last parameter included; fewer
    /// than 2 gives the first only.
    pub fn uniform_parameters(&self, count: usize) -> Vec<f64> {
        let (start, end) = self.domain();
        if count < 2 {
            return vec![start];
        }
        let breakpoints = self.breakpoints();
        let lengths: Vec<f64> =
            breakpoints.windows(2).map(|w| self.length_within_span(w[0], w[1])).collect();
        let total: f64 = lengths.iter().sum();
        let mut parameters = vec![start];
        let (mut span, mut passed) = (0, 0.0);
        // Continue from the last parameter found, so that each integral is short.
        let (mut t, mut reached) = (start, 0.0);
        for index in 1..count - 1 {
            let target = total * index as f64 / (count - 1) as f64;
            while span + 1 < lengths.len() && passed + lengths[span] < target {
                passed += lengths[span];
                span += 1;
                (t, reached) = (breakpoints[span], passed);
            }
            let right = breakpoints[span + 1];
            let found = self.advance(t, right, target - reached, RELATIVE_TOLERANCE * total);
            reached += self.length_within_span(t, found);
            t = found;
            parameters.push(t);
        }
        parameters.push(end);
        parameters
    }

    /// `count` points at equal arc lengths, both ends included.
    pub fn sample(&self, count: usize) -> Vec<Point<f64, D>> {
        self.uniform_parameters(count).into_iter().map(|t| self.at(t)).collect()
    }

    /// The parameter in `[from, right]` (one span) that lies `length` beyond `from`: Newton inside
    /// a shrinking bracket.
    fn advance(&self, from: f64, right: f64, length: f64, tolerance: f64) -> f64 {
        let (mut low, mut high) = (from, right);
        let speed = self.derivative(from).norm();
        let mut t = from + if speed > 0.0 { length / speed } else { 0.5 * (right - from) };
        for _ in 0..60 {
            if !(t > low && t < high) {
                t = 0.5 * (low + high);
            }
            let excess = self.length_within_span(from, t) - length;
            if excess.abs() <= tolerance || high - low <= f64::EPSILON * high.abs() {
                break;
            }
            if excess > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let speed = self.derivative(t).norm();
            t = if speed > 0.0 { t - excess / speed } else { 0.5 * (low + high) };
        }
        t.clamp(from, right)
    }

    fn length_within_span(&self, from: f64, to: f64) -> f64 {
        let whole = self.quadrature(from, to);
        self.refine(from, to, whole, RELATIVE_TOLERANCE * whole, MAX_DEPTH)
    }

    fn refine(&self, from: f64, to: f64, whole: f64, tolerance: f64, depth: usize) -> f64 {
        let middle = 0.5 * (from + to);
        let (left, right) = (self.quadrature(from, middle), self.quadrature(middle, to));
        if depth == 0 || (left + right - whole).abs() <= tolerance {
            return left + right;
        }
        self.refine(from, middle, left, tolerance, depth - 1)
            + self.refine(middle, to, right, tolerance, depth - 1)
    }

    fn quadrature(&self, from: f64, to: f64) -> f64 {
        let (centre, half) = (0.5 * (from + to), 0.5 * (to - from));
        let speed = |t: f64| self.derivative(t).norm();
        let sum: f64 = GAUSS_LEGENDRE
            .iter()
            .map(|(x, w)| w * (speed(centre - half * x) + speed(centre + half * x)))
            .sum();
        half * sum
    }
}

fn clamped(t: f64, start: f64, end: f64) -> f64 {
    if t > start { t.min(end) } else { start }
}
