use accurate_fit::{CalibrationEstimate, side_by_side};
use accurate_geom::{Rig, View1, View2};

use super::candidates::ViewCandidates;
use super::evidence::{Evidence, Walks};
use super::pairs::Tried;
use super::score::Candidate;
use super::search::{Effort, Search};
use crate::Error;

/// Curves nowhere farther apart than this do not compete, px.
pub(crate) const RIVAL_PX: f64 = 5.0;

/// More boundary points of both views than any harder look is made for: three times those of the longest
/// wires of the generated sets.
const MOST_POINTS_TO_LOOK_ON: usize = 30_000;

/// A choice with the last, adaptive fits.
pub(crate) struct Settled {
    pub(crate) choice: Choice,
    /// Of the finalists that are close, the likeliest first, as in `choice`.
    pub(crate) fits: Vec<Candidate>,
    /// Of each of the fits, if the calibration is an unknown.
    pub(crate) calibrations: Vec<Option<CalibrationEstimate>>,
    pub(crate) evidence: Evidence,
}

impl Settled {
    /// The likeliest of the finalists that are close, each fitted adaptively: a score weighs all bends
    /// alike, but one more bend says little of a wire that bends everywhere and much of a straight one.
    /// `given_rig` is the one that the calibration's correction is relative to.
    pub(crate) fn of(
        search: &Search<'_>,
        mut choice: Choice,
        given_rig: &Rig,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) -> Self {
        let least = choice.finalists[0].score;
        let close = |c: &&Candidate| c.score <= least + search.params.contenders;
        let contenders: Vec<_> = choice.finalists.iter().take_while(close).collect();
        let last_fits = side_by_side(&contenders, |c| search.last_fit(c, given_rig));
        let (mut fits, mut calibrations): (Vec<_>, Vec<_>) = last_fits.into_iter().unzip();
        let first = (0..fits.len())
            .min_by(|&a, &b| fits[a].unlikeliness().total_cmp(&fits[b].unlikeliness()))
            .unwrap_or(0);
        choice.finalists.swap(0, first);
        fits.swap(0, first);
        calibrations.swap(0, first);
        let evidence = evidence(&fits, &choice.finalists, given_rig, view1, view2);
        Self { fits, calibrations, evidence, choice }
    }

    /// Takes in the likeliest curve of a search with less effort, which may be lost among more: finalists are
    /// the best by score.
    pub(crate) fn recall(
        &mut self,
        (known, calibration): (Candidate, Option<CalibrationEstimate>),
        given_rig: &Rig,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) {
        let at = self.fits.len();
        let is_likeliest = known.unlikeliness() < self.fits[0].unlikeliness();
        self.choice.finalists.insert(at, known.clone());
        self.fits.push(known);
        self.calibrations.push(calibration);
        self.prefer(if is_likeliest { at } else { 0 }, given_rig, view1, view2);
    }

    /// Whether no harder look helps: most of what the views show is not this body, and no other walk through
    /// it explains it; or the body is so long that a harder look takes minutes.
    pub(crate) fn is_hopeless(&self) -> bool {
        let judgement = &self.fits[0].fit.judgement;
        judgement.unexplained_share() > 0.3 || judgement.boundary_points() > MOST_POINTS_TO_LOOK_ON
    }

    /// Takes one of the contenders. One that had no last fit is taken under the calibration of the one
    /// before.
    pub(crate) fn prefer(
        &mut self,
        mut chosen: usize,
        given_rig: &Rig,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) {
        let finalists = &mut self.choice.finalists;
        let next = self.fits.len();
        if chosen >= next {
            finalists.swap(chosen, next);
            self.fits.push(finalists[next].clone());
            self.calibrations.push(self.calibrations[0]);
            chosen = next;
        }
        finalists.swap(0, chosen);
        self.fits.swap(0, chosen);
        self.calibrations.swap(0, chosen);
        self.evidence = evidence(&self.fits, finalists, given_rig, view1, view2);
    }
}

/// The curves that the choice is among, the chosen first, and by how much each is less likely; those that
/// were not fitted adaptively, by their score than the best one's.
pub(crate) fn contenders<'a>(
    fits: &'a [Candidate],
    finalists: &'a [Candidate],
) -> Vec<(&'a Candidate, f64)> {
    let best = fits[0].unlikeliness();
    let least = finalists.iter().map(|c| c.score).fold(f64::INFINITY, f64::min);
    // Without a last fit of the first there is nothing to compare likelihoods with.
    let behind = |k: usize, fit: &Candidate| {
        let adaptive = k < fits.len() && best.is_finite();
        if adaptive { fit.unlikeliness() - best } else { finalists[k].score - least }
    };
    let all = fits.iter().chain(&finalists[fits.len()..]);
    all.enumerate().map(|(k, fit)| (fit, behind(k, fit))).collect()
}

/// What bears on the choice of the first.
fn evidence(
    fits: &[Candidate],
    finalists: &[Candidate],
    given_rig: &Rig,
    view1: &ViewCandidates<View1>,
    view2: &ViewCandidates<View2>,
) -> Evidence {
    let fit = &fits[0];
    let margin = contenders(fits, finalists)
        .into_iter()
        .skip(1)
        .filter(|(rival, _)| !rival.shape.is_like(&fit.shape, RIVAL_PX))
        .map(|(_, behind)| behind)
        .fold(f64::INFINITY, f64::min);
    let [i, j] = fit.walks;
    let mut walks = Walks::default();
    walks.add(&view1.walks, i, view1.cut_ends(i).len() / 2);
    walks.add(&view2.walks, j, view2.cut_ends(j).len() / 2);
    Evidence::new(fit, &finalists[0].shape, margin, &walks, given_rig)
}

pub(crate) struct Choice {
    /// Different curves, the best first; at least one.
    pub(crate) finalists: Vec<Candidate>,
    pub(crate) fits: usize,
    tried: Vec<Tried>,
}

/// The search with one rig and one effort, going on from an `earlier` one with less effort.
pub(crate) fn choose(
    search: &Search<'_>,
    view1: &mut ViewCandidates<View1>,
    view2: &mut ViewCandidates<View2>,
    earlier: Option<Choice>,
) -> Result<Choice, Error> {
    let params = search.params;
    let (mut found, mut tried, mut fits) = (Vec::new(), Vec::new(), 0);
    if let Some(earlier) = earlier {
        // All with the same freedom, or the freest would win.
        found = side_by_side(&earlier.finalists, |finalist| search.usual(finalist.clone()));
        (tried, fits) = (earlier.tried, earlier.fits);
    }
    if search.effort == Effort::Thorough {
        // Else all walks may be one that turns round at a tip and comes back along itself, varied elsewhere.
        view1.walk_without_turning(&params.walks, search.case)?;
        view2.walk_without_turning(&params.walks, search.case)?;
    }
    let before = found.len();
    let pairs =
        search.propose_and_fit(view1, view2, [0, 0], params.max_fits, &mut tried, &mut found)?;
    fits += found.len() - before;
    let mut finalists = search.finalists(found);
    let mut more = search.restarted(&finalists, &tried, view1, view2);
    if !more.is_empty() {
        more.append(&mut finalists);
        finalists = search.finalists(more);
    }
    let (uncut, pieces) = search.cut_at_hairpins(finalists);
    finalists = uncut;
    fits += pieces;
    if params.exchange {
        let (exchanged, crosses) = search.exchanged(finalists);
        finalists = exchanged;
        fits += crosses;
        let (rerouted, others) = search.rerouted(finalists);
        finalists = rerouted;
        fits += others;
    }
    let is_good = |list: &[Candidate]| list.first().is_some_and(|best| best.is_good(params));
    if !is_good(&finalists) {
        if let Some(best) = finalists.first().cloned() {
            let mut more = Vec::new();
            search.rewarded(&best, view1, view2, params.max_fits / 3, &mut tried, &mut more)?;
            fits += more.len();
            more.append(&mut finalists);
            finalists = search.finalists(more);
        }
        let fine = side_by_side(&finalists, |candidate| search.finer(candidate));
        let fine: Vec<_> = fine.into_iter().flatten().collect();
        if !fine.is_empty() {
            finalists = search.finalists(fine);
        }
        if !is_good(&finalists) {
            let first = &finalists[..params.repaired.min(finalists.len())];
            let tries = side_by_side(first, |candidate| search.repaired(candidate));
            let mut repaired = Vec::new();
            for (candidate, better) in finalists.iter_mut().zip(tries) {
                if better.score < candidate.score {
                    repaired.push(better);
                } else {
                    candidate.mended = true;
                }
            }
            finalists.append(&mut repaired);
            finalists.sort_by(|a, b| a.score.total_cmp(&b.score));
        }
    }
    if finalists.is_empty() {
        let walks = [view1.walks.len(), view2.walks.len()];
        return Err(Error::NoCandidate { case: search.case.to_owned(), walks, pairs });
    }
    Ok(Choice { finalists, fits, tried })
}

/// The rings that pairs of closed walks give.
pub(crate) fn choose_ring(
    search: &Search<'_>,
    view1: &ViewCandidates<View1>,
    view2: &ViewCandidates<View2>,
) -> Result<Choice, Error> {
    let mut found = Vec::new();
    let pairs = search.fit_rings(view1, view2, &mut found)?;
    let fits = found.len();
    let finalists = search.finalists(found);
    if finalists.is_empty() {
        let walks = [view1.walks.len(), view2.walks.len()];
        return Err(Error::NoCandidate { case: search.case.to_owned(), walks, pairs });
    }
    Ok(Choice { finalists, fits, tried: Vec::new() })
}
