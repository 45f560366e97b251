//! The order of one mask, beside the greedy traversal.
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate3d::geom::{Point2, View1};
use accurate3d::seg::{Mask, Skeleton, zhang_suen};
use accurate3d::synth::{CaseOptions, Family, SynthCase, generate};
use accurate3d::traverse::{TraverseParams, trace_single};
use accurate3d::{Error, trace_mask};
use ndarray::Array2;

const SEED: u64 = 1908;

fn case(family: Family, index: u64) -> SynthCase {
    generate(family, SEED, index, &CaseOptions::default()).unwrap()
}

fn true_curve(case: &SynthCase) -> Vec<Point2> {
    case.exact_points.0.iter().map(|p| p.point()).collect()
}

/// The discrete Fréchet distance, in the better direction: how far apart two runners along the curves
/// have to be who never turn back. A wrong order shows, unlike in distances of point sets.
fn frechet_px(a: &[Point2], b: &[Point2]) -> f64 {
    let along = |b: &mut dyn Iterator<Item = &Point2>| {
        let mut last: Vec<f64> = Vec::new();
        for q in b {
            let mut row = Vec::with_capacity(a.len());
            for (i, p) in a.iter().enumerate() {
                let before = match (i, last.is_empty()) {
                    (0, true) => 0.0,
                    (0, false) => last[0],
                    (_, true) => row[i - 1],
                    (_, false) => last[i].min(last[i - 1]).min(row[i - 1]),
                };
                row.push((p - q).norm().max(before));
            }
            last = row;
        }
        last[a.len() - 1]
    };
    along(&mut b.iter()).min(along(&mut b.iter().rev()))
}

fn to_segment(p: &Point2, ends: &[Point2]) -> f64 {
    let along = ends[1] - ends[0];
    let at = ((p - ends[0]).dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
    (p - (ends[0] + along * at)).norm()
}

fn greedy(mask: &Array2<bool>) -> Vec<Point2> {
    let skeleton = Skeleton::of(&zhang_suen(&Mask::from_array(mask.clone()).unwrap())).unwrap();
    let trace = trace_single(&skeleton.pixels_as::<View1>(), &TraverseParams::PAPER).unwrap();
    trace.points.iter().map(|p| p.point()).collect()
}

#[test]
fn walks_run_the_right_way_where_the_greedy_traversal_does_not() {
    const CASES: u64 = 40;
    let (mut right, mut greedy_right) = (0, 0);
    for index in 0..CASES {
        let case = case(Family::Medium, index);
        let curve = true_curve(&case);
        let trace = trace_mask::<View1>(&case.masks[0], "medium").unwrap();
        right += u64::from(frechet_px(&trace.points, &curve) < 5.0);
        greedy_right += u64::from(frechet_px(&greedy(&case.masks[0]), &curve) < 5.0);
    }
    // Measured: 39 and 25. What is left bends less the wrong way; only the other view can tell.
    assert!(right >= 38, "{right}");
    assert!(greedy_right < 30, "{greedy_right}: then the two need not be told apart");
}

/// Largest and mean distance from the points of `a` to the polyline `b`, px.
fn off_px(a: &[Point2], b: &[Point2]) -> (f64, f64) {
    let to_b = |p: &Point2| b.windows(2).map(|w| to_segment(p, w)).fold(f64::INFINITY, f64::min);
    let distances: Vec<f64> = a.iter().map(to_b).collect();
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    (distances.into_iter().fold(0.0, f64::max), mean)
}

/// A body `width_px` wide about a polyline.
fn drawn(line: &[Point2], size: usize, width_px: f64) -> Array2<bool> {
    Array2::from_shape_fn((size, size), |(y, x)| {
        let pixel = Point2::new(x as f64, y as f64);
        line.windows(2).any(|w| to_segment(&pixel, w) <= 0.5 * width_px)
    })
}

fn curve(count: usize, at: impl Fn(f64) -> (f64, f64)) -> Vec<Point2> {
    let points = (0..=count).map(|k| at(k as f64 / count as f64));
    points.map(|(x, y)| Point2::new(x, y)).collect()
}

fn length_px(points: &[Point2]) -> f64 {
    points.windows(2).map(|w| (w[0] - w[1]).norm()).sum()
}

#[test]
fn a_trace_lies_between_the_pixels_from_tip_to_tip() {
    for index in 0..10 {
        let case = case(Family::Easy, index);
        let trace = trace_mask::<View1>(&case.masks[0], "easy").unwrap();
        let truth = true_curve(&case);
        let ((_, mean), (far, back)) =
            (off_px(&trace.points, &truth), off_px(&truth, &trace.points));
        // Strands side by side and crossings are the worst places; whole pixels are off by 0.25 everywhere.
        assert!(mean.max(back) < 0.3, "{index}: {mean} {back}");
        // The mask ends half its width beyond the body, wherever that falls among the pixels; and the tip of
        // a body is led on to along its last few pixels.
        assert!(far < 3.0, "{index}: {far}");
        assert!(!trace.closed && trace.coverage > 0.95, "{} {}", trace.closed, trace.coverage);
    }
}

#[test]
fn a_hairpin_on_a_long_wire_is_not_cut() {
    // 300 px out and back, 20 px apart: the turn has a radius of 10 px.
    let mut line = curve(300, |t| (20.3 + 300.0 * t, 40.2));
    line.extend(curve(60, |t| {
        let angle = std::f64::consts::PI * (t - 0.5);
        (320.3 + 10.0 * angle.cos(), 50.2 + 10.0 * angle.sin())
    }));
    line.extend(curve(300, |t| (320.3 - 300.0 * t, 60.2)));
    let trace = trace_mask::<View1>(&drawn(&line, 360, 3.0), "hairpin").unwrap();
    let (far, back) = (off_px(&trace.points, &line).0, off_px(&line, &trace.points).0);
    // Smoothing that takes the residual of rounding for noise would cut it by 1.7 px.
    assert!(far.max(back) < 1.0, "{far} {back}");
}

#[test]
fn a_gap_is_bridged_and_counted() {
    let line = curve(200, |t| (20.0 + 160.0 * t, 60.0 + 25.0 * (3.0 * t).sin()));
    let mut mask = drawn(&line, 200, 3.0);
    mask.indexed_iter_mut().for_each(|((_, x), body)| *body &= !(95..105).contains(&x));
    let trace = trace_mask::<View1>(&mask, "gap").unwrap();
    assert_eq!(trace.bridges, 1);
    assert!((length_px(&trace.points) - length_px(&line)).abs() < 4.0);
    assert!(off_px(&line, &trace.points).0 < 1.5);
}

#[test]
fn what_was_decided_at_a_crossing_is_told() {
    // A loop: one crossing, passed twice.
    let line = curve(400, |t| {
        let angle = 6.0 * t - 3.0;
        (100.0 + 12.0 * (angle.powi(3) - 3.0 * angle), 20.0 + 9.0 * angle * angle)
    });
    let trace = trace_mask::<View1>(&drawn(&line, 420, 3.0), "loop").unwrap();
    let crossing = Point2::new(100.0, 20.0 + 27.0);
    let there = |at: [f64; 2]| (Point2::new(at[0], at[1]) - crossing).norm() < 6.0;
    let decided: Vec<_> = trace.junctions.iter().filter(|decision| there(decision.at)).collect();
    assert!(decided.len() >= 2, "{:?}", trace.junctions);
    assert!(decided.iter().all(|d| d.alternatives.iter().all(|other| other.price >= d.price)));
    assert!(trace.margin.is_some_and(|margin| margin > 0.0));
}

#[test]
fn a_closed_body_comes_back_to_where_it_began_without_a_kink() {
    use std::f64::consts::TAU;
    let ring = |radius: f64| {
        curve(600, move |t| (61.3 + radius * (TAU * t).cos(), 58.7 + radius * (TAU * t).sin()))
    };
    // Two loops of different size, crossing in the middle: which is passed first is all the same.
    let eight = |first: f64| {
        curve(1200, move |t| {
            let loop_px = if t < 0.5 { first } else { 70.0 - first };
            (71.3 + loop_px * (2.0 * TAU * t).sin(), 72.7 + 1.4 * loop_px * (TAU * t).sin())
        })
    };
    for (name, line) in [
        ("ring", ring(41.2)),
        ("small ring", ring(9.6)),
        ("eight", eight(25.0)),
        ("eight, turned", eight(45.0)),
    ] {
        let trace = trace_mask::<View1>(&drawn(&line, 145, 3.0), name).unwrap();
        assert!(trace.closed, "{name}");
        assert_eq!(trace.points.first(), trace.points.last(), "{name}");
        let (far, back) = (off_px(&trace.points, &line).0, off_px(&line, &trace.points).0);
        let lengths = [length_px(&trace.points), length_px(&line)];
        assert!(far.max(back) < 1.5, "{name}: {far} {back}");
        assert!((lengths[0] / lengths[1] - 1.0).abs() < 0.05, "{name}: {lengths:?}");
        // Also across the seam: steps of about a pixel, and no turn much sharper than elsewhere. (That of an
        // eight is at its crossing, where the skeleton jogs at either passage.)
        let steps: Vec<_> = trace.points.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(steps.iter().all(|step| (0.3..1.7).contains(&step.norm())), "{name}");
        let turn = |k: usize| steps[k].angle(&steps[(k + 1) % steps.len()]);
        let seam = turn(steps.len() - 1);
        let sharpest = (0..steps.len() - 1).map(turn).fold(0.0, f64::max);
        assert!(seam < 1.2 * sharpest, "{name}: {seam} {sharpest}");
    }
}

#[test]
fn what_is_no_thin_body_is_refused() {
    let empty = Array2::from_elem((40, 40), false);
    assert!(matches!(trace_mask::<View1>(&empty, "m"), Err(Error::Segmentation { .. })));
    let full = Array2::from_elem((40, 40), true);
    assert!(trace_mask::<View1>(&full, "m").is_err());
}
