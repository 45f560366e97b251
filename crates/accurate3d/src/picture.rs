use std::fmt::Write;

use accurate_geom::{Camera, LengthUnit, Point2, Point3, nalgebra::Matrix3};
use ndarray::Array2;

use crate::{Reconstruction, ViewPair};

pub(crate) const PANEL: f64 = 420.0;
const MARGIN: f64 = 18.0;
const TITLE: f64 = 30.0;
const FOOTER: f64 = 46.0;

/// An SVG picture of a reconstruction: both views with the trace over the mask, and the 3D curve
/// beside the truth where there is one. The same input gives the same bytes.
pub fn picture_svg(pair: &ViewPair, reconstruction: &Reconstruction) -> String {
    let width = 3.0 * PANEL + 4.0 * MARGIN;
    let height = TITLE + PANEL + FOOTER + MARGIN;
    let mut svg = String::new();
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"14\">\n<rect width=\"100%\" height=\"100%\" \
         fill=\"#ffffff\"/>\n"
    );
    let trace1: Vec<_> = reconstruction.traces.points1.iter().map(|p| p.point()).collect();
    let trace2: Vec<_> = reconstruction.traces.points2.iter().map(|p| p.point()).collect();
    let views = [(pair.rig.camera1(), trace1), (pair.rig.camera2(), trace2)];
    for (index, (camera, trace)) in views.iter().enumerate() {
        let left = MARGIN + index as f64 * (PANEL + MARGIN);
        let mask = pair.masks.as_ref().map(|masks| &masks[index]);
        view_panel(&mut svg, left, index + 1, camera, mask, trace);
    }
    curve_panel(&mut svg, 3.0 * MARGIN + 2.0 * PANEL, pair, reconstruction);
    let d = &reconstruction.diagnostics;
    let _ = write!(
        svg,
        "<text x=\"{MARGIN}\" y=\"{:.1}\" fill=\"#333\">{}: {} from {}, {} points, {:.1} {}, mean \
         epipolar distance {:.2} px. {}</text>\n</svg>\n",
        height - MARGIN,
        escape(&reconstruction.id),
        reconstruction.method,
        reconstruction.input,
        reconstruction.points.len(),
        reconstruction.length(),
        reconstruction.unit,
        d.mean_epipolar_distance_px,
        crate::NOT_FOR_CLINICAL_USE,
    );
    svg
}

pub(crate) fn view_panel(
    svg: &mut String,
    left: f64,
    number: usize,
    camera: &Camera,
    mask: Option<&Array2<bool>>,
    trace: &[Point2],
) {
    let size = camera.size();
    let scale = PANEL / f64::from(size.width.max(size.height));
    let (w, h) = (f64::from(size.width) * scale, f64::from(size.height) * scale);
    let x0 = left + (PANEL - w) / 2.0;
    titled_frame(svg, left, &format!("View {number}, {} x {} px", size.width, size.height));
    let _ = writeln!(
        svg,
        "<g transform=\"translate({:.3} {TITLE}) scale({scale:.6}) translate(0.5 0.5)\">\n\
         <rect x=\"-0.5\" y=\"-0.5\" width=\"{}\" height=\"{}\" fill=\"#f4f4f1\"/>",
        x0, size.width, size.height
    );
    debug_assert!(h <= PANEL + 1e-9);
    if let Some(mask) = mask {
        let _ = writeln!(svg, "<path d=\"{}\" fill=\"#b9b9b2\"/>", mask_runs(mask));
    }
    polyline(svg, trace.iter().map(|p| (p.x, p.y)), "#c2410c", 1.6 / scale);
    if let (Some(first), Some(last)) = (trace.first(), trace.last()) {
        for (p, colour) in [(first, "#15803d"), (last, "#1d4ed8")] {
            let _ = writeln!(
                svg,
                "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{:.2}\" fill=\"{colour}\"/>",
                p.x,
                p.y,
                4.0 / scale
            );
        }
    }
    svg.push_str("</g>\n");
}

/// The 3D curve seen along the direction in which it extends least, so that most of it shows.
pub(crate) fn curve_panel(
    svg: &mut String,
    left: f64,
    pair: &ViewPair,
    reconstruction: &Reconstruction,
) {
    let truth = pair.truth.as_deref().unwrap_or(&[]);
    let title = if truth.is_empty() { "3D curve" } else { "3D curve (orange) on truth (grey)" };
    plane_panel(svg, left, title, truth, &reconstruction.positions(), reconstruction.unit);
}

/// A curve of at least one point in orange on a truth, which may be empty, in grey.
pub(crate) fn plane_panel(
    svg: &mut String,
    left: f64,
    title: &str,
    truth: &[Point3],
    curve: &[Point3],
    unit: LengthUnit,
) {
    titled_frame(svg, left, title);
    let reference = if truth.is_empty() { curve } else { truth };
    let flatten = principal_plane(reference);
    let points: Vec<Point2> = reference.iter().chain(curve).map(&flatten).collect();
    let (low, high) =
        points.iter().fold((points[0], points[0]), |(low, high), p| (low.inf(p), high.sup(p)));
    // A single point has none.
    let extent = Some((high - low).amax()).filter(|extent| *extent > 0.0).unwrap_or(1.0);
    let scale = (PANEL - 50.0) / extent;
    let centre = Point2::from((low.coords + high.coords) / 2.0);
    let place = |p: &Point3| {
        let q = (flatten(p) - centre) * scale;
        (left + PANEL / 2.0 + q.x, TITLE + PANEL / 2.0 + q.y)
    };
    polyline(svg, truth.iter().map(place), "#9ca3af", 5.0);
    polyline(svg, curve.iter().map(place), "#c2410c", 1.6);
    let bar = nice_length(extent / 4.0);
    let (x, y) = (left + 14.0, TITLE + PANEL - 16.0);
    let _ = writeln!(
        svg,
        "<path d=\"M{x:.1} {y:.1}h{:.2}\" stroke=\"#333\" stroke-width=\"2\"/>\n\
         <text x=\"{x:.1}\" y=\"{:.1}\" fill=\"#333\">{bar} {}</text>",
        bar * scale,
        y - 6.0,
        unit
    );
}

pub(crate) fn titled_frame(svg: &mut String, left: f64, title: &str) {
    let _ = writeln!(
        svg,
        "<text x=\"{left:.1}\" y=\"20\" fill=\"#111\">{title}</text>\n<rect x=\"{left:.1}\" \
         y=\"{TITLE}\" width=\"{PANEL}\" height=\"{PANEL}\" fill=\"none\" stroke=\"#d4d4d4\"/>"
    );
}

pub(crate) fn polyline(
    svg: &mut String,
    points: impl Iterator<Item = (f64, f64)>,
    colour: &str,
    width: f64,
) {
    let mut path = String::new();
    for (i, (x, y)) in points.enumerate() {
        let _ = write!(path, "{}{x:.2} {y:.2}", if i == 0 { "M" } else { "L" });
    }
    if !path.is_empty() {
        let _ = writeln!(
            svg,
            "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width:.2}\" \
             stroke-linejoin=\"round\" stroke-linecap=\"round\"/>"
        );
    }
}

/// One rectangle per horizontal run of foreground.
pub(crate) fn mask_runs(mask: &Array2<bool>) -> String {
    let mut path = String::new();
    for (y, row) in mask.rows().into_iter().enumerate() {
        let mut start = None;
        for x in 0..=row.len() {
            let on = x < row.len() && row[x];
            match (start, on) {
                (None, true) => start = Some(x),
                (Some(from), false) => {
                    let (left, top) = (from as f64 - 0.5, y as f64 - 0.5);
                    let _ = write!(path, "M{left} {top}h{}v1h-{}z", x - from, x - from);
                    start = None;
                }
                _ => {}
            }
        }
    }
    path
}

/// Projects onto the two principal axes of the points, with signs fixed by the axes' largest entry.
fn principal_plane(points: &[Point3]) -> impl Fn(&Point3) -> Point2 + use<> {
    let mean = points.iter().map(|p| p.coords).sum::<accurate_geom::nalgebra::Vector3<f64>>()
        / points.len() as f64;
    let covariance: Matrix3<f64> =
        points.iter().map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
    let eigen = covariance.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axis = |k: usize| {
        let v = eigen.eigenvectors.column(order[k]).into_owned();
        if v[v.iamax()] < 0.0 { -v } else { v }
    };
    let (long, short) = (axis(0), axis(1));
    move |p| Point2::new((p.coords - mean).dot(&long), (p.coords - mean).dot(&short))
}

/// The largest of 1, 2, 5 times a power of ten that is not above `length`.
fn nice_length(length: f64) -> f64 {
    let power = 10f64.powf(length.log10().floor());
    let lead = length / power;
    power
        * if lead >= 5.0 {
            5.0
        } else if lead >= 2.0 {
            2.0
        } else {
            1.0
        }
}

pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_bars_are_round_numbers() {
        for (length, bar) in [(0.9, 0.5), (1.0, 1.0), (3.7, 2.0), (49.0, 20.0), (51.0, 50.0)] {
            assert!((nice_length(length) - bar).abs() < 1e-12 * bar, "{length}");
        }
    }

    #[test]
    fn a_mask_becomes_one_rectangle_per_run() {
        let mask = ndarray::arr2(&[[true, true, false, true], [false, false, true, true]]);
        assert_eq!(mask_runs(&mask).matches('M').count(), 3);
    }

    #[test]
    fn names_cannot_break_the_markup() {
        assert_eq!(escape("<a&b>"), "&lt;a&amp;b&gt;");
    }
}
