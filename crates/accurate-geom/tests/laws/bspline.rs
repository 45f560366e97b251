use accurate_geom::nalgebra::{Point, SVector};
use accurate_geom::{BSpline, Curve2, Curve3, GeomError, Point2};
use proptest::prelude::*;

use crate::generators::wandering;

/// Curves with uneven, sometimes repeated interior knots.
pub fn curves<const D: usize>(count: std::ops::Range<usize>) -> impl Strategy<Value = BSpline<D>> {
    let count = count.start.max(4) - 1..count.end - 1;
    (wandering::<D>(count), proptest::collection::vec(0.1..2.0f64, 64), any::<bool>()).prop_map(
        |(control, steps, repeat)| {
            let interior = control.len() - 4;
            let mut knots = vec![1.0; 4];
            let mut knot = 1.0;
            for (index, step) in steps[..interior].iter().enumerate() {
                let repeated = repeat && index % 5 == 3;
                knot += if repeated { 0.0 } else { *step };
                knots.push(knot);
            }
            knots.extend([knot + steps[interior]; 4]);
            BSpline::new(knots, control).unwrap()
        },
    )
}

fn at_share<const D: usize>(curve: &BSpline<D>, share: f64) -> f64 {
    let (start, end) = curve.domain();
    start + share * (end - start)
}

/// Largest control coordinate.
pub fn reach<const D: usize>(curve: &BSpline<D>) -> f64 {
    curve.control_points().iter().map(|p| p.coords.amax()).fold(0.0, f64::max)
}

fn largest_third<const D: usize>(curve: &BSpline<D>) -> f64 {
    curve.breakpoints().iter().map(|t| curve.third_derivative(*t).norm()).fold(0.0, f64::max)
}

proptest! {
    #[test]
    fn basis_functions_are_not_negative_and_sum_to_one(
        curve in curves::<2>(4..30), share in -0.1..1.1f64,
    ) {
        let basis = curve.basis(at_share(&curve, share));
        prop_assert!(basis.values.iter().all(|v| *v >= 0.0));
        prop_assert!((basis.values.iter().sum::<f64>() - 1.0).abs() <= 8.0 * f64::EPSILON);
        prop_assert!(basis.first + 4 <= curve.control_points().len());
        let (_, rows) = curve.basis_derivatives(at_share(&curve, share));
        for row in &rows[1..] {
            let size: f64 = row.iter().map(|v| v.abs()).sum();
            prop_assert!(row.iter().sum::<f64>().abs() <= 8.0 * f64::EPSILON * size);
        }
    }

    #[test]
    fn derivatives_are_those_of_finite_differences(
        control in wandering::<3>(3..20), share in 0.01..0.99f64,
    ) {
        // Simple knots: the second derivative is continuous, the third jumps at knots.
        let curve = Curve3::with_uniform_knots(control).unwrap();
        let t = at_share(&curve, share);
        let h = 1e-5;
        let third = largest_third(&curve);
        let rounding = 16.0 * f64::EPSILON * reach(&curve) / h;
        let central = |f: &dyn Fn(f64) -> SVector<f64, 3>| (f(t + h) - f(t - h)) / (2.0 * h);
        let first = central(&|t| curve.at(t).coords);
        prop_assert!((first - curve.derivative(t)).norm() <= third * h * h + rounding);
        let second = central(&|t| curve.derivative(t));
        // Derivatives of order k round like the curve over the k-th power of the knot distance.
        let spans = curve.control_points().len() as f64;
        prop_assert!((second - curve.second_derivative(t)).norm()
            <= 2.0 * third * h + 16.0 * spans * rounding);
        let left = curve.breakpoints().into_iter().rfind(|b| *b <= t).unwrap();
        let right = curve.breakpoints().into_iter().find(|b| *b > t).unwrap();
        let rise = curve.second_derivative(right) - curve.second_derivative(left);
        let constant = rise / (right - left);
        prop_assert!((constant - curve.third_derivative(t)).norm()
            <= 1e-11 * (third + spans.powi(3) * reach(&curve)));
    }

    #[test]
    fn a_jet_is_the_point_and_its_derivatives(curve in curves::<3>(4..20), share in 0.0..1.0f64) {
        let t = at_share(&curve, share);
        let jet = curve.jet(t);
        prop_assert_eq!(jet.point, curve.at(t));
        prop_assert_eq!(jet.first, curve.derivative(t));
        prop_assert_eq!(jet.second, curve.second_derivative(t));
        prop_assert_eq!(jet.third, curve.third_derivative(t));
    }

    #[test]
    fn a_curve_runs_from_its_first_to_its_last_control_point_inside_their_box(
        curve in curves::<2>(4..30), share in 0.0..1.0f64,
    ) {
        let (start, end) = curve.domain();
        let control = curve.control_points();
        prop_assert_eq!(curve.at(start), control[0]);
        prop_assert!((curve.at(end) - control[control.len() - 1]).norm()
            <= 4.0 * f64::EPSILON * reach(&curve));
        let p = curve.at(at_share(&curve, share));
        for axis in 0..2 {
            let low = control.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
            let high = control.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
            let slack = 8.0 * f64::EPSILON * reach(&curve);
            prop_assert!(p[axis] >= low - slack && p[axis] <= high + slack);
        }
    }

    #[test]
    fn the_reversed_curve_is_the_same_run_backwards(
        curve in curves::<2>(4..30), share in 0.0..1.0f64,
    ) {
        let back = curve.reversed();
        let (start, end) = curve.domain();
        prop_assert_eq!(back.domain(), (start, end));
        let t = at_share(&curve, share);
        let speed = curve.breakpoints().iter().map(|b| curve.derivative(*b).norm()).sum::<f64>();
        let tolerance = 64.0 * f64::EPSILON * (reach(&curve) + speed * end);
        prop_assert!((back.at(end - (t - start)) - curve.at(t)).norm() <= tolerance);
    }

    #[test]
    fn arc_length_is_the_limit_of_chords(curve in curves::<3>(4..12)) {
        let (start, end) = curve.domain();
        let count = 4000;
        let chords: f64 = (0..count)
            .map(|i| {
                let t = |i: usize| start + (end - start) * i as f64 / count as f64;
                (curve.at(t(i + 1)) - curve.at(t(i))).norm()
            })
            .sum();
        let length = curve.arc_length();
        prop_assert!(chords <= length * (1.0 + 1e-11), "{chords} {length}");
        // Chords fall short by about (step² / 24) ∫ curvature² ds; near cusps by a step at most.
        prop_assert!(chords >= length * (1.0 - 1e-3), "{chords} {length}");
    }

    #[test]
    fn uniform_parameters_cut_equal_lengths(curve in curves::<2>(4..12), count in 2..40usize) {
        let parameters = curve.uniform_parameters(count);
        prop_assert_eq!(parameters.len(), count);
        prop_assert_eq!((parameters[0], parameters[count - 1]), curve.domain());
        let total = curve.arc_length();
        for pair in parameters.windows(2) {
            prop_assert!(pair[1] > pair[0]);
            let piece = curve.arc_length_between(pair[0], pair[1]);
            prop_assert!((piece - total / (count - 1) as f64).abs() <= 1e-9 * total);
        }
        prop_assert_eq!(curve.sample(count).len(), count);
    }
}

fn square() -> Vec<Point<f64, 2>> {
    [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Point2::new(x, y)).to_vec()
}

/// One span is a Bézier curve: its middle is (P0 + 3 P1 + 3 P2 + P3) / 8.
#[test]
fn four_control_points_make_a_bezier_curve() {
    let curve = Curve2::with_uniform_knots(square()).unwrap();
    assert_eq!(curve.at(0.5), Point2::new(0.75, 0.5));
    assert_eq!(curve.derivative(0.0), SVector::from([3.0, 0.0]));
    assert_eq!(curve.domain(), (0.0, 1.0));
    assert_eq!(curve.at(f64::NAN), curve.at(0.0));
}

#[test]
fn bad_knots_and_control_points_are_refused() {
    let new = |knots: &[f64], control: Vec<Point<f64, 2>>| Curve2::new(knots.to_vec(), control);
    let five = [square(), vec![Point2::new(0.0, 2.0)]].concat();
    let good = [0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 1.0];
    assert!(new(&good, five.clone()).is_ok());
    assert_eq!(
        new(&good, square()),
        Err(GeomError::LengthMismatch { what: "knots", expected: 8, found: 9 })
    );
    assert_eq!(
        new(&good[..7], square()[..3].to_vec()),
        Err(GeomError::TooFewPoints { found: 3, needed: 4 })
    );
    for (index, value) in [(0, -1.0), (3, 0.1), (4, 0.0), (4, 1.0), (4, 1.5), (8, 2.0)] {
        let mut bad = good;
        bad[index] = value;
        assert!(matches!(new(&bad, five.clone()), Err(GeomError::BadKnot { .. })), "{index}");
    }
    let mut bad = good;
    bad[4] = f64::NAN;
    assert!(matches!(new(&bad, five.clone()), Err(GeomError::NotFinite { .. })));
    let mut bad = five;
    bad[2].y = f64::INFINITY;
    assert!(matches!(new(&good, bad), Err(GeomError::NotFinite { .. })));
    assert!(matches!(
        Curve2::with_uniform_knots(vec![]),
        Err(GeomError::TooFewPoints { found: 0, needed: 4 })
    ));
}
