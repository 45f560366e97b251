use accurate_fit::Outline;
use accurate_geom::{Pixel, View};
use accurate_match::{FreeEnds, SignalCurve};
use accurate_seg::{Mask, distance_to_background, median_width_px, zhang_suen};
use accurate_traverse::{
    GraphParams, SkeletonGraph, Walk, WalkEnd, WalkParams, fill_small_holes, k_best_walks,
};
use ndarray::Array2;

use crate::Error;

/// Everything that one view says: its outline, and the walks that could be the body.
pub(crate) struct ViewCandidates<V: View> {
    pub(crate) outline: Outline<V>,
    pub(crate) walks: Vec<Walk<V>>,
    /// Bridges over what was not seen, as straight stretches.
    pub(crate) bridges: Vec<(Pixel<V>, Pixel<V>)>,
}

impl<V: View> ViewCandidates<V> {
    /// # Errors
    /// [`Error::Segmentation`], [`Error::Traversal`] or [`Error::Fitting`] for a mask that shows no
    /// curve.
    pub(crate) fn of(array: &Array2<bool>, params: &WalkParams, case: &str) -> Result<Self, Error> {
        let segmentation =
            |source| Error::Segmentation { case: case.to_owned(), view: V::NUMBER, source };
        let traversal = |source| Error::Traversal { case: case.to_owned(), source };
        let fitting = |source| Error::Fitting { case: case.to_owned(), source };
        let mask = Mask::from_array(array.clone()).map_err(segmentation)?;
        mask.require_foreground().map_err(segmentation)?;
        let thickness = median_width_px(&mask).map_err(segmentation)?;
        // The holes of near-tangent overlaps would make dozens of nodes; only the graph loses them,
        // the fit sees the mask as it is.
        let filled = fill_small_holes(array, GraphParams::hole_area_px(thickness));
        let filled = Mask::from_array(filled).map_err(segmentation)?;
        let thin = zhang_suen(&filled);
        let radii = distance_to_background(&filled).map_err(segmentation)?;
        let graph = SkeletonGraph::new(thin.as_array(), &radii, thickness, &GraphParams::DEFAULT)
            .map_err(traversal)?;
        let walks = k_best_walks(&graph, params).map_err(traversal)?;
        let outline = Outline::from_mask(array.view()).map_err(fitting)?;
        let bridges = graph
            .edges()
            .iter()
            .filter(|edge| edge.link)
            .flat_map(|edge| edge.points.windows(2).map(|w| (w[0], w[1])))
            .collect();
        Ok(Self { outline, walks, bridges })
    }

    /// The walks as candidates for pairing.
    pub(crate) fn signals(&self) -> Vec<SignalCurve<'_, V>> {
        self.walks
            .iter()
            .map(|walk| SignalCurve {
                points: &walk.points,
                cost: walk.cost.total(),
                free: free_ends(walk),
            })
            .collect()
    }
}

/// How much of a walk's ends may be wrong: a tip on an edge that is used twice lies anywhere on it,
/// a walk that ends at a junction may be off by its node.
pub(crate) fn free_ends<V: View>(walk: &Walk<V>) -> FreeEnds {
    const JUNCTION_PX: f64 = 4.0;
    let spacing = walk.length_px() / (walk.points.len().max(2) - 1) as f64;
    let reused = |count: usize| count as f64 * spacing;
    let free = |end: WalkEnd, run: usize| match end {
        WalkEnd::Tip | WalkEnd::Closed => 0.0,
        WalkEnd::Junction => JUNCTION_PX,
        WalkEnd::OnReusedEdge => reused(run),
    };
    let head = walk.flags.iter().take_while(|f| f.reused).count();
    let tail = walk.flags.iter().rev().take_while(|f| f.reused).count();
    FreeEnds { begin_px: free(walk.ends[0], head), end_px: free(walk.ends[1], tail) }
}
