//! Directions of edges at their ends, and the price of a turn.

use accurate_geom::{Point2, View};
use nalgebra::Vector2;

use super::{HalfEdge, WalkParams};
use crate::{NodeKind, SkeletonGraph};

/// Everything about half-edges that a walk asks for, by their index `2 edge + reversed`.
#[derive(Debug)]
pub(super) struct Turns {
    /// Node it starts from and node it leads to.
    pub from: Vec<u32>,
    pub to: Vec<u32>,
    /// Direction in which it leaves its node, and in which it arrives.
    pub out: Vec<Vector2<f64>>,
    pub exit: Vec<Vector2<f64>>,
    /// By how much it turns the remembered direction.
    pub memory: Vec<f64>,
    pub link: Vec<bool>,
    /// Half-edges leaving node `n`: `leaving[first[n] .. first[n + 1]]`, ascending.
    first: Vec<u32>,
    leaving: Vec<u32>,
    pub tip: Vec<bool>,
    /// Price of turning round at the node, and of starting or ending there.
    pub turning: Vec<f64>,
    pub ending: Vec<f64>,
    bend: f64,
    bend_by_length: f64,
}

impl Turns {
    pub fn new<V: View>(graph: &SkeletonGraph<V>, params: &WalkParams) -> Self {
        let (nodes, edges) = (graph.nodes(), graph.edges());
        let count = 2 * edges.len();
        let mut turns = Self {
            from: Vec::with_capacity(count),
            to: Vec::with_capacity(count),
            out: Vec::with_capacity(count),
            exit: Vec::with_capacity(count),
            memory: Vec::with_capacity(count),
            link: Vec::with_capacity(count),
            first: vec![0; nodes.len() + 1],
            leaving: Vec::with_capacity(count),
            tip: nodes.iter().map(|node| node.is_tip()).collect(),
            turning: nodes
                .iter()
                .map(|node| match node.kind {
                    NodeKind::Tip => params.u_turn,
                    NodeKind::WidthStep => params.step_u_turn,
                    NodeKind::Junction => params.inner_u_turn,
                    NodeKind::LinkFoot => f64::INFINITY,
                })
                .collect(),
            ending: nodes
                .iter()
                .map(|node| match node.kind {
                    NodeKind::Tip => 0.0,
                    NodeKind::WidthStep => params.step_end,
                    NodeKind::Junction | NodeKind::LinkFoot => params.inner_end,
                })
                .collect(),
            bend: params.bend,
            bend_by_length: params.bend_by_length,
        };
        for edge in edges {
            let [a, b] = edge.ends.map(|node| node as u32);
            let direction = |side| {
                let at = |px: f64| at_arc(&edge.points, edge.length_px, side, px);
                // On an edge shorter than the window, what there is of it.
                let from = params.direction_from_px.min(0.25 * edge.length_px);
                (at(params.direction_to_px) - at(from)).try_normalize(0.0).unwrap_or_default()
            };
            let (out, back) = (direction(0), direction(1));
            let share = edge.length_px / params.memory_px;
            // A memory of 0 px: every edge makes the walk forget.
            let memory = if share.is_nan() { 1.0 } else { share.min(1.0).max(params.memory_min) };
            turns.from.extend([a, b]);
            turns.to.extend([b, a]);
            turns.out.extend([out, back]);
            turns.exit.extend([-back, -out]);
            turns.memory.extend([memory; 2]);
            turns.link.extend([edge.link; 2]);
        }
        for &node in &turns.from {
            turns.first[node as usize + 1] += 1;
        }
        for node in 0..nodes.len() {
            turns.first[node + 1] += turns.first[node];
        }
        let mut next = turns.first.clone();
        turns.leaving = vec![0; count];
        for half in 0..count {
            let slot = &mut next[turns.from[half] as usize];
            turns.leaving[*slot as usize] = half as u32;
            *slot += 1;
        }
        turns
    }

    pub fn leaving(&self, node: u32) -> &[u32] {
        let node = node as usize;
        &self.leaving[self.first[node] as usize..self.first[node + 1] as usize]
    }

    /// Whether a walk that came along `from` may go on along `half`, uses aside.
    pub fn allows(&self, from: u32, half: u32) -> bool {
        if self.link[from as usize] && self.link[half as usize] {
            return false;
        }
        half != reverse(from)
            || (self.turning[self.to[from as usize] as usize].is_finite()
                && !self.link[from as usize])
    }

    /// The price of going on along `half` when the remembered direction is `ahead`.
    pub fn price(&self, from: u32, ahead: &Vector2<f64>, half: u32) -> f64 {
        if half == reverse(from) {
            self.turning[self.to[from as usize] as usize]
        } else {
            self.bend(ahead, half)
        }
    }

    /// The price of going on along the first half-edge again at the end of a walk whose last one is `last`:
    /// it closes the walk. `None` if it may not, or ends elsewhere.
    pub fn closing(&self, first: u32, last: u32, ahead: &Vector2<f64>) -> Option<f64> {
        let node = self.to[last as usize];
        let closes = node == self.from[first as usize]
            && !self.tip[node as usize]
            && self.allows(last, first);
        closes.then(|| self.price(last, ahead, first))
    }

    /// The price of the bend alone.
    fn bend(&self, ahead: &Vector2<f64>, half: u32) -> f64 {
        let out = &self.out[half as usize];
        if *out == Vector2::zeros() || *ahead == Vector2::zeros() {
            return 0.0;
        }
        let weight = self.bend + self.bend_by_length * self.memory[half as usize];
        // Rounding may lift a cosine above 1.
        (1.0 - ahead.dot(out)).max(0.0) * weight
    }

    /// The direction remembered at the end of `half`, entered with `ahead`.
    pub fn carry(&self, from: u32, ahead: &Vector2<f64>, half: u32) -> Vector2<f64> {
        let h = half as usize;
        let before = if half == reverse(from) { &self.out[h] } else { ahead };
        let b = self.memory[h];
        (self.exit[h] * b + before * (1.0 - b)).try_normalize(1e-12).unwrap_or(self.exit[h])
    }
}

pub(super) fn reverse(half: u32) -> u32 {
    half ^ 1
}

impl HalfEdge {
    pub(super) fn from_index(index: u32) -> Self {
        Self { edge: (index / 2) as usize, reversed: index % 2 == 1 }
    }
}

/// The point `px` along the edge from its end `side`. Edges have equally spaced points.
fn at_arc<V: View>(
    points: &[accurate_geom::Pixel<V>],
    length: f64,
    side: usize,
    px: f64,
) -> Point2 {
    let last = points.len() - 1;
    let position = if length > 0.0 { (px / length).min(1.0) * last as f64 } else { 0.0 };
    let k = (position as usize).min(last.saturating_sub(1));
    let at = |k: usize| points[if side == 0 { k } else { last - k }].point();
    at(k) + (at((k + 1).min(last)) - at(k)) * (position - k as f64)
}
