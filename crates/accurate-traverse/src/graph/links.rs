//! Links: what may be hidden between a tip and another tip, or the body ahead of it.

use accurate_geom::{Point2, View};
use nalgebra::Vector2;

use super::{GraphEdge, GraphNode, GraphParams, NodeKind, split_edge};

/// A tip and the direction in which the body would go on.
struct Tip {
    node: usize,
    edge: usize,
    /// End of the edge, 0 or 1.
    side: usize,
    at: Point2,
    ahead: Vector2<f64>,
}

/// Where a ray meets the body: point `index` of `edge`.
#[derive(Clone, Copy)]
struct Hit {
    tip: usize,
    edge: usize,
    index: usize,
}

/// Appends the links; splits the edges on which one ends.
pub(super) fn add<V: View>(
    nodes: &mut Vec<GraphNode<V>>,
    edges: &mut Vec<GraphEdge<V>>,
    params: &GraphParams,
) {
    let tips = tips(nodes, edges);
    let mut ends: Vec<[usize; 2]> = Vec::new();
    for (i, a) in tips.iter().enumerate() {
        for b in &tips[i + 1..] {
            let across = b.at - a.at;
            let distance = across.norm();
            let facing = |tip: &Tip, way: Vector2<f64>| {
                tip.ahead.dot(&way) >= params.far_link_cosine * distance
            };
            let far = distance <= params.far_link_px && facing(a, across) && facing(b, -across);
            if distance <= params.near_link_px || far {
                ends.push([a.node, b.node]);
            }
        }
    }
    let mut cuts: Vec<Hit> = Vec::new();
    for index in 0..tips.len() {
        let Some(hit) = first_hit(&tips, index, edges, params) else { continue };
        let [first, last] = edges[hit.edge].ends;
        let after = hit.index as f64;
        let before = (edges[hit.edge].points.len() - 1 - hit.index) as f64;
        if after.min(before) >= params.snap_px {
            cuts.push(hit);
            continue;
        }
        let (node, own) = (if after <= before { first } else { last }, tips[index].node);
        // A tip met head-on was linked above, if it may be.
        if node != own && !nodes[node].is_tip() {
            ends.push([own, node]);
        }
    }
    split(nodes, edges, &tips, cuts, params.snap_px, &mut ends);
    for [a, b] in ends {
        edges.push(GraphEdge::bridge([a, b], nodes[a].at, nodes[b].at));
    }
}

fn tips<V: View>(nodes: &[GraphNode<V>], edges: &[GraphEdge<V>]) -> Vec<Tip> {
    let mut tips = Vec::new();
    for (index, edge) in edges.iter().enumerate() {
        for side in 0..2 {
            let node = edge.ends[side];
            if nodes[node].is_tip() {
                let at = nodes[node].at.point();
                // Over 10 px: skeletons bend towards corners of the mask in the last few.
                let ahead = (at - edge.near_end(side, 10)).try_normalize(0.0).unwrap_or_default();
                tips.push(Tip { node, edge: index, side, at, ahead });
            }
        }
    }
    tips
}

/// The first point of the body inside the cone ahead of the tip.
fn first_hit<V: View>(
    tips: &[Tip],
    tip: usize,
    edges: &[GraphEdge<V>],
    params: &GraphParams,
) -> Option<Hit> {
    let Tip { edge: own, side, at, ahead, .. } = tips[tip];
    let mut best: Option<(f64, Hit)> = None;
    for (edge, body) in edges.iter().enumerate() {
        let last = body.points.len() - 1;
        for (index, point) in body.points.iter().enumerate() {
            let from_tip = if side == 0 { index } else { last - index };
            if edge == own && (from_tip as f64) < params.ray_blind_px {
                continue;
            }
            let offset = point.point() - at;
            let along = offset.dot(&ahead);
            if !(params.ray_from_px..=params.far_link_px).contains(&along) {
                continue;
            }
            let across = offset.perp(&ahead).abs();
            // Nearest along the ray, and on the body's crossing of it rather than at its rim.
            let rank = along + across;
            if across <= params.ray_half_width_px + params.ray_slope * along
                && best.as_ref().is_none_or(|(least, _)| rank < *least)
            {
                best = Some((rank, Hit { tip, edge, index }));
            }
        }
    }
    best.map(|(_, hit)| hit)
}

/// Splits edges at the hits; hits within `snap_px` share a node.
fn split<V: View>(
    nodes: &mut Vec<GraphNode<V>>,
    edges: &mut Vec<GraphEdge<V>>,
    tips: &[Tip],
    mut cuts: Vec<Hit>,
    snap_px: f64,
    ends: &mut Vec<[usize; 2]>,
) {
    cuts.sort_by_key(|hit| (hit.edge, hit.index));
    // From the last cut of an edge to the first: what is cut off is appended, the rest stays.
    let mut later: Option<(usize, usize, usize)> = None;
    for hit in cuts.into_iter().rev() {
        let node = match later {
            Some((edge, index, node))
                if edge == hit.edge && ((index - hit.index) as f64) < snap_px =>
            {
                node
            }
            _ => {
                let node = split_edge(nodes, edges, hit.edge, hit.index, NodeKind::LinkFoot);
                later = Some((hit.edge, hit.index, node));
                node
            }
        };
        ends.push([tips[hit.tip].node, node]);
    }
}
