/// The curvature, at its last point, of the least-squares quadratic through equally weighted points
/// with parameter `t = k / (n - 1)`.
///
/// On a uniform grid the fit is a fixed linear map of the points: with `s = k - (n - 1) / 2` the
/// polynomials `1`, `s` and `s² - (n² - 1) / 12` are orthogonal, so both derivatives at the last
/// point are one dot product each. The rows are computed once per window length.
///
/// # Source
/// ACCURATE, section 2.2, `κ(W_t ∪ q)`. The paper leaves the parametrisation and the place of
/// evaluation open: uniform in the index, at the candidate.
#[derive(Debug)]
pub(crate) struct CurvatureRows {
    /// Entry `n` belongs to `n` points; entries 0 to 2 are empty.
    rows: Vec<Vec<[f64; 2]>>,
}

/// What a window contributes to the derivatives at a candidate not yet known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WindowSums {
    first: [f64; 2],
    second: [f64; 2],
    candidate_row: [f64; 2],
}

impl CurvatureRows {
    /// Rows for windows of up to `window` points and one candidate.
    pub(crate) fn new(window: usize) -> Self {
        let rows =
            (0..=window + 1).map(|n| if n < 3 { Vec::new() } else { derivative_rows(n) }).collect();
        Self { rows }
    }

    /// Sums over the points before the candidate, or `None` if there are fewer than two of them (a
    /// quadratic needs three points with the candidate).
    pub(crate) fn window_sums(&self, before: &[[f64; 2]]) -> Option<WindowSums> {
        let rows = self.rows.get(before.len() + 1).filter(|rows| !rows.is_empty())?;
        let mut sums = WindowSums {
            first: [0.0; 2],
            second: [0.0; 2],
            candidate_row: rows.last().copied().unwrap_or_default(),
        };
        for (point, row) in before.iter().zip(rows) {
            let ([x, y], [first, second]) = (point, row);
            sums.first[0] += first * x;
            sums.first[1] += first * y;
            sums.second[0] += second * x;
            sums.second[1] += second * y;
        }
        Some(sums)
    }
}

impl WindowSums {
    /// Curvature at the candidate, 1/px.
    pub(crate) fn curvature(&self, candidate: [f64; 2]) -> f64 {
        let [first, second] = self.candidate_row;
        let dx = self.first[0] + first * candidate[0];
        let dy = self.first[1] + first * candidate[1];
        let ddx = self.second[0] + second * candidate[0];
        let ddy = self.second[1] + second * candidate[1];
        let speed_2 = dx * dx + dy * dy;
        // The published constant; it keeps a fit that folds back onto itself finite.
        (dx * ddy - dy * ddx).abs() / (speed_2 * speed_2.sqrt() + 1e-8)
    }
}

/// Per point its weights in `d/dt` and `d²/dt²` at `t = 1`, for `n >= 3` points.
fn derivative_rows(n: usize) -> Vec<[f64; 2]> {
    let count = n as f64;
    let n2 = count * count;
    let linear_norm = count * (n2 - 1.0) / 12.0;
    let quadratic_norm = linear_norm * (n2 - 4.0) / 15.0;
    let intervals = count - 1.0;
    (0..n)
        .map(|k| {
            let s = k as f64 - intervals / 2.0;
            let linear = s / linear_norm;
            let quadratic = (s * s - (n2 - 1.0) / 12.0) / quadratic_norm;
            // ds/dt = n - 1, and at the last point the derivative of s² is n - 1.
            let first = intervals * (linear + intervals * quadratic);
            [first, intervals * intervals * 2.0 * quadratic]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn an_exact_parabola_has_its_analytic_curvature(
            b in prop::array::uniform2(-40.0..40.0),
            c in prop::array::uniform2(-40.0..40.0),
            a in prop::array::uniform2(-40.0..40.0),
            n in 3_usize..=30,
        ) {
            let at = |k: usize| {
                let t = k as f64 / (n - 1) as f64;
                [0, 1].map(|i| a[i] + b[i] * t + c[i] * t * t)
            };
            let before: Vec<_> = (0..n - 1).map(at).collect();
            let rows = CurvatureRows::new(n - 1);
            let found = rows.window_sums(&before).unwrap().curvature(at(n - 1));
            let d: [f64; 2] = [b[0] + 2.0 * c[0], b[1] + 2.0 * c[1]];
            let dd: [f64; 2] = [2.0 * c[0], 2.0 * c[1]];
            let speed = d[0].hypot(d[1]);
            prop_assume!(speed > 1.0);
            let expected = (d[0] * dd[1] - d[1] * dd[0]).abs() / speed.powi(3);
            // Row sums of absolute values are below 8 n (first) and 24 n (second derivative), the
            // points below 120 px: n terms of rounding each, then one product with |d|, |d'| < 240.
            let d_error = 24.0 * (n * n) as f64 * 120.0 * f64::EPSILON;
            let tolerance = (4.0 * 240.0 * d_error + 1e-8 * expected) / speed.powi(3)
                + expected * 3.0 * d_error / speed;
            prop_assert!((found - expected).abs() <= tolerance, "{found} {expected}");
        }

        #[test]
        fn points_on_a_line_have_no_curvature(
            direction in prop::array::uniform2(-3_i32..=3), n in 3_usize..=11,
        ) {
            let at = |k: usize| direction.map(|d| f64::from(d) * k as f64);
            let before: Vec<_> = (0..n - 1).map(at).collect();
            let sums = CurvatureRows::new(10).window_sums(&before).unwrap();
            // Second derivatives vanish up to the rounding of n terms of size 24 n * 3 n.
            prop_assert!(sums.curvature(at(n - 1)) <= 1e-9);
        }
    }

    #[test]
    fn two_points_have_no_quadratic() {
        assert!(CurvatureRows::new(10).window_sums(&[[0.0, 0.0]]).is_none());
        assert!(CurvatureRows::new(0).window_sums(&[]).is_none());
    }
}
