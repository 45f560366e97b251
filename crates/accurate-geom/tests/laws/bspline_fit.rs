use accurate_geom::nalgebra::Point;
use accurate_geom::{BSpline, Curve2, Curve3, GeomError, Point2};
use proptest::prelude::*;

use crate::bspline::reach;
use crate::generators::wandering;

fn chord_lengths<const D: usize>(points: &[Point<f64, D>]) -> Vec<f64> {
    let mut u = vec![0.0];
    for pair in points.windows(2) {
        u.push(u[u.len() - 1] + (pair[1] - pair[0]).norm());
    }
    u
}

fn residual<const D: usize>(curve: &BSpline<D>, points: &[Point<f64, D>], u: &[f64]) -> f64 {
    points.iter().zip(u).map(|(p, t)| (curve.at(*t) - p).norm_squared()).sum()
}

fn noise(count: usize, size: f64) -> impl Strategy<Value = Vec<(f64, f64)>> {
    proptest::collection::vec((-size..size, -size..size), count)
}

proptest! {
    #[test]
    fn interpolation_passes_through_every_point(points in wandering::<3>(3..80)) {
        let curve = Curve3::interpolate(&points).unwrap();
        let u = chord_lengths(&points);
        // Backward stable elimination: each equation holds to the rounding of its terms.
        let tolerance = 64.0 * f64::EPSILON * reach(&curve);
        for (p, t) in points.iter().zip(&u) {
            prop_assert!((curve.at(*t) - p).norm() <= tolerance);
        }
        // FITPACK's knots: all parameters but the second and the last but one.
        let n = points.len();
        prop_assert_eq!(&curve.knots()[4..n], &u[2..n - 2]);
    }

    #[test]
    fn interpolation_of_a_straight_line_is_that_line(
        steps in proptest::collection::vec(0.1..3.0f64, 3..50), turn in -3.1..3.1f64,
        share in 0.0..1.0f64,
    ) {
        let mut s = 0.0;
        let mut points = vec![Point2::origin()];
        for step in steps {
            s += step;
            points.push(Point2::new(s * turn.cos(), s * turn.sin()));
        }
        let curve = Curve2::interpolate(&points).unwrap();
        let t = share * s;
        let expected = Point2::new(t * turn.cos(), t * turn.sin());
        prop_assert!((curve.at(t) - expected).norm() <= 256.0 * f64::EPSILON * s);
    }

    #[test]
    fn least_squares_recovers_a_bezier_curve_from_its_points(
        control in wandering::<3>(3..4), count in 4..60usize,
    ) {
        let curve = Curve3::with_uniform_knots(control.clone()).unwrap();
        let u: Vec<f64> = (0..count).map(|i| i as f64 / (count - 1) as f64).collect();
        let points: Vec<_> = u.iter().map(|t| curve.at(*t)).collect();
        let found = Curve3::least_squares(&points, &u, 4).unwrap();
        for (a, b) in found.control_points().iter().zip(&control) {
            // Normal equations of four Bernstein functions: condition below 1e4.
            prop_assert!((a - b).norm() <= 1e5 * f64::EPSILON * reach(&curve));
        }
    }

    #[test]
    fn no_control_point_of_a_least_squares_fit_can_be_improved(
        points in wandering::<2>(20..60), count in 4..15usize, which in 0..15usize,
        (dx, dy) in (-0.01..0.01f64, -0.01..0.01f64),
    ) {
        let u = chord_lengths(&points);
        let curve = Curve2::least_squares(&points, &u, count).unwrap();
        let best = residual(&curve, &points, &u);
        let mut control = curve.control_points().to_vec();
        control[which % count] += accurate_geom::nalgebra::Vector2::new(dx, dy);
        let moved = Curve2::new(curve.knots().to_vec(), control).unwrap();
        prop_assert!(residual(&moved, &points, &u) >= best * (1.0 - 1e-12) - 1e-20);
    }

    #[test]
    fn smoothing_leaves_the_residual_that_the_noise_has(
        clean in wandering::<2>(20..120), shift in noise(121, 0.5), sigma in 0.05..0.5f64,
    ) {
        let points: Vec<_> = clean.iter().zip(&shift)
            .map(|(p, (dx, dy))| Point2::new(p.x + dx, p.y + dy)).collect();
        let u = chord_lengths(&points);
        let target = 2.0 * points.len() as f64 * sigma * sigma;
        let curve = Curve2::smoothing(&points, sigma).unwrap();
        let found = residual(&curve, &points, &u);
        prop_assert!(found <= target * (1.0 + 1e-5) || dense_knots(&curve, &points));
        if found < target * (1.0 - 1e-5) {
            // Only a parabola may be nearer to the data than asked for.
            let (start, end) = curve.domain();
            let bend = curve.second_derivative(end) - curve.second_derivative(start);
            prop_assert!(bend.norm() * (end - start).powi(2) <= 1e-3 * (1.0 + reach(&curve)));
        }
    }

    #[test]
    fn more_noise_allowed_never_bends_more(points in wandering::<2>(20..80), sigma in 0.02..0.2f64) {
        let bending = |curve: &Curve2| curve.breakpoints().windows(2)
            .map(|w| curve.third_derivative(w[0]).norm_squared() * (w[1] - w[0])).sum::<f64>();
        let (fine, coarse) = (
            Curve2::smoothing(&points, sigma).unwrap(), Curve2::smoothing(&points, 2.0 * sigma).unwrap(),
        );
        prop_assert!(coarse.knots().len() <= fine.knots().len());
        // Comparable only over the same knots.
        if coarse.knots() == fine.knots() {
            prop_assert!(bending(&coarse) <= bending(&fine) * (1.0 + 1e-4) + 1e-12);
        }
    }
}

fn dense_knots<const D: usize>(curve: &BSpline<D>, points: &[Point<f64, D>]) -> bool {
    curve.control_points().len() >= points.len()
}

/// A circle of radius 40 rounded to whole pixels: noise of standard deviation 1/√12 px.
#[test]
fn smoothing_rounded_pixels_comes_nearer_to_the_truth_than_the_pixels() {
    let points: Vec<Point2> = (0..200)
        .map(|i| {
            let turn = f64::from(i) * 0.025;
            Point2::new((100.0 + 40.0 * turn.cos()).round(), (100.0 + 40.0 * turn.sin()).round())
        })
        .collect();
    let mut points = points;
    points.dedup();
    let curve = Curve2::smoothing(&points, 1.0 / 12f64.sqrt()).unwrap();
    let off = |p: &Point2| ((p.x - 100.0).hypot(p.y - 100.0) - 40.0).abs();
    let rms = |points: &[Point2]| {
        (points.iter().map(|p| off(p).powi(2)).sum::<f64>() / points.len() as f64).sqrt()
    };
    let (before, after) = (rms(&points), rms(&curve.sample(500)));
    assert!(after < 0.5 * before, "{before} {after}");
}

/// A bridged gap leaves many knot spans without data: the penalty must carry the curve across.
#[test]
fn smoothing_crosses_a_gap_in_the_points() {
    let xs = (0..100).chain(220..300).map(f64::from);
    let points: Vec<_> =
        xs.map(|x| Point2::new(x, 5.0 * (x / 20.0).sin() + 0.2 * (7.0 * x).sin())).collect();
    let curve = Curve2::smoothing(&points, 0.15).unwrap();
    let found = residual(&curve, &points, &chord_lengths(&points));
    let target = 2.0 * points.len() as f64 * 0.15 * 0.15;
    assert!((found / target - 1.0).abs() < 1e-5);
}

#[test]
fn without_noise_smoothing_interpolates() {
    let points: Vec<_> =
        (0..20).map(|i| Point2::new(f64::from(i), (f64::from(i) / 3.0).sin())).collect();
    assert_eq!(Curve2::smoothing(&points, 0.0), Curve2::interpolate(&points));
}

#[test]
fn curves_that_cannot_be_fitted_are_refused() {
    let line: Vec<_> = (0..8).map(|i| Point2::new(f64::from(i), 0.0)).collect();
    let u = chord_lengths(&line);
    for few in [&line[..0], &line[..1], &line[..3]] {
        let expected = GeomError::TooFewPoints { found: few.len(), needed: 4 };
        assert_eq!(Curve2::interpolate(few), Err(expected.clone()));
        assert_eq!(Curve2::smoothing(few, 1.0), Err(expected));
    }
    let mut twice = line.clone();
    twice[3] = twice[2];
    assert_eq!(Curve2::interpolate(&twice), Err(GeomError::DuplicatePoint { index: 3 }));
    let still = vec![Point2::new(5.0, 5.0); 6];
    assert_eq!(Curve2::smoothing(&still, 1.0), Err(GeomError::DuplicatePoint { index: 1 }));
    let mut nan = line.clone();
    nan[5].x = f64::NAN;
    assert!(matches!(Curve2::interpolate(&nan), Err(GeomError::NotFinite { .. })));
    let huge: Vec<_> = (0..6).map(|i| Point2::new(1e308 * f64::from(i % 2), 0.0)).collect();
    assert!(matches!(Curve2::interpolate(&huge), Err(GeomError::NotFinite { .. })));
    for sigma in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(Curve2::smoothing(&line, sigma), Err(GeomError::OutOfRange { .. })));
    }
    assert!(matches!(
        Curve2::least_squares(&line, &u, 9),
        Err(GeomError::TooFewPoints { found: 8, needed: 9 })
    ));
    assert!(matches!(
        Curve2::least_squares(&line, &u, 3),
        Err(GeomError::TooFewPoints { found: 3, needed: 4 })
    ));
    assert!(matches!(
        Curve2::least_squares(&line, &u[1..], 4),
        Err(GeomError::LengthMismatch { expected: 8, found: 7, .. })
    ));
    let mut falling = u.clone();
    falling[4] = 0.0;
    assert!(matches!(Curve2::least_squares(&line, &falling, 4), Err(GeomError::OutOfRange { .. })));
    assert!(matches!(
        Curve2::least_squares(&line, &[1.0; 8], 4),
        Err(GeomError::OutOfRange { .. })
    ));
    // Two distinct parameters cannot hold four control points.
    let repeated = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
    assert!(matches!(
        Curve2::least_squares(&line, &repeated, 4),
        Err(GeomError::Underdetermined { .. })
    ));
}
