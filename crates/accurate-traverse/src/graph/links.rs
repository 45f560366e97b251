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

#[cfg(test)]
mod tests {
    use accurate_geom::{Pixel, View1};
    use proptest::prelude::*;

    use super::*;

    type Graph = (Vec<GraphNode<View1>>, Vec<GraphEdge<View1>>);

    /// Straight strokes of `n` points 1 px apart: `(x, y, direction, n, kind of its nodes)`.
    fn strokes(strokes: &[(f64, f64, f64, u8, NodeKind)]) -> Graph {
        let (mut nodes, mut edges) = (Vec::new(), Vec::new());
        for &(x, y, direction, n, kind) in strokes {
            let (sin, cos) = direction.sin_cos();
            let at = |k| Pixel::new(x + f64::from(k) * cos, y + f64::from(k) * sin);
            let ends = [nodes.len(), nodes.len() + 1];
            nodes.extend([0, n - 1].map(|k| GraphNode { at: at(k), degree: 1, kind }));
            edges.push(GraphEdge::body(ends, (0..n).map(at).collect(), vec![1.0; n.into()]));
        }
        (nodes, edges)
    }

    /// The ends of the links, which join their nodes.
    fn linked((nodes, edges): &Graph) -> Vec<[usize; 2]> {
        let links = edges.iter().filter(|edge| edge.link);
        let check = |link: &GraphEdge<View1>| {
            assert_eq!(link.points, link.ends.map(|node| nodes[node].at));
            link.ends
        };
        links.map(check).collect()
    }

    /// No tip links to another.
    const RAYS: GraphParams =
        GraphParams { near_link_px: 0.0, far_link_cosine: 1.0, ..GraphParams::DEFAULT };

    proptest! {
        #[test]
        fn tips_are_linked_that_are_near_or_point_at_each_other(
            given in prop::collection::vec((0.0..120.0_f64, 0.0..120.0_f64, 0.0..6.2_f64, 12..60_u8), 1..6),
        ) {
            let given: Vec<_> = given.iter().map(|&(x, y, a, n)| (x, y, a, n, NodeKind::Tip)).collect();
            // No ray begins that far away.
            let params = GraphParams { ray_from_px: 1e9, ..GraphParams::DEFAULT };
            let before = strokes(&given);
            let (mut nodes, mut edges) = before.clone();
            add(&mut nodes, &mut edges, &params);
            prop_assert_eq!((&nodes, &edges[..given.len()]), (&before.0, &before.1[..]));
            let mut expected = Vec::new();
            for b in 0..nodes.len() {
                for a in 0..b {
                    let way = nodes[b].at.point() - nodes[a].at.point();
                    // Between the stroke, on from its end, and the way to the other tip.
                    let cosine = |node: usize, way: Vector2<f64>| {
                        let (sin, cos) = given[node / 2].2.sin_cos();
                        let on = if node % 2 == 1 { 1.0 } else { -1.0 };
                        on * (cos * way.x + sin * way.y) / way.norm()
                    };
                    let facing = cosine(a, way) >= 0.2 && cosine(b, -way) >= 0.2;
                    if way.norm() <= 24.0 || (way.norm() <= 50.0 && facing) {
                        expected.push([a, b]);
                    }
                }
            }
            let mut found = linked(&(nodes, edges));
            found.sort_by_key(|[a, b]| (*b, *a));
            prop_assert_eq!(found, expected);
        }

        /// A stroke that points at a bar, at no less than 50 degrees: the ray is then met nearest where it
        /// crosses the bar.
        #[test]
        fn a_tip_is_linked_to_the_body_that_its_tangent_meets(
            direction in 0.0..6.2_f64, meets in 0.0..60.0_f64, turn in 0.873..2.268_f64, gap in 0.5..70.0_f64,
            tips: bool,
        ) {
            // To 1 px: which point is nearest, and whether it is near the end. At the ends of the ray its
            // width counts as well: up to 9 px across, which the bar may be 8 px nearer or farther.
            let from_end = meets.min(60.0 - meets);
            prop_assume!((from_end - 6.0).abs() > 1.0);
            prop_assume!(!(1.0..4.0).contains(&gap) && !(49.0..58.0).contains(&gap));
            let ((sin, cos), ahead) = (direction.sin_cos(), direction + turn);
            let crossing = Pixel::<View1>::new(300.0 + meets * cos, 300.0 + meets * sin);
            let back = gap + 39.0;
            let start = Pixel::<View1>::new(crossing.x - back * ahead.cos(), crossing.y - back * ahead.sin());
            let kind = if tips { NodeKind::Tip } else { NodeKind::Junction };
            let given = [(300.0, 300.0, direction, 61, kind), (start.x, start.y, ahead, 40, NodeKind::Tip)];
            let (mut nodes, mut edges) = strokes(&given);
            let bar = edges[0].clone();
            add(&mut nodes, &mut edges, &RAYS);
            let links = linked(&(nodes.clone(), edges.clone()));
            if !(3.0..50.0).contains(&gap) || (from_end < 6.0 && tips) {
                prop_assert_eq!((links.len(), nodes.len(), edges.len()), (0, 4, 2));
            } else if from_end < 6.0 {
                prop_assert_eq!(links, vec![[3, usize::from(meets > 30.0)]]);
            } else {
                prop_assert_eq!(links, vec![[3, 4]]);
                prop_assert_eq!((nodes[4].kind, nodes[4].degree), (NodeKind::LinkFoot, 2));
                prop_assert!(nodes[4].at.distance(crossing) <= 1.0);
                prop_assert_eq!([edges[0].ends, edges[2].ends], [[0, 4], [4, 1]]);
                prop_assert_eq!([&edges[0].points[..], &edges[2].points[1..]].concat(), bar.points);
            }
        }
    }

    #[test]
    fn feet_lie_on_the_nearer_bar_and_those_less_than_the_snap_apart_are_one() {
        for apart in 1..12_u8 {
            let bar = |y| (0.0, y, 0.0, 80, NodeKind::Junction);
            let down = |x| (x, -45.0, std::f64::consts::FRAC_PI_2, 31, NodeKind::Tip);
            let (mut nodes, mut edges) =
                strokes(&[bar(12.0), bar(0.0), down(30.0), down(30.0 + f64::from(apart))]);
            add(&mut nodes, &mut edges, &RAYS);
            let mut feet: Vec<_> = linked(&(nodes.clone(), edges)).iter().map(|l| l[1]).collect();
            assert!(feet.len() == 2 && feet.iter().all(|&foot| nodes[foot].at.y == 0.0));
            feet.dedup();
            assert_eq!(feet.len(), if apart < 6 { 1 } else { 2 }, "{apart}");
        }
    }
}
