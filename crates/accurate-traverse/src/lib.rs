//! From unordered skeleton pixels to ordered curves: the published traversal, and a graph that
//! proposes every plausible order.
//!
//! # As published (GCTT)
//! [`trace_pair`] picks the pair of endpoints that the epipolar geometry prefers and walks along
//! each skeleton from there; [`trace_single`] and [`trace_from`] do it for one view. A [`Trace`]
//! says what it left out and where it jumped.
//!
//! ```
//! use accurate_geom::{Pixel, View1};
//! use accurate_traverse::{TraverseParams, trace_single};
//!
//! let skeleton: Vec<Pixel<View1>> = [(2, 0), (0, 2), (1, 1), (3, 0), (4, 0)]
//!     .map(|(x, y)| Pixel::new(f64::from(x), f64::from(y)))
//!     .to_vec();
//! let trace = trace_single(&skeleton, &TraverseParams::PAPER)?;
//! let columns: Vec<f64> = trace.points.iter().map(|p| p.x).collect();
//! assert_eq!(columns, [4.0, 3.0, 2.0, 1.0, 0.0]);
//! assert_eq!(trace.left, 0);
//! # Ok::<(), accurate_traverse::TraverseError>(())
//! ```
//!
//! # Through crossings and overlaps
//! A greedy walk loses its way where the body crosses itself. [`SkeletonGraph`] makes tips and
//! junctions of a skeleton nodes and the stretches between them smooth edges, with links over gaps;
//! [`k_best_walks`] proposes the cheapest [`Walk`]s along the whole body in one go, each with its
//! price and the reason of every turn. Which proposal is true is for the two views together to say.
//! [`k_best_walks_with_reward`] proposes again where a proposal left something unexplained.
//! [`smooth_centreline`], [`recentre`] and [`extend_to_body_ends`] make sub-pixel curves of pixels.
//!
//! # Source
//! ACCURATE, section 2.2 (Geometry-consistent Curve Topology Traversal); the rest is ours.

mod body_end;
mod curvature;
mod error;
mod gctt;
mod graph;
mod pair;
mod params;
mod skeleton;
mod subpixel;
mod trace;
mod walk;

pub use error::TraverseError;
pub use gctt::{trace_from, trace_single};
pub use graph::{GraphEdge, GraphNode, GraphParams, NodeKind, SkeletonGraph, fill_small_holes};
pub use pair::{StartPair, start_pair, trace_pair};
pub use params::{Norm, TraverseParams};
pub use skeleton::endpoints;
pub use subpixel::{CentrelineParams, extend_to_body_ends, recentre, smooth_centreline};
pub use trace::{Jump, Trace};
pub use walk::{
    Decision, HalfEdge, PointFlags, Walk, WalkCost, WalkEnd, WalkParams, k_best_walks,
    k_best_walks_with_reward,
};
