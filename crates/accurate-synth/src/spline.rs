use accurate_geom::Point3;
use nalgebra::Vector3;

/// Samples of the natural cubic spline through two or more distinct knots, parametrised by chord
/// length: `per_segment` samples per segment and the last knot.
pub(crate) fn natural_spline(knots: &[Point3], per_segment: usize) -> Vec<Point3> {
    let n = knots.len();
    let h: Vec<f64> = knots.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
    let slope: Vec<Vector3<f64>> =
        knots.windows(2).zip(&h).map(|(w, h)| (w[1] - w[0]) / *h).collect();

    // Second derivatives m: tridiagonal system
    // h[i-1] m[i-1] + 2 (h[i-1] + h[i]) m[i] + h[i] m[i+1] = 6 (slope[i] - slope[i-1]), m = 0 at
    // both ends; forward elimination, then back substitution. Diagonally dominant: no pivoting.
    let mut upper = vec![0.0; n];
    let mut m = vec![Vector3::zeros(); n];
    for i in 1..n - 1 {
        let pivot = 2.0 * (h[i - 1] + h[i]) - h[i - 1] * upper[i - 1];
        upper[i] = h[i] / pivot;
        m[i] = ((slope[i] - slope[i - 1]) * 6.0 - m[i - 1] * h[i - 1]) / pivot;
    }
    for i in (1..n - 1).rev() {
        let next = m[i + 1];
        m[i] -= next * upper[i];
    }

    let mut samples = Vec::with_capacity((n - 1) * per_segment + 1);
    for i in 0..n - 1 {
        let linear = slope[i] - (m[i] * 2.0 + m[i + 1]) * (h[i] / 6.0);
        let cubic = (m[i + 1] - m[i]) / (6.0 * h[i]);
        for k in 0..per_segment {
            let x = h[i] * k as f64 / per_segment as f64;
            samples.push(knots[i] + ((cubic * x + m[i] / 2.0) * x + linear) * x);
        }
    }
    samples.push(knots[n - 1]);
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knots() -> Vec<Point3> {
        vec![
            Point3::new(0.0, 0.0, 0.0),
            Point3::new(80.0, 10.0, -30.0),
            Point3::new(120.0, 90.0, 20.0),
            Point3::new(60.0, 150.0, 60.0),
            Point3::new(-20.0, 100.0, 140.0),
        ]
    }

    #[test]
    fn the_spline_passes_through_its_knots() {
        let samples = natural_spline(&knots(), 100);
        for (k, knot) in knots().iter().enumerate() {
            assert!((samples[100 * k] - knot).norm() < 1e-11);
        }
    }

    #[test]
    fn the_spline_is_smooth_to_second_order_and_straight_at_its_ends() {
        // Second differences over the chord-length step squared, either side of each knot.
        let per = 1000;
        let samples = natural_spline(&knots(), per);
        let step: Vec<f64> =
            knots().windows(2).map(|w| (w[1] - w[0]).norm() / per as f64).collect();
        let second = |at: usize, h: f64| {
            ((samples[at + 1] - samples[at]) - (samples[at] - samples[at - 1])) / (h * h)
        };
        for k in 1..4 {
            // Two samples apart: the second derivative is linear with slope < 1e-3 here.
            let left = second(per * k - 1, step[k - 1]);
            let right = second(per * k + 1, step[k]);
            assert!((left - right).norm() < 1e-3 * 2.0 * (step[k - 1] + step[k]) + 1e-6);
        }
        assert!(second(1, step[0]).norm() < 1e-3 * step[0]);
    }
}
