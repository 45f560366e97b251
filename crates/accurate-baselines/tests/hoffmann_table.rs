//! Hoffmann as comparison tables run it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
mod support;
use accurate_baselines::HoffmannTable;
use accurate_geom::Pixel;
use accurate_match::{CurveMatcher, MatchError};
use support::*;

#[test]
fn rounded_pixels_of_a_helix_come_back_within_their_rounding() {
    let rig = turntable_rig(40.0);
    let truth = sampled(3000, helix);
    let (a, b) = rounded_images(&rig, &truth);
    let found = HoffmannTable::PAPER.reconstruct(&a, &b, &rig).unwrap();
    let worst =
        found.points.iter().map(|p| distance_to_curve(&p.position, &truth)).fold(0.0, f64::max);
    println!("{} points, worst {worst}", found.points.len());
    assert!(found.pairs.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1));
    assert!(found.points.len() > a.len() / 2);
    // Each pixel is rounded by up to 0.71 px and a pair lies up to 1 px off its epipolar line: 2.4 px
    // across rays that meet at 40 degrees are 2.4 / sin 40° = 3.8 px, 0.38 units.
    assert!(worst < 0.38, "{worst}");
}

/// The principal row of a turntable is an epipolar line: every pair of its points is a candidate.
#[test]
fn more_candidates_than_there_is_room_for_are_refused() {
    let rig = turntable_rig(40.0);
    let n = 8000;
    let row = |k: usize| (512.0 * k as f64 / n as f64, 1024.0);
    let a: Vec<_> = (0..n).map(|k| Pixel::new(row(k).0, row(k).1)).collect();
    let b: Vec<_> = (0..n).map(|k| Pixel::new(row(k).0, row(k).1)).collect();
    match HoffmannTable::PAPER.reconstruct(&a, &b, &rig) {
        Err(MatchError::TooLarge { n1, n2, bytes, limit_bytes }) => {
            assert_eq!((n1, n2), (n, n));
            assert!(bytes > limit_bytes, "{bytes}");
        }
        found => panic!("{found:?}"),
    }
}
