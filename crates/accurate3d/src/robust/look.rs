use accurate_fit::{CalibrationEstimate, OutlinePair};
use accurate_geom::{Pixel, Point2, Rig, View, View1, View2};
use accurate_traverse::Walk;
use ndarray::Array2;

use super::RobustParams;
use super::candidates::ViewCandidates;
use super::choice::{RIVAL_PX, Settled, choose, choose_ring, contenders};
use super::evidence::Evidence;
use super::frame::{Frame, Turn};
use super::joint::JointResult;
use super::score::Candidate;
use super::search::{Effort, Search};
use super::suspicion::{DoubtLimits, calls_for_a_second_look};
use super::upright::Orientation;
use crate::{Closure, Error, Explanation};

/// What a look at the images takes.
pub(crate) struct Look<'a> {
    pub(crate) masks: &'a [Array2<bool>; 2],
    pub(crate) probabilities: Option<&'a [Array2<f32>; 2]>,
    pub(crate) rig: &'a Rig,
    pub(crate) params: &'a RobustParams,
    pub(crate) closure: Closure,
    pub(crate) turn: Turn,
    pub(crate) case: &'a str,
}

/// What a look at the images came to.
pub(crate) struct Seen {
    view1: ViewCandidates<View1>,
    view2: ViewCandidates<View2>,
    settled: Settled,
    /// What other looks settled on.
    others: Vec<Candidate>,
    /// Pairs of walks that were fitted, by all looks.
    fits: usize,
}

impl Look<'_> {
    /// Quickly, and thoroughly if in doubt.
    pub(crate) fn look(&self) -> Result<Seen, Error> {
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
        let corrected = settled.calibrations[0].as_ref().and_then(|found| found.correct(rig).ok());
        if let Some(corrected) = &corrected {
            search.rig = corrected;
            settled = settle(&search, None)?;
        }
        let in_doubt = !settled.is_hopeless() && calls_for_a_second_look(&settled.evidence);
        let again = closure == Closure::Open && params.second_look.is_due(in_doubt);
        if again {
            search.effort = Effort::Thorough;
            let known = (settled.fits.swap_remove(0), settled.calibrations.swap_remove(0));
            settled = settle(&search, Some(settled.choice))?;
            settled.recall(known, rig, &view1, &view2);
        }
        let fits = settled.choice.fits;
        Ok(Seen { view1, view2, settled, others: Vec::new(), fits })
    }
}

impl Seen {
    /// The likelier of two looks at the same images, with what the other one knows against it.
    pub(crate) fn beside(self, other: Self) -> Self {
        let unlikeliness = |seen: &Self| seen.settled.fits[0].unlikeliness();
        let (mut seen, passed) =
            if unlikeliness(&other) < unlikeliness(&self) { (other, self) } else { (self, other) };
        seen.others.extend(passed.settled.fits);
        seen.others.extend(passed.others);
        seen.fits += passed.fits;
        seen
    }

    pub(crate) fn best(&self) -> &Candidate {
        &self.settled.fits[0]
    }

    /// What bears on the choice, the curves of all looks among it.
    pub(crate) fn evidence(&self) -> Evidence {
        let best = self.best();
        // Without a last fit there is no likelihood.
        let behind = |rival: &Candidate| match best.unlikeliness() {
            least if least.is_finite() => rival.unlikeliness() - least,
            _ => rival.score - best.score,
        };
        let behind = self.rivals().map(behind).filter(|behind| behind.is_finite());
        let margin = behind.chain(self.settled.evidence.margin).min_by(f64::total_cmp);
        Evidence { margin, ..self.settled.evidence }
    }

    /// The curves that the look chose among, the chosen first, and by how much each is less likely, as a
    /// score.
    pub(crate) fn contenders(&self) -> Vec<(&Candidate, f64)> {
        contenders(&self.settled.fits, &self.settled.choice.finalists)
    }

    /// Whether no harder look can help.
    pub(crate) fn is_hopeless(&self) -> bool {
        self.settled.is_hopeless()
    }

    /// What the curves are fitted under, if the calibration is an unknown.
    pub(crate) fn calibration(&self) -> Option<&CalibrationEstimate> {
        self.settled.calibrations[0].as_ref()
    }

    /// The first so many of the contenders had a last fit.
    pub(crate) fn fitted_last(&self) -> usize {
        self.settled.fits.len()
    }

    /// Takes one of the contenders. Its margin stays what the maps say: where others know better there is
    /// doubt.
    pub(crate) fn prefer(&mut self, chosen: usize, given_rig: &Rig) {
        self.settled.prefer(chosen, given_rig, &self.view1, &self.view2);
    }

    /// Other curves than the best that other looks settled on.
    fn rivals(&self) -> impl Iterator<Item = &Candidate> {
        let best = &self.best().shape;
        self.others.iter().filter(move |other| !other.shape.is_like(best, RIVAL_PX))
    }

    /// In the images as they were given.
    pub(crate) fn into_result(
        self,
        limits: &DoubtLimits,
        orientation: &Orientation,
    ) -> JointResult {
        let evidence = self.evidence();
        let Settled { choice, fits, .. } = &self.settled;
        let rivals = choice.finalists[fits.len()..].iter().chain(self.rivals());
        let mut candidates: Vec<_> = fits.iter().chain(rivals).map(Candidate::considered).collect();
        let Self { view1, view2, settled, fits: tried, .. } = self;
        let Settled { mut fits, mut calibrations, .. } = settled;
        let best = fits.swap_remove(0);
        let [i, j] = best.walks;
        let mut coverage = [view1.walks[i].coverage, view2.walks[j].coverage];
        let [frame1, frame2] = &orientation.frames;
        let mut junctions = [view1.junctions(i, frame1), view2.junctions(j, frame2)];
        let mut walk1: Vec<_> = in_given(&view1.walks[i], frame1);
        let mut walk2: Vec<_> = in_given(&view2.walks[j], frame2);
        if best.reversed {
            walk2.reverse();
        }
        if orientation.swapped {
            candidates.iter_mut().for_each(|curve| curve.walks.reverse());
            coverage.reverse();
            junctions.reverse();
            std::mem::swap(&mut walk1, &mut walk2);
        }
        let calibration = calibrations.swap_remove(0);
        JointResult {
            grey_levels: None,
            explanation: Explanation { candidates, junctions },
            walk1: walk1.into_iter().map(Pixel::from).collect(),
            walk2: walk2.into_iter().map(Pixel::from).collect(),
            coverage,
            mean_distance_px: best.mean_distance_px,
            fits: tried,
            calibration: calibration.map(|found| orientation.given_calibration(&found)),
            suspicions: evidence.suspicions(limits),
            evidence,
            fit: best.fit,
        }
    }
}

/// The bridges twice as wide as they come: what hides the body hides how it bends there.
fn corridors<V: View>(bridges: &[(Pixel<V>, Pixel<V>)]) -> Vec<(Pixel<V>, Pixel<V>)> {
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

fn in_given<V: View>(walk: &Walk<V>, frame: &Frame) -> Vec<Point2> {
    walk.points.iter().map(|p| frame.in_image(*p).point()).collect()
}
