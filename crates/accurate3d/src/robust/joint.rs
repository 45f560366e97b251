use accurate_fit::{CalibrationEstimate, CalibrationPriors, OutlineFit, OutlinePair};
use accurate_geom::{Pixel, Rig, View1, View2};
use accurate_match::ProposeParams;
use accurate_traverse::WalkParams;
use ndarray::Array2;

use super::candidates::ViewCandidates;
use super::evidence::{Evidence, Walks};
use super::frame::Turn;
use super::score::Candidate;
use super::search::{Effort, Search, Tried};
use super::suspicion::{Suspicion, calls_for_a_second_look, suspicions};
use crate::{Closure, ConsideredCurve, Error, Explanation};

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
    /// Finalists whose scores are no more than this behind the best are compared by likelihood; 0: the
    /// best score decides.
    pub contenders: f64,
    /// Finalists that are repaired if none is good.
    pub repaired: usize,
    /// A fit is good if it leaves less than this unexplained or outside.
    pub good_unexplained: f64,
    /// A fit is good if its mean squared residual is below this, px²; 1/18 at the truth.
    pub good_chi_per_point: f64,
    /// A fit is good only if its walks agree to this mean epipolar distance, px: a pair that does
    /// not agree may still be bent into explaining both outlines.
    pub good_distance_px: f64,
    /// Weight of the walks' own cost in the final choice.
    pub walk_weight: f64,
    /// Whether a pair from images is judged by the probability maps themselves, and walks are led
    /// over gaps by them; else by the masks alone. On the built-in network's maps more curves are
    /// right, and they are placed better (docs/segmentation.md).
    pub by_probability: bool,
    /// Whether finalists exchange stretches and are tried on other ways through one view. Never on the
    /// masks of a segmentation: what it adds or misses makes wrong stretches likely.
    pub exchange: bool,
    /// How wrong the calibration of view 2 may be; `None`: it is exact. Else a shift of image 2 and a
    /// roll of its camera are unknowns, and the search is repeated with the rig so corrected.
    pub calibration: Option<CalibrationPriors>,
    /// When the search goes on with more effort after the first choice.
    pub second_look: SecondLook,
}

/// When the search goes on with more effort after the first choice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SecondLook {
    /// The first choice is the last.
    Never,
    /// If there is reason to doubt the first choice.
    InDoubt,
    /// Always; several times slower.
    Always,
}

impl RobustParams {
    /// Tuned on seeds 1000 to 1999 of the generated families.
    pub const DEFAULT: Self = Self {
        walks: WalkParams::DEFAULT,
        propose: ProposeParams::DEFAULT,
        max_fits: 24,
        min_fits: 1,
        enough_fits: 12,
        clear_lead: 1.5,
        finalists: 6,
        contenders: 10.0,
        repaired: 2,
        good_unexplained: 0.03,
        good_chi_per_point: 0.062,
        good_distance_px: 1.0,
        walk_weight: 0.3,
        by_probability: true,
        exchange: true,
        calibration: None,
        second_look: SecondLook::InDoubt,
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
    pub(crate) fits: usize,
    /// What the curve says about the calibration of view 2, if asked.
    pub(crate) calibration: Option<CalibrationEstimate>,
    /// Reasons to doubt the result; none for most right ones.
    pub(crate) suspicions: Vec<Suspicion>,
    /// What they rest on.
    pub(crate) evidence: Evidence,
    /// What was considered and decided.
    pub(crate) explanation: Explanation,
}

/// Curves nowhere farther apart than this do not compete, px.
const RIVAL_PX: f64 = 5.0;

/// Proposes, pairs, fits, judges; by the probability maps behind the masks, where they are given. In
/// doubt once more with the images turned, and again, until nothing speaks against the likeliest curve.
///
/// # Errors
/// [`Error`] of a view that shows no curve; [`Error::NoCandidate`] if no pair of walks gives one;
/// [`Error::NotClosed`] if a ring was asked for and a view shows none.
pub(crate) fn reconstruct_masks(
    masks: &[Array2<bool>; 2],
    probabilities: Option<&[Array2<f32>; 2]>,
    rig: &Rig,
    params: &RobustParams,
    closure: Closure,
    case: &str,
) -> Result<JointResult, Error> {
    let look = |turn| Look { masks, probabilities, rig, params, closure, turn, case }.look();
    let mut seen = look(Turn::Upright)?;
    for turn in Turn::OTHERS {
        let again = match params.second_look {
            // Every pair of closed walks has been fitted from everywhere.
            _ if closure == Closure::Closed => false,
            SecondLook::Never => false,
            SecondLook::InDoubt => !suspicions(&seen.settled.evidence).is_empty(),
            SecondLook::Always => true,
        };
        if !again {
            break;
        }
        // What shows no curve when turned takes nothing from what was seen.
        if let Ok(other) = look(turn) {
            seen = seen.beside(other);
        }
    }
    Ok(seen.into_result())
}

/// What a look at the images takes.
struct Look<'a> {
    masks: &'a [Array2<bool>; 2],
    probabilities: Option<&'a [Array2<f32>; 2]>,
    rig: &'a Rig,
    params: &'a RobustParams,
    closure: Closure,
    turn: Turn,
    case: &'a str,
}

/// What a look at the images came to.
struct Seen {
    view1: ViewCandidates<View1>,
    view2: ViewCandidates<View2>,
    settled: Settled,
    /// Other curves that other looks found.
    passed_over: Vec<ConsideredCurve>,
    /// Pairs of walks that were fitted, by all looks.
    fits: usize,
}

impl Look<'_> {
    /// Quickly, and thoroughly if in doubt.
    fn look(&self) -> Result<Seen, Error> {
        let Self { masks, probabilities, rig, params, closure, turn, case } = *self;
        let map = |view: usize| probabilities.map(|both| &both[view]);
        let walks = &params.walks;
        let mut view1 = ViewCandidates::<View1>::of(&masks[0], map(0), walks, turn, case)?;
        let mut view2 = ViewCandidates::<View2>::of(&masks[1], map(1), walks, turn, case)?;
        let (outline1, outline2) = (view1.outline.clone(), view2.outline.clone());
        let outlines = OutlinePair::new(&outline1, &outline2)
            .with_bridges(&corridors(&view1.bridges), &corridors(&view2.bridges));
        let mut search = Search { outlines: &outlines, rig, params, case, effort: Effort::Quick };
        let mut settle = |search: &Search<'_>, earlier| -> Result<Settled, Error> {
            let choice = match closure {
                Closure::Open => choose(search, &mut view1, &mut view2, earlier)?,
                Closure::Closed => choose_ring(search, &view1, &view2)?,
            };
            Ok(Settled::of(search, choice, rig, &view1, &view2))
        };
        let mut settled = settle(&search, None)?;
        let corrected = settled.calibration.as_ref().and_then(|found| found.correct(rig).ok());
        if let Some(corrected) = &corrected {
            search.rig = corrected;
            settled = settle(&search, None)?;
        }
        let again = match params.second_look {
            _ if closure == Closure::Closed => false,
            SecondLook::Never => false,
            SecondLook::InDoubt => calls_for_a_second_look(&settled.evidence),
            SecondLook::Always => true,
        };
        if again {
            search.effort = Effort::Thorough;
            settled = settle(&search, Some(settled.choice))?;
        }
        let fits = settled.choice.fits;
        Ok(Seen { view1, view2, settled, passed_over: Vec::new(), fits })
    }
}

impl Seen {
    /// The likelier of two looks at the same images, with what the other one knows against it.
    fn beside(self, other: Self) -> Self {
        let unlikeliness = |seen: &Self| seen.settled.fits[0].unlikeliness();
        let (mut seen, passed) =
            if unlikeliness(&other) < unlikeliness(&self) { (other, self) } else { (self, other) };
        let best = &seen.settled.fits[0];
        let rivals =
            passed.settled.fits.iter().filter(|fit| !fit.shape.is_like(&best.shape, RIVAL_PX));
        let behind = rivals.clone().map(|rival| rival.unlikeliness() - best.unlikeliness());
        let margin = &mut seen.settled.evidence.margin;
        *margin = behind.chain(*margin).min_by(f64::total_cmp);
        seen.passed_over.extend(rivals.map(Candidate::considered));
        seen.passed_over.extend(passed.passed_over);
        seen.fits += passed.fits;
        seen
    }

    fn into_result(self) -> JointResult {
        let Self { view1, view2, settled, passed_over, fits: tried } = self;
        let Settled { choice, mut fits, calibration, evidence } = settled;
        let rivals = &choice.finalists[fits.len()..];
        let candidates =
            fits.iter().chain(rivals).map(Candidate::considered).chain(passed_over).collect();
        let best = fits.swap_remove(0);
        let [i, j] = best.walks;
        let coverage = [view1.walks[i].coverage, view2.walks[j].coverage];
        let explanation =
            Explanation { candidates, junctions: [view1.junctions(i), view2.junctions(j)] };
        JointResult {
            explanation,
            walk1: view1.walks[i].points.clone(),
            walk2: directed(&view2.walks[j].points, best.reversed),
            coverage,
            mean_distance_px: best.mean_distance_px,
            fits: tried,
            calibration,
            suspicions: suspicions(&evidence),
            evidence,
            fit: best.fit,
        }
    }
}

/// A choice with the last, adaptive fits.
struct Settled {
    choice: Choice,
    /// Of the finalists that are close, the likeliest first, as in `choice`.
    fits: Vec<Candidate>,
    calibration: Option<CalibrationEstimate>,
    evidence: Evidence,
}

impl Settled {
    /// The likeliest of the finalists that are close, each fitted adaptively: a score weighs all bends
    /// alike, but one more bend says little of a wire that bends everywhere and much of a straight one.
    /// `given_rig` is the one that the calibration's correction is relative to.
    fn of(
        search: &Search<'_>,
        mut choice: Choice,
        given_rig: &Rig,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) -> Self {
        let least = choice.finalists[0].score;
        let contenders =
            choice.finalists.iter().take_while(|c| c.score <= least + search.params.contenders);
        let (mut fits, mut calibrations): (Vec<_>, Vec<_>) =
            contenders.map(|c| search.last_fit(c, given_rig)).unzip();
        let first = (0..fits.len())
            .min_by(|&a, &b| fits[a].unlikeliness().total_cmp(&fits[b].unlikeliness()))
            .unwrap_or(0);
        choice.finalists.swap(0, first);
        fits.swap(0, first);
        let (fit, rivals) = (&fits[0], &fits[1..]);
        let close = rivals.iter().map(|rival| (rival.unlikeliness() - fit.unlikeliness(), rival));
        let far = choice.finalists[fits.len()..].iter();
        let far = far.map(|rival| (rival.score - least, rival));
        let margin = close
            .chain(far)
            .filter(|(_, rival)| !rival.shape.is_like(&fit.shape, RIVAL_PX))
            .map(|(behind, _)| behind)
            .fold(f64::INFINITY, f64::min);
        let [i, j] = fit.walks;
        let mut walks = Walks::default();
        walks.add(&view1.walks, i, view1.cut_ends(i).len() / 2);
        walks.add(&view2.walks, j, view2.cut_ends(j).len() / 2);
        let evidence = Evidence::new(fit, &choice.finalists[0].shape, margin, &walks, given_rig);
        Self { fits, calibration: calibrations.swap_remove(first), evidence, choice }
    }
}

struct Choice {
    /// Different curves, the best first; at least one.
    finalists: Vec<Candidate>,
    fits: usize,
    tried: Vec<Tried>,
}

/// The search with one rig and one effort, going on from an `earlier` one with less effort.
fn choose(
    search: &Search<'_>,
    view1: &mut ViewCandidates<View1>,
    view2: &mut ViewCandidates<View2>,
    earlier: Option<Choice>,
) -> Result<Choice, Error> {
    let params = search.params;
    let (mut found, mut tried, mut fits) = (Vec::new(), Vec::new(), 0);
    if let Some(earlier) = earlier {
        found.extend(earlier.finalists);
        (tried, fits) = (earlier.tried, earlier.fits);
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
            search.rewarded(&best, view1, view2, params.max_fits / 3, &mut more)?;
            fits += more.len();
            more.append(&mut finalists);
            finalists = search.finalists(more);
        }
        // All with the same freedom, or the freest would win.
        let fine: Vec<_> = finalists.iter().filter_map(|c| search.finer(c)).collect();
        finalists = search.finalists(fine);
        if !is_good(&finalists) {
            let mended: Vec<_> =
                finalists.iter().take(params.repaired).map(|c| search.repaired(c)).collect();
            finalists.extend(mended);
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
fn choose_ring(
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

/// The bridges twice as wide as they come: what hides the body hides how it bends there.
fn corridors<V: accurate_geom::View>(
    bridges: &[(Pixel<V>, Pixel<V>)],
) -> Vec<(Pixel<V>, Pixel<V>)> {
    const ASIDE_PX: f64 = 4.0;
    const LONGEST_PX: f64 = 30.0;
    let mut all = bridges.to_vec();
    for (a, b) in bridges {
        let length = a.distance(*b);
        if length > 2.0 * ASIDE_PX && length < LONGEST_PX {
            let (nx, ny) = ((b.y - a.y) / length * ASIDE_PX, (a.x - b.x) / length * ASIDE_PX);
            for side in [-1.0, 1.0] {
                let moved = |p: &Pixel<V>| Pixel::new(p.x + side * nx, p.y + side * ny);
                all.push((moved(a), moved(b)));
            }
        }
    }
    all
}

fn directed(points: &[Pixel<View2>], reversed: bool) -> Vec<Pixel<View2>> {
    if reversed { points.iter().rev().copied().collect() } else { points.to_vec() }
}
