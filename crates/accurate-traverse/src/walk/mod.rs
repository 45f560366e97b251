//! The cheapest ways to walk along the whole body in one go.

mod assemble;
mod beam;
mod params;
mod prices;
mod turns;

use accurate_geom::{Pixel, View};

pub use params::WalkParams;

use crate::{SkeletonGraph, TraverseError};
use turns::Turns;

/// An edge of a [`SkeletonGraph`] walked along in one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HalfEdge {
    /// Index in [`SkeletonGraph::edges`].
    pub edge: usize,
    /// Whether from its last point to its first.
    pub reversed: bool,
}

/// What a walk costs, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WalkCost {
    /// Bends at nodes.
    pub bending: f64,
    /// Turning round: at tips and other nodes.
    pub u_turns: f64,
    /// Starting and ending elsewhere than at tips.
    pub ends: f64,
    /// Body not walked along.
    pub uncovered: f64,
    /// Edges walked along more than once.
    pub reuse: f64,
    /// Links taken.
    pub links: f64,
    /// Rewards not earned; 0 unless asked for.
    pub missed_reward: f64,
}

impl WalkCost {
    /// The sum of the parts.
    pub fn total(&self) -> f64 {
        self.bending
            + self.u_turns
            + self.ends
            + self.uncovered
            + self.reuse
            + self.links
            + self.missed_reward
    }
}

/// Where a walk ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WalkEnd {
    /// At a visible tip, on an edge walked along once.
    Tip,
    /// On an edge that the walk uses more than once: the true tip may lie anywhere on it.
    OnReusedEdge,
    /// At a junction, on an edge walked along once.
    Junction,
    /// Nowhere: the walk is closed.
    Closed,
}

/// What happened at a node, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Decision<V: View> {
    /// The node.
    pub at: Pixel<V>,
    /// The half-edge that led there, and the one that was taken.
    pub came_along: HalfEdge,
    /// See [`Self::came_along`].
    pub left_along: HalfEdge,
    /// What the turn taken cost, edge prices aside.
    pub price: f64,
    /// The other half-edges allowed there (uses aside), each with the price of its turn.
    pub alternatives: Vec<(HalfEdge, f64)>,
}

/// A point of a walk: how far to trust it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PointFlags {
    /// On a link: nothing was seen here.
    pub link: bool,
    /// On an edge that the walk uses more than once: strands lie on each other here.
    pub reused: bool,
}

/// One way to walk along the body, with its price and its reasons.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk<V: View> {
    /// Points in order, equally spaced, at most 1 px apart; at least two.
    pub points: Vec<Pixel<V>>,
    /// One entry per point.
    pub flags: Vec<PointFlags>,
    /// The edges in order.
    pub halves: Vec<HalfEdge>,
    /// The price.
    pub cost: WalkCost,
    /// How the walk starts and ends.
    pub ends: [WalkEnd; 2],
    /// One entry per node passed; of a closed walk in the end the one where it closes.
    pub decisions: Vec<Decision<V>>,
    /// Part of the body's length walked along, 0 to 1.
    pub coverage: f64,
}

impl<V: View> Walk<V> {
    /// Whether the last point leads back to the first.
    pub fn is_closed(&self) -> bool {
        self.ends[0] == WalkEnd::Closed
    }

    /// Length of the polyline through the points, px.
    pub fn length_px(&self) -> f64 {
        self.points.windows(2).map(|w| w[0].distance(w[1])).sum()
    }
}

/// The cheapest walks through the graph: at most [`WalkParams::walks`], cheapest first, ties by the
/// numbers of their edges. A walk and its reverse are one, and so are the starts of a closed walk.
///
/// Each edge is walked along at most three times, each link once, and never two links in a row. The
/// cheapest is the cheapest of all walks if the beam never overflowed; there is no promise
/// otherwise.
///
/// # Errors
/// [`TraverseError::InvalidParameter`].
///
/// # Source
/// The pairing of branches at crossings by bending follows the idea of mBEST (Choi et al., arXiv
/// 2302.09444); covering the graph by one walk that may repeat edges is a Chinese-postman problem
/// with turn prices, searched here by a beam.
///
/// # Cost
/// O(steps · beam · branches at a node) and O(walks · length).
pub fn k_best_walks<V: View>(
    graph: &SkeletonGraph<V>,
    params: &WalkParams,
) -> Result<Vec<Walk<V>>, TraverseError> {
    k_best_walks_with_reward(graph, params, &[])
}

/// As [`k_best_walks`], where body near the given positions wants to be walked along twice: each
/// `(position, weight)` adds `weight` to the price of a walk that uses the edge nearest to the
/// position once, and twice that if it does not use it at all.
///
/// For stretches of the outline that the best walk so far does not explain. Positions farther than
/// 1.5 thicknesses + 2 px from every edge have no effect.
///
/// # Errors
/// [`TraverseError::InvalidParameter`], also for a weight that is negative or not finite.
pub fn k_best_walks_with_reward<V: View>(
    graph: &SkeletonGraph<V>,
    params: &WalkParams,
    rewards: &[(Pixel<V>, f64)],
) -> Result<Vec<Walk<V>>, TraverseError> {
    params.validate()?;
    for &(at, value) in rewards {
        if !(value.is_finite() && value >= 0.0 && at.is_finite()) {
            let expected = "a finite weight not below 0 at a finite position";
            return Err(TraverseError::InvalidParameter { name: "rewards", value, expected });
        }
    }
    let turns = Turns::new(graph, params);
    let prices = prices::prices(graph, params, rewards);
    let found = beam::search(&turns, &prices, params);
    let mut priced: Vec<_> =
        found.into_iter().map(|walk| assemble::price(&turns, &prices, walk)).collect();
    priced.sort_by(|a, b| {
        a.cost.total().total_cmp(&b.cost.total()).then_with(|| a.halves.cmp(&b.halves))
    });
    Ok(priced.into_iter().map(|walk| assemble::assemble(graph, &turns, walk)).collect())
}
