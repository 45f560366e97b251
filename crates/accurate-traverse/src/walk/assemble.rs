//! From half-edges to a walk with points, prices and reasons.

use accurate_geom::{Pixel, View};

use super::beam::Found;
use super::prices::EdgePrices;
use super::turns::Turns;
use super::{Decision, HalfEdge, PointFlags, Walk, WalkCost, WalkEnd};
use crate::SkeletonGraph;

/// A walk with its price.
#[derive(Debug)]
pub(super) struct Priced {
    pub halves: Vec<u32>,
    pub cost: WalkCost,
    pub closed: bool,
    uses: Vec<u8>,
}

/// The price of a walk, from scratch.
pub(super) fn price(
    turns: &Turns,
    prices: &[EdgePrices],
    Found { halves, closed }: Found,
) -> Priced {
    let mut cost = WalkCost::default();
    let mut uses = vec![0u8; prices.len()];
    halves.iter().for_each(|&half| uses[half as usize / 2] += 1);
    for (price, &uses) in prices.iter().zip(&uses) {
        let uses = usize::from(uses);
        cost.uncovered += price.uncovered[uses];
        cost.reuse += price.reuse[uses];
        cost.links += price.link[uses];
        cost.missed_reward += price.missed_reward[uses];
    }
    for_each_turn(turns, &halves, closed, |came, ahead, left| {
        let price = turns.price(came, ahead, left);
        let part =
            if left == super::turns::reverse(came) { &mut cost.u_turns } else { &mut cost.bending };
        *part += price;
    });
    if !closed {
        let ends = [turns.from[halves[0] as usize], turns.to[halves[halves.len() - 1] as usize]];
        cost.ends = ends.iter().map(|&node| turns.ending[node as usize]).sum();
    }
    Priced { halves, cost, closed, uses }
}

/// Calls `visit` with the half-edge that led to each node, the direction remembered there, and the
/// half-edge taken; in the end at the node where a closed walk closes.
fn for_each_turn(
    turns: &Turns,
    halves: &[u32],
    closed: bool,
    mut visit: impl FnMut(u32, &nalgebra::Vector2<f64>, u32),
) {
    let mut ahead = turns.exit[halves[0] as usize];
    for pair in halves.windows(2) {
        visit(pair[0], &ahead, pair[1]);
        ahead = turns.carry(pair[0], &ahead, pair[1]);
    }
    if closed {
        visit(halves[halves.len() - 1], &ahead, halves[0]);
    }
}

pub(super) fn assemble<V: View>(graph: &SkeletonGraph<V>, turns: &Turns, walk: Priced) -> Walk<V> {
    let Priced { halves, cost, closed, uses } = walk;
    let mut decisions = Vec::with_capacity(halves.len());
    for_each_turn(turns, &halves, closed, |came, ahead, left| {
        let node = turns.to[came as usize];
        let alternatives = turns
            .leaving(node)
            .iter()
            .filter(|&&half| half != left && turns.allows(came, half))
            .map(|&half| (HalfEdge::from_index(half), turns.price(came, ahead, half)))
            .collect();
        decisions.push(Decision {
            at: graph.nodes()[node as usize].at,
            came_along: HalfEdge::from_index(came),
            left_along: HalfEdge::from_index(left),
            price: turns.price(came, ahead, left),
            alternatives,
        });
    });
    let end = |half: u32, node: u32| {
        if closed {
            WalkEnd::Closed
        } else if uses[half as usize / 2] > 1 {
            WalkEnd::OnReusedEdge
        } else if turns.tip[node as usize] {
            WalkEnd::Tip
        } else {
            WalkEnd::Junction
        }
    };
    let (first, last) = (halves[0], halves[halves.len() - 1]);
    let ends = [end(first, turns.from[first as usize]), end(last, turns.to[last as usize])];
    let edges = graph.edges();
    let covered: f64 = edges
        .iter()
        .zip(&uses)
        .filter(|(edge, uses)| !edge.link && **uses > 0)
        .map(|(edge, _)| edge.length_px)
        .sum();
    let (points, flags) = resample(graph, &halves, &uses);
    Walk {
        points,
        flags,
        halves: halves.iter().map(|&half| HalfEdge::from_index(half)).collect(),
        cost,
        ends,
        decisions,
        coverage: covered / graph.length_px(),
    }
}

/// The polylines of the edges in a row, resampled at equal steps of at most 1 px.
fn resample<V: View>(
    graph: &SkeletonGraph<V>,
    halves: &[u32],
    uses: &[u8],
) -> (Vec<Pixel<V>>, Vec<PointFlags>) {
    let edges = graph.edges();
    let length: f64 = halves.iter().map(|&half| edges[half as usize / 2].length_px).sum();
    let steps = ((length * (1.0 - 4.0 * f64::EPSILON)).ceil() as usize).max(1);
    let step = length / steps as f64;
    let mut points = Vec::with_capacity(steps + 1);
    let mut flags = Vec::with_capacity(steps + 1);
    let mut arc = 0.0;
    let mut last = None;
    for &half in halves {
        let edge = &edges[half as usize / 2];
        let flag = PointFlags { link: edge.link, reused: uses[half as usize / 2] > 1 };
        let side = half as usize % 2;
        for k in 1..edge.points.len() {
            let (from, to) = (edge.near_end(side, k - 1), edge.near_end(side, k));
            let span = (to - from).norm();
            while points.len() < steps && points.len() as f64 * step <= arc + span {
                let share = if span > 0.0 {
                    ((points.len() as f64 * step - arc) / span).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                points.push(Pixel::from(from + (to - from) * share));
                flags.push(flag);
            }
            arc += span;
            last = Some((to, flag));
        }
    }
    if let Some((to, flag)) = last {
        // Rounding may have left a step out before the last point; the points still join.
        points.push(to.into());
        flags.push(flag);
    }
    (points, flags)
}
