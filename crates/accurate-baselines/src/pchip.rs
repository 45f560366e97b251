use accurate_geom::GeomError;

/// A monotone piecewise cubic through given knots: between two knots it never leaves their values,
/// so that it rises where the data rise and is constant where they are.
///
/// # Source
/// Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980): the condition on the slopes. The slopes
/// themselves are the weighted harmonic means of Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5
/// (1984); the end slopes are one-sided three-point formulas, limited to keep the condition.
///
/// # Cost
/// O(n) to build, O(log n) per value.
#[derive(Debug, Clone, PartialEq)]
pub struct Pchip {
    x: Vec<f64>,
    y: Vec<f64>,
    slope: Vec<f64>,
}

impl Pchip {
    /// Through `(x, y)` knots with strictly increasing, finite `x` and finite `y`. One knot gives a
    /// constant.
    ///
    /// # Errors
    /// [`GeomError::TooFewPoints`] without a knot, [`GeomError::NotFinite`] for a knot,
    /// [`GeomError::OutOfRange`] if `x` does not increase or two knots are so close that their slope
    /// overflows.
    pub fn new(knots: &[(f64, f64)]) -> Result<Self, GeomError> {
        let count = knots.len();
        if count == 0 {
            return Err(GeomError::TooFewPoints { found: 0, needed: 1 });
        }
        for (index, knot) in knots.iter().enumerate() {
            for (name, value) in [("x", knot.0), ("y", knot.1)] {
                if !value.is_finite() {
                    let what = format!("{name} of PCHIP knot {index}");
                    return Err(GeomError::NotFinite { what, value });
                }
            }
        }
        let mut step = Vec::with_capacity(count - 1);
        let mut secant = Vec::with_capacity(count - 1);
        for pair in knots.windows(2) {
            let h = pair[1].0 - pair[0].0;
            let delta = (pair[1].1 - pair[0].1) / h;
            // A slope of three secants must not overflow either.
            if !(h > 0.0 && h.is_finite() && delta.abs() < f64::MAX / 8.0) {
                let what = "step between PCHIP knots";
                let expected = "a finite number above 0, with a finite slope";
                return Err(GeomError::OutOfRange { what, value: h, expected });
            }
            step.push(h);
            secant.push(delta);
        }
        let (x, y) = knots.iter().copied().unzip();
        Ok(Self { x, y, slope: slopes(&step, &secant) })
    }

    /// The value at `x`; outside the knots, the value at the nearer end.
    pub fn value(&self, x: f64) -> f64 {
        let last = self.x.len() - 1;
        if x <= self.x[0] || x.is_nan() {
            return self.y[0];
        }
        if x >= self.x[last] {
            return self.y[last];
        }
        let right = self.x.partition_point(|&knot| knot <= x);
        let left = right - 1;
        let h = self.x[right] - self.x[left];
        let u = (x - self.x[left]) / h;
        let v = 1.0 - u;
        let (y0, y1) = (self.y[left], self.y[right]);
        let cubic = v * v * ((1.0 + 2.0 * u) * y0 + h * u * self.slope[left])
            + u * u * ((1.0 + 2.0 * v) * y1 - h * v * self.slope[right]);
        // Rounding may step over the knots' values; the guarantee is worth a clamp.
        cubic.clamp(y0.min(y1), y0.max(y1))
    }

    /// First and last knot abscissa.
    pub fn range(&self) -> (f64, f64) {
        (self.x[0], self.x[self.x.len() - 1])
    }
}

fn slopes(step: &[f64], secant: &[f64]) -> Vec<f64> {
    let segments = secant.len();
    if segments < 2 {
        return vec![secant.first().copied().unwrap_or(0.0); segments + 1];
    }
    let mut slope = vec![0.0; segments + 1];
    for k in 1..segments {
        let (d0, d1) = (secant[k - 1], secant[k]);
        // Written with signs, not a product: tiny secants would underflow.
        if (d0 > 0.0 && d1 > 0.0) || (d0 < 0.0 && d1 < 0.0) {
            let (h0, h1) = (step[k - 1], step[k]);
            let w0 = (2.0 * h1 + h0) / (3.0 * (h0 + h1));
            slope[k] = 1.0 / (w0 / d0 + (1.0 - w0) / d1);
        }
    }
    slope[0] = end_slope(step[0], step[1], secant[0], secant[1]);
    slope[segments] = end_slope(
        step[segments - 1],
        step[segments - 2],
        secant[segments - 1],
        secant[segments - 2],
    );
    slope
}

fn end_slope(h0: f64, h1: f64, d0: f64, d1: f64) -> f64 {
    let w = h0 / (h0 + h1);
    let slope = (1.0 + w) * d0 - w * d1;
    if slope * d0.signum() <= 0.0 || d0 == 0.0 {
        0.0
    } else if slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn increasing_knots() -> impl Strategy<Value = Vec<(f64, f64)>> {
        prop::collection::vec((0.01..5.0f64, 0.0..3.0f64), 1..20).prop_map(|steps| {
            let (mut x, mut y) = (0.0, 0.0);
            steps
                .into_iter()
                .map(|(dx, dy)| {
                    x += dx;
                    // Flat stretches are what makes ordinary cubics overshoot.
                    y += if dy < 1.0 { 0.0 } else { dy };
                    (x, y)
                })
                .collect()
        })
    }

    proptest! {
        #[test]
        fn pchip_of_rising_data_never_falls(knots in increasing_knots()) {
            let curve = Pchip::new(&knots).unwrap();
            let (a, b) = curve.range();
            // A cubic in Hermite form is summed from terms as large as the data: 8 roundings.
            let tolerance = 8.0 * f64::EPSILON * knots[knots.len() - 1].1.max(1.0);
            let values: Vec<f64> =
                (0..=500).map(|k| curve.value(a + (b - a) * f64::from(k) / 500.0)).collect();
            for pair in values.windows(2) {
                prop_assert!(pair[1] >= pair[0] - tolerance);
            }
        }

        #[test]
        fn pchip_goes_through_its_knots(
            ys in prop::collection::vec(-1e3..1e3f64, 1..30), h in 0.1..10.0f64,
        ) {
            let knots: Vec<_> = ys.iter().enumerate().map(|(k, &y)| (k as f64 * h, y)).collect();
            let curve = Pchip::new(&knots).unwrap();
            for (x, y) in knots {
                prop_assert_eq!(curve.value(x), y);
            }
        }

        #[test]
        fn pchip_reproduces_a_straight_line(a in -5.0..5.0f64, b in -5.0..5.0f64, x in 0.0..9.0f64) {
            let knots: Vec<_> =
                [0.0, 1.0, 2.5, 4.0, 9.0].iter().map(|&x| (x, a * x + b)).collect();
            let y = Pchip::new(&knots).unwrap().value(x);
            // Slopes are quotients of differences: some ten roundings of numbers up to 50.
            prop_assert!((y - (a * x + b)).abs() < 1e-12);
        }
    }

    #[test]
    fn knots_that_do_not_increase_are_refused() {
        assert_eq!(Pchip::new(&[]), Err(GeomError::TooFewPoints { found: 0, needed: 1 }));
        assert!(Pchip::new(&[(0.0, 0.0), (0.0, 1.0)]).is_err());
        assert!(Pchip::new(&[(0.0, f64::NAN)]).is_err());
        assert!(Pchip::new(&[(0.0, -1e308), (1e-5, 1e308)]).is_err());
    }
}
