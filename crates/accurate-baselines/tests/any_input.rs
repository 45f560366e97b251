//! Whatever comes in: a curve of finite points, or a typed error. Never NaN, never a panic.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
mod support;

use accurate_baselines::{Baur, NAMES, by_name};
use accurate_geom::{Pixel, View, View1, View2};
use accurate_match::{CurveMatcher, MatchError};
use proptest::prelude::*;
use support::*;

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => (0..600i32).prop_map(f64::from),
        6 => -100.0..2100.0f64,
        1 => prop::sample::select(vec![0.0, -0.0, 1e-300, 1e9, -1e9, 1e200, -1e308]),
    ]
}

/// Short or long, tame or with huge steps, with repeated points now and then.
fn curve<V: View>() -> impl Strategy<Value = Vec<Pixel<V>>> {
    prop_oneof![
        prop::collection::vec((coordinate(), coordinate()), 1..12),
        // A walk that looks like a traced wire.
        prop::collection::vec((-2..=2i32, -1..=2i32), 1..150).prop_map(|steps| {
            let (mut x, mut y) = (250.0, 900.0);
            steps
                .into_iter()
                .map(|(dx, dy)| {
                    x += f64::from(dx);
                    y += f64::from(dy);
                    (x, y)
                })
                .collect()
        }),
    ]
    .prop_map(|points| points.into_iter().map(|(x, y)| Pixel::new(x, y)).collect())
}

/// As by name, but for the size of Baur's graph: some hundred cases shall take seconds.
fn quick(name: &str) -> Box<dyn CurveMatcher> {
    match name {
        Baur::NAME => Box::new(Baur { max_samples: 80, ..Baur::default() }),
        _ => by_name(name).unwrap(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_method_gives_finite_points_or_an_error(
        a in curve::<View1>(), b in curve::<View2>(), angle in 5.0..120.0f64,
    ) {
        let rig = turntable_rig(angle);
        for name in NAMES {
            let Ok(found) = quick(name).reconstruct(&a, &b, &rig) else { continue };
            prop_assert!(!found.points.is_empty());
            prop_assert_eq!(found.points.len(), found.pairs.len());
            for p in &found.points {
                prop_assert!(p.position.coords.iter().all(|v| v.is_finite()), "{name}");
                prop_assert!(p.pixel1.is_finite() && p.pixel2.is_finite(), "{name}");
                prop_assert!(p.epipolar_distance_px.is_finite() && p.epipolar_distance_px >= 0.0);
            }
            prop_assert!(found.pairs.iter().all(|&(i, j)| i < a.len() && j < b.len()), "{name}");
        }
    }

    #[test]
    fn every_method_gives_the_same_curve_twice(a in curve::<View1>(), b in curve::<View2>()) {
        let rig = turntable_rig(40.0);
        for name in NAMES {
            let run = || quick(name).reconstruct(&a, &b, &rig);
            prop_assert_eq!(run(), run());
        }
    }

    #[test]
    fn every_method_but_baert_table_keeps_the_order_of_both_views(
        a in curve::<View1>(), b in curve::<View2>(),
    ) {
        let rig = turntable_rig(40.0);
        for name in NAMES.into_iter().filter(|name| *name != "baert-table") {
            let Ok(found) = quick(name).reconstruct(&a, &b, &rig) else { continue };
            for w in found.pairs.windows(2) {
                prop_assert!(w[0].0 <= w[1].0 && w[0].1 <= w[1].1, "{name}: {w:?}");
            }
        }
    }
}

#[test]
fn an_empty_curve_is_its_own_error() {
    let rig = turntable_rig(40.0);
    let (a, b) = images(&rig, &sampled(50, line));
    for name in NAMES {
        let method = by_name(name).unwrap();
        assert_eq!(method.reconstruct(&[], &b, &rig), Err(MatchError::Empty { view: 1 }));
        assert_eq!(method.reconstruct(&a, &[], &rig), Err(MatchError::Empty { view: 2 }));
    }
}

#[test]
fn a_point_that_is_not_finite_is_named() {
    let rig = turntable_rig(40.0);
    let (mut a, mut b) = images(&rig, &sampled(50, line));
    a[7] = Pixel::new(1.0, f64::NEG_INFINITY);
    for name in NAMES {
        let found = by_name(name).unwrap().reconstruct(&a, &b, &rig);
        assert!(matches!(found, Err(MatchError::NotFinite { view: 1, index: 7, .. })), "{name}");
    }
    a[7] = a[6];
    b[3] = Pixel::new(f64::NAN, 0.0);
    for name in NAMES {
        let found = by_name(name).unwrap().reconstruct(&a, &b, &rig);
        assert!(matches!(found, Err(MatchError::NotFinite { view: 2, index: 3, .. })), "{name}");
    }
}

#[test]
fn curves_that_no_epipolar_line_joins_have_no_correspondence() {
    // View 1 sees the top of the line only, view 2 the bottom.
    let rig = turntable_rig(40.0);
    let (a, b) = images(&rig, &sampled(600, line));
    for name in NAMES.into_iter().filter(|name| *name != "baur") {
        let found = by_name(name).unwrap().reconstruct(&a[..200], &b[400..], &rig);
        assert!(matches!(found, Err(MatchError::NoCorrespondence { .. })), "{name}: {found:?}");
    }
}

#[test]
fn names_and_methods_agree_and_are_all_there() {
    for name in NAMES {
        assert_eq!(by_name(name).unwrap().name(), name);
    }
    assert!(by_name("Baert").is_none() && by_name("").is_none());
}
