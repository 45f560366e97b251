use accurate_geom::Point3;
use accurate_geom::nalgebra::Vector3;
use accurate_geom::number::Number;
use pulp::Scalar;

use crate::FitError;
use crate::normal::NormalEquations;
use crate::span_blocks::LinearRow;

/// A cubic B-spline with uniform knots: `u` runs from 0 to [`UniformSpline::spans`], one unit per
/// span; the point at `u` depends on the control points `floor(u) .. floor(u) + 4`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UniformSpline {
    pub(crate) control: Vec<Vector3<f64>>,
}

/// Weights of the four control points at the offset `t` in `[0, 1]` of a span.
#[inline(always)]
pub(crate) fn basis<N: Number>(t: N) -> [N; 4] {
    let (one, three, six) = (t.all(1.0), t.all(3.0), t.all(6.0));
    let s = one - t;
    let (t2, t3) = (t * t, t * t * t);
    [
        s * s * s / six,
        (three * t3 - six * t2 + t.all(4.0)) / six,
        (t.all(-3.0) * t3 + three * t2 + three * t + one) / six,
        t3 / six,
    ]
}

/// First derivative of [`basis`].
#[inline(always)]
pub(crate) fn basis_1<N: Number>(t: N) -> [N; 4] {
    let (half, three_halves) = (t.all(0.5), t.all(1.5));
    let s = t.all(1.0) - t;
    [
        t.all(-0.5) * s * s,
        three_halves * t * t - t.all(2.0) * t,
        t.all(-1.5) * t * t + t + half,
        half * t * t,
    ]
}

/// Second derivative of [`basis`].
#[inline]
pub(crate) fn basis_2(t: f64) -> [f64; 4] {
    [1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t]
}

impl UniformSpline {
    /// Number of spans, `control points - 3`, at least 1.
    #[inline]
    pub(crate) fn spans(&self) -> usize {
        self.control.len() - 3
    }

    /// Mean length of a span: the distance of the knots along the curve, px.
    pub(crate) fn spacing_px(&self, px_per_unit: f64) -> f64 {
        self.length(8) * px_per_unit / self.spans() as f64
    }

    /// Span and offset of the parameter `u`, which is first cut to the curve.
    #[inline]
    pub(crate) fn locate(&self, u: f64) -> (usize, f64) {
        Self::locate_in(self.spans(), u)
    }

    /// The same for any spline of so many spans. NaN counts as the start.
    #[inline]
    pub(crate) fn locate_in(spans: usize, u: f64) -> (usize, f64) {
        let u = u.max(0.0).min(spans as f64);
        let span = (u as usize).min(spans - 1);
        (span, u - span as f64)
    }

    /// The control points of a span, weighted.
    #[inline]
    pub(crate) fn combine(&self, span: usize, weights: [f64; 4]) -> Vector3<f64> {
        let c = &self.control[span..span + 4];
        c[0] * weights[0] + c[1] * weights[1] + c[2] * weights[2] + c[3] * weights[3]
    }

    #[inline]
    pub(crate) fn point(&self, u: f64) -> Vector3<f64> {
        let (span, t) = self.locate(u);
        self.combine(span, basis(t))
    }

    /// `steps` points per span, and the end.
    pub(crate) fn sample(&self, steps: usize) -> Vec<Point3> {
        let n = self.spans() * steps;
        (0..=n).map(|k| Point3::from(self.point(k as f64 / steps as f64))).collect()
    }

    /// Length in the world's unit, by `steps` chords per span.
    pub(crate) fn length(&self, steps: usize) -> f64 {
        let points = self.sample(steps);
        points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
    }

    /// `∫ κ² ds` over the curve, 1 / world unit, by the midpoint rule with 4 points per span.
    pub(crate) fn bending(&self) -> f64 {
        let mut sum = 0.0;
        for span in 0..self.spans() {
            for k in 0..4 {
                let t = (k as f64 + 0.5) / 4.0;
                let d1 = self.combine(span, basis_1(t));
                let d2 = self.combine(span, basis_2(t));
                let speed = d1.norm();
                if speed > 0.0 {
                    sum += 0.25 * d1.cross(&d2).norm_squared() / speed.powi(5);
                }
            }
        }
        sum
    }

    /// The smoothing least-squares spline through `(u, point)` data, `0 <= u <= spans`, with second
    /// and third differences of the control points penalised.
    pub(crate) fn least_squares(
        spans: usize,
        data: &[(f64, Vector3<f64>)],
        lambda2: f64,
        lambda3: f64,
    ) -> Result<Self, FitError> {
        let n = spans + 3;
        // Relative to the middle: damping draws to the origin, and nothing is lost of points far from it.
        let centre = data.iter().map(|(_, point)| point).sum::<Vector3<f64>>() / data.len() as f64;
        let mut spline = Self { control: vec![Vector3::zeros(); n] };
        let mut normal = NormalEquations::new(n, 0)?;
        for (u, point) in data {
            let (span, t) = spline.locate(*u);
            let weights = basis(t);
            for axis in 0..3 {
                let mut gradient = [0.0; 3];
                gradient[axis] = 1.0;
                let row = LinearRow {
                    span,
                    basis: &weights,
                    gradient: &gradient,
                    global: &[],
                    residual: centre[axis] - point[axis],
                    weight: 1.0,
                };
                normal.add(Scalar::new(), &row);
            }
        }
        normal.add_smoothness(&spline.control, lambda2, lambda3, &[]);
        let step = normal.solve(1e-9)?;
        spline.add(step);
        spline.control.iter_mut().for_each(|control| *control += centre);
        Ok(spline)
    }

    /// Moves the control points by `step`, three numbers per control point.
    pub(crate) fn add(&mut self, step: &[f64]) {
        for (c, d) in self.control.iter_mut().zip(step.chunks_exact(3)) {
            *c += Vector3::new(d[0], d[1], d[2]);
        }
    }

    /// The spline of another number of spans through dense points, parametrised by arc length.
    pub(crate) fn through(points: &[Point3], spans: usize) -> Result<Self, FitError> {
        let mut arc = Vec::with_capacity(points.len());
        let mut length = 0.0;
        for (k, p) in points.iter().enumerate() {
            if k > 0 {
                length += (p - points[k - 1]).norm();
            }
            arc.push(length);
        }
        if !(length > 0.0 && length.is_finite()) {
            return Err(FitError::BadLength { length_px: length });
        }
        let to_u = spans as f64 / length;
        // Only ties the control points that no datum reaches.
        let data: Vec<_> = arc.iter().zip(points).map(|(s, p)| (s * to_u, p.coords)).collect();
        Self::least_squares(spans, &data, 0.0, 1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn basis_functions_sum_to_one_and_their_derivatives_to_zero(t in 0.0..=1.0f64) {
            let sum = |b: [f64; 4]| b.iter().sum::<f64>();
            // Four terms of order 1.
            let tol = 8.0 * f64::EPSILON;
            prop_assert!((sum(basis(t)) - 1.0).abs() < tol);
            prop_assert!(sum(basis_1(t)).abs() < tol);
            prop_assert!(sum(basis_2(t)).abs() < tol);
        }

        #[test]
        fn derivatives_are_limits_of_differences(t in 0.001..0.999f64) {
            let h = 1e-4;
            for k in 0..4 {
                // Error of central differences: h²/6 times the third (at most 3) derivative, and
                // rounding / h.
                let d1 = (basis(t + h)[k] - basis(t - h)[k]) / (2.0 * h);
                prop_assert!((d1 - basis_1(t)[k]).abs() < 0.5 * h * h + 1e-11);
                let d2 = (basis_1(t + h)[k] - basis_1(t - h)[k]) / (2.0 * h);
                prop_assert!((d2 - basis_2(t)[k]).abs() < 1e-10);
            }
        }

        #[test]
        fn least_squares_returns_the_spline_that_made_the_data(
            control in prop::collection::vec((-1e2..1e2f64, -1e2..1e2f64, -1e2..1e2f64), 4..12),
        ) {
            let truth = UniformSpline {
                control: control.iter().map(|&(x, y, z)| Vector3::new(x, y, z)).collect(),
            };
            let n = 12 * truth.spans();
            let at = |k: usize| k as f64 * truth.spans() as f64 / n as f64;
            let data: Vec<_> = (0..=n).map(|k| (at(k), truth.point(at(k)))).collect();
            let found = UniformSpline::least_squares(truth.spans(), &data, 0.0, 0.0).unwrap();
            for (a, b) in found.control.iter().zip(&truth.control) {
                // Damping 1e-9 relative to the diagonal, times the condition of a cubic basis
                // (< 1e4 with 12 points in the only span), times 100.
                prop_assert!((a - b).norm() < 1e-2, "{a} {b}");
            }
        }
    }

    #[test]
    fn a_straight_spline_has_its_length_and_no_bending() {
        let control = (0..9).map(|k| Vector3::new(k as f64 * 2.0, 0.0, 1.0)).collect();
        let line = UniformSpline { control };
        assert!((line.length(3) - 12.0).abs() < 1e-12);
        assert!(line.bending() < 1e-20);
    }

    #[test]
    fn the_bending_of_a_circle_is_two_pi_over_its_radius() {
        let points: Vec<Point3> = (0..=400)
            .map(|k| {
                let (s, c) = (k as f64 / 400.0 * std::f64::consts::TAU).sin_cos();
                Point3::new(30.0 * c, 30.0 * s, 5.0)
            })
            .collect();
        let circle = UniformSpline::through(&points, 40).unwrap();
        let expected = std::f64::consts::TAU / 30.0;
        assert!((circle.bending() - expected).abs() < 1e-3 * expected, "{}", circle.bending());
    }
}
