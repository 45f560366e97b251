use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Camera, Pixel, Point3, Rig, View};
use serde_json::{Value, json};

use super::Provenance;
use super::images::{cost_image, view_image};
use crate::{ConsideredCurve, Error, NOT_FOR_CLINICAL_USE, Reconstruction, ViewPair};

/// Everything the page shows, as it expects it.
pub(super) fn content(
    pair: &ViewPair,
    reconstruction: &Reconstruction,
    scores: Option<&Value>,
    provenance: &Provenance,
) -> Result<Value, Error> {
    let r = reconstruction;
    let digits = WorldDigits::of(&r.positions());
    let parameters: serde_json::Map<String, Value> =
        provenance.parameters.iter().map(|(stage, text)| (stage.clone(), json!(text))).collect();
    let inputs: Vec<Value> = provenance
        .inputs
        .iter()
        .map(|(file, hash)| json!({"file": file, "blake3": hash}))
        .collect();
    Ok(json!({
        "case": r.id,
        "method": r.method.name(),
        "input": r.input.name(),
        "unit": r.unit.label(),
        "note": NOT_FOR_CLINICAL_USE,
        "suspicions": r.diagnostics.reasons(),
        "diagnostics": r.diagnostics,
        "scores": scores,
        "curve": curve(r, digits),
        "truth": pair.truth.as_ref().map(|truth| digits.points(truth)),
        "fundamental": rows(pair.rig.fundamental().matrix()),
        "views": [
            view(pair, 0, pair.rig.camera1(), pixels(&r.traces.points1))?,
            view(pair, 1, pair.rig.camera2(), pixels(&r.traces.points2))?,
        ],
        "match": cost_image(&r.traces, &pair.rig)?,
        "candidates": r
            .explanation
            .candidates
            .iter()
            .map(|c| candidate(c, &pair.rig))
            .collect::<Vec<_>>(),
        "junctions": r.explanation.junctions,
        "provenance": {
            "version": provenance.version,
            "pair": provenance.pair,
            "parameters": parameters,
            "inputs": inputs,
        },
    }))
}

fn curve(r: &Reconstruction, digits: WorldDigits) -> Value {
    let mut travelled = 0.0;
    let mut before: Option<Point3> = None;
    let arc: Vec<f64> = r
        .points
        .iter()
        .map(|p| {
            travelled += before.map_or(0.0, |b| (p.position - b).norm());
            before = Some(p.position);
            digits.round(travelled)
        })
        .collect();
    let positions = r.positions();
    let sigma =
        r.sigmas_across().map(|sigmas| sigmas.into_iter().map(significant).collect::<Vec<_>>());
    json!({
        "points": digits.points(&positions),
        "arc": arc,
        "sigma": sigma,
        "along": r.along_epipolar_line,
        "pixels1": pixels(r.points.iter().map(|p| &p.pixel1)),
        "pixels2": pixels(r.points.iter().map(|p| &p.pixel2)),
        "distance": r.points.iter().map(|p| hundredth(p.epipolar_distance_px)).collect::<Vec<_>>(),
    })
}

fn view(
    pair: &ViewPair,
    index: usize,
    camera: &Camera,
    trace: Vec<[f64; 2]>,
) -> Result<Value, Error> {
    let (kind, image) = view_image(pair, index)?;
    let centre = camera.centre();
    Ok(json!({
        "width": camera.size().width,
        "height": camera.size().height,
        "kind": kind,
        "image": image,
        "trace": trace,
        "rotation": rows(camera.r()),
        "centre": [centre.x, centre.y, centre.z],
    }))
}

fn candidate(c: &ConsideredCurve, rig: &Rig) -> Value {
    // A point behind a camera has no picture there.
    let seen: Vec<_> = c.points.iter().filter_map(|p| rig.project(p).ok()).collect();
    json!({
        "walks": c.walks,
        "reversed": c.reversed,
        "score": c.score,
        "unlikeliness": c.unlikeliness,
        "unexplained": c.unexplained,
        "outside": c.outside,
        "chi_per_point": c.chi_per_point,
        "mean_distance_px": c.mean_distance_px,
        "pixels": [
            pixels(seen.iter().map(|(p, _)| p)),
            pixels(seen.iter().map(|(_, p)| p)),
        ],
    })
}

fn rows(matrix: &Matrix3<f64>) -> Vec<[f64; 3]> {
    (0..3).map(|row| [0, 1, 2].map(|column| matrix[(row, column)])).collect()
}

fn pixels<'a, V: View>(points: impl IntoIterator<Item = &'a Pixel<V>>) -> Vec<[f64; 2]> {
    points.into_iter().map(|p| [hundredth(p.x), hundredth(p.y)]).collect()
}

/// What a screen can show of a pixel coordinate.
fn hundredth(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

/// Four significant digits.
fn significant(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return 0.0;
    }
    let scale = 10f64.powi(3 - value.abs().log10().floor() as i32);
    let rounded = (value * scale).round() / scale;
    // The scale of a subnormal overflows.
    if rounded.is_finite() { rounded } else { value }
}

/// Decimals that resolve a millionth of a curve's extent: more would only make the file longer.
#[derive(Clone, Copy)]
struct WorldDigits {
    scale: f64,
}

impl WorldDigits {
    fn of(points: &[Point3]) -> Self {
        let (mut low, mut high) = (points[0], points[0]);
        for p in points {
            (low, high) = (low.inf(p), high.sup(p));
        }
        let extent = (high - low).amax();
        let decimals = if extent > 0.0 { (6.0 - extent.log10()).ceil() } else { 6.0 };
        Self { scale: 10f64.powi(decimals.clamp(0.0, 15.0) as i32) }
    }

    fn round(self, value: f64) -> f64 {
        let rounded = (value * self.scale).round() / self.scale;
        if rounded.is_finite() { rounded } else { value }
    }

    fn points(self, points: &[Point3]) -> Vec<[f64; 3]> {
        points.iter().map(|p| [p.x, p.y, p.z].map(|v| self.round(v))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_keeps_the_digits_it_names() {
        assert_eq!(significant(0.000123456), 0.0001235);
        assert_eq!(significant(98_765.0), 98_770.0);
        assert_eq!(significant(0.0), 0.0);
        assert!(significant(5e-324).is_finite());
        let digits = WorldDigits::of(&[Point3::origin(), Point3::new(400.0, 0.0, 0.0)]);
        assert_eq!(digits.round(1.234_567_89), 1.2346);
        let dot = WorldDigits::of(&[Point3::origin()]);
        assert_eq!(dot.round(0.123_456_78), 0.123_457);
    }
}
