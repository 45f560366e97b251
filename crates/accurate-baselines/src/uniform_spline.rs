use accurate_geom::Point3;
use accurate_geom::nalgebra::Vector3;

/// A cubic B-spline in space with equal spans over `[start, start + spans * width]`. Free ends: the
/// first and last control point lie outside the curve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UniformSpline {
    pub(crate) start: f64,
    pub(crate) width: f64,
    /// `spans + 3` control points, world unit.
    pub(crate) controls: Vec<Vector3<f64>>,
}

/// Weights of four neighbouring control points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Weights {
    pub(crate) first: usize,
    pub(crate) weight: [f64; 4],
}

/// Nodes on `[0, 1]` and weights of the Gauss-Legendre rule of three points: exact to degree 5, and
/// so for the squared second derivative of a cubic.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

impl UniformSpline {
    /// All control points at the origin.
    pub(crate) fn zero(start: f64, end: f64, spans: usize) -> Self {
        let spans = spans.max(1);
        let width = (end - start) / spans as f64;
        Self { start, width, controls: vec![Vector3::zeros(); spans + 3] }
    }

    pub(crate) fn spans(&self) -> usize {
        self.controls.len() - 3
    }

    pub(crate) fn point(&self, t: f64) -> Point3 {
        Point3::from(self.sum(&self.value_weights(t)))
    }

    pub(crate) fn sum(&self, weights: &Weights) -> Vector3<f64> {
        (0..4).map(|k| self.controls[weights.first + k] * weights.weight[k]).sum()
    }

    pub(crate) fn value_weights(&self, t: f64) -> Weights {
        let place = (t - self.start) / self.width;
        let first = (place.max(0.0) as usize).min(self.spans() - 1);
        let u = place - first as f64;
        let v = 1.0 - u;
        let weight = [
            v * v * v / 6.0,
            (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
            (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0,
            u * u * u / 6.0,
        ];
        Weights { first, weight }
    }

    /// For every Gauss point of every span: the measure `dt` it stands for, and the weights of the
    /// first and the second derivative there.
    pub(crate) fn quadrature(&self) -> impl Iterator<Item = (f64, Weights, Weights)> + '_ {
        let width = self.width;
        (0..self.spans()).flat_map(move |first| {
            GAUSS.iter().map(move |&(u, share)| {
                let v = 1.0 - u;
                let d1 = [
                    -v * v / 2.0,
                    (3.0 * u * u - 4.0 * u) / 2.0,
                    (4.0 * v - 3.0 * v * v) / 2.0,
                    u * u / 2.0,
                ];
                let d2 = [v, 3.0 * u - 2.0, 1.0 - 3.0 * u, u];
                let first_derivative = Weights { first, weight: d1.map(|w| w / width) };
                let second_derivative = Weights { first, weight: d2.map(|w| w / (width * width)) };
                (share * width, first_derivative, second_derivative)
            })
        })
    }

    /// Arc length, world unit (three Gauss points per span).
    pub(crate) fn length(&self) -> f64 {
        self.quadrature().map(|(dt, d1, _)| dt * self.sum(&d1).norm()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn splines() -> impl Strategy<Value = UniformSpline> {
        prop::collection::vec([-5.0..5.0f64, -5.0..5.0f64, -5.0..5.0f64], 4..12).prop_map(|c| {
            UniformSpline {
                start: -1.0,
                width: 0.7,
                controls: c.into_iter().map(Vector3::from).collect(),
            }
        })
    }

    proptest! {
        #[test]
        fn the_weights_of_a_value_sum_to_one(spline in splines(), share in 0.0..1.0f64) {
            let t = spline.start + share * spline.width * spline.spans() as f64;
            let sum: f64 = spline.value_weights(t).weight.iter().sum();
            prop_assert!((sum - 1.0).abs() < 16.0 * f64::EPSILON);
        }

        #[test]
        fn derivative_weights_agree_with_differences(spline in splines()) {
            for (k, (_, d1, d2)) in spline.quadrature().enumerate() {
                let t = spline.start + spline.width * (d1.first as f64 + GAUSS[k % 3].0);
                // Inside one span the curve is a cubic: the truncation of a central difference is
                // h² / 6 times a third derivative of at most 8 * 5 / 0.7³ = 117; the second
                // difference is exact but for rounding of 4 eps * 5 / h².
                let h = 1e-4;
                let (a, b, c) = (spline.point(t - h), spline.point(t), spline.point(t + h));
                let first = (c - a) / (2.0 * h) - spline.sum(&d1);
                let second = ((c - b) - (b - a)) / (h * h) - spline.sum(&d2);
                prop_assert!(first.norm() < 1e-6);
                prop_assert!(second.norm() < 1e-5);
            }
        }
    }

    #[test]
    fn the_length_of_a_straight_spline_is_the_distance_of_its_ends() {
        let controls = (0..8).map(|k| Vector3::new(3.0, 4.0, 0.0) * f64::from(k)).collect();
        let spline = UniformSpline { start: 0.0, width: 2.0, controls };
        let ends = (spline.point(10.0) - spline.point(0.0)).norm();
        assert!((spline.length() - ends).abs() < 1e-12 && (ends - 25.0).abs() < 1e-12);
    }
}
