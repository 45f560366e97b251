use accurate_fit::{OutlineFit, OutlineFitParams};
use accurate_geom::{Pixel, Rig, View1, View2};

use super::RobustParams;
use super::search::{FINE_KNOTS_PX, settled_params};
use super::shape::{Shape, bending, px_per_unit};

/// Ends of bridges, where the outline is the cut face of something that hides the body.
pub(crate) struct Cuts {
    at: [Vec<[f64; 2]>; 2],
}

/// A stretch of outline that lies wholly this near to the end of a bridge is a cut face, px.
const CUT_PX: f64 = 5.0;
/// Weight of the bending in a score.
const BENDING: f64 = 5.0;

impl Cuts {
    pub(crate) fn new(
        bridges1: &[(Pixel<View1>, Pixel<View1>)],
        bridges2: &[(Pixel<View2>, Pixel<View2>)],
    ) -> Self {
        let at1 = bridges1.iter().flat_map(|(a, b)| [[a.x, a.y], [b.x, b.y]]).collect();
        let at2 = bridges2.iter().flat_map(|(a, b)| [[a.x, a.y], [b.x, b.y]]).collect();
        Self { at: [at1, at2] }
    }

    /// What a fit leaves unexplained besides cut faces.
    pub(crate) fn unexplained(&self, fit: &OutlineFit) -> f64 {
        let cut = |view: u8, points: &[[f64; 2]]| {
            self.at[usize::from(view == 2)]
                .iter()
                .any(|[x, y]| points.iter().all(|[px, py]| (px - x).hypot(py - y) < CUT_PX))
        };
        let faces: f64 = fit
            .unexplained
            .iter()
            .filter(|stretch| cut(stretch.view, &stretch.points))
            .map(|stretch| stretch.unexplained)
            .sum();
        (fit.judgement.unexplained - faces).max(0.0)
    }
}

/// A fitted curve with all that counts in the choice.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// Index of the walk of each view, and whether the second runs against the first.
    pub(crate) walks: [usize; 2],
    pub(crate) reversed: bool,
    pub(crate) fit: OutlineFit,
    pub(crate) shape: Shape,
    knot_spacing_px: f64,
    /// Outline left unexplained besides cut faces, and curve outside the masks.
    pub(crate) misfit: f64,
    /// Less is better.
    pub(crate) score: f64,
    /// What does not depend on the fit.
    pub(crate) prior: f64,
    pub(crate) mean_distance_px: f64,
    /// Score of the proposal it came from.
    pub(crate) proposal_score: f64,
}

/// What a candidate was before it was fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Origin {
    pub(crate) walks: [usize; 2],
    pub(crate) reversed: bool,
    pub(crate) walks_cost: f64,
    pub(crate) mean_distance_px: f64,
    pub(crate) proposal_score: f64,
}

impl Candidate {
    pub(crate) fn new(
        fit: OutlineFit,
        origin: &Origin,
        cuts: &Cuts,
        rig: &Rig,
        params: &RobustParams,
    ) -> Self {
        let disagreement = (origin.mean_distance_px - params.good_distance_px).max(0.0);
        let prior = params.walk_weight * origin.walks_cost + disagreement;
        let mut candidate = Self {
            walks: origin.walks,
            reversed: origin.reversed,
            shape: Shape::new(&fit.curve, rig),
            fit,
            knot_spacing_px: 0.0,
            misfit: 0.0,
            score: 0.0,
            prior,
            mean_distance_px: origin.mean_distance_px,
            proposal_score: origin.proposal_score,
        };
        candidate.judge(cuts, rig);
        candidate
    }

    /// The same origin with another fit.
    pub(crate) fn refitted(&self, fit: OutlineFit, cuts: &Cuts, rig: &Rig) -> Self {
        let shape = Shape::new(&fit.curve, rig);
        let mut candidate = Self { fit, shape, ..self.clone() };
        candidate.judge(cuts, rig);
        candidate
    }

    fn judge(&mut self, cuts: &Cuts, rig: &Rig) {
        let curve = &self.fit.curve;
        let spans = curve.breakpoints().len().max(2) - 1;
        self.knot_spacing_px =
            1.3 * curve.arc_length() * px_per_unit(&curve.sample(16), rig) / spans as f64;
        let judgement = &self.fit.judgement;
        self.misfit = cuts.unexplained(&self.fit) + judgement.outside;
        self.score = self.misfit
            + 0.5 * judgement.chi
            + BENDING * bending(&self.fit.curve, rig)
            + self.prior;
    }

    /// Whether its knots are those for curves that bend much.
    pub(crate) fn has_fine_knots(&self) -> bool {
        self.knot_spacing_px < OutlineFitParams::DEFAULT.knot_spacing_px
    }

    /// Settings for carrying the fit on.
    pub(crate) fn settled_params(&self) -> OutlineFitParams {
        let spacing = if self.has_fine_knots() {
            FINE_KNOTS_PX
        } else {
            OutlineFitParams::DEFAULT.knot_spacing_px
        };
        settled_params(spacing)
    }

    /// Whether nothing speaks against it.
    pub(crate) fn is_good(&self, params: &RobustParams) -> bool {
        self.misfit < params.good_unexplained
            && self.fit.judgement.chi_per_point() < params.good_chi_per_point
            && self.mean_distance_px < params.good_distance_px
    }
}
