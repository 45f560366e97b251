//! From unordered skeleton pixels of two views to two ordered curves, as published (GCTT).
//!
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
//! # Source
//! ACCURATE, section 2.2 (Geometry-consistent Curve Topology Traversal).

mod curvature;
mod error;
mod gctt;
mod graph;
mod pair;
mod params;
mod skeleton;
mod trace;
mod walk;

pub use error::TraverseError;
pub use gctt::{trace_from, trace_single};
pub use graph::{GraphEdge, GraphNode, GraphParams, NodeKind, SkeletonGraph, fill_small_holes};
pub use pair::{StartPair, start_pair, trace_pair};
pub use params::{Norm, TraverseParams};
pub use skeleton::endpoints;
pub use trace::{Jump, Trace};
pub use walk::{
    Decision, HalfEdge, PointFlags, Walk, WalkCost, WalkEnd, WalkParams, k_best_walks,
    k_best_walks_with_reward,
};
