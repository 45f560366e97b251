//! Laws of the angle between a curve and its epipolar lines, and of the bridges on closed curves.
#![allow(clippy::unwrap_used, clippy::panic)]

mod scenes;

use accurate_geom::nalgebra::Vector3;
use accurate_geom::{Camera, EpipolarAngle, LengthUnit, Pixel, Point3, Rig, View, View1, View2};
use accurate_match::{FreeMatcher, PointFlag, tangency_sines1, tangency_sines2};
use proptest::prelude::*;
use scenes::{DISTANCE_TOLERANCE_PX, REACH_PX, curves, rig, rigs, view1, view2};

/// A line that is off by [`DISTANCE_TOLERANCE_PX`] at the reach is off by this in its direction.
const SINE_TOLERANCE: f64 = DISTANCE_TOLERANCE_PX / REACH_PX;

/// Where a camera would see the other, in homogeneous pixels: it may be at infinity.
fn epipole(camera: &Camera, other: &Camera) -> Vector3<f64> {
    camera.k() * (camera.r() * other.centre().coords + camera.t())
}

/// By the definition: the chord from the first to the last point within the window, at least between the
/// neighbours, against the line through the pixel and the epipole.
fn by_definition<V: View>(curve: &[Pixel<V>], epipole: Vector3<f64>, window_px: f64) -> Vec<f64> {
    let last = curve.len() - 1;
    let step = |pair: &[Pixel<V>]| pair[0].distance(pair[1]);
    let within = |from: usize, to: usize| {
        to - from <= 1 || curve[from..=to].windows(2).map(step).sum::<f64>() <= window_px
    };
    let sine = |k: usize| {
        let from = (0..=k).find(|&j| within(j, k)).unwrap();
        let to = (k..=last).rfind(|&j| within(k, j)).unwrap();
        let chord = curve[to].point() - curve[from].point();
        let line = epipole.cross(&curve[k].homogeneous()).xy();
        if chord.norm() > 0.0 { line.normalize().dot(&chord.normalize()).abs() } else { 0.0 }
    };
    (0..=last).map(sine).collect()
}

proptest! {
    #[test]
    fn sines_are_those_of_the_chord_and_the_line_to_the_epipole(
        rig in rigs(), curve in curves::<View1>(1..=60), copies in prop::collection::vec(0..3_usize, 60),
        window in 0.0..9.0_f64,
    ) {
        // Some points are left out, some stand twice; the first always stays.
        let curve: Vec<Pixel<View1>> = curve.iter().zip(&copies).enumerate()
            .flat_map(|(k, (p, n))| vec![*p; if k == 0 { (*n).max(1) } else { *n }]).collect();
        let other: Vec<Pixel<View2>> = scenes::relabelled(&curve);
        let angles = EpipolarAngle::new(&rig);
        let (camera1, camera2) = (rig.camera1(), rig.camera2());
        let found1 = tangency_sines1(&angles, &curve, window).unwrap();
        let found2 = tangency_sines2(&angles, &other, window).unwrap();
        let expected1 = by_definition(&curve, epipole(camera1, camera2), window);
        let expected2 = by_definition(&other, epipole(camera2, camera1), window);
        prop_assert_eq!((found1.len(), found2.len()), (curve.len(), curve.len()));
        for (found, expected) in found1.iter().zip(&expected1).chain(found2.iter().zip(&expected2)) {
            prop_assert!((0.0..=1.0).contains(found));
            prop_assert!((found - expected).abs() <= SINE_TOLERANCE, "{} {}", found, expected);
        }
    }
}

#[test]
fn there_is_no_direction_at_the_epipole_nor_where_a_curve_stands_still() {
    // Each camera sees the other.
    let camera1 = scenes::camera_at(Vector3::new(200.0, 0.0, 0.0), 1000.0, 1000.0);
    let camera2 = scenes::camera_at(Vector3::new(-150.0, 40.0, 30.0), 1200.0, 1200.0);
    let at = Pixel::<View1>::from(camera1.project(&camera2.centre()).unwrap());
    let angles = EpipolarAngle::new(&Rig::new(camera1, camera2, LengthUnit::Unit).unwrap());
    // Through the epipole, beside it by 3 px on either side, and still at the end.
    let beside = |dx: f64, dy: f64| Pixel::new(at.x + dx, at.y + dy);
    let curve = [beside(-3.0, 0.0), at, beside(3.0, 0.0), beside(3.0, 4.0), beside(3.0, 4.0)];
    let sines = tangency_sines1(&angles, &curve, 0.0).unwrap();
    // Along the line; none; the chord (3, 4) against the row; up against (3, 4); none.
    let expected = [0.0, 0.0, 0.8, 0.6, 0.0];
    for (found, expected) in sines.iter().zip(expected) {
        // So near to the epipole a line is only as good as its distance over those 3 px.
        assert!((found - expected).abs() <= DISTANCE_TOLERANCE_PX / 3.0, "{sines:?}");
    }
    assert_eq!((sines[1], sines[4]), (0.0, 0.0));
}

/// Matched positions and flags of a ring of `n` points, two places of which run along epipolar lines; both
/// views begin at some point of it. By the numbers of the ring's own points.
fn around(n: usize, cut: [usize; 2]) -> Vec<(f64, f64, PointFlag)> {
    let at = |k: usize| {
        let (sin, cos) = ((k % n) as f64 / n as f64 * std::f64::consts::TAU).sin_cos();
        Point3::new(15.0 * cos, 12.0 * sin, 14.0 * (cos + 0.4 * sin) + 6.0 * cos * sin)
    };
    let [one, two] = cut.map(|cut| (cut..cut + n).map(at).collect::<Vec<_>>());
    let rig = rig(1.2, 20.0, 1500.0, 1500.0);
    let (c1, c2) = (view1(&rig, &one), view2(&rig, &two));
    let found = FreeMatcher::default().match_closed(&c1, &c2, &rig).unwrap().swap_remove(0);
    // Rounding must not take point 0 to the end.
    let own = |at: f64, k: usize| (at + cut[k] as f64 + 0.1) % n as f64 - 0.1;
    let flags = found.positions.iter().zip(found.flags);
    flags.map(|((at1, at2), flag)| (own(*at1, 0), own(*at2, 1), flag)).collect()
}

/// Only of cuts away from the bridges: at a cut a match ends, and an end keeps its outermost pair.
#[test]
fn the_match_of_a_ring_does_not_depend_on_where_it_is_cut() {
    const N: usize = 300;
    let sorted = |cut: [usize; 2]| {
        let mut found = around(N, cut);
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Where it is cut, the first point is the last again.
        found.dedup_by(|a, b| (a.0 - b.0).abs() < 1e-6 && (a.1 - b.1).abs() < 1e-6);
        found
    };
    let expected = sorted([N / 4, 0]);
    let bridged = expected.iter().filter(|m| m.2 == PointFlag::Bridged).map(|m| m.0);
    assert!(bridged.clone().count() > 6);
    // A bridge takes the slopes of 20 px beside it, along both curves together; a step along view 1 is
    // more than half a px.
    let near = |cut: usize| {
        let apart = |at: f64| (at - cut as f64).abs();
        bridged.clone().any(|at| apart(at).min(N as f64 - apart(at)) < 40.0)
    };
    let cuts: Vec<usize> = (0..N).step_by(29).filter(|&cut| !near(cut)).collect();
    assert!(cuts.len() > 1);
    for (&cut1, cut2) in cuts.iter().flat_map(|cut1| [31, 150].map(|cut2| (cut1, cut2))) {
        let found = sorted([cut1, cut2]);
        assert_eq!(found.len(), expected.len(), "cut at {cut1}, {cut2}");
        for (found, expected) in found.iter().zip(&expected) {
            // Points are off by DISTANCE_TOLERANCE_PX across lines whose sine is 0.1 at least, and steps
            // are half a px.
            let off = (found.0 - expected.0).abs().max((found.1 - expected.1).abs());
            assert!(off < DISTANCE_TOLERANCE_PX / 0.05, "{off} at {expected:?}");
            assert_eq!(found.2, expected.2);
        }
    }
}
