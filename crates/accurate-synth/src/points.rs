//! Ordered points of one view: exact, and as the paper makes them.

use std::collections::BTreeMap;

use accurate_geom::{ImageSize, Pixel, View};

use crate::polyline::locate;
use crate::projection::Projection;

/// Exact points about 1 px apart along the visible stretches, and the arc length (world unit) of
/// the point of the truth that each one shows.
pub(crate) fn exact<V: View>(
    projection: &Projection,
    truth_arc: &[f64],
    gaps: &[(f64, f64)],
) -> (Vec<Pixel<V>>, Vec<f64>) {
    let mut points = Vec::new();
    let mut arcs = Vec::new();
    for (from, to) in projection.visible(gaps) {
        let steps = (to - from).round().max(1.0);
        for k in 0..=steps as usize {
            let s = from + (to - from) * k as f64 / steps;
            points.push(projection.at(s).into());
            let (segment, along) = projection.locate_in_3d(s);
            let length = truth_arc[segment + 1] - truth_arc[segment];
            arcs.push(truth_arc[segment] + length * along);
        }
    }
    (points, arcs)
}

/// The paper's "ordered points": the truth's vertices rounded to integer pixels through a z-buffer
/// (each pixel keeps the vertex nearest to the camera, the first of equals), listed in the order of
/// the truth. Every pixel occurs once: at a crossing the far strand has a gap.
pub(crate) fn rounded<V: View>(
    projection: &Projection,
    size: ImageSize,
    gaps: &[(f64, f64)],
) -> Vec<Pixel<V>> {
    let mut nearest: BTreeMap<(i64, i64), usize> = BTreeMap::new();
    for (index, (point, &depth)) in projection.points.iter().zip(&projection.depth).enumerate() {
        let s = projection.arc[index];
        if gaps.iter().any(|&(start, end)| start < s && s < end) {
            continue;
        }
        let (x, y) = (point.x.round() as i64, point.y.round() as i64);
        if !(0..i64::from(size.width)).contains(&x) || !(0..i64::from(size.height)).contains(&y) {
            continue;
        }
        nearest
            .entry((x, y))
            .and_modify(|kept| {
                if depth < projection.depth[*kept] {
                    *kept = index;
                }
            })
            .or_insert(index);
    }
    let mut visible: Vec<_> = nearest.into_iter().map(|(pixel, index)| (index, pixel)).collect();
    visible.sort_unstable();
    visible.into_iter().map(|(_, (x, y))| Pixel::new(x as f64, y as f64)).collect()
}

/// The point of a polyline at arc length `s` (its cumulative lengths are `arc`).
pub(crate) fn at_arc(
    truth: &[accurate_geom::Point3],
    arc: &[f64],
    s: f64,
) -> accurate_geom::Point3 {
    let (k, along) = locate(arc, s);
    truth[k] + (truth[k + 1] - truth[k]) * along
}
