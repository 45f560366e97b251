use accurate_fit::{
    AdaptiveParams, CalibrationEstimate, OutlineFit, OutlineFitParams, OutlinePair, fit_outlines,
    fit_outlines_adaptively, fit_outlines_and_calibration, start_curve,
};
use accurate_geom::{Curve3, EpipolarAngle, Pixel, Point3, Rig, View, View1, View2};
use accurate_match::{FreeEnds, Proposal, ProposeParams, propose_pairs};

use super::RobustParams;
use super::candidates::{ViewCandidates, free_ends};
use super::score::{Candidate, CutEnds, Origin};
use super::shape::{Shape, arc_lengths_px, dense, is_shown_near, px_per_unit};
use super::side_by_side::side_by_side;
use super::start::{OTHER_PRICES, PRICES, start_from};
use crate::Error;

/// Two curves that are nowhere farther apart than this are one, px.
pub(crate) const SAME_PX: f64 = 2.0;
/// A start no farther than this from a fitted curve would end there, px: within reach of the fit.
const SAME_START_PX: f64 = 4.0;
/// Fits from two starts that are nowhere farther apart end in the same curve, px.
const SAME_FIT_PX: f64 = 0.5;

/// For a start within a few px: to tell the good from the bad, not to the end.
pub(crate) const PLAIN: OutlineFitParams =
    OutlineFitParams { tolerance: 1e-3, ..OutlineFitParams::DEFAULT };

/// For a start that may run along the wrong strand for a stretch.
pub(crate) const ANNEALED: OutlineFitParams =
    OutlineFitParams { tolerance: 1e-3, ..OutlineFitParams::ANNEALED };

/// For a start that is a fit already: the last settings from the first step on.
pub(crate) const SETTLED: OutlineFitParams = OutlineFitParams {
    cauchy_scale_start_px: OutlineFitParams::DEFAULT.cauchy_scale_px,
    subsample: false,
    iterations: 8,
    // Less than a tenth of what scores are compared by.
    tolerance: 3e-4,
    ..OutlineFitParams::DEFAULT
};

/// The same for curves that bend more than the usual knots and smoothness allow.
pub(crate) const FINE: OutlineFitParams = OutlineFitParams {
    iterations: SETTLED.iterations,
    tolerance: SETTLED.tolerance,
    ..OutlineFitParams::FINE
};

/// Steps of the last fit before those that find its smoothness too.
const LAST_ITERATIONS: usize = 3;

/// A margin beyond this is as good as any larger one.
const CLEAR: f64 = 5.0;
/// A score so much worse than a good one's is no rival's.
const BEHIND: f64 = 10.0;

/// How much around the ends of bridges a restart spans smoothly, px.
pub(crate) const BRIDGED_PX: [f64; 2] = [12.0, 25.0];

/// Pairs kept at each sieve of the proposals where a good curve is likely among the first; see
/// [`ProposeParams`].
const QUICK_KEPT: [usize; 3] = [600, 24, 20];

/// A pair that was fitted.
#[derive(Debug, Clone)]
pub(crate) struct Tried {
    proposal: Proposal,
    /// Where its fit started.
    start: Shape,
    /// From every start.
    wholly: bool,
}

/// Where the fit of a pair starts.
struct Start {
    curve: Curve3,
    shape: Shape,
    origin: Origin,
}

/// A candidate, and whether it was fitted from every start.
struct Judged {
    candidate: Candidate,
    wholly: bool,
}

/// Everything that stays the same while candidates come and go.
pub(crate) struct Search<'a> {
    pub(crate) outlines: &'a OutlinePair<'a>,
    pub(crate) rig: &'a Rig,
    pub(crate) params: &'a RobustParams,
    pub(crate) case: &'a str,
    pub(crate) effort: Effort,
}

/// How much is tried before a good curve is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effort {
    /// What is right for most.
    Quick,
    /// All proposals up to [`RobustParams::max_fits`], each from every start.
    Thorough,
}

impl Search<'_> {
    /// Pairs the walks from the given numbers on, fits the pairs in the order of their promise, and
    /// stops early once a good one is there and the next are not worth a try. Returns the number of
    /// pairs proposed and adds to `found`, unsorted, and to `tried`, whose pairs are not tried again.
    pub(crate) fn propose_and_fit(
        &self,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
        from: [usize; 2],
        max_fits: usize,
        tried: &mut Vec<Tried>,
        found: &mut Vec<Candidate>,
    ) -> Result<usize, Error> {
        let matching = |source| Error::Matching { case: self.case.to_owned(), source };
        let angles = EpipolarAngle::new(self.rig);
        let (signals1, signals2) = (view1.signals(from[0]), view2.signals(from[1]));
        let params = &self.params.propose;
        let params = match self.effort {
            Effort::Quick => ProposeParams {
                keep_screened: params.keep_screened.min(QUICK_KEPT[0]),
                keep_coarse: params.keep_coarse.min(QUICK_KEPT[1]),
                keep_fine: params.keep_fine.min(QUICK_KEPT[2]),
                // What is tried first is taken if it looks good.
                doubled_weight: 0.0,
                ..*params
            },
            Effort::Thorough => *params,
        };
        let proposals = propose_pairs(&angles, &signals1, &signals2, &params).map_err(matching)?;
        // Pairs that were looked at, and those among them that start another fit.
        let (mut count, mut fits) = (0, 0);
        let mut starts = Vec::new();
        for proposal in &proposals {
            let proposal =
                Proposal { i: proposal.i + from[0], j: proposal.j + from[1], ..*proposal };
            if fits >= max_fits || self.settled(found, count, &proposal) {
                break;
            }
            let mut known = tried.iter().filter(|t| t.wholly || self.effort == Effort::Quick);
            if known.clone().any(|t| are_alike(&t.proposal, &proposal, view1, view2)) {
                continue;
            }
            let Some(start) = self.start(&proposal, view1, view2) else { continue };
            count += 1;
            if known.any(|t| t.start.is_like(&start.shape, SAME_FIT_PX)) {
                continue;
            }
            fits += 1;
            let mut wholly = true;
            let shape = start.shape.clone();
            if self.effort == Effort::Thorough {
                starts.push(start);
            } else {
                let good = found.iter().filter(|c| c.good).map(|c| c.score).min_by(f64::total_cmp);
                if let Some(judged) = self.judged(&start, good) {
                    wholly = judged.wholly;
                    found.push(judged.candidate);
                }
            }
            tried.push(Tried { proposal, start: shape, wholly });
        }
        // With much effort no fit decides about the next.
        let judged = side_by_side(&starts, |start| self.judged(start, None));
        found.extend(judged.into_iter().flatten().map(|judged| judged.candidate));
        Ok(proposals.len())
    }

    /// Whether a good fit is there and the next proposal is not worth a try.
    fn settled(&self, found: &[Candidate], tried: usize, next: &Proposal) -> bool {
        if self.effort == Effort::Thorough {
            return false;
        }
        let best = found.iter().filter(|c| c.good).map(|c| c.proposal_score).min_by(f64::total_cmp);
        best.is_some_and(|best| {
            tried >= self.params.enough_fits
                || (tried >= self.params.min_fits && next.score > best + self.params.clear_lead)
        })
    }

    /// Where the fit of a pair starts; `None` if it gives no curve.
    fn start(
        &self,
        proposal: &Proposal,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) -> Option<Start> {
        let (walk1, walk2) = (&view1.walks[proposal.i], &view2.walks[proposal.j]);
        let (curve, mean_distance_px) = start_from(
            &PRICES,
            (&walk1.points, free_ends(walk1)),
            (&walk2.points, free_ends(walk2)),
            proposal.reversed,
            self.rig,
            OutlineFitParams::DEFAULT.knot_spacing_px,
        )?;
        let origin = Origin {
            walks: [proposal.i, proposal.j],
            reversed: proposal.reversed,
            cuts: [view1.cut_ends(proposal.i), view2.cut_ends(proposal.j)],
            walks_cost: walk1.cost.total() + walk2.cost.total(),
            mean_distance_px,
            proposal_score: proposal.score,
        };
        let shape = Shape::new(&curve, self.rig);
        Some(Start { curve, shape, origin })
    }

    /// The better of a plain and, unless that is good already, an annealed fit. Without much effort
    /// what is far behind the best `good` score is left at that.
    fn judged(&self, start: &Start, good: Option<f64>) -> Option<Judged> {
        let judge = |fit| Candidate::new(fit, &start.origin, self.rig, self.params);
        let plain = self.fit(&start.curve, &PLAIN).map(judge);
        if let Some(mut plain) = plain.clone().filter(|c| c.is_good(self.params)) {
            plain.good = true;
            return Some(Judged { candidate: plain, wholly: true });
        }
        let hopeless = |c: &Candidate| {
            self.effort == Effort::Quick && good.is_some_and(|good| c.score > good + BEHIND)
        };
        if let Some(candidate) = plain.clone().filter(hopeless) {
            return Some(Judged { candidate, wholly: false });
        }
        let annealed = self.fit(&start.curve, &ANNEALED).map(judge);
        let best = [plain, annealed].into_iter().flatten();
        let best = best.min_by(|a, b| a.score.total_cmp(&b.score))?;
        Some(Judged { candidate: self.checked(best), wholly: true })
    }

    /// Notes whether a candidate is good, perhaps with finer knots: a J tip bends more than the usual
    /// ones can.
    fn checked(&self, mut candidate: Candidate) -> Candidate {
        /// Beyond this it is not the knots.
        const MOST: f64 = 6.0;
        candidate.good = candidate.is_good(self.params)
            || (candidate.misfit < MOST
                && self.finer(&candidate).is_some_and(|finer| finer.is_good(self.params)));
        candidate
    }

    /// The candidate with knots and smoothness for curves that bend much.
    pub(crate) fn finer(&self, candidate: &Candidate) -> Option<Candidate> {
        if candidate.settings == FINE && candidate.rests {
            return Some(candidate.clone());
        }
        let fit = self.fit(&candidate.fit.curve, &FINE)?;
        Some(candidate.refitted(fit, FINE, self.rig))
    }

    /// The candidate with the usual knots and smoothness again, to stand beside others that have them.
    pub(crate) fn usual(&self, candidate: Candidate) -> Candidate {
        if candidate.settings == SETTLED {
            return candidate;
        }
        match self.fit(&candidate.fit.curve, &SETTLED) {
            Some(fit) => candidate.refitted(fit, SETTLED, self.rig),
            None => candidate,
        }
    }

    /// The first walk pairs again, matched from corner to corner: some stretches along epipolar lines
    /// come out otherwise. Without much effort only where that start is another one than those `tried`.
    /// Before that, where a walk takes bridges, once more without what lies near them.
    pub(crate) fn restarted(
        &self,
        finalists: &[Candidate],
        tried: &[Tried],
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) -> Vec<Candidate> {
        let restarts = |candidate: &Candidate| {
            let mut more = Vec::new();
            for reach_px in BRIDGED_PX {
                let bridged = self.bridged(candidate, reach_px);
                if let Some(fit) = bridged.and_then(|start| self.fit(&start, &PLAIN)) {
                    more.push(candidate.refitted(fit, SETTLED, self.rig));
                }
            }
            let [i, j] = candidate.walks;
            let start = start_from(
                &OTHER_PRICES,
                (&view1.walks[i].points, FreeEnds::NONE),
                (&view2.walks[j].points, FreeEnds::NONE),
                candidate.reversed,
                self.rig,
                OutlineFitParams::DEFAULT.knot_spacing_px,
            );
            let Some((start, _)) = start else { return more };
            if self.effort == Effort::Quick {
                let shape = Shape::new(&start, self.rig);
                if shape.is_along(&candidate.shape, SAME_START_PX)
                    || tried.iter().any(|t| t.start.is_like(&shape, SAME_FIT_PX))
                {
                    return more;
                }
            }
            for params in [PLAIN, ANNEALED] {
                if let Some(fit) = self.fit(&start, &params) {
                    more.push(candidate.refitted(fit, SETTLED, self.rig));
                }
            }
            more
        };
        side_by_side(&finalists[..finalists.len().min(3)], restarts).concat()
    }

    /// A start that leaves out what is near the ends of bridges, px in either view, and spans it
    /// smoothly: the rim of what hides the body may have drawn the fit aside. `None` where there are
    /// no bridges.
    fn bridged(&self, candidate: &Candidate, reach_px: f64) -> Option<Curve3> {
        if candidate.cuts.iter().all(Vec::is_empty) {
            return None;
        }
        let points = dense(&candidate.fit.curve, self.rig);
        let px_per_unit = px_per_unit(&points, self.rig);
        let last = points.len() - 1;
        let arc_px = arc_lengths_px(&points, px_per_unit);
        let (kept, arc_px): (Vec<Point3>, Vec<f64>) = points
            .iter()
            .zip(arc_px)
            .enumerate()
            .filter(|(k, (point, _))| {
                !self.is_near(&candidate.cuts, point, reach_px) || *k == 0 || *k == last
            })
            .map(|(_, (point, arc))| (*point, arc))
            .unzip();
        start_curve(&kept, &arc_px, OutlineFitParams::DEFAULT.knot_spacing_px).ok()
    }

    /// Whether a point lies near an end of a bridge in either view.
    pub(crate) fn is_near(&self, cuts: &CutEnds, point: &Point3, reach_px: f64) -> bool {
        let cameras = [self.rig.camera1(), self.rig.camera2()];
        cameras.iter().zip(cuts).any(|(camera, cuts)| is_shown_near(camera, point, cuts, reach_px))
    }

    /// The candidate with its last, adaptive fit under the given cameras, and what that says about the
    /// calibration if it is among the unknowns; as it is if there is no such fit.
    pub(crate) fn last_fit(
        &self,
        candidate: &Candidate,
        given_rig: &Rig,
    ) -> (Candidate, Option<CalibrationEstimate>) {
        // The steps of the smoothness move the curve as well.
        let settings = &OutlineFitParams { iterations: LAST_ITERATIONS, ..candidate.settings };
        let start = &candidate.fit.curve;
        let (outlines, adaptive) = (self.outlines, AdaptiveParams::DEFAULT);
        let found = match &self.params.calibration {
            Some(priors) => fit_outlines_and_calibration(
                start, outlines, given_rig, settings, &adaptive, priors,
            )
            .map(|found| (found.fit, Some(found.calibration))),
            None => fit_outlines_adaptively(start, outlines, given_rig, settings, &adaptive)
                .map(|fit| (fit, None)),
        };
        found.map_or_else(
            |_| (candidate.clone(), None),
            |(fit, calibration)| {
                (candidate.refitted(fit, candidate.settings, given_rig), calibration)
            },
        )
    }

    pub(crate) fn fit(&self, start: &Curve3, params: &OutlineFitParams) -> Option<OutlineFit> {
        fit_outlines(start, self.outlines, self.rig, params).ok()
    }

    /// The fit carried on with its last settings until it rests; ranking before that picks wrong
    /// loops. What cannot come near the score `to_beat` at its pace is left.
    pub(crate) fn converged(&self, candidate: &Candidate, to_beat: f64) -> Candidate {
        const ROUNDS: usize = 4;
        const REST: f64 = 0.3;
        let mut best = candidate.clone();
        if best.rests {
            return best;
        }
        for round in 1..=ROUNDS {
            let Some(fit) = self.fit(&best.fit.curve, &best.settings) else { break };
            let next = best.refitted(fit, best.settings, self.rig);
            let gain = best.score - next.score;
            let rests = gain < REST || next.fit.converged;
            if gain > 0.0 {
                best = next;
            }
            best.rests = rests;
            // Later rounds gain less than the ones before.
            let hope = gain * (ROUNDS - round) as f64;
            if best.rests || best.score - hope > to_beat + CLEAR {
                break;
            }
        }
        best
    }

    /// The best different curves, converged, best first. Beside a good one, those far behind are
    /// not carried on.
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
        if let Some(best) = found.first().filter(|best| best.good).map(|best| best.score) {
            found.retain(|candidate| candidate.score < best + BEHIND);
        }
        let good = found.first().is_some_and(|best| best.is_good(self.params));
        if good && (found.len() == 1 || self.effort == Effort::Quick) {
            // The last fit carries them on.
            return found;
        }
        let mut to_beat = f64::INFINITY;
        let mut converged = Vec::with_capacity(found.len());
        for candidate in &found {
            let candidate = self.converged(candidate, to_beat);
            to_beat = to_beat.min(candidate.score);
            converged.push(candidate);
        }
        different(converged)
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
