use accurate_fit::{OutlineFitParams, start_curve};
use accurate_geom::{Curve3, Pixel, Point3, Rig, View, View1, View2};
use accurate_match::{FreeEnds, FreeMatchParams, FreeMatcher, MovePrices};

use super::shape::arc_lengths_px;

/// Prices of the alignment that a fit starts from: a trimmed tip costs little, for only ends that a
/// walk itself doubts may be trimmed.
pub(crate) const PRICES: MovePrices =
    MovePrices { diagonal_weight: 2.0, step: 0.02, end_skip: 0.06, gap_open: 3.0, gap_skip: 0.9 };

/// The same where steps cost next to nothing, so that only distances count.
pub(crate) const OTHER_PRICES: MovePrices = MovePrices { diagonal_weight: 1.0, ..PRICES };

/// A 3D curve from two walks, and the mean epipolar distance of their alignment, px.
///
/// Aligned at full length with the ends free that the walks doubt; stretches along epipolar lines
/// are bridged; triangulated and smoothed. `None` if the pair gives no curve (nothing triangulates
/// in front of both cameras, no length): such a pair is no candidate.
pub(crate) fn start_from(
    prices: &MovePrices,
    walk1: (&[Pixel<View1>], FreeEnds),
    walk2: (&[Pixel<View2>], FreeEnds),
    reversed: bool,
    rig: &Rig,
    knot_spacing_px: f64,
) -> Option<(Curve3, f64)> {
    let matcher = FreeMatcher::new(FreeMatchParams {
        prices: *prices,
        free1: walk1.1,
        free2: walk2.1,
        near_coarse_path: true,
        ..FreeMatchParams::DEFAULT
    });
    let matched = matcher.match_directed(walk1.0, walk2.0, reversed, rig).ok()?;
    let (arc1, arc2) = (arc_lengths(walk1.0), arc_lengths(walk2.0));
    let along2 = |j: f64| {
        let s = at(&arc2, j);
        if reversed { arc2[arc2.len() - 1] - s } else { s }
    };
    let arc: Vec<f64> =
        matched.positions.iter().map(|&(i, j)| (at(&arc1, i) + along2(j)) / 2.0).collect();
    let points: Vec<_> = matched.points.iter().map(|p| p.position).collect();
    let curve = start_curve(&points, &arc, knot_spacing_px).ok()?;
    Some((curve, matched.mean_epipolar_distance_px))
}

/// A start through dense points of a curve.
pub(crate) fn through(points: &[Point3], px_per_unit: f64) -> Option<Curve3> {
    let arc = arc_lengths_px(points, px_per_unit);
    start_curve(points, &arc, OutlineFitParams::DEFAULT.knot_spacing_px).ok()
}

/// Arc length at a fractional index.
fn at(arc: &[f64], index: f64) -> f64 {
    let below = (index.max(0.0) as usize).min(arc.len() - 1);
    let above = (below + 1).min(arc.len() - 1);
    arc[below] + (index - below as f64) * (arc[above] - arc[below])
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
