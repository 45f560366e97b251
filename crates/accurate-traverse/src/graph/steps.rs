//! Places on an edge where the body becomes thinner: a strand that ran beside the other ends or
//! turns there without a branch of the skeleton to show for it.

use accurate_geom::View;
use nalgebra::Vector2;
use ndarray::Array2;

use super::{GraphEdge, GraphNode, GraphParams, NodeKind, split_edge};
use crate::body_end::free_up_to as rim;

/// Half of the window over which widths are averaged, samples of 1 px. A mask's pixels put an error
/// of up to 0.7 px on a single width.
const HALF_WINDOW: usize = 3;
/// Half of the chord that gives a normal, samples of 1 px.
const HALF_CHORD: usize = 3;

/// Splits edges where a stretch of at least [`GraphParams::step_length_px`] that is
/// [`GraphParams::step_px`] wider than the body begins or ends.
pub(super) fn split<V: View>(
    nodes: &mut Vec<GraphNode<V>>,
    edges: &mut Vec<GraphEdge<V>>,
    radii: &Array2<f64>,
    mask_thickness_px: f64,
    params: &GraphParams,
) {
    let widths: Vec<Vec<f64>> =
        edges.iter().map(|edge| widths(edge, radii, 2.0 * mask_thickness_px)).collect();
    let mut sorted: Vec<f64> = widths.iter().flatten().copied().collect();
    if sorted.is_empty() {
        return;
    }
    let middle = sorted.len() / 2;
    let (_, &mut median, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
    for (edge, widths) in widths.iter().enumerate() {
        let last = widths.len() - 1;
        let mut cuts: Vec<usize> = Vec::new();
        let mut start = None;
        for k in 0..=last + 1 {
            let wide = k <= last && widths[k] > median + params.step_px;
            match (wide, start) {
                (true, None) => start = Some(k),
                (false, Some(from)) => {
                    if (k - from) as f64 >= params.step_length_px {
                        cuts.extend([from, k - 1]);
                    }
                    start = None;
                }
                _ => {}
            }
        }
        // From the last to the first: what is cut off is appended, the rest stays in its place.
        let mut end = last;
        for cut in cuts.into_iter().rev() {
            if cut as f64 >= params.snap_px && (end - cut) as f64 >= params.snap_px {
                split_edge(nodes, edges, edge, cut, NodeKind::WidthStep);
                end = cut;
            }
        }
    }
}

/// Twice the smaller distance to the rim along the normal, averaged: beside a fork one side is
/// wide, where two strands have merged both are.
fn widths<V: View>(edge: &GraphEdge<V>, radii: &Array2<f64>, most: f64) -> Vec<f64> {
    let last = edge.points.len() - 1;
    let at = |k: usize| edge.points[k].point();
    let single: Vec<f64> = (0..=last)
        .map(|k| {
            let along = at((k + HALF_CHORD).min(last)) - at(k.saturating_sub(HALF_CHORD));
            let Some(along) = along.try_normalize(0.0) else { return 0.0 };
            let normal = Vector2::new(-along.y, along.x);
            2.0 * rim(radii, at(k), normal, most).min(rim(radii, at(k), -normal, most))
        })
        .collect();
    (0..=last)
        .map(|k| {
            let window =
                &single[k.saturating_sub(HALF_WINDOW)..(k + HALF_WINDOW + 1).min(last + 1)];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use accurate_geom::{Pixel, View1};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// A straight bar, wider on some stretch by whole pixels on either side.
        #[test]
        fn a_long_wide_stretch_is_cut_where_it_begins_and_ends(
            half in 2..5_usize, start in 25..50_usize, length in 0..32_usize,
            more in [0..3_usize, 0..3_usize], upright: bool,
        ) {
            let wide = |k: usize| (start..start + length).contains(&k);
            let inside = |k: usize, across: usize| {
                across.abs_diff(20) <= half + if wide(k) { more[usize::from(across < 20)] } else { 0 }
            };
            let radii = Array2::from_shape_fn((120, 120), |(y, x)| {
                let (k, across) = if upright { (y, x) } else { (x, y) };
                f64::from(u8::from(inside(k, across)))
            });
            let points: Vec<Pixel<View1>> = (5..115)
                .map(f64::from)
                .map(|k| if upright { Pixel::new(20.0, k) } else { Pixel::new(k, 20.0) })
                .collect();
            let whole = GraphEdge::body([0, 1], points.clone(), vec![1.0; 110]);
            let tip = |at| GraphNode { at, degree: 1, kind: NodeKind::Tip };
            let mut nodes = vec![tip(points[0]), tip(points[109])];
            let mut edges = vec![whole.clone()];
            let params = GraphParams { step_length_px: 15.0, ..GraphParams::DEFAULT };
            split(&mut nodes, &mut edges, &radii, (2 * half + 1) as f64, &params);
            // Widths are averaged over 3 px on both sides, which lengthens a stretch by at most those.
            // It does not shorten one: at its ends 4 of 7 px are wide by 2 px, and 8 / 7 px exceed the step.
            let counts = more[0].min(more[1]) > 0;
            if !counts || length + 6 < 15 {
                prop_assert_eq!((nodes.len(), edges), (2, vec![whole]));
            } else if length >= 15 {
                prop_assert_eq!((nodes.len(), edges.len()), (4, 3));
                let mut cuts: Vec<f64> = Vec::new();
                for node in &nodes[2..] {
                    prop_assert_eq!((node.kind, node.degree), (NodeKind::WidthStep, 2));
                    cuts.push(if upright { node.at.y } else { node.at.x });
                }
                cuts.sort_by(f64::total_cmp);
                prop_assert!((cuts[0] - start as f64).abs() <= 3.0, "{:?}", cuts);
                prop_assert!((cuts[1] - (start + length - 1) as f64).abs() <= 3.0, "{:?}", cuts);
                // In order, the parts are the whole.
                let (mut joined, mut node) = (vec![points[0]], 0);
                for _ in 0..3 {
                    let part = edges.iter().find(|edge| edge.ends[0] == node).unwrap();
                    prop_assert_eq!(part.points[0], nodes[node].at);
                    joined.extend_from_slice(&part.points[1..]);
                    node = part.ends[1];
                }
                prop_assert_eq!((joined, node), (points, 1));
            }
        }
    }
}
