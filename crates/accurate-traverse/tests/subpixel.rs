//! Middles and ends of bodies between the pixels, and masks that are none of one body.
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate_geom::{Pixel, View1};
use accurate_traverse::{
    CentrelineParams, GraphParams, SkeletonGraph, TraverseError, extend_to_body_ends, recentre,
    smooth_centreline,
};
use ndarray::Array2;
use proptest::prelude::*;

/// Distance of each pixel of a straight bar to its outside, 0 outside: the pixels whose centres lie within
/// `half` of the segment from `a` to `b`.
fn radii(a: [f64; 2], b: [f64; 2], half: f64) -> Array2<f64> {
    let inside = |x: f64, y: f64| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let t = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy);
        let t = t.clamp(0.0, 1.0);
        (x - a[0] - t * dx).hypot(y - a[1] - t * dy) <= half
    };
    let mask = Array2::from_shape_fn((90, 90), |(y, x)| inside(x as f64, y as f64));
    Array2::from_shape_fn((90, 90), |(y, x)| {
        if !mask[[y, x]] {
            return 0.0;
        }
        let around = 9_usize;
        let mut nearest = f64::INFINITY;
        for r in y.saturating_sub(around)..(y + around + 1).min(90) {
            for c in x.saturating_sub(around)..(x + around + 1).min(90) {
                if !mask[[r, c]] {
                    nearest = nearest.min((r as f64 - y as f64).hypot(c as f64 - x as f64));
                }
            }
        }
        nearest
    })
}

fn ends(angle: f64) -> ([f64; 2], [f64; 2]) {
    let (s, c) = angle.sin_cos();
    ([44.3 - 30.0 * c, 44.8 - 30.0 * s], [44.3 + 30.0 * c, 44.8 + 30.0 * s])
}

fn along(a: [f64; 2], b: [f64; 2], t: f64) -> [f64; 2] {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

/// Bars of every slope, width and distance of the line from their middle, one after the other: the pixels
/// of a single one show its axis to half a pixel only (along the grid, and in long waves beside the
/// diagonal), those of all of them better.
#[test]
fn a_line_beside_the_middle_of_a_bar_comes_to_its_middle() {
    let (mut before, mut after, mut bars) = (0.0, 0.0, 0.0);
    for k in 0..40 {
        let angle = 0.078 * f64::from(k);
        let (a, b) = ends(angle);
        let (s, c) = angle.sin_cos();
        for half in [2.0, 2.7, 3.4, 4.0] {
            let radii = radii(a, b, half);
            for aside in [-0.9, -0.4, 0.0, 0.3, 0.8] {
                let line: Vec<Pixel<View1>> = (0..51)
                    .map(|k| along(a, b, 0.1 + 0.8 * f64::from(k) / 50.0))
                    .map(|[x, y]| Pixel::new(x - aside * s, y + aside * c))
                    .collect();
                let middle = recentre(&line, &radii, 2.0 * half).unwrap();
                assert_eq!(middle.len(), line.len());
                let off = |p: &Pixel<View1>| ((p.y - a[1]) * c - (p.x - a[0]) * s).abs();
                for (from, to) in line.iter().zip(&middle) {
                    assert!(from.distance(*to) <= 2.0 + 1e-9);
                    assert!(off(to) <= 0.5, "{} from {aside} at {angle}, {half}", off(to));
                }
                let mean = |line: &[Pixel<View1>]| line.iter().map(off).sum::<f64>() / 51.0;
                (before, after) = (before + mean(&line), after + mean(&middle));
                bars += 1.0;
            }
        }
    }
    let (before, after) = (before / bars, after / bars);
    assert!(before > 0.4 && after < 0.25, "{before} {after}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_line_that_stops_short_is_drawn_out_to_where_the_body_ends(
        angle in 0.0..3.1f64, half in 1.5..4.0f64, short_px in 2.0..9.0f64,
    ) {
        let (a, b) = ends(angle);
        let radii = radii(a, b, half);
        let cut = short_px / 60.0;
        let line: Vec<Pixel<View1>> = (0..51)
            .map(|k| along(a, b, cut + (1.0 - 2.0 * cut) * f64::from(k) / 50.0))
            .map(|[x, y]| Pixel::new(x, y))
            .collect();
        let whole = extend_to_body_ends(&line, &radii, 2.0 * half).unwrap();
        for (tip, end) in [(whole[0], a), (whole[whole.len() - 1], b)] {
            // The cap is known to a pixel, and the free length is walked in steps of half of one.
            let off = tip.distance(Pixel::new(end[0], end[1]));
            prop_assert!(off < 1.5, "{off} after {short_px}");
        }
        prop_assert!(whole.windows(2).all(|w| w[0].distance(w[1]) <= 60.0 / 50.0 + 1e-9));
        // What reaches the end already stays.
        let again = extend_to_body_ends(&whole, &radii, 2.0 * half).unwrap();
        prop_assert!(again[0].distance(whole[0]) < 1.0);
    }
}

/// A slowly turning line that zigzags by half a pixel, in steps of exactly 1 px: no smooth curve is nearer
/// to it than noise of the default would be.
fn zigzags() -> impl Strategy<Value = Vec<Pixel<View1>>> {
    let turns = prop::collection::vec(-0.1..0.1f64, 20..60);
    (turns, 0.0..6.2f64, 1.1..1.3f64).prop_map(|(turns, mut heading, half_angle)| {
        let (mut at, mut side) = (Pixel::new(300.0, 200.0), half_angle);
        let mut step = |turn: &f64| {
            (heading, side) = (heading + turn, -side);
            at = Pixel::new(at.x + (heading + side).cos(), at.y + (heading + side).sin());
            at
        };
        turns.iter().map(&mut step).collect()
    })
}

/// Two points per step of 1 px; a little more, lest rounding add one.
const HALVES: CentrelineParams =
    CentrelineParams { spacing_px: 0.5 * (1.0 + 1e-9), ..CentrelineParams::DEFAULT };

fn smoothed(points: &[Pixel<View1>]) -> Vec<Pixel<View1>> {
    smooth_centreline(points, &HALVES).unwrap()
}

proptest! {
    #[test]
    fn a_centreline_is_as_far_from_its_points_as_noise_would_be_in_either_direction_and_turned(
        points in zigzags(), twice in prop::collection::vec(1..3usize, 60),
    ) {
        let (n, line) = (points.len(), smoothed(&points));
        prop_assert_eq!(line.len(), 2 * n - 1);
        let sum: f64 = (0..n).map(|k| line[2 * k].distance(points[k]).powi(2)).sum();
        // Of two coordinates each; the fit is asked for a relative 1e-6.
        let expected = 2.0 * n as f64 * CentrelineParams::DEFAULT.sigma_px.powi(2);
        prop_assert!((sum / expected - 1.0).abs() < 2e-6, "{sum} {expected}");
        // Of all curves as smooth, each is the nearest to the points. Two of them whose sums of squares
        // differ by d are then at most the root of d apart.
        let slack = (2e-6 * expected).sqrt();
        let moved = |p: &Pixel<View1>| Pixel::new(50.0 - p.y, 20.0 + p.x);
        let turned = smoothed(&points.iter().map(moved).collect::<Vec<_>>());
        let backwards = smoothed(&points.iter().rev().copied().collect::<Vec<_>>());
        prop_assert_eq!((turned.len(), backwards.len()), (line.len(), line.len()));
        for k in (0..line.len()).step_by(2) {
            prop_assert!(turned[k].distance(moved(&line[k])) <= slack);
            prop_assert!(backwards[line.len() - 1 - k].distance(line[k]) <= slack);
        }
        let doubled: Vec<_> = points.iter().zip(&twice).flat_map(|(p, n)| vec![*p; *n]).collect();
        prop_assert_eq!(smoothed(&doubled), line);
    }
}

#[test]
fn fewer_than_four_different_points_are_their_own_centreline() {
    let at = |x: f64| Pixel::<View1>::new(x, 2.0 * x);
    for different in
        [vec![], vec![at(1.0)], vec![at(1.0), at(2.0)], vec![at(1.0), at(2.0), at(1.0)]]
    {
        let twice: Vec<_> = different.iter().flat_map(|p| [*p, *p]).collect();
        assert_eq!(smoothed(&twice), different);
    }
}

#[test]
fn bad_thicknesses_are_refused() {
    let none = Array2::zeros((5, 5));
    for thickness in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = recentre::<View1>(&[], &none, thickness).unwrap_err();
        assert!(matches!(refused, TraverseError::InvalidParameter { .. }), "{refused}");
        let refused = extend_to_body_ends::<View1>(&[], &none, thickness).unwrap_err();
        assert!(matches!(refused, TraverseError::InvalidParameter { .. }), "{refused}");
    }
}

#[test]
fn a_mask_of_hundreds_of_strokes_is_no_body() {
    let strokes = |count: usize| {
        Array2::from_shape_fn((400, 400), |(y, x)| {
            y % 10 == 5 && x % 20 >= 3 && x % 20 < 17 && (y / 10) * 20 + x / 20 < count
        })
    };
    let graph = |count: usize| {
        let skeleton = strokes(count);
        let radii = skeleton.mapv(|set| if set { 1.0 } else { 0.0 });
        SkeletonGraph::<View1>::new(&skeleton, &radii, 1.0, &GraphParams::DEFAULT)
    };
    assert!(graph(100).is_ok());
    let refused = graph(300).unwrap_err();
    assert_eq!(refused, TraverseError::Tangled { view: 1, strands: 300, limit: 256 });
}
