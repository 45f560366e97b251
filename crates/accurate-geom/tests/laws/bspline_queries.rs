//! Intersections with lines and closest points, against dense sampling.

use accurate_geom::nalgebra::Point;
use accurate_geom::{BSpline, Curve2, Point2, Point3};
use proptest::prelude::*;

use crate::bspline::{curves, reach};

const SAMPLES: usize = 4000;

fn dense<const D: usize>(curve: &BSpline<D>) -> Vec<f64> {
    let (start, end) = curve.domain();
    (0..=SAMPLES).map(|i| start + (end - start) * i as f64 / SAMPLES as f64).collect()
}

/// Unit lines that pass near the curve.
fn lines() -> impl Strategy<Value = (f64, f64, f64)> {
    (-3.2..3.2f64, -5.0..15.0f64).prop_map(|(turn, c)| (turn.cos(), turn.sin(), -c))
}

fn value(curve: &Curve2, (a, b, c): (f64, f64, f64), t: f64) -> f64 {
    let p = curve.at(t);
    a * p.x + b * p.y + c
}

fn closest_equals_brute_force<const D: usize>(
    curve: &BSpline<D>,
    query: Point<f64, D>,
) -> Result<(), TestCaseError> {
    let found = curve.closest(&query);
    let parameters = dense(curve);
    let points: Vec<_> = parameters.iter().map(|t| curve.at(*t)).collect();
    let brute = points.iter().map(|p| (p - query).norm()).fold(f64::INFINITY, f64::min);
    let step = points.windows(2).map(|w| (w[1] - w[0]).norm()).fold(0.0, f64::max);
    let slack = 1e-12 * (1.0 + reach(curve) + query.coords.norm());
    prop_assert!(found.distance <= brute + slack, "{} {brute}", found.distance);
    prop_assert!(found.distance >= brute - step - slack);
    prop_assert_eq!(curve.at(found.parameter), found.point);
    Ok(())
}

proptest! {
    #[test]
    fn line_intersections_are_those_of_dense_sampling(curve in curves::<2>(4..30), line in lines()) {
        let (a, b, c) = line;
        let roots = curve.intersect_line(a, b, c);
        prop_assert!(roots.windows(2).all(|w| w[0] < w[1]));
        let (start, end) = curve.domain();
        let speed = curve.control_points().windows(2).map(|w| (w[1] - w[0]).norm())
            .fold(0.0, f64::max) * 3.0 / 0.1;
        // A root is known to an ulp of its parameter.
        let tolerance = 64.0 * f64::EPSILON * (reach(&curve) + c.abs() + speed * end);
        for root in &roots {
            prop_assert!(*root >= start && *root <= end);
            prop_assert!(value(&curve, line, *root).abs() <= tolerance);
        }
        let parameters = dense(&curve);
        for pair in parameters.windows(2) {
            let (v, w) = (value(&curve, line, pair[0]), value(&curve, line, pair[1]));
            if v.abs() > tolerance && w.abs() > tolerance && v * w < 0.0 {
                let inside = roots.iter().filter(|r| **r > pair[0] && **r < pair[1]).count();
                prop_assert!(inside % 2 == 1, "a crossing in {pair:?} was missed: {roots:?}");
            }
        }
    }

    #[test]
    fn line_extrema_are_those_of_dense_sampling(curve in curves::<2>(4..30), line in lines()) {
        let (a, b, c) = line;
        let extrema = curve.line_extrema(a, b, c);
        let parameters = dense(&curve);
        let tolerance = 1e-12 * (1.0 + reach(&curve) + c.abs());
        for three in parameters.windows(3) {
            let [u, v, w] = [0, 1, 2].map(|i| value(&curve, line, three[i]));
            if (v - u).abs() > tolerance && (w - v).abs() > tolerance && (v - u) * (w - v) < 0.0 {
                let inside = extrema.iter().filter(|t| **t > three[0] && **t < three[2]).count();
                prop_assert!(inside >= 1, "an extremum in {three:?} was missed");
            }
        }
        let h = 1e-6;
        for t in &extrema {
            // Knots repeated twice make corners, where the slope only changes sign.
            let slope = |t: f64| { let d = curve.derivative(t); a * d.x + b * d.y };
            let size = curve.derivative(*t).norm() + curve.second_derivative(*t).norm();
            prop_assert!(slope(t - h) * slope(t + h) <= 0.0
                || slope(*t).abs() <= 1e-9 * (1.0 + size));
        }
        // Between two crossings the value turns back.
        for pair in curve.intersect_line(a, b, c).windows(2) {
            prop_assert!(extrema.iter().any(|t| *t >= pair[0] && *t <= pair[1]));
        }
    }

    #[test]
    fn the_scale_of_a_line_changes_no_intersection(
        curve in curves::<2>(4..30), (a, b, c) in lines(), exponent in -20..20i32,
    ) {
        // A power of two scales without rounding.
        let scale = 2f64.powi(exponent);
        prop_assert_eq!(
            curve.intersect_line(a, b, c), curve.intersect_line(scale * a, scale * b, scale * c)
        );
    }

    #[test]
    fn the_closest_point_of_a_curve_is_that_of_brute_force_in_2d(
        curve in curves::<2>(4..20), x in -20.0..20.0f64, y in -20.0..20.0f64,
    ) {
        closest_equals_brute_force(&curve, Point2::new(x, y))?;
    }

    #[test]
    fn the_closest_point_of_a_curve_is_that_of_brute_force_in_3d(
        curve in curves::<3>(4..20), x in -20.0..20.0f64, y in -20.0..20.0f64,
    ) {
        closest_equals_brute_force(&curve, Point3::new(x, y, 0.2 * y))?;
    }

    /// Control points anywhere: spans that loop, with several local minima each.
    #[test]
    fn the_closest_point_of_a_tangled_curve_is_that_of_brute_force(
        control in proptest::collection::vec((0.0..10.0f64, 0.0..10.0f64), 4..9),
        x in 0.0..10.0f64, y in 0.0..10.0f64,
    ) {
        let control = control.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
        let curve = Curve2::with_uniform_knots(control).unwrap();
        closest_equals_brute_force(&curve, Point2::new(x, y))?;
    }

    #[test]
    fn a_point_of_the_curve_is_its_own_closest_point(
        curve in curves::<3>(4..20), share in 0.0..1.0f64,
    ) {
        let (start, end) = curve.domain();
        let p = curve.at(start + share * (end - start));
        prop_assert!(curve.closest(&p).distance <= 1e-12 * (1.0 + reach(&curve)));
        let half = curve.closest_between(&p, start, start + 0.5 * (end - start));
        prop_assert!(half.parameter <= start + 0.5 * (end - start));
        prop_assert!(share > 0.5 || half.distance <= 1e-12 * (1.0 + reach(&curve)));
    }
}

/// y = u (1 - u) type arch of height 0.75: touched, crossed twice, missed.
#[test]
fn an_arch_is_crossed_twice_touched_once_or_missed() {
    let control = [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (3.0, 0.0)];
    let arch =
        Curve2::with_uniform_knots(control.map(|(x, y)| Point2::new(x, y)).to_vec()).unwrap();
    assert_eq!(arch.intersect_line(0.0, 1.0, -0.5).len(), 2);
    assert_eq!(arch.intersect_line(0.0, 1.0, -0.75), [0.5]);
    assert_eq!(arch.intersect_line(0.0, 1.0, -0.8), []);
    assert_eq!(arch.line_extrema(0.0, 1.0, -0.8), [0.5]);
    assert_eq!(arch.intersect_line(0.0, 1.0, 0.0), [0.0, 1.0]);
    assert_eq!(arch.intersect_line(0.0, 0.0, 1.0), []);
    assert_eq!(arch.intersect_line(f64::NAN, 1.0, 0.0), []);
    assert_eq!(arch.line_extrema(f64::INFINITY, 1.0, 0.0), []);
}
