//! Exact dense points of curves without tangency come back to a millionth of a unit.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
mod support;

use accurate_baselines::{Baert, Hoffmann};
use accurate_geom::Point3;
use accurate_match::CurveMatcher;
use proptest::prelude::*;
use support::*;

/// Points 1 px apart (0.1 units at 10 px per unit) on curves that bend over some 80 px: a cubic
/// through them is wrong by 5/384 h⁴ |f''''| = 0.013 · 80 / 80⁴ px = 3e-8 px inside, some ten times
/// that at the ends, and a pixel is 0.1 units. The truth is a polyline of h = 0.005 units, wrong by
/// h² / (8 · 8 units) = 4e-7 units.
const TOLERANCE: f64 = 1e-6;

fn worst(matcher: &dyn CurveMatcher, angle: f64, curve: fn(f64) -> Point3, length: f64) -> f64 {
    let rig = turntable_rig(angle);
    let (a, b) = images(&rig, &sampled((length * 10.0) as usize, curve));
    let found = matcher.reconstruct(&a, &b, &rig).unwrap();
    assert_eq!(found.dropped, 0);
    // A point per px of view 1, but for some at the tips that see no crossing.
    let length_px: f64 = a.windows(2).map(|w| w[0].distance(w[1])).sum();
    assert!(found.points.len() as f64 > length_px - 5.0, "{} of {length_px}", found.points.len());
    let truth = sampled((length * 200.0) as usize, curve);
    // Every 7th point keeps the quadratic search quick.
    let thinned = found.points.iter().step_by(7);
    thinned.map(|p| distance_to_curve(&p.position, &truth)).fold(0.0, f64::max)
}

fn exact() -> [Box<dyn CurveMatcher>; 2] {
    // Exact points carry no noise to smooth.
    let sigma_px = 0.0;
    [
        Box::new(Baert { sigma_px, ..Baert::default() }),
        Box::new(Hoffmann { sigma_px, ..Hoffmann::default() }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_straight_line_is_reconstructed(angle in 25.0..80.0f64) {
        for matcher in exact() {
            let worst = worst(matcher.as_ref(), angle, line, 62.0);
            prop_assert!(worst < TOLERANCE, "{}: {worst:e}", matcher.name());
        }
    }

    #[test]
    fn a_planar_arc_is_reconstructed(angle in 25.0..80.0f64) {
        for matcher in exact() {
            let worst = worst(matcher.as_ref(), angle, arc, 65.0);
            prop_assert!(worst < TOLERANCE, "{}: {worst:e}", matcher.name());
        }
    }

    #[test]
    fn a_helix_is_reconstructed(angle in 25.0..80.0f64) {
        for matcher in exact() {
            let worst = worst(matcher.as_ref(), angle, helix, 85.0);
            prop_assert!(worst < TOLERANCE, "{}: {worst:e}", matcher.name());
        }
    }
}
