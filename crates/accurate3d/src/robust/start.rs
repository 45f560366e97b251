use accurate_fit::start_curve;
use accurate_geom::{Curve3, Pixel, Rig, Triangulation, Triangulator, View, View1, View2};
use accurate_match::{CostModel, DistanceKind, TieOrder, align_rows};

/// A 3D curve from two walks: aligned at full length, triangulated, smoothed.
///
/// `None` if the pair gives no curve (nothing triangulates in front of both cameras, no length):
/// such a pair is no candidate.
pub(crate) fn start_from(
    walk1: &[Pixel<View1>],
    walk2: &[Pixel<View2>],
    rig: &Rig,
    knot_spacing_px: f64,
) -> Option<(Curve3, f64)> {
    let model = CostModel::new(rig.fundamental(), walk1, walk2, DistanceKind::Sampson).ok()?;
    let fill = |i: usize, row: &mut [f64]| model.fill_row(i, row);
    let alignment = align_rows(walk1.len(), walk2.len(), fill, TieOrder::DiagonalFirst).ok()?;
    let path = trimmed(&alignment.path);
    let (arc1, arc2) = (arc_lengths(walk1), arc_lengths(walk2));
    let triangulator = Triangulator::new(rig, Triangulation::LindstromNiter2);
    let mut points = Vec::with_capacity(path.len());
    let mut arc = Vec::with_capacity(path.len());
    for &(i, j) in path {
        let Ok(point) = triangulator.triangulate(walk1[i], walk2[j]) else { continue };
        if rig.camera1().depth(&point) > 0.0 && rig.camera2().depth(&point) > 0.0 {
            points.push(point);
            arc.push((arc1[i] + arc2[j]) / 2.0);
        }
    }
    let curve = start_curve(&points, &arc, knot_spacing_px).ok()?;
    Some((curve, alignment.mean_cost()))
}

/// The path without the runs along one curve at its corners: there the other view has ended.
fn trimmed(path: &[(usize, usize)]) -> &[(usize, usize)] {
    let (first, last) = (path[0], path[path.len() - 1]);
    let at = |corner: (usize, usize)| move |c: &&(usize, usize)| c.0 == corner.0 || c.1 == corner.1;
    let head = path.iter().take_while(at(first)).count().saturating_sub(1);
    let tail = path.iter().rev().take_while(at(last)).count().saturating_sub(1);
    if head + tail + 4 > path.len() { path } else { &path[head..path.len() - tail] }
}

fn arc_lengths<V: View>(points: &[Pixel<V>]) -> Vec<f64> {
    let mut length = 0.0;
    let mut arc = Vec::with_capacity(points.len());
    for (k, point) in points.iter().enumerate() {
        if k > 0 {
            length += point.distance(points[k - 1]);
        }
        arc.push(length);
    }
    arc
}
