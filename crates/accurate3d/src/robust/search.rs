use accurate_fit::{OutlineFit, OutlineFitParams, OutlinePair, fit_outlines};
use accurate_geom::{Curve3, EpipolarAngle, Pixel, Rig, View, View1, View2};
use accurate_match::{Proposal, propose_pairs};

use super::RobustParams;
use super::candidates::{ViewCandidates, free_ends};
use super::score::{Candidate, Cuts, Origin};
use super::start::start_from;
use crate::Error;

/// Two curves that are nowhere farther apart than this are one, px.
pub(crate) const SAME_PX: f64 = 2.0;

/// Knots for curves that bend more than the usual ones can, px.
pub(crate) const FINE_KNOTS_PX: f64 = 5.0;

/// Everything that stays the same while candidates come and go.
pub(crate) struct Search<'a> {
    pub(crate) outlines: &'a OutlinePair<'a>,
    pub(crate) cuts: &'a Cuts,
    pub(crate) rig: &'a Rig,
    pub(crate) params: &'a RobustParams,
    pub(crate) case: &'a str,
}

impl Search<'_> {
    /// Pairs the walks from the given numbers on, fits the pairs in the order of their promise, and
    /// stops early once a good one is there and the next are not worth a try. Returns the number of
    /// pairs proposed and adds to `found`, unsorted.
    pub(crate) fn propose_and_fit(
        &self,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
        from: [usize; 2],
        max_fits: usize,
        found: &mut Vec<Candidate>,
    ) -> Result<usize, Error> {
        let matching = |source| Error::Matching { case: self.case.to_owned(), source };
        let angles = EpipolarAngle::new(self.rig);
        let (signals1, signals2) = (view1.signals(from[0]), view2.signals(from[1]));
        let proposals =
            propose_pairs(&angles, &signals1, &signals2, &self.params.propose).map_err(matching)?;
        let mut tried: Vec<Proposal> = Vec::new();
        for proposal in &proposals {
            let proposal =
                Proposal { i: proposal.i + from[0], j: proposal.j + from[1], ..*proposal };
            if tried.len() >= max_fits || self.settled(found, tried.len(), &proposal) {
                break;
            }
            if tried.iter().any(|known| are_alike(known, &proposal, view1, view2)) {
                continue;
            }
            tried.push(proposal);
            found.extend(self.judged(&proposal, view1, view2));
        }
        Ok(proposals.len())
    }

    /// Whether a good fit is there and the next proposal is not worth a try.
    fn settled(&self, found: &[Candidate], tried: usize, next: &Proposal) -> bool {
        let best = found
            .iter()
            .filter(|c| c.is_good(self.params))
            .map(|c| c.proposal_score)
            .min_by(f64::total_cmp);
        best.is_some_and(|best| {
            tried >= self.params.enough_fits
                || (tried >= self.params.min_fits && next.score > best + self.params.clear_lead)
        })
    }

    /// The better of a plain and, unless that is good already, an annealed fit.
    fn judged(
        &self,
        proposal: &Proposal,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) -> Option<Candidate> {
        let (walk1, walk2) = (&view1.walks[proposal.i], &view2.walks[proposal.j]);
        let (start, mean_distance_px) = start_from(
            (&walk1.points, free_ends(walk1)),
            (&walk2.points, free_ends(walk2)),
            proposal.reversed,
            self.rig,
            OutlineFitParams::DEFAULT.knot_spacing_px,
        )?;
        let origin = Origin {
            walks: [proposal.i, proposal.j],
            reversed: proposal.reversed,
            walks_cost: walk1.cost.total() + walk2.cost.total(),
            mean_distance_px,
            proposal_score: proposal.score,
        };
        let judge = |fit| Candidate::new(fit, &origin, self.cuts, self.rig, self.params);
        let plain = self.fit(&start, &OutlineFitParams::DEFAULT).map(judge);
        let plain = plain.map(|candidate| self.with_finer_knots(candidate));
        if plain.as_ref().is_some_and(|c| c.is_good(self.params)) {
            return plain;
        }
        let annealed = self.fit(&start, &OutlineFitParams::ANNEALED).map(judge);
        [plain, annealed].into_iter().flatten().min_by(|a, b| a.score.total_cmp(&b.score))
    }

    /// The candidate with knots half as far apart, if it nearly explains the outlines and they
    /// explain more: a J tip bends more than the usual ones can.
    pub(crate) fn with_finer_knots(&self, candidate: Candidate) -> Candidate {
        /// Beyond this it is not the knots.
        const MOST: f64 = 6.0;
        const GAIN: f64 = 1.0;
        if candidate.is_good(self.params) || candidate.misfit > MOST || candidate.has_fine_knots() {
            return candidate;
        }
        match self.fit(&candidate.fit.curve, &settled_params(FINE_KNOTS_PX)) {
            Some(fit) => {
                let finer = candidate.refitted(fit, self.cuts, self.rig);
                if finer.score < candidate.score - GAIN { finer } else { candidate }
            }
            None => candidate,
        }
    }

    pub(crate) fn fit(&self, start: &Curve3, params: &OutlineFitParams) -> Option<OutlineFit> {
        fit_outlines(start, self.outlines, self.rig, params).ok()
    }

    /// The fit carried on with its last settings until it rests; ranking before that picks wrong
    /// loops.
    pub(crate) fn converged(&self, candidate: &Candidate) -> Candidate {
        const ROUNDS: usize = 4;
        const REST: f64 = 0.3;
        let mut best = candidate.clone();
        for _ in 0..ROUNDS {
            let Some(fit) = self.fit(&best.fit.curve, &best.settled_params()) else { break };
            let next = best.refitted(fit, self.cuts, self.rig);
            let gain = best.score - next.score;
            if gain > 0.0 {
                best = next;
            }
            if gain < REST {
                break;
            }
        }
        best
    }

    /// The best different curves, converged, best first.
    pub(crate) fn finalists(&self, mut found: Vec<Candidate>) -> Vec<Candidate> {
        let different = |mut list: Vec<Candidate>| {
            list.sort_by(|a, b| a.score.total_cmp(&b.score));
            let mut kept: Vec<Candidate> = Vec::new();
            for candidate in list {
                if kept.iter().all(|k| !k.shape.is_like(&candidate.shape, SAME_PX)) {
                    kept.push(candidate);
                }
            }
            kept
        };
        found = different(found);
        found.truncate(self.params.finalists);
        different(found.iter().map(|candidate| self.converged(candidate)).collect())
    }
}

/// For a start that is a fit already: its last settings from the first step on.
pub(crate) fn settled_params(knot_spacing_px: f64) -> OutlineFitParams {
    let d = OutlineFitParams::DEFAULT;
    OutlineFitParams {
        knot_spacing_px,
        cauchy_scale_start_px: d.cauchy_scale_px,
        subsample: false,
        iterations: 8,
        ..d
    }
}

/// Whether two pairs of walks would start the same fit.
fn are_alike(
    a: &Proposal,
    b: &Proposal,
    view1: &ViewCandidates<View1>,
    view2: &ViewCandidates<View2>,
) -> bool {
    let (a1, b1) = (&view1.walks[a.i].points, &view1.walks[b.i].points);
    let (a2, b2) = (&view2.walks[a.j].points, &view2.walks[b.j].points);
    // Both walks of a pair may run the other way.
    match (directed(a1, b1), directed(a2, b2)) {
        (Some([same1, back1]), Some([same2, back2])) => {
            if a.reversed == b.reversed {
                (same1 && same2) || (back1 && back2)
            } else {
                (same1 && back2) || (back1 && same2)
            }
        }
        _ => false,
    }
}

/// Whether two walks pass the same places at the same fractions of their lengths, in the same and in
/// the other direction; `None` if in neither.
fn directed<V: View>(a: &[Pixel<V>], b: &[Pixel<V>]) -> Option<[bool; 2]> {
    const SAMPLES: usize = 40;
    const LENGTH_PX: usize = 6;
    const NEAR_PX: f64 = 4.0;
    if a.len().abs_diff(b.len()) > LENGTH_PX {
        return None;
    }
    let at = |list: &[Pixel<V>], k: usize| list[k * (list.len() - 1) / SAMPLES];
    let same = (0..=SAMPLES).all(|k| at(a, k).distance(at(b, k)) < NEAR_PX);
    let back = (0..=SAMPLES).all(|k| at(a, k).distance(at(b, SAMPLES - k)) < NEAR_PX);
    (same || back).then_some([same, back])
}
