use accurate_fit::{CalibrationEstimate, CalibrationPriors, FitError, OutlineFit};
use accurate_geom::{Curve3, Pixel, Rig, View1, View2};
use accurate_match::ProposeParams;
use accurate_traverse::WalkParams;
use ndarray::Array2;

use super::evidence::Evidence;
use super::frame::Turn;
use super::grey_levels::{choose_by_grey_levels, on_grey_levels};
use super::hairpins::{DOUBLED, KINKS};
use super::look::{Look, Seen};
use super::suspicion::{DoubtLimits, Suspicion, calls_for_the_pictures};
use super::upright::{Orientation, Upright};
use crate::{Closure, Error, Explanation, IntensityDiagnostics};

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
    /// A fit is good if it leaves less than this unexplained or outside; of outlines of more than 3,000
    /// points more in proportion.
    pub good_unexplained: f64,
    /// A fit is good if its mean squared residual is below this, px²; 1/18 at the truth.
    pub good_chi_per_point: f64,
    /// A fit is good only if its walks agree to this mean epipolar distance, px: a pair that does
    /// not agree may still be bent into explaining both outlines.
    pub good_distance_px: f64,
    /// Weight of the walks' own cost in the final choice.
    pub walk_weight: f64,
    /// What a radian costs by which a curve turns more sharply than a wire bends (a radius of 4 px): wires go
    /// on, and what turns back has gone on along something else. On images only: the masks of some
    /// generated families show such turns.
    pub kink_weight: f64,
    /// What a px costs along which a curve runs back over itself in both views, beyond 12 px. Less on masks,
    /// where all that is shown is the body: there it is above all a reason for doubt.
    pub doubled_weight: f64,
    /// Whether a pair from images is judged by the probability maps themselves, and walks are led
    /// over gaps by them; else by the masks alone. On the built-in network's maps more curves are
    /// right, and they are placed better (docs/segmentation.md).
    pub by_probability: bool,
    /// Whether the curve of a pair from images is fitted on to their grey levels at last: tips end where
    /// the darkness does, and hooks that are one blob to the network are told apart.
    pub by_grey_levels: bool,
    /// Whether finalists exchange stretches and are tried on other ways through one view. Never on the
    /// masks of a segmentation: what it adds or misses makes wrong stretches likely.
    pub exchange: bool,
    /// Whether in doubt, after the second look, the images are looked at turned. Never on the masks of a
    /// segmentation: there the likelier curve is not the right one more often.
    pub turned: bool,
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

impl SecondLook {
    pub(crate) const fn is_due(self, in_doubt: bool) -> bool {
        match self {
            Self::Never => false,
            Self::InDoubt => in_doubt,
            Self::Always => true,
        }
    }
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
        kink_weight: KINKS,
        doubled_weight: DOUBLED,
        by_probability: true,
        by_grey_levels: true,
        exchange: true,
        turned: true,
        calibration: None,
        second_look: SecondLook::InDoubt,
    };

    /// Pairs that are fitted whatever comes of them, if there are so many.
    pub(crate) fn sure_fits(&self) -> usize {
        self.min_fits.min(self.enough_fits)
    }

    /// Refuses weights and priors that nothing can be compared by, and a search that fits nothing.
    pub(crate) fn validate(&self) -> Result<(), FitError> {
        for (name, value) in [
            ("contenders", self.contenders),
            ("walk_weight", self.walk_weight),
            ("kink_weight", self.kink_weight),
            ("doubled_weight", self.doubled_weight),
            ("clear_lead", self.clear_lead),
            ("good_unexplained", self.good_unexplained),
            ("good_chi_per_point", self.good_chi_per_point),
            ("good_distance_px", self.good_distance_px),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        for (name, value) in [("max_fits", self.max_fits), ("finalists", self.finalists)] {
            if value == 0 {
                return Err(FitError::BadParameter { name, value: 0.0 });
            }
        }
        self.calibration.map_or(Ok(()), |priors| priors.validate())
    }
}

/// What the joint choice settled on.
pub(crate) struct JointResult {
    pub(crate) fit: OutlineFit,
    pub(crate) walk1: Vec<Pixel<View1>>,
    pub(crate) walk2: Vec<Pixel<View2>>,
    pub(crate) coverage: [f64; 2],
    /// Mean distance of the chosen walks' pixels of one view to their partners' epipolar lines, px.
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
    /// What came of the grey levels, if they were asked.
    pub(crate) grey_levels: Option<IntensityDiagnostics>,
}

/// What the search through masks, or maps, came to; pictures were not asked.
pub(crate) struct Searched {
    seen: Seen,
    limits: &'static DoubtLimits,
    orientation: Orientation,
}

/// Proposes, pairs, fits, judges; by the probability maps behind the masks, where they are given. In
/// doubt once more with the images turned, and again, until nothing speaks against the likeliest curve.
/// Where `turn_upright`, masks are brought upright first; not where maps or pictures are asked, which are not.
///
/// # Errors
/// [`Error`] of a view that shows no curve; [`Error::NoCandidate`] if no pair of walks gives one;
/// [`Error::NotClosed`] if a ring was asked for and a view shows none.
pub(crate) fn search_masks(
    masks: &[Array2<bool>; 2],
    probabilities: Option<&[Array2<f32>; 2]>,
    turn_upright: bool,
    rig: &Rig,
    params: &RobustParams,
    closure: Closure,
    case: &str,
) -> Result<Searched, Error> {
    let upright = if turn_upright {
        Upright::of(masks, rig, params.calibration.is_none(), case)?
    } else {
        Upright::as_given(masks, rig)
    };
    let look = |turn| {
        let (masks, rig) = (&*upright.masks, &*upright.rig);
        Look { masks, probabilities, rig, params, closure, turn, case }.look()
    };
    let [limits, to_look_on] = match (probabilities, &params.calibration) {
        (Some(_), _) => [&DoubtLimits::MAPS; 2],
        (None, None) => [&DoubtLimits::MASKS, &DoubtLimits::MASKS_TO_LOOK_ON],
        (None, Some(_)) => [&DoubtLimits::MASKS_WITH_CALIBRATION, &DoubtLimits::MASKS_TO_LOOK_ON],
    };
    let worth_it =
        |seen: &Seen| !seen.is_hopeless() && !seen.evidence().suspicions(to_look_on).is_empty();
    let mut seen = look(Turn::NONE)?;
    for turn in Turn::OTHERS {
        // Every pair of closed walks has been fitted from everywhere.
        let again =
            closure == Closure::Open && params.turned && params.second_look.is_due(worth_it(&seen));
        if !again {
            break;
        }
        // What shows no curve when turned takes nothing from what was seen.
        if let Ok(other) = look(turn) {
            seen = seen.beside(other);
        }
    }
    Ok(Searched { seen, limits, orientation: upright.orientation })
}

impl Searched {
    /// What bears on the choice so far.
    pub(crate) fn evidence(&self) -> Evidence {
        self.seen.evidence()
    }

    /// The curve so far.
    pub(crate) fn curve(&self) -> &Curve3 {
        &self.seen.best().fit.curve
    }

    pub(crate) fn into_result(self) -> JointResult {
        self.seen.into_result(self.limits, &self.orientation)
    }

    /// At last by the grey levels of the images, of which the search has seen the maps, if any.
    pub(crate) fn by_pictures(
        mut self,
        images: &[Array2<f32>; 2],
        maps: Option<&[Array2<f32>; 2]>,
        rig: &Rig,
        params: &RobustParams,
    ) -> JointResult {
        let overruled_by = if calls_for_the_pictures(&self.seen.evidence()) {
            choose_by_grey_levels(&mut self.seen, images, rig, params)
        } else {
            None
        };
        let mut result = self.into_result();
        result.grey_levels =
            Some(on_grey_levels(&mut result, images, maps, rig, params, overruled_by));
        result
    }
}
