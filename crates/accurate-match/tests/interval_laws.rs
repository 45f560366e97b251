//! Laws of the interval alignment and of the ranking of pairs.
#![allow(clippy::unwrap_used, clippy::panic)]

mod scenes;

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{
    Camera, EpipolarAngle, GeomError, ImageSize, LengthUnit, Pixel, Rig, View, View1, View2,
};
use accurate_match::{
    AngleProfile, AngleSignal, FreeEnds, IntervalPrices, MatchError, MovePrices, OpenEnds,
    Proposal, ProposeParams, SignalCurve, align_free, interval_energy, propose_pairs,
};
use proptest::prelude::*;
use scenes::{curves, rigs};

/// Samples `(low, high, gradient)`: some px of angle at 1/1200 radian per px.
fn samples(widths: f64) -> impl Strategy<Value = Vec<(f64, f64, f64)>> {
    let sample = (-0.01..0.01_f64, 0.0..=widths, 0.0005..0.002_f64)
        .prop_map(|(low, width, gradient)| (low, low + width, gradient));
    prop::collection::vec(sample, 1..=5)
}

fn free_ends() -> impl Strategy<Value = FreeEnds> {
    let free = prop_oneof![Just(0.0), 0.0..12.0_f64, Just(f64::INFINITY)];
    (free.clone(), free).prop_map(|(begin_px, end_px)| FreeEnds { begin_px, end_px })
}

const STEP_PX: f64 = 3.0;

/// `D` as documented.
fn distance(a: (f64, f64, f64), b: (f64, f64, f64), prices: &IntervalPrices) -> f64 {
    let gap = (a.0 - b.1).max(b.0 - a.1).max(0.0);
    (2.0_f64.sqrt() * gap / a.2.hypot(b.2) - prices.tolerance_px).clamp(0.0, prices.cap_px)
}

/// Cost of the best path, by visiting every one.
fn brute_force(
    a: &[(f64, f64, f64)],
    free1: FreeEnds,
    b: &[(f64, f64, f64)],
    free2: FreeEnds,
    prices: &IntervalPrices,
) -> f64 {
    let d = |i: usize, j: usize| distance(a[i], b[j], prices);
    let (n1, n2) = (a.len(), b.len());
    let allowed = |n: usize, free: f64| n as f64 * STEP_PX <= free;
    fn least(
        (i, j): (usize, usize),
        sum: f64,
        (n1, n2): (usize, usize),
        d: &impl Fn(usize, usize) -> f64,
        step_px: f64,
        end: &impl Fn(usize, usize) -> f64,
    ) -> f64 {
        let mut best = sum + end(i, j);
        for (di, dj) in [(1, 0), (0, 1), (1, 1)] {
            let (i, j) = (i + di, j + dj);
            if i < n1 && j < n2 {
                let price = if di + dj == 2 { 2.0 * d(i, j) } else { d(i, j) + step_px };
                best = best.min(least((i, j), sum + price, (n1, n2), d, step_px, end));
            }
        }
        best
    }
    let end = |i: usize, j: usize| {
        let (out1, out2) = (n1 - 1 - i, n2 - 1 - j);
        let fine =
            out1.min(out2) == 0 && allowed(out1, free1.end_px) && allowed(out2, free2.end_px);
        if fine { (out1 + out2) as f64 * prices.trim_px } else { f64::INFINITY }
    };
    let mut best = f64::INFINITY;
    for i in 0..n1 {
        for j in 0..n2 {
            if i.min(j) == 0 && allowed(i, free1.begin_px) && allowed(j, free2.begin_px) {
                let start = (i + j) as f64 * prices.trim_px + 2.0 * d(i, j);
                best = best.min(least((i, j), start, (n1, n2), &d, prices.step_px, &end));
            }
        }
    }
    best
}

/// What ends that differ cost, as documented, from the angles of the end points themselves; `None`
/// if both differ by more than the limit.
fn end_penalty(
    angles: &EpipolarAngle,
    c1: &SignalCurve<'_, View1>,
    c2: &SignalCurve<'_, View2>,
    reversed: bool,
    params: &ProposeParams,
) -> Option<f64> {
    let view1 = |p: Option<&Pixel<View1>>| angles.view1(*p.unwrap()).unwrap();
    let view2 = |p: Option<&Pixel<View2>>| angles.view2(*p.unwrap()).unwrap();
    let (begin1, end1) = (view1(c1.points.first()), view1(c1.points.last()));
    let (mut begin2, mut end2) = (view2(c2.points.first()), view2(c2.points.last()));
    let mut free2 = c2.free;
    if reversed {
        (begin2, end2) = (end2, begin2);
        free2 = free2.reversed();
    }
    let mut differences = Vec::new();
    for (a, b, free) in [
        (begin1, begin2, c1.free.begin_px.max(free2.begin_px)),
        (end1, end2, c1.free.end_px.max(free2.end_px)),
    ] {
        if free == 0.0 {
            let turn = std::f64::consts::TAU;
            let apart = (a.phi - b.phi).abs();
            let apart = apart.min(turn - apart);
            differences.push(2.0_f64.sqrt() * apart / a.gradient_per_px.hypot(b.gradient_per_px));
        }
    }
    if differences.iter().filter(|px| **px > params.end_limit_px).count() == 2 {
        return None;
    }
    let sum: f64 = differences.iter().map(|px| px.min(params.end_limit_px)).sum();
    Some(params.end_weight * (sum - params.end_tolerance_px).max(0.0))
}

/// Rounding of angles to f32 (0.01 · 2⁻²⁴ radians at 1/0.0005 px per radian), and ten f32 operations
/// on costs up to 10 cells of 2 · 60 px.
const TOLERANCE: f64 = (0.04 * 2000.0 * 20.0 + 10.0 * 1200.0) * 6e-8;

proptest! {
    #[test]
    fn the_energy_is_that_of_the_best_of_all_paths(
        a in samples(0.004), b in samples(0.004), free1 in free_ends(), free2 in free_ends()
    ) {
        let prices = IntervalPrices::DEFAULT;
        let (s1, s2) = (AngleSignal::from_samples(STEP_PX, &a).unwrap(), AngleSignal::from_samples(STEP_PX, &b).unwrap());
        let found = interval_energy(&s1, free1, &s2, free2, false, &prices).unwrap();
        let expected = brute_force(&a, free1, &b, free2, &prices) * STEP_PX / 2.0;
        prop_assert!((found - expected).abs() <= TOLERANCE * STEP_PX, "{found} {expected}");
    }

    #[test]
    fn without_width_tolerance_and_cap_it_is_the_plain_alignment(a in samples(0.0), b in samples(0.0)) {
        let prices = IntervalPrices { tolerance_px: 0.0, cap_px: f64::INFINITY, step_px: 0.02, trim_px: 0.0 };
        let (s1, s2) = (AngleSignal::from_samples(STEP_PX, &a).unwrap(), AngleSignal::from_samples(STEP_PX, &b).unwrap());
        let found = interval_energy(&s1, FreeEnds::NONE, &s2, FreeEnds::NONE, false, &prices).unwrap();
        let fill = |i: usize, row: &mut [f64]| {
            row.iter_mut().zip(&b).for_each(|(cell, b)| *cell = distance(a[i], *b, &prices));
        };
        let plain = MovePrices { diagonal_weight: 2.0, step: 0.02, ..MovePrices::ECDP };
        let plain = align_free(a.len(), b.len(), fill, &plain, &OpenEnds::NONE).unwrap();
        prop_assert!((found - plain.total_cost * STEP_PX / 2.0).abs() <= TOLERANCE * STEP_PX);
    }

    #[test]
    fn the_views_may_be_exchanged(
        a in samples(0.004), b in samples(0.004), free1 in free_ends(), free2 in free_ends()
    ) {
        let (s1, s2) = (AngleSignal::from_samples(STEP_PX, &a).unwrap(), AngleSignal::from_samples(STEP_PX, &b).unwrap());
        let prices = IntervalPrices::DEFAULT;
        let there = interval_energy(&s1, free1, &s2, free2, false, &prices).unwrap();
        let back = interval_energy(&s2, free2, &s1, free1, false, &prices).unwrap();
        prop_assert_eq!(there, back);
    }

    #[test]
    fn reading_backwards_is_the_same_as_a_reversed_curve(
        a in samples(0.004), b in samples(0.004), free1 in free_ends(), free2 in free_ends()
    ) {
        let (s1, s2) = (AngleSignal::from_samples(STEP_PX, &a).unwrap(), AngleSignal::from_samples(STEP_PX, &b).unwrap());
        let turned: Vec<_> = b.iter().rev().copied().collect();
        let turned = AngleSignal::from_samples(STEP_PX, &turned).unwrap();
        let prices = IntervalPrices::DEFAULT;
        let read = interval_energy(&s1, free1, &s2, free2, true, &prices).unwrap();
        // The middle sample, which settles whole turns, differs; there are none here.
        let given = interval_energy(&s1, free1, &turned, free2.reversed(), false, &prices).unwrap();
        prop_assert_eq!(read, given);
    }

    #[test]
    fn wider_intervals_freer_ends_and_whole_turns_never_cost_more(
        a in samples(0.004), b in samples(0.004), free1 in free_ends(), free2 in free_ends(), more in 0.0..0.002_f64
    ) {
        let prices = IntervalPrices::DEFAULT;
        let signal = |s: &[(f64, f64, f64)]| AngleSignal::from_samples(STEP_PX, s).unwrap();
        let (s1, s2) = (signal(&a), signal(&b));
        let energy = |s1: &AngleSignal, free1, s2: &AngleSignal, free2| {
            interval_energy(s1, free1, s2, free2, false, &prices).unwrap()
        };
        let found = energy(&s1, free1, &s2, free2);
        prop_assert!(energy(&s1, FreeEnds::ANY, &s2, free2) <= found);
        let wider: Vec<_> = a.iter().map(|&(low, high, g)| (low - more, high + more, g)).collect();
        prop_assert!(energy(&signal(&wider), free1, &s2, free2) <= found + TOLERANCE);
        let turn = std::f64::consts::TAU;
        let turned: Vec<_> = b.iter().map(|&(low, high, g)| (low + turn, high + turn, g)).collect();
        // f32 at 2π: 24 times coarser than TOLERANCE allows for at 0.26.
        prop_assert!((energy(&s1, free1, &signal(&turned), free2) - found).abs() <= 1000.0 * TOLERANCE);
    }

    #[test]
    fn a_coarser_signal_covers_the_same_angles(rig in rigs(), curve in curves::<View1>(2..=80), step in 1.0..20.0_f64) {
        let angles = EpipolarAngle::new(&rig);
        let profile = AngleProfile::of_view1(&angles, &curve, 1.0).unwrap();
        let (fine, coarse) = (profile.signal(1.0).unwrap(), profile.signal(step).unwrap());
        let extremes = |s: &AngleSignal| {
            (0..s.samples()).map(|k| s.interval(k).unwrap()).fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), (low, high)| (a.min(low), b.max(high)))
        };
        prop_assert_eq!(extremes(&fine), extremes(&coarse));
        // Neighbours touch: no angle of the curve is lost between them.
        for k in 1..coarse.samples() {
            let (a, b) = (coarse.interval(k - 1).unwrap(), coarse.interval(k).unwrap());
            let slack = 1e-6; // two roundings to f32
            prop_assert!(a.0 <= b.1 + slack && b.0 <= a.1 + slack);
        }
    }

    #[test]
    fn the_ranking_is_what_comparing_every_pair_gives(
        rig in rigs(),
        curves1 in prop::collection::vec((curves::<View1>(20..=60), 0.0..1.0_f64, free_ends(), 0.0..60.0_f64), 1..=5),
        curves2 in prop::collection::vec((curves::<View2>(20..=60), 0.0..1.0_f64, free_ends(), 0.0..60.0_f64), 1..=5),
        keep_screened in 1..30_usize, keep_coarse in 1..30_usize, keep_fine in 1..20_usize,
        end_limit_px in 20.0..400.0_f64,
    ) {
        let angles = EpipolarAngle::new(&rig);
        fn signal_curve<V: View>((points, cost, free, doubled_px): &(Vec<Pixel<V>>, f64, FreeEnds, f64)) -> SignalCurve<'_, V> {
            SignalCurve { points, cost: *cost, free: *free, doubled_px: *doubled_px }
        }
        let (c1, c2): (Vec<_>, Vec<_>) = (curves1.iter().map(signal_curve).collect(), curves2.iter().map(signal_curve).collect());
        let params = ProposeParams {
            keep_screened, keep_coarse, keep_fine, end_limit_px, end_weight: 0.01, ..ProposeParams::DEFAULT
        };
        let found = propose_pairs(&angles, &c1, &c2, &params).unwrap();

        // Every pair, nothing abandoned, one at a time.
        let keep_all = usize::MAX;
        let everything = ProposeParams {
            energy_weight: 0.0, keep_screened: keep_all, keep_coarse: keep_all, keep_fine: keep_all, ..params
        };
        let mut pairs = propose_pairs(&angles, &c1, &c2, &everything).unwrap();
        pairs.sort_by_key(|p| (p.i, p.j, p.reversed));
        let mut expected = Vec::new();
        for (i, c1) in c1.iter().enumerate() {
            for (j, c2) in c2.iter().enumerate() {
                for reversed in [false, true] {
                    if let Some(penalty) = end_penalty(&angles, c1, c2, reversed, &params) {
                        expected.push(((i, j, reversed), penalty));
                    }
                }
            }
        }
        prop_assert_eq!(pairs.len(), expected.len());
        for (p, (ids, penalty)) in pairs.iter().zip(expected) {
            prop_assert_eq!((p.i, p.j, p.reversed), ids);
            // The last sample of a profile is its last point but for rounding: 1e-12 px, of which
            // angles far from the epipole keep all but a few digits.
            prop_assert!((p.end_penalty - penalty).abs() <= 1e-9, "{} {}", p.end_penalty, penalty);
        }
        let best = |pairs: &mut Vec<Proposal>, keep: usize| {
            pairs.sort_by(|a, b| a.score.total_cmp(&b.score).then((a.i, a.j, a.reversed).cmp(&(b.i, b.j, b.reversed))));
            pairs.truncate(keep);
        };
        let base = |p: &Proposal| {
            let (c1, c2) = (&c1[p.i], &c2[p.j]);
            let doubled = 0.04 * (c1.doubled_px.min(c2.doubled_px) - 25.0).max(0.0);
            c1.cost + c2.cost + p.end_penalty + doubled
        };
        for p in &mut pairs {
            p.score = base(p);
        }
        best(&mut pairs, keep_screened);
        for (step, keep) in [(params.coarse_step_px, keep_coarse), (params.fine_step_px, keep_fine)] {
            for p in &mut pairs {
                let s1 = AngleProfile::of_view1(&angles, c1[p.i].points, params.fine_step_px).unwrap().signal(step).unwrap();
                let s2 = AngleProfile::of_view2(&angles, c2[p.j].points, params.fine_step_px).unwrap().signal(step).unwrap();
                p.energy_px2 = interval_energy(&s1, c1[p.i].free, &s2, c2[p.j].free, p.reversed, &params.prices).unwrap();
                p.score = base(p) + params.energy_weight * p.energy_px2;
            }
            best(&mut pairs, keep);
        }
        prop_assert_eq!(found, pairs);
    }
}

/// Around an epipole inside the image the plane turns as the pixel does: past ±π, where the angle of a
/// single pixel starts again, that of a curve goes on.
#[test]
fn the_angle_goes_on_past_half_a_turn() {
    let k = Matrix3::new(800.0, 0.0, 256.0, 0.0, 800.0, 256.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 512, height: 512 };
    let camera =
        |z: f64| Camera::new(k, Matrix3::identity(), Vector3::new(0.0, 0.0, z), size).unwrap();
    let rig = Rig::new(camera(0.0), camera(50.0), LengthUnit::Millimetre).unwrap();
    let turns = 1.25;
    let around = |k: i32| {
        let angle = turns * std::f64::consts::TAU * f64::from(k) / 500.0;
        Pixel::new(256.0 + 100.0 * angle.cos(), 256.0 + 100.0 * angle.sin())
    };
    let curve: Vec<Pixel<View1>> = (0..=500).map(around).collect();
    let profile = AngleProfile::of_view1(&EpipolarAngle::new(&rig), &curve, 1.0).unwrap();
    let turned = (profile.last().0 - profile.first().0).abs();
    assert!((turned - turns * std::f64::consts::TAU).abs() < 1e-9, "{turned}");
    // 785 px in steps of 5: no sample covers more angle than two of its own steps.
    let signal = profile.signal(5.0).unwrap();
    for k in 0..signal.samples() {
        let (low, high) = signal.interval(k).unwrap();
        assert!(high - low < 0.1, "{low} {high}");
    }
}

#[test]
fn no_candidates_give_no_proposals() {
    let angles = EpipolarAngle::new(&scenes::rig(1.0, 20.0, 1500.0, 1500.0));
    assert_eq!(propose_pairs(&angles, &[], &[], &ProposeParams::DEFAULT), Ok(vec![]));
}

#[test]
fn unusable_input_is_refused_by_name() {
    let angles = EpipolarAngle::new(&scenes::rig(1.0, 20.0, 1500.0, 1500.0));
    let point = [Pixel::<View1>::new(10.0, 20.0)];
    let curve = |points, cost| SignalCurve { points, cost, free: FreeEnds::NONE, doubled_px: 0.0 };
    let propose = |c: SignalCurve<'_, View1>, params: &ProposeParams| {
        propose_pairs(&angles, &[c], &[], params).unwrap_err()
    };
    let out_of_range = |error| matches!(error, MatchError::Geometry(GeomError::OutOfRange { .. }));
    let default = ProposeParams::DEFAULT;
    assert_eq!(propose(curve(&[], 0.0), &default), MatchError::Empty { view: 1 });
    let nan = [Pixel::new(f64::NAN, 0.0)];
    assert!(matches!(propose(curve(&nan, 0.0), &default), MatchError::NotFinite { index: 0, .. }));
    let far = [Pixel::new(-1e9, 0.0), Pixel::new(1e9, 0.0)];
    assert!(out_of_range(propose(curve(&far, 0.0), &default)));
    assert!(out_of_range(propose(curve(&point, f64::NAN), &default)));
    assert!(out_of_range(propose(
        SignalCurve { free: FreeEnds { begin_px: -1.0, end_px: 0.0 }, ..curve(&point, 0.0) },
        &default
    )));
    for doubled_px in [f64::NAN, f64::INFINITY] {
        let doubled = SignalCurve { doubled_px, ..curve(&point, 0.0) };
        assert!(out_of_range(propose(doubled, &default)));
    }
    assert!(out_of_range(propose(curve(&point, f64::INFINITY), &default)));
    for params in [
        ProposeParams { fine_step_px: 0.0, ..default },
        ProposeParams { coarse_step_px: f64::INFINITY, ..default },
        ProposeParams { end_weight: -1.0, ..default },
        ProposeParams { doubled_weight: f64::NAN, ..default },
        ProposeParams { doubled_weight: f64::INFINITY, ..default },
        ProposeParams { end_limit_px: f64::INFINITY, ..default },
        ProposeParams { doubled_tolerance_px: -1.0, ..default },
        ProposeParams {
            prices: IntervalPrices { cap_px: f64::NAN, ..IntervalPrices::DEFAULT },
            ..default
        },
    ] {
        assert!(out_of_range(propose(curve(&point, 0.0), &params)));
    }
    let one = AngleSignal::from_samples(1.0, &[(0.0, 0.0, 0.001)]).unwrap();
    let two = AngleSignal::from_samples(2.0, &[(0.0, 0.0, 0.001)]).unwrap();
    let (ends, prices) = (FreeEnds::NONE, IntervalPrices::DEFAULT);
    assert!(out_of_range(interval_energy(&one, ends, &two, ends, false, &prices).unwrap_err()));
    assert!(AngleSignal::from_samples(1.0, &[]).is_err());
    assert!(out_of_range(AngleSignal::from_samples(1.0, &[(1.0, 0.0, 1.0)]).unwrap_err()));
}
