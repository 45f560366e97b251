use accurate_geom::{Pixel, Rig, Triangulation, View1, View2};

use crate::{
    Alignment, CostModel, CurveMatcher, CurveReconstruction, DistanceKind, MatchError, PixelPair,
    RefineDirections, RefineRule, TieOrder, align_curves, refine, triangulate_pairs,
};

/// What [`Ecdp`] leaves to choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct EcdpParams {
    /// The distance the path adds up. Paper: [`DistanceKind::View1`].
    pub distance: DistanceKind,
    /// The order of equal predecessors. Paper: [`TieOrder::UpLeftDiagonal`].
    pub ties: TieOrder,
    /// How runs of the path are refined. Paper: [`RefineRule::Paper`] in the text,
    /// [`RefineRule::Off`] behind the published table.
    pub refine: RefineRule,
    /// Which runs are refined. Paper: [`RefineDirections::Horizontal`].
    pub refine_directions: RefineDirections,
    /// How each pair becomes a 3D point. Paper: [`Triangulation::Dlt`].
    pub triangulation: Triangulation,
}

impl EcdpParams {
    /// The published table: operator R off (its numbers agree with that), DLT.
    pub const PAPER: Self = Self {
        distance: DistanceKind::View1,
        ties: TieOrder::UpLeftDiagonal,
        refine: RefineRule::Off,
        refine_directions: RefineDirections::Horizontal,
        triangulation: Triangulation::Dlt,
    };

    /// The published text: as [`PAPER`](Self::PAPER), with operator R.
    pub const PAPER_REFINED: Self = Self { refine: RefineRule::Paper, ..Self::PAPER };
}

/// Epipolar-constrained dynamic programming: the monotone correspondence of two ordered curves with
/// the least sum of epipolar distances, every cell of its path triangulated.
///
/// The curves must run the same way: their first points match each other, and so do their last.
///
/// # Source
/// ACCURATE, section 2.3.
///
/// # Cost
/// As [`align_curves`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ecdp {
    /// The choices.
    pub params: EcdpParams,
}

impl Ecdp {
    /// ECDP with `params`.
    pub const fn new(params: EcdpParams) -> Self {
        Self { params }
    }

    /// The first stage alone: the path, and its total cost in px.
    ///
    /// # Errors
    /// As [`CostModel::new`] and [`align_curves`].
    pub fn align(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<Alignment, MatchError> {
        self.align_costs(&self.costs(curve1, curve2, rig)?)
    }

    /// The first two stages: the refined pairs of pixels, one per cell of the path.
    ///
    /// # Errors
    /// As [`align`](Self::align).
    pub fn pairs(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<Vec<PixelPair>, MatchError> {
        let costs = self.costs(curve1, curve2, rig)?;
        let alignment = self.align_costs(&costs)?;
        Ok(refine(&alignment.path, &costs, self.params.refine, self.params.refine_directions))
    }

    fn costs(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CostModel, MatchError> {
        CostModel::new(rig.fundamental(), curve1, curve2, self.params.distance)
    }

    fn align_costs(&self, costs: &CostModel) -> Result<Alignment, MatchError> {
        align_curves(costs, self.params.ties)
    }
}

impl Default for Ecdp {
    /// [`EcdpParams::PAPER`].
    fn default() -> Self {
        Self::new(EcdpParams::PAPER)
    }
}

impl CurveMatcher for Ecdp {
    fn name(&self) -> &'static str {
        "ecdp"
    }

    /// See [`CurveMatcher::reconstruct`]. One point per cell of the path; cells that cannot be
    /// triangulated are counted in [`CurveReconstruction::dropped`].
    fn reconstruct(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CurveReconstruction, MatchError> {
        let pairs = self.pairs(curve1, curve2, rig)?;
        triangulate_pairs(self.name(), rig, self.params.triangulation, &pairs)
    }
}
