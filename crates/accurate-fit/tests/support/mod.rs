//! Curves and distances for the tests.
#![allow(dead_code, clippy::unwrap_used)]

use accurate_fit::CurveCovariance;
use accurate_geom::nalgebra::Vector2;
use accurate_geom::{Curve3, Pixel, Point3, Rig, View, View1, View2};
use accurate_synth::SynthCase;

/// The smooth curve through every 4th point of a dense polyline.
pub fn curve_through(points: &[Point3]) -> Curve3 {
    let last = points.len() - 1;
    let mut sparse: Vec<Point3> = points[..last - 2].iter().step_by(4).copied().collect();
    sparse.push(points[last]);
    Curve3::interpolate(&sparse).unwrap()
}

/// Every point moved smoothly by up to `amount` per coordinate.
pub fn perturbed(points: &[Point3], amount: f64, unit_per_px: f64) -> Vec<Point3> {
    let step = (points[1] - points[0]).norm() / unit_per_px;
    points
        .iter()
        .enumerate()
        .map(|(k, p)| {
            let s = k as f64 * step;
            let wave = |length: f64, phase: f64| amount * (s / length + phase).sin();
            Point3::new(p.x + wave(17.0, 0.0), p.y + wave(23.0, 1.0), p.z + wave(29.0, 2.0))
        })
        .collect()
}

/// Image px per world unit near the curve, in view 1.
pub fn px_per_unit(case: &SynthCase) -> f64 {
    let camera = case.rig.camera1();
    camera.k()[(0, 0)].abs() / camera.depth(&case.truth[case.truth.len() / 2])
}

fn to_polyline(p: &Point3, line: &[Point3]) -> f64 {
    let squared = line.windows(2).map(|w| {
        let e = w[1] - w[0];
        let t = ((p - w[0]).dot(&e) / e.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p - w[0] - e * t).norm_squared()
    });
    squared.fold(f64::INFINITY, f64::min).sqrt()
}

/// Mean (of both directions) and largest distance between a curve and a dense truth.
pub fn deviation(curve: &Curve3, truth: &[Point3]) -> (f64, f64) {
    let (start, end) = curve.domain();
    let found: Vec<Point3> =
        (0..=1000).map(|k| curve.at(start + (end - start) * f64::from(k) / 1000.0)).collect();
    let there: Vec<f64> = found.iter().map(|p| to_polyline(p, truth)).collect();
    let back: Vec<f64> = truth.iter().step_by(2).map(|p| to_polyline(p, &found)).collect();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let max = there.iter().chain(&back).copied().fold(0.0, f64::max);
    (0.5 * (mean(&there) + mean(&back)), max)
}

/// Rounded to pixels, repeats dropped.
pub fn integers<V: View>(curve: &[Pixel<V>]) -> Vec<Pixel<V>> {
    let mut rounded: Vec<Pixel<V>> =
        curve.iter().map(|p| Pixel::new(p.x.round(), p.y.round())).collect();
    rounded.dedup();
    rounded
}

/// Pairs of least total epipolar distance from corner to corner, the diagonal first.
pub fn match_points(one: &[Pixel<View1>], two: &[Pixel<View2>], rig: &Rig) -> Vec<(usize, usize)> {
    let (n, m) = (one.len(), two.len());
    let lines: Vec<_> = two.iter().map(|p| rig.fundamental().line(*p).unwrap()).collect();
    let mut cost = vec![0.0; n * m];
    for i in 0..n {
        for j in 0..m {
            let before = match (i, j) {
                (0, 0) => 0.0,
                (0, _) => cost[j - 1] + 0.02,
                (_, 0) => cost[(i - 1) * m] + 0.02,
                _ => f64::min(
                    cost[(i - 1) * m + j - 1],
                    f64::min(cost[(i - 1) * m + j], cost[i * m + j - 1]) + 0.02,
                ),
            };
            cost[i * m + j] = before + lines[j].distance(one[i]);
        }
    }
    let (mut i, mut j) = (n - 1, m - 1);
    let mut pairs = vec![(i, j)];
    while (i, j) != (0, 0) {
        let diagonal = if i > 0 && j > 0 { cost[(i - 1) * m + j - 1] } else { f64::INFINITY };
        let up = if i > 0 { cost[(i - 1) * m + j] + 0.02 } else { f64::INFINITY };
        let left = if j > 0 { cost[i * m + j - 1] + 0.02 } else { f64::INFINITY };
        if diagonal <= up && diagonal <= left {
            (i, j) = (i - 1, j - 1);
        } else if up <= left {
            i -= 1;
        } else {
            j -= 1;
        }
        pairs.push((i, j));
    }
    pairs.reverse();
    pairs
}

/// Squared Mahalanobis distances (2 degrees of freedom) of the truth from a fitted curve, across the
/// curve, at `count` places inside.
pub fn distances_across(
    curve: &Curve3,
    covariance: &CurveCovariance,
    truth: &[Point3],
    count: usize,
) -> Vec<f64> {
    let (start, end) = curve.domain();
    (1..=count)
        .map(|k| {
            let t = start + (end - start) * k as f64 / (count + 1) as f64;
            let p = curve.at(t);
            let (axes, spread) = covariance.across(curve, t);
            let nearest = truth.windows(2).map(|w| {
                let e = w[1] - w[0];
                let s =
                    ((p - w[0]).dot(&e) / e.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                w[0] + e * s - p
            });
            let off = nearest.min_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap();
            let e = Vector2::new(axes[0].dot(&off), axes[1].dot(&off));
            e.dot(&(spread.try_inverse().unwrap() * e))
        })
        .collect()
}
