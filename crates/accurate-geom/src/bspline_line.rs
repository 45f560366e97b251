use crate::BSpline;

impl BSpline<2> {
    /// Parameters of all points on the line `a x + b y + c = 0`, ascending: every crossing, and
    /// every tangency whose value is exactly zero. A stretch that lies on the line gives the ends
    /// of its pieces. Empty if a coefficient is not finite.
    ///
    /// The line need not be normalised.
    ///
    /// # Cost
    /// O(n) for n control points, plus a safeguarded Newton iteration per crossing.
    pub fn intersect_line(&self, a: f64, b: f64, c: f64) -> Vec<f64> {
        let Some(pieces) = self.monotone_pieces(a, b, c, true) else { return Vec::new() };
        let mut found = Vec::new();
        for piece in &pieces {
            if piece.left_value == 0.0 {
                found.push(piece.left);
            } else if piece.left_value * piece.right_value.signum() < 0.0
                && piece.right_value != 0.0
            {
                found.push(piece.root());
            }
        }
        // Spans left out do not touch the line, so only the last end has no piece to its right.
        if let Some(last) = pieces.last().filter(|piece| piece.right_value == 0.0) {
            found.push(last.right);
        }
        found.dedup();
        found
    }

    /// Parameters inside the domain where `a x + b y + c` has a local extremum along the curve,
    /// ascending: where the curve runs parallel to the line and turns back. Near-tangent contacts
    /// are extrema of small value.
    pub fn line_extrema(&self, a: f64, b: f64, c: f64) -> Vec<f64> {
        let Some(pieces) = self.monotone_pieces(a, b, c, false) else { return Vec::new() };
        let mut found = Vec::new();
        let mut direction = 0.0;
        for piece in &pieces {
            let rise = piece.right_value - piece.left_value;
            if rise == 0.0 {
                continue;
            }
            if rise * direction < 0.0 {
                found.push(piece.left);
            }
            direction = rise.signum();
        }
        found
    }

    /// The curve cut at its knots and wherever the value of the line is stationary. With
    /// `near_zero`, without the spans that stay clear of the line. `None` if a value is not finite.
    fn monotone_pieces(
        &self,
        a: f64,
        b: f64,
        c: f64,
        near_zero: bool,
    ) -> Option<Vec<MonotonePiece>> {
        let control = self.control_points();
        let values: Vec<f64> = control.iter().map(|p| a * p.x + b * p.y + c).collect();
        let reach = control.iter().fold(0.0f64, |m, p| m.max(p.coords.amax()));
        // Beyond this the sign of a value is no matter of rounding.
        let margin = 64.0 * f64::EPSILON * ((a.abs() + b.abs()) * reach + c.abs());
        if !values.iter().all(|v| v.is_finite()) || !margin.is_finite() {
            return None;
        }
        let mut pieces: Vec<MonotonePiece> = Vec::new();
        for span in self.spans() {
            // The values of a span lie between those of its four control points.
            let local = &values[span - 3..=span];
            let clear = local.iter().all(|v| *v > margin) || local.iter().all(|v| *v < -margin);
            if near_zero && clear {
                continue;
            }
            let cubic = self.line_cubic(span, a, b, c);
            if !cubic.coefficients.iter().all(|v| v.is_finite()) {
                return None;
            }
            let mut left = 0.0;
            for right in cubic.stationary().into_iter().flatten().chain([1.0]) {
                // One value per cut, shared by the pieces on both sides, so that no root is lost
                // or doubled between them.
                let before = pieces.last().filter(|piece| piece.right == cubic.parameter(left));
                let left_value = before.map_or_else(|| cubic.at(left), |piece| piece.right_value);
                pieces.push(MonotonePiece {
                    left: cubic.parameter(left),
                    right: cubic.parameter(right),
                    left_value,
                    right_value: cubic.at(right),
                    local: (left, right),
                    cubic,
                });
                left = right;
            }
        }
        Some(pieces)
    }

    fn line_cubic(&self, span: usize, a: f64, b: f64, c: f64) -> LineCubic {
        let (start, end) = (self.knots()[span], self.knots()[span + 1]);
        let jet = self.jet_in_span(span, start);
        let h = end - start;
        let along = |x: f64, y: f64| a * x + b * y;
        LineCubic {
            start,
            end,
            coefficients: [
                along(jet.point.x, jet.point.y) + c,
                along(jet.first.x, jet.first.y) * h,
                along(jet.second.x, jet.second.y) * h * h / 2.0,
                along(jet.third.x, jet.third.y) * h * h * h / 6.0,
            ],
        }
    }
}

/// Signed value of the line over one span: a cubic of `u` in `[0, 1]`.
#[derive(Debug, Clone, Copy)]
struct LineCubic {
    start: f64,
    end: f64,
    coefficients: [f64; 4],
}

impl LineCubic {
    fn at(&self, u: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients;
        c0 + u * (c1 + u * (c2 + u * c3))
    }

    fn slope(&self, u: f64) -> f64 {
        let [_, c1, c2, c3] = self.coefficients;
        c1 + u * (2.0 * c2 + u * 3.0 * c3)
    }

    fn parameter(&self, u: f64) -> f64 {
        if u == 1.0 { self.end } else { (self.start + u * (self.end - self.start)).min(self.end) }
    }

    /// Zeros of the slope inside `(0, 1)`, ascending, by the quadratic formula that does not
    /// cancel.
    fn stationary(&self) -> [Option<f64>; 2] {
        let [_, c1, c2, c3] = self.coefficients;
        let (qa, half_b, qc) = (3.0 * c3, c2, c1);
        let discriminant = half_b * half_b - qa * qc;
        if !(discriminant >= 0.0) {
            return [None, None];
        }
        let q = -(half_b + discriminant.sqrt().copysign(half_b));
        // Division by zero gives an infinity or NaN, which is not inside (0, 1).
        let inside = |u: f64| (u > 0.0 && u < 1.0).then_some(u);
        let (u1, u2) = (inside(q / qa), inside(qc / q));
        match (u1, u2) {
            (Some(x), Some(y)) if x > y => [Some(y), Some(x)],
            (Some(x), Some(y)) if x == y => [Some(x), None],
            _ => [u1, u2],
        }
    }
}

struct MonotonePiece {
    left: f64,
    right: f64,
    left_value: f64,
    right_value: f64,
    /// `left` and `right` as parameters of `cubic`.
    local: (f64, f64),
    cubic: LineCubic,
}

impl MonotonePiece {
    /// The root between ends of opposite sign: Newton, with bisection whenever it leaves the
    /// bracket or converges too slowly.
    fn root(&self) -> f64 {
        let (mut low, mut high) = self.local;
        let rising = self.right_value > self.left_value;
        let mut u = {
            let share = self.left_value / (self.left_value - self.right_value);
            low + share * (high - low)
        };
        for iteration in 0..100 {
            let value = self.cubic.at(u);
            if value == 0.0 {
                break;
            }
            if (value > 0.0) == rising {
                high = u;
            } else {
                low = u;
            }
            if high - low <= f64::EPSILON {
                break;
            }
            let newton = u - value / self.cubic.slope(u);
            let next = if newton > low && newton < high && iteration % 8 != 7 {
                newton
            } else {
                0.5 * (low + high)
            };
            if (next - u).abs() <= 0.5 * f64::EPSILON {
                break;
            }
            u = next;
        }
        self.cubic.parameter(u)
    }
}
