//! `accurate` mode on rings: wherever they are cut, whichever way they run, as points and as masks.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "support/rings.rs"]
mod rings;

use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::{Error, Suspicion, ViewPair};
use ndarray::Array2;
use rings::{Ring, Shown, reconstruct_ring, ring_pair, ring_rig};

const SEED: u64 = 1931;
/// One unit is 1.2 px: a ring in the wrong direction is off by tens.
const WRONG_UNITS: f64 = 4.0;

/// Reconstructs `count` rings: all are closed, the mean of the distances from right ones stays below
/// `mean_units`, and those that are wrong, `wrong` at most, are said to be ambiguous.
fn assert_rings(shown: Shown, count: u64, mean_units: f64, most_wrong: usize) {
    let mut wrong = Vec::new();
    let mut means = Vec::new();
    for index in 0..count {
        let ring = Ring::generate(SEED, index);
        let found = reconstruct_ring(&ring_pair(&ring, index, shown)).unwrap();
        assert!(found.diagnostics.closed);
        assert_eq!(found.points[0].position, found.points[found.points.len() - 1].position);
        assert_eq!(found.covariances.as_ref().map(Vec::len), Some(found.points.len()));
        let scores = ring.scores(&found.positions());
        if scores.hausdorff < WRONG_UNITS {
            means.push(scores.overall);
        } else {
            let reasons = &found.diagnostics.suspicions;
            assert!(reasons.contains(&Suspicion::Ambiguous), "{shown:?} {index}: {scores:?}");
            wrong.push(index);
        }
    }
    assert!(wrong.len() <= most_wrong, "{shown:?}: wrong are {wrong:?}");
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    assert!(mean < mean_units, "{shown:?}: {mean}");
}

/// As open curves: exact points to hundredths.
#[test]
fn exact_points_of_rings_wherever_they_begin_and_whichever_way_they_run() {
    assert_rings(Shown::Exact, 8, 0.01, 0);
}

/// As open curves of whole pixels, whose mean is 0.14 px.
#[test]
fn whole_pixels_of_rings() {
    assert_rings(Shown::Whole, 8, 0.14, 0);
}

/// As open bodies, whose mean is 0.1 px.
#[test]
fn masks_of_rings() {
    assert_rings(Shown::Masks, 6, 0.1, 1);
}

#[test]
fn a_repeated_first_point_changes_nothing() {
    let ring = Ring::generate(SEED, 0);
    let mut pair = ring_pair(&ring, 0, Shown::Exact);
    let once = reconstruct_ring(&pair).unwrap();
    let (one, two) = pair.points.as_mut().unwrap();
    one.push(one[0]);
    two.push(two[0]);
    assert_eq!(reconstruct_ring(&pair).unwrap().points, once.points);
}

#[test]
fn an_open_body_is_no_ring() {
    let case = generate(Family::Easy, SEED, 0, &CaseOptions::default()).unwrap();
    match reconstruct_ring(&ViewPair { points: None, ..ViewPair::from(case) }) {
        Err(Error::NotClosed { view: 1, tips, .. }) => assert!(tips >= 1),
        other => panic!("{other:?}"),
    }
}

/// A pixel, a blob, a line and the smallest rings: refused, or a finite closed curve.
#[test]
fn what_is_hardly_a_ring_is_refused_or_closed_but_never_nan() {
    let drawn = |shown: fn(i64, i64) -> bool| {
        let mask =
            Array2::from_shape_fn((512, 512), |(y, x)| shown(x as i64 - 255, y as i64 - 255));
        [mask.clone(), mask]
    };
    let shapes: [fn(i64, i64) -> bool; 6] = [
        |x, y| (x, y) == (0, 0),
        |x, y| x * x + y * y < 400,
        |x, y| y.abs() < 2 && x.abs() < 60,
        |x, y| x.abs().max(y.abs()) == 1,
        |x, y| (9..=20).contains(&(x * x + y * y)),
        |x, y| (30..=60).contains(&(x * x + y * y)),
    ];
    for (index, shape) in shapes.into_iter().enumerate() {
        let pair = ViewPair { masks: Some(drawn(shape)), ..ViewPair::new("shape", ring_rig()) };
        if let Ok(found) = reconstruct_ring(&pair) {
            assert!(found.diagnostics.closed, "{index}");
            let positions = found.positions();
            assert_eq!(positions.first(), positions.last(), "{index}");
            assert!(positions.iter().all(|p| p.iter().all(|x| x.is_finite())), "{index}");
        }
    }
}
