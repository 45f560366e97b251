//! Matching with free ends, end to end: known 3D curves through random rigs, and real pairs.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod scenes;

use std::path::{Path, PathBuf};

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, GeomError, ImageSize, LengthUnit, Pixel, Point3, Rig, View1, View2};
use accurate_io::{PairParts, find_pairs, read_pair};
use accurate_match::{
    CostModel, CurveMatcher, DistanceKind, Ecdp, FreeEnds, FreeMatch, FreeMatchParams, FreeMatcher,
    MatchError, MovePrices, PointFlag, TangencyParams, TieOrder, align, zero_crossings,
};
use proptest::prelude::*;
use scenes::{DISTANCE_TOLERANCE_PX, Helix, curves, rigs, view1, view2};

/// Slender helices along the axis: the epipolar angle rises all the way, no stretch is tangent.
fn rising() -> impl Strategy<Value = Helix> {
    (2.0..4.0, 25.0..40.0, 0.5..1.5, 0.0..6.2).prop_map(|(radius, pitch, turns, phase)| Helix {
        radius,
        pitch,
        turns,
        phase,
    })
}

fn points(helix: &Helix, n: usize) -> Vec<Point3> {
    Helix::parameters(n, 0.3).into_iter().map(|s| helix.at(s)).collect()
}

fn matched(
    c1: &[Pixel<View1>],
    c2: &[Pixel<View2>],
    rig: &Rig,
    params: &FreeMatchParams,
) -> FreeMatch {
    FreeMatcher::new(*params).match_best_direction(c1, c2, rig).unwrap()
}

/// No stretch is doubted: what is tested is the path.
const TRUSTING: FreeMatchParams = FreeMatchParams {
    tangency: TangencyParams { max_sine: 0.0, ..TangencyParams::DEFAULT },
    ..FreeMatchParams::DEFAULT
};

/// Whether shifting any part of the match by a sample costs more than leaving that sample out, so
/// that the cheapest path on exact data is the true one whatever else is cut.
fn samples_are_well_apart(rig: &Rig, c1: &[Pixel<View1>], c2: &[Pixel<View2>]) -> bool {
    let costs = CostModel::new(rig.fundamental(), c1, c2, DistanceKind::Sampson).unwrap();
    (1..c1.len()).all(|k| costs.cost(k, k - 1).min(costs.cost(k - 1, k)) > 1.0)
}

/// All lists agree in length and order.
fn check_consistent(found: &FreeMatch, n1: usize, n2: usize) -> Result<(), TestCaseError> {
    let count = found.points.len();
    prop_assert!(count > 0);
    prop_assert_eq!(
        (found.flags.len(), found.pairs.len(), found.positions.len()),
        (count, count, count)
    );
    prop_assert!(found.matched1.end <= n1 && found.matched2.end <= n2);
    prop_assert!(found.mean_cost_px.is_finite() && found.margin_px.is_none_or(|m| m >= 0.0));
    for ((i, j), (at1, at2)) in found.pairs.iter().zip(&found.positions) {
        prop_assert!(found.matched1.contains(i) && found.matched2.contains(j));
        prop_assert!(
            (at1 - *i as f64).abs() <= 0.5 + 1e-9 && (at2 - *j as f64).abs() <= 0.5 + 1e-9
        );
    }
    for pair in found.positions.windows(2) {
        let (step1, step2) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
        // Indices that went through n - 1 - at and back: rounding of numbers below 1000.
        let slack = 1e-9;
        let step2 = if found.reversed { -step2 } else { step2 };
        prop_assert!(step1 >= -slack && step2 >= -slack, "{step1} {step2}");
    }
    for point in &found.points {
        prop_assert!(point.position.coords.iter().all(|v| v.is_finite()));
        prop_assert!(point.epipolar_distance_px.is_finite());
    }
    Ok(())
}

proptest! {
    #[test]
    fn without_freedom_the_path_is_that_of_ecdp(rig in rigs(), c1 in curves::<View1>(2..=60), c2 in curves::<View2>(2..=60)) {
        let params = FreeMatchParams {
            distance: DistanceKind::View1,
            prices: MovePrices::ECDP,
            free1: FreeEnds::NONE,
            free2: FreeEnds::NONE,
            ..TRUSTING
        };
        let found = FreeMatcher::new(params).match_directed(&c1, &c2, false, &rig);
        let ecdp = Ecdp::default().align(&c1, &c2, &rig).unwrap();
        // Random curves may lie behind the cameras; then nothing can be triangulated.
        prop_assume!(found.is_ok());
        let found = found.unwrap();
        let mean = ecdp.total_cost / (c1.len() + c2.len()) as f64;
        prop_assert!((found.mean_cost_px - mean).abs() <= 1e-9 * mean.max(1.0));
        prop_assert_eq!((found.matched1, found.matched2), (0..c1.len(), 0..c2.len()));
        let costs = CostModel::new(rig.fundamental(), &c1, &c2, DistanceKind::View1).unwrap();
        let same = align(c1.len(), c2.len(), |i, j| costs.cost(i, j), TieOrder::DiagonalFirst).unwrap();
        prop_assert!((found.mean_epipolar_distance_px - same.mean_cost()).abs() <= 1e-9 * mean.max(1.0));
    }

    #[test]
    fn an_exact_curve_comes_back_in_either_direction(rig in rigs(), helix in rising(), n in 3..60_usize, backwards: bool) {
        let truth = points(&helix, n);
        let (c1, mut c2) = (view1(&rig, &truth), view2(&rig, &truth));
        prop_assume!(samples_are_well_apart(&rig, &c1, &c2));
        if backwards {
            c2.reverse();
        }
        let found = matched(&c1, &c2, &rig, &TRUSTING);
        check_consistent(&found, n, n)?;
        prop_assert_eq!(found.reversed, backwards);
        prop_assert_eq!(found.matched1.clone(), 0..n);
        prop_assert_eq!(found.matched2.clone(), 0..n);
        let expected: Vec<_> = (0..n).map(|k| (k, if backwards { n - 1 - k } else { k })).collect();
        prop_assert_eq!(&found.pairs, &expected);
        prop_assert!(found.mean_epipolar_distance_px <= DISTANCE_TOLERANCE_PX);
        prop_assert!(found.mean_cost_px <= 2.0 * DISTANCE_TOLERANCE_PX);
        prop_assert!(found.margin_px.unwrap() > 0.01);
    }

    /// The coarse look leads to the cheapest path: of views of one curve, in whole pixels, with ends cut.
    #[test]
    fn near_the_coarse_path_lies_the_cheapest(
        rig in rigs(), helix in rising(), n in 150..400_usize, begin1 in 0..30_usize, end2 in 0..30_usize
    ) {
        let truth = points(&helix, n);
        let whole = |p: f64| p.round();
        let c1: Vec<Pixel<View1>> =
            view1(&rig, &truth)[begin1..].iter().map(|p| Pixel::new(whole(p.x), whole(p.y))).collect();
        let c2: Vec<Pixel<View2>> =
            view2(&rig, &truth)[..n - end2].iter().map(|p| Pixel::new(whole(p.x), whole(p.y))).collect();
        let near = FreeMatchParams { near_coarse_path: true, ..TRUSTING };
        let [found, near] = [TRUSTING, near]
            .map(|params| FreeMatcher::new(params).match_directed(&c1, &c2, false, &rig));
        prop_assert_eq!(found, near);
    }

    #[test]
    fn cutting_a_view_leaves_the_other_pairs(
        rig in rigs(), helix in rising(), n in 12..60_usize, begin1 in 0..4_usize, end1 in 0..4_usize,
        begin2 in 0..4_usize, end2 in 0..4_usize
    ) {
        let truth = points(&helix, n);
        let (c1, c2) = (view1(&rig, &truth), view2(&rig, &truth));
        prop_assume!(samples_are_well_apart(&rig, &c1, &c2));
        // At each end one view sees more.
        let (begin2, end2) = (if begin1 > 0 { 0 } else { begin2 }, if end1 > 0 { 0 } else { end2 });
        let found = matched(&c1[begin1..n - end1], &c2[begin2..n - end2], &rig, &TRUSTING);
        prop_assert!(!found.reversed);
        let kept = begin1.max(begin2)..n - end1.max(end2);
        let expected: Vec<_> = kept.clone().map(|k| (k - begin1, k - begin2)).collect();
        prop_assert_eq!(&found.pairs, &expected);
        prop_assert_eq!(found.matched1, kept.start - begin1..kept.end - begin1);
        prop_assert_eq!(found.matched2, kept.start - begin2..kept.end - begin2);
    }

    #[test]
    fn a_stretch_that_one_view_lacks_is_a_gap(
        rig in rigs(), helix in rising(), n in 20..60_usize, from in 3..8_usize, lacking in 6..10_usize, in_view1: bool
    ) {
        let truth = points(&helix, n);
        let (mut c1, mut c2) = (view1(&rig, &truth), view2(&rig, &truth));
        prop_assume!(samples_are_well_apart(&rig, &c1, &c2));
        // Squeezing the stretch in must cost more than the gap: at least 3 px wide at 0.9 px a point.
        if in_view1 { c1.drain(from..from + lacking); } else { c2.drain(from..from + lacking); }
        let found = matched(&c1, &c2, &rig, &TRUSTING);
        check_consistent(&found, c1.len(), c2.len())?;
        let gap = from..from + lacking;
        let (gaps1, gaps2) = if in_view1 { (vec![], vec![gap]) } else { (vec![gap], vec![]) };
        prop_assert_eq!((found.gaps1, found.gaps2), (gaps1, gaps2));
        prop_assert_eq!(found.pairs.len(), n - lacking);
        prop_assert!(found.mean_epipolar_distance_px <= DISTANCE_TOLERANCE_PX);
    }

    #[test]
    fn reversing_curve_2_flips_the_direction_and_nothing_else(
        rig in rigs(), helix in scenes::helices(), n1 in 20..80_usize, n2 in 20..80_usize
    ) {
        let (c1, c2) = (view1(&rig, &points(&helix, n1)), view2(&rig, &points(&helix, n2)));
        let turned: Vec<_> = c2.iter().rev().copied().collect();
        let (a, b) = (matched(&c1, &c2, &rig, &FreeMatchParams::DEFAULT), matched(&c1, &turned, &rig, &FreeMatchParams::DEFAULT));
        check_consistent(&a, n1, n2)?;
        check_consistent(&b, n1, n2)?;
        prop_assert_eq!(a.margin_px, b.margin_px);
        prop_assume!(a.margin_px.unwrap() > 0.0);
        prop_assert_eq!(a.reversed, !b.reversed);
        prop_assert_eq!(&a.points, &b.points);
        prop_assert_eq!(&a.flags, &b.flags);
        let mirrored: Vec<_> = b.pairs.iter().map(|&(i, j)| (i, n2 - 1 - j)).collect();
        // A position half way between two points may round to either.
        for (a, b) in a.pairs.iter().zip(&mirrored) {
            prop_assert!(a.0 == b.0 && a.1.abs_diff(b.1) <= 1);
        }
        prop_assert_eq!(a.gaps2.len(), b.gaps2.len());
    }

    #[test]
    fn any_curves_give_a_consistent_match_or_a_named_refusal(
        rig in rigs(), c1 in curves::<View1>(1..=70), c2 in curves::<View2>(1..=70), sine in 0.0..1.1_f64
    ) {
        let tangency = TangencyParams { max_sine: sine, ..TangencyParams::DEFAULT };
        let params = FreeMatchParams { tangency, ..FreeMatchParams::DEFAULT };
        match FreeMatcher::new(params).match_best_direction(&c1, &c2, &rig) {
            Ok(found) => check_consistent(&found, c1.len(), c2.len())?,
            Err(error) => prop_assert!(matches!(error, MatchError::NothingTriangulated { .. }), "{}", error),
        }
    }

    #[test]
    fn crossings_lie_on_one_epipolar_plane(rig in rigs(), helix in scenes::helices(), n1 in 20..80_usize, n2 in 20..80_usize) {
        let (c1, c2) = (view1(&rig, &points(&helix, n1)), view2(&rig, &points(&helix, n2)));
        let found = matched(&c1, &c2, &rig, &TRUSTING);
        for (point, flag) in found.points.iter().zip(&found.flags) {
            prop_assert!(*flag != PointFlag::Bridged);
            if *flag == PointFlag::Exact {
                prop_assert!(point.epipolar_distance_px <= DISTANCE_TOLERANCE_PX);
            }
        }
    }

    /// Where the angle rises all the way, the epipolar line of almost every point crosses the other
    /// curve between two of its samples, here a few px apart at most.
    #[test]
    fn crossings_of_a_rising_curve_are_exact(
        rig in rigs(), helix in rising(), n1 in 150..400_usize, n2 in 150..400_usize
    ) {
        prop_assume!(n1 != n2);
        let (c1, c2) = (view1(&rig, &points(&helix, n1)), view2(&rig, &points(&helix, n2)));
        let found = matched(&c1, &c2, &rig, &TRUSTING);
        let exact = found.flags.iter().filter(|flag| **flag == PointFlag::Exact).count();
        prop_assert!(found.matched1.len() > n1 / 2);
        prop_assert!(10 * exact > 9 * found.flags.len(), "{exact} of {}", found.flags.len());
    }

    #[test]
    fn a_closed_curve_comes_back_wherever_it_is_cut(
        rig in rigs(), n in 12..60_usize, cut1 in 0..60_usize, cut2 in 0..60_usize, backwards: bool, tilt in 0.3..1.2_f64
    ) {
        // A tilted ring, not symmetric in the views.
        let at = |k: usize| {
            let (sin, cos) = (k as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
            Point3::new(15.0 * cos, 12.0 * sin, 20.0 * tilt * (cos + 0.4 * sin) + 3.0 * (2.0 * cos * sin))
        };
        let cut = |by: usize| (0..n).map(|k| at((k + by) % n)).collect::<Vec<_>>();
        let (c1, mut c2) = (view1(&rig, &cut(cut1)), view2(&rig, &cut(cut2)));
        if backwards {
            c2.reverse();
        }
        let directions = FreeMatcher::new(TRUSTING).match_closed(&c1, &c2, &rig).unwrap();
        let found = directions
            .into_iter()
            .min_by(|a, b| a.mean_cost_px.total_cmp(&b.mean_cost_px))
            .unwrap();
        prop_assert!(found.mean_cost_px <= 2.0 * DISTANCE_TOLERANCE_PX, "{}", found.mean_cost_px);
        prop_assert_eq!((found.matched1.clone(), found.matched2.clone()), (0..n, 0..n));
        for ((i, j), (at1, at2)) in found.pairs.iter().zip(&found.positions) {
            let apart = |at: f64, k: usize| {
                let apart = (at - k as f64).abs();
                apart.min(n as f64 - apart)
            };
            prop_assert!((0.0..n as f64).contains(at1) && apart(*at1, *i) <= 0.5 + 1e-9, "{} {}", at1, i);
            prop_assert!((0.0..n as f64).contains(at2) && apart(*at2, *j) <= 0.5 + 1e-9, "{} {}", at2, j);
        }
        // Both senses of a ring may explain exact samples only if every sample pair does.
        if found.margin_px.unwrap() > 1e-6 {
            prop_assert_eq!(found.reversed, backwards);
            for &(i, j) in &found.pairs {
                let j = if backwards { n - 1 - j } else { j };
                prop_assert_eq!((i + cut1) % n, (j + cut2) % n);
            }
            prop_assert!(found.pairs.len() >= n);
        }
    }
}

#[test]
fn a_stretch_along_the_epipolar_line_is_bridged_between_trusted_matches() {
    let rig = scenes::rig(1.2, 0.0, 1500.0, 1500.0);
    // Up, level (in epipolar planes of cameras at equal height), and up again.
    let at = |s: f64| {
        let height = 20.0 * (s - 0.5) - 3.0 * (2.0 * std::f64::consts::TAU * s).sin();
        Point3::new(12.0 * (3.0 * s).cos(), 12.0 * (3.0 * s).sin(), height)
    };
    let truth: Vec<_> = (0..400).map(|k| at(f64::from(k) / 399.0)).collect();
    let (c1, c2) = (view1(&rig, &truth), view2(&rig, &truth));
    let found = matched(&c1, &c2, &rig, &FreeMatchParams::DEFAULT);
    check_consistent(&found, 400, 400).unwrap();
    let bridged = found.flags.iter().filter(|f| **f == PointFlag::Bridged).count();
    assert!(bridged > 10 && bridged < found.flags.len() / 2, "{bridged}");
    // 12 units of radius at 200 from the camera: arc length is kept to a fraction of a unit.
    for (point, (at1, _)) in found.points.iter().zip(&found.positions) {
        let error = (point.position - at(at1 / 399.0)).norm();
        assert!(error < 0.2, "{error} at {at1}");
    }
    let trusted = matched(&c1, &c2, &rig, &TRUSTING);
    assert!(trusted.flags.iter().all(|f| *f != PointFlag::Bridged));
}

#[test]
fn free_lengths_are_kept() {
    let rig = scenes::rig(1.2, 20.0, 1500.0, 1500.0);
    let truth: Vec<_> =
        (0..50).map(|k| Point3::new(0.3 * f64::from(k), 2.0, f64::from(k) - 25.0)).collect();
    let (c1, c2) = (view1(&rig, &truth), view2(&rig, &truth[10..]));
    let free = |free1| {
        let params = FreeMatchParams { free1, free2: FreeEnds::NONE, ..TRUSTING };
        FreeMatcher::new(params).match_directed(&c1, &c2, false, &rig).unwrap().matched1
    };
    assert_eq!(free(FreeEnds { begin_px: f64::INFINITY, end_px: 0.0 }), 10..50);
    assert_eq!(free(FreeEnds { begin_px: 0.0, end_px: f64::INFINITY }).start, 0);
    let some: f64 = c1[..6].windows(2).map(|w| w[0].distance(w[1])).sum();
    assert_eq!(free(FreeEnds { begin_px: some + 1e-6, end_px: 0.0 }).start, 5);
}

/// View 2 goes on for 20 samples, of which 4 may be left out. The path leaves out those 4 and matches 16
/// with the last point of view 1; of these all but the few within the slack are left out as well.
/// A straight wire of which view 2 sees 20 px more at its end. Epipolar lines are rows; samples are 1 px apart
/// along the curves and 0.1 px across the lines.
fn a_longer_second_view() -> (Rig, Vec<Pixel<View1>>, Vec<Pixel<View2>>) {
    let k = Matrix3::new(1000.0, 0.0, 256.0, 0.0, 1000.0, 256.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 512, height: 512 };
    let camera =
        |x: f64| Camera::new(k, Matrix3::identity(), Vector3::new(x, 0.0, 0.0), size).unwrap();
    let rig = Rig::new(camera(0.0), camera(-10.0), LengthUnit::Unit).unwrap();
    let at = |k: u32| (0.99_f64.sqrt() * f64::from(k), 0.1 * f64::from(k));
    let c1 = (0..60).map(|k| Pixel::new(300.0 + at(k).0, 200.0 + at(k).1)).collect();
    let c2 = (0..80).map(|k| Pixel::new(200.0 + at(k).0, 200.0 + at(k).1)).collect();
    (rig, c1, c2)
}

#[test]
fn a_run_at_a_free_end_is_left_out_beyond_the_free_length() {
    let (rig, c1, c2) = a_longer_second_view();
    let params = FreeMatchParams {
        prices: MovePrices { end_skip: 0.06, ..TRUSTING.prices },
        free1: FreeEnds::NONE,
        free2: FreeEnds { begin_px: 0.0, end_px: 4.5 },
        ..TRUSTING
    };
    let matched2 = |end_run_px: f64| {
        let params = FreeMatchParams { end_run_px, ..params };
        let found = FreeMatcher::new(params).match_directed(&c1, &c2, false, &rig).unwrap();
        assert_eq!(found.matched1, 0..60);
        found.matched2
    };
    assert_eq!(matched2(f64::INFINITY), 0..76);
    // Each sample is 0.1 / √2 px farther from its line by Sampson's measure: four lie within 0.3 px.
    assert_eq!(matched2(0.3), 0..64);
    assert_eq!(matched2(0.0), 0..60);
}

#[test]
fn an_end_that_is_seen_is_kept_though_its_point_stands_twice_and_a_free_one_is_free_however_short()
{
    let (rig, c1, mut c2) = a_longer_second_view();
    c2.push(c2[79]);
    let matched2 = |end_px: f64| {
        let params = FreeMatchParams {
            prices: MovePrices { end_skip: 0.06, ..TRUSTING.prices },
            free1: FreeEnds::NONE,
            free2: FreeEnds { begin_px: 0.0, end_px },
            end_run_px: 0.3,
            ..TRUSTING
        };
        FreeMatcher::new(params).match_directed(&c1, &c2, false, &rig).unwrap().matched2
    };
    assert_eq!(matched2(0.0), 0..81);
    assert_eq!(matched2(0.9), 0..64);
}

#[test]
fn unusable_input_is_refused_by_name() {
    let rig = scenes::rig(1.2, 20.0, 1500.0, 1500.0);
    let (c1, c2) = ([Pixel::new(500.0, 500.0)], [Pixel::new(500.0, 500.0)]);
    let run = |c1: &[Pixel<View1>], params: FreeMatchParams| {
        FreeMatcher::new(params).reconstruct(c1, &c2, &rig)
    };
    assert!(run(&c1, FreeMatchParams::DEFAULT).is_ok());
    assert_eq!(run(&[], FreeMatchParams::DEFAULT).unwrap_err(), MatchError::Empty { view: 1 });
    let nan = [Pixel::new(0.0, f64::NAN)];
    let refused = run(&nan, FreeMatchParams::DEFAULT).unwrap_err();
    assert!(matches!(refused, MatchError::NotFinite { view: 1, index: 0, .. }));
    let default = FreeMatchParams::DEFAULT;
    for params in [
        FreeMatchParams { free1: FreeEnds { begin_px: -1.0, end_px: 0.0 }, ..default },
        FreeMatchParams { free2: FreeEnds { begin_px: 0.0, end_px: f64::NAN }, ..default },
        FreeMatchParams { prices: MovePrices { step: f64::NAN, ..default.prices }, ..default },
        FreeMatchParams { end_run_px: -1.0, ..default },
        FreeMatchParams {
            tangency: TangencyParams { max_sine: f64::NAN, window_px: 1.0 },
            ..default
        },
    ] {
        let refused = run(&c1, params).unwrap_err();
        assert!(matches!(refused, MatchError::Geometry(GeomError::OutOfRange { .. })), "{refused}");
    }
    let closed = FreeMatcher::default().match_closed(&[], &c2, &rig).unwrap_err();
    assert_eq!(closed, MatchError::Empty { view: 1 });
}

#[test]
fn coordinates_of_any_size_give_finite_numbers_or_an_error() {
    let rig = scenes::rig(1.2, 20.0, 1500.0, 1500.0);
    for size in [0.0, 1e-300, 1e6, 1e100, 1e160, 1e300, f64::MAX] {
        let c1: Vec<_> = (0..9)
            .map(|k| Pixel::new(size * f64::from(k % 3) / 2.0, -size * f64::from(k) / 9.0))
            .collect();
        let c2: Vec<_> = c1.iter().map(|p: &Pixel<View1>| Pixel::new(-p.y, p.x)).collect();
        let matcher = FreeMatcher::default();
        let open = matcher.match_best_direction(&c1, &c2, &rig).ok();
        let closed = matcher.match_closed(&c1, &c2, &rig).unwrap_or_default();
        for found in open.into_iter().chain(closed) {
            assert!(found.points.iter().all(|p| p.position.coords.iter().all(|v| v.is_finite())));
            assert!(found.positions.iter().all(|(a, b)| a.is_finite() && b.is_finite()));
            assert_eq!(found.points.len(), found.flags.len());
        }
    }
}

#[test]
fn crossings_of_no_path_are_none() {
    let rig = scenes::rig(1.2, 20.0, 1500.0, 1500.0);
    let (c1, c2) = ([Pixel::new(500.0, 500.0)], [Pixel::new(500.0, 500.0)]);
    let costs = CostModel::new(rig.fundamental(), &c1, &c2, DistanceKind::Sampson).unwrap();
    assert_eq!(zero_crossings(&[], &costs), []);
    assert_eq!(zero_crossings(&[(7, 7)], &costs), []);
}

/// `ACCURATE_DATA`, else `shared/data` beside the workspace.
fn data() -> PathBuf {
    std::env::var_os("ACCURATE_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    )
}

#[test]
fn real_wires_match_where_both_cameras_see_them() {
    let set = data().join("guide3d/pairs");
    if !set.is_dir() {
        println!("skipped: no guide3d data");
        return;
    }
    let mut good = 0;
    for case in find_pairs(&set).unwrap() {
        let pair = read_pair(&case, PairParts { points: true, ..PairParts::default() }).unwrap();
        let (c1, c2) = pair.points.unwrap();
        let found = matched(&c1, &c2, &pair.rig, &FreeMatchParams::DEFAULT);
        check_consistent(&found, c1.len(), c2.len()).unwrap();
        let turned = matched(
            &c1,
            &c2.iter().rev().copied().collect::<Vec<_>>(),
            &pair.rig,
            &FreeMatchParams::DEFAULT,
        );
        assert_ne!(found.reversed, turned.reversed);
        // One camera sees at least 200 px more of every wire; forced on the other they are 4 px off.
        let left_out = c1.len() - found.matched1.len() + c2.len() - found.matched2.len();
        assert!(left_out > 200, "{}: {left_out}", pair.case_id);
        good +=
            usize::from(found.mean_epipolar_distance_px <= 0.5 && found.margin_px.unwrap() > 0.1);
    }
    assert!(good >= 11, "{good} of 12");
}
