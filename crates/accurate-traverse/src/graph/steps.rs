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
