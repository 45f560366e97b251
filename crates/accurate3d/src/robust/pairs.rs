use accurate_fit::{OutlineFitParams, side_by_side};
use accurate_geom::{Curve3, EpipolarAngle, Pixel, View, View1, View2};
use accurate_match::{Proposal, ProposeParams, propose_pairs};

use super::candidates::{ViewCandidates, free_ends};
use super::finalists::BEHIND;
use super::fitting::{ANNEALED, PLAIN};
use super::score::{Candidate, Origin};
use super::search::{Effort, Search};
use super::shape::Shape;
use super::start::{PRICES, start_from};
use crate::Error;

/// Fits from two starts that are nowhere farther apart end in the same curve, px.
const SAME_FIT_PX: f64 = 0.5;

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

impl Tried {
    /// Whether its fit started so near that both end in the same curve.
    pub(crate) fn starts_as(&self, start: &Shape) -> bool {
        self.start.is_like(start, SAME_FIT_PX)
    }
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
        let mut waiting = Vec::new();
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
            if known.any(|t| t.starts_as(&start.shape)) {
                continue;
            }
            fits += 1;
            waiting.push((tried.len(), start.curve, start.origin));
            tried.push(Tried { proposal, start: start.shape, wholly: true });
            // Until then no fit decides whether there is a next.
            if self.effort == Effort::Quick && count >= self.params.sure_fits() {
                self.fit_in_order(std::mem::take(&mut waiting), tried, found);
            }
        }
        if self.effort == Effort::Quick {
            self.fit_in_order(waiting, tried, found);
        } else {
            // Nor whether it is annealed.
            let judged = side_by_side(&waiting, |(_, curve, origin)| {
                self.judged(curve, origin, self.plain(curve, origin), None)
            });
            found.extend(judged.into_iter().flatten().map(|judged| judged.candidate));
        }
        Ok(proposals.len())
    }

    /// Fits what waits, each with its number among the `tried`; what the ones before gave decides how far.
    fn fit_in_order(
        &self,
        waiting: Vec<(usize, Curve3, Origin)>,
        tried: &mut [Tried],
        found: &mut Vec<Candidate>,
    ) {
        let plain = side_by_side(&waiting, |(_, curve, origin)| self.plain(curve, origin));
        for ((number, curve, origin), plain) in waiting.into_iter().zip(plain) {
            let good = found.iter().filter(|c| c.good).map(|c| c.score).min_by(f64::total_cmp);
            if let Some(judged) = self.judged(&curve, &origin, plain, good) {
                tried[number].wholly = judged.wholly;
                found.push(judged.candidate);
            }
        }
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

    fn plain(&self, start: &Curve3, origin: &Origin) -> Option<Candidate> {
        let fit = self.fit(start, &PLAIN)?;
        Some(Candidate::new(fit, origin, self.rig, self.params))
    }

    /// The better of a `plain` and, unless that is good already, an annealed fit. Without much effort
    /// what is far behind the best `good` score is left at that.
    fn judged(
        &self,
        start: &Curve3,
        origin: &Origin,
        plain: Option<Candidate>,
        good: Option<f64>,
    ) -> Option<Judged> {
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
        let judge = |fit| Candidate::new(fit, origin, self.rig, self.params);
        let annealed = self.fit(start, &ANNEALED).map(judge);
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
