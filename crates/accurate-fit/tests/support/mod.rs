//! Curves and distances for the tests.
#![allow(dead_code, clippy::unwrap_used)]

use accurate_geom::{Curve3, Point3};
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
