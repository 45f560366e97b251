use accurate_geom::{Pixel, Rig, Triangulation, View1, View2};
use accurate_match::{
    CostModel, CurveMatcher, CurveReconstruction, DistanceKind, MatchError, PixelPair,
    triangulate_pairs,
};

use crate::chain::longest_chain;
use crate::range::not_negative;
use crate::room::{all_pairs, check_room};

/// A candidate, its copy in order, its row, its column and its link in [`longest_chain`].
const CANDIDATE_BYTES: u64 = 72;

/// Hoffmann's method as comparison tables run it: `hoffmann-table`.
///
/// Every pair of input points whose distance in view 2 to the epipolar line is below the threshold
/// is a candidate; the longest chain of candidates that strictly increases in both curves is
/// triangulated linearly. Points without a partner are left out.
///
/// # Source
/// Hoffmann et al., MICCAI 2012 (Fig. 3) and IEEE TMI 35(2), 2016: correspondences as a shortest
/// path over candidates, monotone in both curves, at the cost of skipped points. The method there
/// works on intersections with fitted curves: [`Hoffmann`](crate::Hoffmann) does. Integer pixels and
/// a distance threshold in their place are how the ACCURATE paper's comparison treats it.
///
/// Ties, which the publications leave open: see [`longest_chain`](crate::longest_chain).
///
/// # Cost
/// O(n1 n2) distances and O(M log M) time, O(M) memory, for M candidates: 5 to 10 per point at the
/// default threshold, all n1 n2 at a threshold as large as the image or where both curves run along one
/// epipolar line. What would need more than [`MAX_ALIGNMENT_BYTES`](accurate_match::MAX_ALIGNMENT_BYTES)
/// is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoffmannTable {
    /// Candidates are nearer to the epipolar line than this, px. 1.0 in the table.
    pub threshold_px: f64,
}

impl HoffmannTable {
    /// As in the paper's comparison table.
    pub const PAPER: Self = Self { threshold_px: 1.0 };

    /// Name of the method.
    pub const NAME: &'static str = "hoffmann-table";
}

impl Default for HoffmannTable {
    fn default() -> Self {
        Self::PAPER
    }
}

impl CurveMatcher for HoffmannTable {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn reconstruct(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CurveReconstruction, MatchError> {
        not_negative("threshold_px", self.threshold_px)?;
        let costs = CostModel::new(rig.fundamental(), curve1, curve2, DistanceKind::View2)?;
        let chain = longest_chain(&self.candidates(&costs)?);
        if chain.is_empty() {
            return Err(MatchError::NoCorrespondence { method: Self::NAME, candidates: 0 });
        }
        let pairs: Vec<PixelPair> = chain
            .into_iter()
            .map(|(i, j)| PixelPair { cell: (i, j), pixel1: curve1[i], pixel2: curve2[j] })
            .collect();
        triangulate_pairs(Self::NAME, rig, Triangulation::Dlt, &pairs)
    }
}

impl HoffmannTable {
    /// All pairs below the threshold, in order. Along an epipolar line that is every pair of points.
    fn candidates(&self, costs: &CostModel) -> Result<Vec<(usize, usize)>, MatchError> {
        let (n1, n2) = (costs.n1(), costs.n2());
        let mut row = vec![0.0; n2];
        // Counted first only where there may be too many: it asks for every distance once more.
        if check_room(all_pairs(n1, n2), CANDIDATE_BYTES, n1, n2).is_err() {
            let mut count = 0;
            for i in 0..n1 {
                costs.fill_row(i, &mut row);
                count += row.iter().filter(|d| **d < self.threshold_px).count() as u64;
            }
            check_room(count, CANDIDATE_BYTES, n1, n2)?;
        }
        let mut candidates = Vec::new();
        for i in 0..n1 {
            costs.fill_row(i, &mut row);
            let near = row.iter().enumerate().filter(|(_, d)| **d < self.threshold_px);
            candidates.extend(near.map(|(j, _)| (i, j)));
        }
        Ok(candidates)
    }
}
