//! What an edge costs by the number of times it is walked along.

use accurate_geom::{Pixel, View};

use super::WalkParams;
use crate::SkeletonGraph;

/// Most times an edge is walked along; a link once.
pub(super) const MAX_USES: usize = 3;

/// Prices of one edge for 0, 1, 2, 3 uses.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct EdgePrices {
    pub uncovered: [f64; MAX_USES + 1],
    pub reuse: [f64; MAX_USES + 1],
    pub link: [f64; MAX_USES + 1],
    pub missed_reward: [f64; MAX_USES + 1],
    pub max_uses: usize,
    /// Sum of the parts.
    pub total: [f64; MAX_USES + 1],
    /// The least of `total` for this many uses or more.
    pub least: [f64; MAX_USES + 1],
}

impl EdgePrices {
    /// Sums up the parts.
    fn close(mut self) -> Self {
        for uses in 0..=MAX_USES {
            self.total[uses] = self.uncovered[uses]
                + self.reuse[uses]
                + self.link[uses]
                + self.missed_reward[uses];
        }
        self.least = self.total;
        for uses in (0..self.max_uses).rev() {
            self.least[uses] = self.total[uses].min(self.least[uses + 1]);
        }
        self
    }
}

/// The prices of all edges, with a reward for walking along unexplained stretches.
pub(super) fn prices<V: View>(
    graph: &SkeletonGraph<V>,
    params: &WalkParams,
    rewards: &[(Pixel<V>, f64)],
) -> Vec<EdgePrices> {
    let mut reward = vec![0.0; graph.edges().len()];
    for &(at, weight) in rewards {
        if let Some(edge) = nearest_edge(graph, at) {
            reward[edge] += weight;
        }
    }
    let edges = graph.edges().iter().zip(reward);
    edges
        .map(|(edge, reward)| {
            let mut prices = EdgePrices::default();
            if edge.link {
                prices.max_uses = 1;
                prices.link = [0.0, params.link + params.link_per_px * edge.length_px, 0.0, 0.0];
            } else {
                prices.max_uses = MAX_USES;
                prices.uncovered[0] = params.uncovered_per_px * edge.length_px;
                let again = params.reuse_per_px * edge.length_px.min(params.reuse_max_px);
                prices.reuse = [0.0, 0.0, again, 2.0 * again + params.third_use];
                prices.missed_reward = [2.0 * reward, reward, 0.0, 0.0];
            }
            prices.close()
        })
        .collect()
}

/// The edge (no link) nearest to a position, if the body there can reach it.
fn nearest_edge<V: View>(graph: &SkeletonGraph<V>, at: Pixel<V>) -> Option<usize> {
    // An outline point lies half a thickness from its strand; two merged strands are thicker.
    let reach = 1.5 * graph.mask_thickness_px() + 2.0;
    let mut best = None;
    let mut least = reach;
    for (index, edge) in graph.edges().iter().enumerate().filter(|(_, e)| !e.link) {
        for point in &edge.points {
            let distance = point.distance(at);
            if distance < least {
                least = distance;
                best = Some(index);
            }
        }
    }
    best
}
