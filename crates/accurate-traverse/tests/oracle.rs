//! The traversal against a slow implementation written from the definition alone.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Pixel, View1};
use accurate_traverse::{Norm, TraverseParams, trace_from};
use proptest::prelude::*;

type Xy = (i32, i32);

/// Curvature at the last point of the quadratics fitted by normal equations.
fn curvature(points: &[Xy]) -> f64 {
    let n = points.len();
    if n < 3 {
        return 0.0;
    }
    let mut normal = Matrix3::zeros();
    let (mut bx, mut by) = (Vector3::zeros(), Vector3::zeros());
    for (k, &(x, y)) in points.iter().enumerate() {
        let t = k as f64 / (n - 1) as f64;
        let powers = Vector3::new(1.0, t, t * t);
        normal += powers * powers.transpose();
        bx += powers * f64::from(x);
        by += powers * f64::from(y);
    }
    let inverse = normal.try_inverse().unwrap();
    let (cx, cy) = (inverse * bx, inverse * by);
    let (dx, dy) = (cx[1] + 2.0 * cx[2], cy[1] + 2.0 * cy[2]);
    let (ddx, ddy) = (2.0 * cx[2], 2.0 * cy[2]);
    (dx * ddy - dy * ddx).abs() / ((dx * dx + dy * dy).powf(1.5) + 1e-8)
}

fn loss(trace: &[Xy], q: Xy, params: &TraverseParams) -> f64 {
    let here = trace[trace.len() - 1];
    let (dx, dy) = (f64::from(q.0 - here.0), f64::from(q.1 - here.1));
    let recent = &trace[trace.len().saturating_sub(params.curvature_window)..];
    let window: Vec<Xy> = recent.iter().copied().chain([q]).collect();
    let angle = if trace.len() < 2 {
        0.0
    } else {
        let before = trace[trace.len() - 2];
        let (hx, hy) = (f64::from(here.0 - before.0), f64::from(here.1 - before.1));
        1.0 - (hx * dx + hy * dy) / (hx.hypot(hy) * dx.hypot(dy) + 1e-8)
    };
    let distance = match params.distance_norm {
        Norm::Chebyshev => dx.abs().max(dy.abs()),
        Norm::Euclidean => dx.hypot(dy),
    };
    curvature(&window) + params.angle_weight * angle + params.distance_weight * distance
}

/// The trace by full scans. Where losses agree within rounding, the choice of `given` is taken if it
/// is one of them: which of two rounding errors is smaller is no law.
fn slow_trace(pixels: &[Xy], start: Xy, params: &TraverseParams, given: &[Xy]) -> Vec<Xy> {
    let mut trace = vec![start];
    loop {
        let here = trace[trace.len() - 1];
        let mut candidates: Vec<Xy> = Vec::new();
        for r in params.radius_min_px..=params.max_gap_px {
            candidates = pixels
                .iter()
                .filter(|q| !trace.contains(q))
                .filter(|q| (q.0 - here.0).abs().max((q.1 - here.1).abs()) <= r as i32)
                .copied()
                .collect();
            if !candidates.is_empty() {
                break;
            }
        }
        if candidates.is_empty() {
            return trace;
        }
        let losses: Vec<f64> = candidates.iter().map(|&q| loss(&trace, q, params)).collect();
        let least = losses.iter().copied().fold(f64::INFINITY, f64::min);
        // Normal equations of 11 points have condition below 1e4 and coordinates below 100: the
        // derivatives are good to 1e-9, and so is a curvature of order 1.
        let tied: Vec<Xy> = candidates
            .iter()
            .zip(&losses)
            .filter(|(_, l)| **l <= least + 1e-8)
            .map(|(q, _)| *q)
            .collect();
        let chosen = given.get(trace.len()).filter(|q| tied.contains(q)).copied();
        trace.push(chosen.unwrap_or(tied[0]));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn the_trace_equals_the_definition_by_full_scans(
        walks in prop::collection::vec(
            ((0..60_i32, 0..60_i32), prop::collection::vec((-1..=1_i32, -1..=1_i32), 1..20)), 1..5,
        ),
        pick in any::<prop::sample::Index>(),
        (window, radius, gap) in (0..12_usize, 1..12_u32, 0..40_u32),
        weights in (0.0..2.0_f64, 0.0..2.0_f64),
        euclidean in any::<bool>(),
    ) {
        let mut xy = Vec::new();
        for ((mut x, mut y), steps) in walks {
            for (dx, dy) in steps {
                xy.push((x, y));
                x += dx;
                y += dy;
            }
        }
        xy.sort_by_key(|&(x, y)| (y, x));
        xy.dedup();
        prop_assume!(xy.len() >= 2);
        let params = TraverseParams {
            curvature_window: window,
            radius_min_px: radius,
            max_gap_px: radius + gap,
            angle_weight: weights.0,
            distance_weight: weights.1,
            distance_norm: if euclidean { Norm::Euclidean } else { Norm::Chebyshev },
        };
        let skeleton: Vec<Pixel<View1>> =
            xy.iter().map(|&(x, y)| Pixel::new(x.into(), y.into())).collect();
        for params in [params, TraverseParams::PAPER] {
            let fast = trace_from(&skeleton, *pick.get(&skeleton), &params).unwrap();
            let fast: Vec<Xy> = fast.points.iter().map(|p| (p.x as i32, p.y as i32)).collect();
            let slow = slow_trace(&xy, *pick.get(&xy), &params, &fast);
            prop_assert_eq!(fast, slow);
        }
    }
}

#[test]
fn of_equal_losses_the_first_in_raster_order_wins() {
    // Mirror images about the heading have bitwise equal losses.
    let mut xy: Vec<Xy> = (0..8).map(|y| (0, y)).collect();
    xy.extend([(1, 8), (-1, 8)]);
    let skeleton: Vec<Pixel<View1>> =
        xy.iter().map(|&(x, y)| Pixel::new(x.into(), y.into())).collect();
    let trace = trace_from(&skeleton, skeleton[0], &TraverseParams::PAPER).unwrap();
    assert_eq!(trace.points[8], Pixel::new(-1.0, 8.0));
    // Heading up, two candidates in one row; heading right, two in one column.
    let turned: Vec<Pixel<View1>> =
        xy.iter().map(|&(x, y)| Pixel::new(y.into(), x.into())).collect();
    let trace = trace_from(&turned, turned[0], &TraverseParams::PAPER).unwrap();
    assert_eq!(trace.points[8], Pixel::new(8.0, -1.0));
}
