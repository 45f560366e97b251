use accurate_fit::{
    AdaptiveParams, Judgement, OutlineFit, OutlineFitParams, OutlinePair, fit_outlines,
    fit_outlines_adaptively,
};
use accurate_geom::{EpipolarAngle, Pixel, Rig, View1, View2};
use accurate_match::{Proposal, ProposeParams, propose_pairs};
use accurate_traverse::WalkParams;
use ndarray::Array2;

use super::candidates::{ViewCandidates, free_ends};
use super::start::start_from;
use crate::Error;

/// How hard the joint choice looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobustParams {
    /// The walks of each view.
    pub walks: WalkParams,
    /// The pairing of walks.
    pub propose: ProposeParams,
    /// Most pairs that are fitted.
    pub max_fits: usize,
    /// Fewest pairs that are fitted before a good one ends the search.
    pub min_fits: usize,
    /// Pairs that are fitted before a good one ends the search, however close the next proposal.
    pub enough_fits: usize,
    /// The next proposal must be worse than the best one by this before the search ends early.
    pub clear_lead: f64,
    /// Fits that are carried to convergence before the last choice.
    pub finalists: usize,
    /// A fit is good if it leaves less than this unexplained or outside.
    pub good_unexplained: f64,
    /// A fit is good if its mean squared residual is below this, px²; 1/18 at the truth.
    pub good_chi_per_point: f64,
    /// A fit is good only if its walks agree to this mean epipolar distance, px: a pair that does
    /// not agree may still be bent into explaining both outlines.
    pub good_distance_px: f64,
    /// Weight of the walks' own cost in the final choice.
    pub walk_weight: f64,
}

impl RobustParams {
    /// Tuned on seeds 1000 to 1999 of the generated families.
    pub const DEFAULT: Self = Self {
        walks: WalkParams::DEFAULT,
        propose: ProposeParams::DEFAULT,
        max_fits: 40,
        min_fits: 3,
        enough_fits: 16,
        clear_lead: 2.5,
        finalists: 6,
        good_unexplained: 0.15,
        good_chi_per_point: 0.0575,
        good_distance_px: 1.0,
        walk_weight: 0.3,
    };
}

/// What the joint choice settled on.
pub(crate) struct JointResult {
    pub(crate) fit: OutlineFit,
    pub(crate) walk1: Vec<Pixel<View1>>,
    pub(crate) walk2: Vec<Pixel<View2>>,
    pub(crate) coverage: [f64; 2],
    /// Mean Sampson distance of the chosen walks' alignment, px.
    pub(crate) mean_distance_px: f64,
    /// Score of the best fit from another pair of walks, minus the chosen one's; infinite if there
    /// is none.
    pub(crate) margin: f64,
    pub(crate) fits: usize,
}

struct Candidate {
    proposal: Proposal,
    fit: OutlineFit,
    score: f64,
    mean_distance_px: f64,
}

/// Proposes, pairs, fits, judges.
///
/// # Errors
/// [`Error`] of a view that shows no curve; [`Error::NoCandidate`] if no pair of walks gives one.
pub(crate) fn reconstruct_masks(
    masks: &[Array2<bool>; 2],
    rig: &Rig,
    params: &RobustParams,
    case: &str,
) -> Result<JointResult, Error> {
    let view1 = ViewCandidates::<View1>::of(&masks[0], &params.walks, case)?;
    let view2 = ViewCandidates::<View2>::of(&masks[1], &params.walks, case)?;
    let matching = |source| Error::Matching { case: case.to_owned(), source };
    let angles = EpipolarAngle::new(rig);
    let proposals = propose_pairs(&angles, &view1.signals(), &view2.signals(), &params.propose)
        .map_err(matching)?;
    let outlines = OutlinePair::new(&view1.outline, &view2.outline)
        .with_bridges(&view1.bridges, &view2.bridges);

    let mut candidates: Vec<Candidate> = Vec::new();
    for proposal in &proposals {
        if candidates.len() >= params.max_fits || settled(&candidates, proposal, params) {
            break;
        }
        candidates.extend(judged(proposal, &view1, &view2, &outlines, rig, params));
    }
    let fits = candidates.len();
    candidates.sort_by(|a, b| a.score.total_cmp(&b.score));
    candidates.truncate(params.finalists);
    for candidate in &mut candidates {
        converge(candidate, &outlines, rig, params);
    }
    candidates.sort_by(|a, b| a.score.total_cmp(&b.score));
    let margin = candidates
        .iter()
        .skip(1)
        .find(|c| {
            (c.proposal.i, c.proposal.j) != (candidates[0].proposal.i, candidates[0].proposal.j)
        })
        .map_or(f64::INFINITY, |c| c.score - candidates[0].score);
    let Some(best) = candidates.into_iter().next() else {
        return Err(Error::NoCandidate {
            case: case.to_owned(),
            walks: [view1.walks.len(), view2.walks.len()],
            pairs: proposals.len(),
        });
    };
    let fit = fit_outlines_adaptively(
        &best.fit.curve,
        &outlines,
        rig,
        &settled_params(),
        &AdaptiveParams::DEFAULT,
    )
    .unwrap_or(best.fit);
    let (i, j) = (best.proposal.i, best.proposal.j);
    Ok(JointResult {
        fit,
        walk1: view1.walks[i].points.clone(),
        walk2: directed(&view2.walks[j].points, best.proposal.reversed),
        coverage: [view1.walks[i].coverage, view2.walks[j].coverage],
        mean_distance_px: best.mean_distance_px,
        margin,
        fits,
    })
}

fn directed(points: &[Pixel<View2>], reversed: bool) -> Vec<Pixel<View2>> {
    if reversed { points.iter().rev().copied().collect() } else { points.to_vec() }
}

fn good(judgement: &Judgement, mean_distance_px: f64, params: &RobustParams) -> bool {
    judgement.unexplained + judgement.outside < params.good_unexplained
        && judgement.chi_per_point() < params.good_chi_per_point
        && mean_distance_px < params.good_distance_px
}

/// Whether a good fit is there and the next proposal is not worth a try.
fn settled(candidates: &[Candidate], next: &Proposal, params: &RobustParams) -> bool {
    let tried = candidates.len();
    let best = candidates
        .iter()
        .filter(|c| good(&c.fit.judgement, c.mean_distance_px, params))
        .map(|c| c.proposal.score)
        .min_by(f64::total_cmp);
    best.is_some_and(|best| {
        tried >= params.enough_fits
            || (tried >= params.min_fits && next.score > best + params.clear_lead)
    })
}

/// The better of a plain and, unless that is good already, an annealed fit.
fn judged(
    proposal: &Proposal,
    view1: &ViewCandidates<View1>,
    view2: &ViewCandidates<View2>,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    params: &RobustParams,
) -> Option<Candidate> {
    let (walk1, walk2) = (&view1.walks[proposal.i], &view2.walks[proposal.j]);
    let spacing = OutlineFitParams::DEFAULT.knot_spacing_px;
    let (start, mean_distance_px) = start_from(
        (&walk1.points, free_ends(walk1)),
        (&walk2.points, free_ends(walk2)),
        proposal.reversed,
        rig,
        spacing,
    )?;
    let plain = fit_outlines(&start, outlines, rig, &OutlineFitParams::DEFAULT).ok();
    let fit = match plain {
        Some(fit) if good(&fit.judgement, mean_distance_px, params) => fit,
        plain => {
            let annealed = fit_outlines(&start, outlines, rig, &OutlineFitParams::ANNEALED).ok();
            [plain, annealed]
                .into_iter()
                .flatten()
                .min_by(|a, b| a.judgement.score().total_cmp(&b.judgement.score()))?
        }
    };
    let walks_cost = walk1.cost.total() + walk2.cost.total();
    let disagreement = (mean_distance_px - params.good_distance_px).max(0.0);
    let score = fit.judgement.score() + params.walk_weight * walks_cost + disagreement;
    Some(Candidate { proposal: *proposal, fit, score, mean_distance_px })
}

/// Carries a fit on with its last settings; ranking before convergence picks wrong loops.
fn converge(
    candidate: &mut Candidate,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    _params: &RobustParams,
) {
    let Ok(fit) = fit_outlines(&candidate.fit.curve, outlines, rig, &settled_params()) else {
        return;
    };
    let gain = candidate.fit.judgement.score() - fit.judgement.score();
    if gain > 0.0 {
        candidate.score -= gain;
        candidate.fit = fit;
    }
}

/// For a start that is a fit already: its last settings from the first step on.
fn settled_params() -> OutlineFitParams {
    let d = OutlineFitParams::DEFAULT;
    OutlineFitParams {
        cauchy_scale_start_px: d.cauchy_scale_px,
        subsample: false,
        iterations: 8,
        ..d
    }
}
