//! A skeleton as a graph of smooth edges between tips and junctions.

mod ends;
mod fill;
mod links;
mod params;
mod pixels;
mod rough;
mod smooth;
mod steps;

use accurate_geom::{Pixel, Point2, View};
use ndarray::Array2;

pub use fill::fill_small_holes;
pub use params::GraphParams;

use crate::TraverseError;

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NodeKind {
    /// The body visibly ends here.
    Tip,
    /// Strands cross, touch, join or separate here; or the one node of a closed curve.
    Junction,
    /// The body becomes thinner here: a strand that ran along another may end or turn here.
    WidthStep,
    /// A link ends here.
    LinkFoot,
}

/// A node of a [`SkeletonGraph`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GraphNode<V: View> {
    /// Position, px: the pixel of a tip, the centroid of a junction's pixels.
    pub at: Pixel<V>,
    /// Edges that end here without the links; a loop counts twice.
    pub degree: usize,
    /// What it is.
    pub kind: NodeKind,
}

impl<V: View> GraphNode<V> {
    /// Whether the body visibly ends here.
    pub fn is_tip(&self) -> bool {
        self.kind == NodeKind::Tip
    }
}

/// A stretch of the body between two nodes, or a link across a stretch that cannot be seen.
#[derive(Debug, Clone, PartialEq)]
pub struct GraphEdge<V: View> {
    /// The nodes at the first and the last point.
    pub ends: [usize; 2],
    /// Smooth polyline from node to node, about 1 px from point to point; a link has two points.
    pub points: Vec<Pixel<V>>,
    /// Distance to the background at each point, px; 0 on a link.
    pub radii: Vec<f64>,
    /// Length of the polyline, px.
    pub length_px: f64,
    /// Whether this is a link.
    pub link: bool,
}

/// The most strands that are taken for parts of one body; a wire of twelve control points that crosses
/// itself all over has some fifty.
const MOST_STRANDS: usize = 256;
/// The most chains of pixels, with the artefacts of thinning among them.
const MOST_CHAINS: usize = 4096;

fn refuse_tangle(view: u8, strands: usize, limit: usize) -> Result<(), TraverseError> {
    if strands > limit { Err(TraverseError::Tangled { view, strands, limit }) } else { Ok(()) }
}

/// The skeleton of a mask as a graph: tips and junctions joined by smooth polylines, and links over
/// gaps.
///
/// Junction pixels that touch are one node at their centroid. Artefacts of thinning (short side
/// branches, tiny loops, specks) are dropped, junctions less than
/// [`GraphParams::contract_px`] apart joined. Two edges may have the same two nodes, and an edge may
/// end where it starts; a closed curve without a junction is one such edge.
///
/// # Symmetry
/// Turning or mirroring the *skeleton* by multiples of 90° does the same to the graph, up to
/// rounding and the numbers of nodes and edges, as long as no two edges that compete for being
/// dropped are equally long and equally straight; only where a ring without a junction begins is its first
/// pixel in the order of rows. Turning the *mask* moves the skeleton itself by up
/// to about 1 px, as the half-steps of thinning take the south-east before the north-west, and may
/// split a junction in another way.
#[derive(Debug, Clone, PartialEq)]
pub struct SkeletonGraph<V: View> {
    nodes: Vec<GraphNode<V>>,
    edges: Vec<GraphEdge<V>>,
    mask_thickness_px: f64,
}

impl<V: View> SkeletonGraph<V> {
    /// The graph of a skeleton (8-connected, one pixel wide).
    ///
    /// `skeleton` and `radii` have shape (height, width), index `[[y, x]]`; `radii` is the distance
    /// from pixel centre to the nearest background centre, px: positive on the skeleton, 0 outside the
    /// mask. Around the skeleton it tells how far tips reach and where the body is wider.
    /// `mask_thickness_px` is the width of the strands of the mask, px.
    ///
    /// # Errors
    /// [`TraverseError::ShapeMismatch`], [`TraverseError::Empty`], [`TraverseError::TooSmall`],
    /// [`TraverseError::NoEdge`], [`TraverseError::BadRadius`], [`TraverseError::Tangled`], and
    /// [`TraverseError::InvalidParameter`] for a thickness that is not positive or a bad field of
    /// `params`.
    ///
    /// # Cost
    /// One scan of the image and O(pixels) besides; quadratic in the number of edges.
    pub fn new(
        skeleton: &Array2<bool>,
        radii: &Array2<f64>,
        mask_thickness_px: f64,
        params: &GraphParams,
    ) -> Result<Self, TraverseError> {
        let view = V::NUMBER;
        params.validate()?;
        if !(mask_thickness_px > 0.0 && mask_thickness_px.is_finite()) {
            let (name, value) = ("mask_thickness_px", mask_thickness_px);
            let expected = "a positive finite number";
            return Err(TraverseError::InvalidParameter { name, value, expected });
        }
        if skeleton.dim() != radii.dim() {
            let (skeleton, radii) = (skeleton.dim(), radii.dim());
            return Err(TraverseError::ShapeMismatch { view, skeleton, radii });
        }
        let mut pixels = 0;
        for ((y, x), _) in skeleton.indexed_iter().filter(|(_, set)| **set) {
            let value = radii[[y, x]];
            if !(value > 0.0 && value.is_finite()) {
                return Err(TraverseError::BadRadius { view, x, y, value });
            }
            pixels += 1;
        }
        match pixels {
            0 => return Err(TraverseError::Empty { view }),
            1 => return Err(TraverseError::TooSmall { view, pixels }),
            _ => {}
        }
        let mut rough = pixels::trace(skeleton, radii);
        refuse_tangle(view, rough.edges.len(), MOST_CHAINS)?;
        rough.simplify(mask_thickness_px, params);
        refuse_tangle(view, rough.edges.len(), MOST_STRANDS)?;
        if rough.edges.is_empty() {
            return Err(TraverseError::NoEdge { view, pixels });
        }
        ends::extend_tips(&mut rough, radii, mask_thickness_px);
        let mut number = vec![None; rough.nodes.len()];
        let mut nodes: Vec<GraphNode<V>> = Vec::new();
        let mut edges = Vec::with_capacity(rough.edges.len());
        for edge in &rough.edges {
            let ends = edge.ends.map(|node| {
                let id = *number[node].get_or_insert_with(|| {
                    let at = rough.nodes[node].into();
                    nodes.push(GraphNode { at, degree: 0, kind: NodeKind::Junction });
                    nodes.len() - 1
                });
                nodes[id].degree += 1;
                id
            });
            let (points, radii) =
                smooth::smooth(&edge.points, &edge.radii, params.smooth_sigma_px)?;
            edges.push(GraphEdge::body(ends, points.into_iter().map(Pixel::from).collect(), radii));
        }
        for node in nodes.iter_mut().filter(|node| node.degree == 1) {
            node.kind = NodeKind::Tip;
        }
        let tips: Vec<[bool; 2]> =
            edges.iter().map(|edge| edge.ends.map(|node| nodes[node].is_tip())).collect();
        ends::stretch(&mut edges, &tips, radii, mask_thickness_px);
        for (edge, tips) in edges.iter().zip(&tips) {
            for side in (0..2).filter(|&side| tips[side]) {
                nodes[edge.ends[side]].at = edge.near_end(side, 0).into();
            }
        }
        steps::split(&mut nodes, &mut edges, radii, mask_thickness_px, params);
        links::add(&mut nodes, &mut edges, params);
        Ok(Self { nodes, edges, mask_thickness_px })
    }

    /// The nodes; an edge refers to them by index.
    pub fn nodes(&self) -> &[GraphNode<V>] {
        &self.nodes
    }

    /// The edges, links among them.
    pub fn edges(&self) -> &[GraphEdge<V>] {
        &self.edges
    }

    /// Width of the strands of the mask, px, as given.
    pub fn mask_thickness_px(&self) -> f64 {
        self.mask_thickness_px
    }

    /// Length of all edges but the links, px.
    pub fn length_px(&self) -> f64 {
        self.edges.iter().filter(|e| !e.link).map(|e| e.length_px).sum()
    }
}

impl<V: View> GraphEdge<V> {
    fn body(ends: [usize; 2], points: Vec<Pixel<V>>, radii: Vec<f64>) -> Self {
        let length_px = points.windows(2).map(|w| w[0].distance(w[1])).sum();
        Self { ends, points, radii, length_px, link: false }
    }

    fn bridge(ends: [usize; 2], from: Pixel<V>, to: Pixel<V>) -> Self {
        let length_px = from.distance(to);
        Self { ends, points: vec![from, to], radii: vec![0.0; 2], length_px, link: true }
    }

    /// The point at index `k` from the end `side` (0: first, 1: last), or the farthest there is.
    pub fn near_end(&self, side: usize, k: usize) -> Point2 {
        let last = self.points.len() - 1;
        let k = k.min(last);
        self.points[if side == 0 { k } else { last - k }].point()
    }
}

/// Splits an edge at one of its inner points; the part behind it becomes the last edge. The new node.
fn split_edge<V: View>(
    nodes: &mut Vec<GraphNode<V>>,
    edges: &mut Vec<GraphEdge<V>>,
    edge: usize,
    index: usize,
    kind: NodeKind,
) -> usize {
    let whole = &mut edges[edge];
    let at = whole.points[index];
    let (points, radii) = (whole.points.split_off(index), whole.radii.split_off(index));
    whole.points.push(at);
    whole.radii.push(radii[0]);
    let node = nodes.len();
    nodes.push(GraphNode { at, degree: 2, kind });
    let [near, far] = whole.ends;
    let (front, front_radii) =
        (std::mem::take(&mut whole.points), std::mem::take(&mut whole.radii));
    *whole = GraphEdge::body([near, node], front, front_radii);
    edges.push(GraphEdge::body([node, far], points, radii));
    node
}
