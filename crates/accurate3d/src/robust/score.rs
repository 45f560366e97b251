use accurate_fit::{OutlineFit, OutlineFitParams, UnexplainedStretch};
use accurate_geom::Rig;

use super::RobustParams;
use super::fitting::SETTLED;
use super::hairpins::Turns;
use super::shape::{Shape, bending};
use crate::ConsideredCurve;

/// A stretch of outline that lies wholly this near to the end of a bridge is a cut face, px.
const CUT_PX: f64 = 5.0;
/// A cut face leaves no more than this unexplained.
const CUT_UNEXPLAINED: f64 = 0.3;
/// A piece of outline by itself, on a probability map, that the curve passes by: a segmentation adds
/// short pieces, and misses the body rather than to invent a long one. Up to the first number of
/// points it counts as the share says, from the second on in full.
const STRAY_POINTS: [f64; 2] = [120.0, 300.0];
const STRAY_SHARE: f64 = 0.1;
/// Weights in a score, all on half a squared px of residual. Of pairs of curves that explain the
/// outlines, the less bent one is right more often: the other bends to serve the noise.
pub(super) const MISFIT: f64 = 2.0;
pub(super) const BENDING: f64 = 10.0;
/// -2 ln of a probability for half a squared px: a residual has the variance 3/18 px² then.
const SURPRISE_PER_SCORE: f64 = 12.0;
/// What a boundary point costs that the curve does not use, px²: what it would cost at the truth, so
/// that losing points is no gain.
const UNUSED_PX2: f64 = 1.0 / 18.0;

/// Boundary points of both views up to which a limit of what is unexplained holds as it is.
const USUAL_POINTS: f64 = 3000.0;

/// By how much more a curve may leave unexplained for so many boundary points: the misfits of a few tenths
/// of a px that a right one has in its tightest bends add up along it.
pub(super) fn allowance(boundary_points: usize) -> f64 {
    (boundary_points as f64 / USUAL_POINTS).max(1.0)
}

/// Where a walk takes a bridge, `[x, y]`, by view: there the outline is the cut face of something that
/// hides the body.
pub(crate) type CutEnds = [Vec<[f64; 2]>; 2];

/// What a fit leaves unexplained besides cut faces and strays.
fn unexplained(fit: &OutlineFit, cuts: &CutEnds) -> f64 {
    let cut = |view: u8, points: &[[f64; 2]]| {
        cuts[usize::from(view == 2)]
            .iter()
            .any(|[x, y]| points.iter().all(|[px, py]| (px - x).hypot(py - y) < CUT_PX))
    };
    let face = |stretch: &UnexplainedStretch| {
        let is_face = cut(stretch.view, &stretch.points);
        if is_face { stretch.unexplained.min(CUT_UNEXPLAINED) } else { 0.0 }
    };
    // A piece beside a cut end is one or the other.
    let forgiven: f64 = fit.unexplained.iter().map(|s| face(s).max(stray(s))).sum();
    (fit.judgement.unexplained - forgiven).max(0.0)
}

/// What need not be explained of a piece of a segmentation that is none of the body.
fn stray(stretch: &UnexplainedStretch) -> f64 {
    if !(stretch.isolated && stretch.from_map) {
        return 0.0;
    }
    let points = stretch.points.len() as f64;
    let [from, to] = STRAY_POINTS;
    let share = STRAY_SHARE + (1.0 - STRAY_SHARE) * ((points - from) / (to - from));
    (1.0 - share.clamp(STRAY_SHARE, 1.0)) * stretch.unexplained
}

/// A fitted curve with all that counts in the choice.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// Index of the walk of each view, and whether the second runs against the first.
    pub(crate) walks: [usize; 2],
    pub(crate) reversed: bool,
    pub(crate) cuts: CutEnds,
    pub(crate) fit: OutlineFit,
    pub(crate) shape: Shape,
    /// Settings for carrying the fit on.
    pub(crate) settings: OutlineFitParams,
    /// Whether it is good, perhaps only with finer knots.
    pub(crate) good: bool,
    /// Whether carrying the fit on gains nothing more.
    pub(crate) rests: bool,
    /// Whether no repair helps.
    pub(crate) mended: bool,
    /// Outline left unexplained besides cut faces, and curve outside the masks.
    pub(crate) misfit: f64,
    /// Less is better.
    pub(crate) score: f64,
    /// How it turns where hardly any body does, and the prices of that.
    pub(crate) turns: Turns,
    turn_weights: [f64; 2],
    /// What does not depend on the fit.
    pub(crate) prior: f64,
    pub(crate) mean_distance_px: f64,
    /// Score of the proposal it came from.
    pub(crate) proposal_score: f64,
}

/// What a candidate was before it was fitted.
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    pub(crate) walks: [usize; 2],
    pub(crate) cuts: CutEnds,
    pub(crate) reversed: bool,
    pub(crate) walks_cost: f64,
    pub(crate) mean_distance_px: f64,
    pub(crate) proposal_score: f64,
}

impl Candidate {
    pub(crate) fn new(fit: OutlineFit, origin: &Origin, rig: &Rig, params: &RobustParams) -> Self {
        let disagreement = (origin.mean_distance_px - params.good_distance_px).max(0.0);
        let prior = params.walk_weight * origin.walks_cost + disagreement;
        let mut candidate = Self {
            walks: origin.walks,
            reversed: origin.reversed,
            cuts: origin.cuts.clone(),
            shape: Shape::new(&fit.curve, rig),
            fit,
            settings: SETTLED,
            good: false,
            rests: false,
            mended: false,
            misfit: 0.0,
            score: 0.0,
            turns: Turns { kinks: 0.0, doubled_px: 0.0 },
            turn_weights: [params.kink_weight, params.doubled_weight],
            prior,
            mean_distance_px: origin.mean_distance_px,
            proposal_score: origin.proposal_score,
        };
        candidate.judge(rig);
        candidate
    }

    /// The same origin with another fit, which is carried on with these settings.
    pub(crate) fn refitted(&self, fit: OutlineFit, settings: OutlineFitParams, rig: &Rig) -> Self {
        let shape = Shape::new(&fit.curve, rig);
        let mut candidate =
            Self { fit, shape, settings, rests: false, mended: false, ..self.clone() };
        candidate.judge(rig);
        candidate
    }

    /// A fit that started from stretches of both: as likely by its walks as they are on average.
    pub(crate) fn crossed(
        &self,
        other: &Self,
        fit: OutlineFit,
        rig: &Rig,
        params: &RobustParams,
    ) -> Self {
        let prior = 0.5 * (self.prior + other.prior);
        let mut cross = Self { prior, ..self.clone() }.refitted(fit, SETTLED, rig);
        cross.good = cross.is_good(params);
        cross
    }

    /// What a reader is told about it.
    pub(crate) fn considered(&self) -> ConsideredCurve {
        const SAMPLES: usize = 200;
        let judgement = &self.fit.judgement;
        ConsideredCurve {
            walks: self.walks,
            reversed: self.reversed,
            score: self.score,
            unlikeliness: self.fit.surprise.map(|_| self.unlikeliness()),
            unexplained: self.misfit - judgement.outside,
            outside: judgement.outside,
            chi_per_point: judgement.chi_per_point(),
            mean_distance_px: self.mean_distance_px,
            points: self.fit.curve.sample(SAMPLES),
        }
    }

    fn judge(&mut self, rig: &Rig) {
        let judgement = &self.fit.judgement;
        self.misfit = unexplained(&self.fit, &self.cuts) + judgement.outside;
        self.turns = Turns::of(&self.fit.curve, rig, self.turn_weights);
        let total = |count: [usize; 2]| (count[0] + count[1]) as f64;
        let unused = (total(judgement.points) - total(judgement.used)).max(0.0);
        self.score = MISFIT * self.misfit
            + 0.5 * (judgement.chi + UNUSED_PX2 * unused)
            + BENDING * bending(&self.fit.curve, rig)
            + self.turns.price(self.turn_weights)
            + self.prior;
    }

    /// How much less likely than others it is, on the scale of a score: by [`OutlineFit::surprise`]
    /// where the fit was adaptive.
    pub(crate) fn unlikeliness(&self) -> f64 {
        self.fit.surprise.map_or(f64::INFINITY, |surprise| surprise / SURPRISE_PER_SCORE)
            + MISFIT * self.misfit
            + self.turns.price(self.turn_weights)
            + self.prior
    }

    /// Whether nothing speaks against it.
    pub(crate) fn is_good(&self, params: &RobustParams) -> bool {
        let judgement = &self.fit.judgement;
        self.misfit < allowance(judgement.boundary_points()) * params.good_unexplained
            && judgement.chi_per_point() < params.good_chi_per_point
            && !self.turns.are_back()
            && self.mean_distance_px < params.good_distance_px
    }
}
