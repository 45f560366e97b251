use std::borrow::Borrow;
use std::ops::Range;

use accurate_fit::{CalibrationEstimate, FitError, PointFit};
use accurate_match::{CurveReconstruction, FreeMatch};
use serde::Serialize;

use crate::robust::{Evidence, JointResult, Suspicion};
use crate::{CarefulLook, Traces};

/// How far a reconstruction can be trusted, without knowing the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnostics {
    /// Mean distance in view 1 of matched pixels to their epipolar lines, px. Right orders stay
    /// below about 0.5; a wrong traversal or direction shows as more. By [`Method::Accurate`] on masks
    /// and images it is that of the two walks that the curve started from, in one of the views: the fitted
    /// curve's own is 0, for its pixels are projections of one point.
    ///
    /// [`Method::Accurate`]: crate::Method::Accurate
    pub mean_epipolar_distance_px: f64,
    /// The largest such distance of a matched pair, px; none where the points are those of a fitted
    /// curve, whose projections always meet.
    pub max_epipolar_distance_px: Option<f64>,
    /// Fraction of each view's skeleton that the trace passes.
    pub trace_coverage: [f64; 2],
    /// Steps longer than 3 px in each view's trace.
    pub trace_jumps: [usize; 2],
    /// Fraction of each view's ordered points that found a partner.
    pub matched_fraction: [f64; 2],
    /// Whether the points of view 2 were given against those of view 1, and turned round.
    pub view2_reversed: bool,
    /// Matched pairs whose rays gave no finite point.
    pub dropped_pairs: usize,
    /// Fraction of the points where the curve runs along an epipolar line (within 6 degrees, in
    /// either view): there depth is weakly seen.
    pub along_epipolar_line: f64,
    /// Reasons to doubt the result; none for most right ones.
    pub suspicions: Vec<Suspicion>,
    /// How well the curve explains both outlines, where it was fitted to them.
    pub outline: Option<OutlineDiagnostics>,
    /// What came of the fit to the images' grey levels, where the curve was found in images.
    pub grey_levels: Option<IntensityDiagnostics>,
    /// What the curve says about the calibration of view 2, if that was asked for.
    pub calibration: Option<CalibrationDiagnostics>,
    /// Why ordered points were matched but not adjusted, if so.
    pub not_adjusted: Option<String>,
    /// How well the adjusted curve explains ordered points, if it was adjusted to them.
    pub points_fit: Option<PointsDiagnostics>,
    /// By how much a match in the other direction costs more per point, px, where both were tried:
    /// the confidence in [`view2_reversed`](Self::view2_reversed). Negative where the match left the
    /// direction open and the fits chose the dearer one.
    pub direction_margin_px: Option<f64>,
    /// Whether the curve is closed; its last point then repeats its first.
    pub closed: bool,
    /// What came of a careful second look at the images, if there was one.
    pub careful_look: Option<CarefulLook>,
}

/// How well an adjusted curve explains the ordered points of both views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PointsDiagnostics {
    /// Standard deviation of a point across the curve, px: that of rounding for whole pixels, else
    /// estimated.
    pub noise_px: f64,
    /// Root mean square distance of the points from the curve, px, before and after.
    pub rms_px: [f64; 2],
    /// Mean of the squared distances in units of the noise's variance: about 1 if the curve explains
    /// the points. Where the noise was estimated it says nothing: less than 1 by what the curve takes up,
    /// and far less where the noise stands at its least.
    pub chi2_per_point: f64,
    /// Points of each view that lie beyond what the other one sees.
    pub beyond: [usize; 2],
    /// Largest standard deviation of the curve across its own direction, px.
    pub sigma_px: f64,
}

/// What came of the adjustment of ordered points.
pub(crate) struct Adjustment {
    refusal: Option<String>,
    fit: Option<PointsDiagnostics>,
    calibration: Option<CalibrationDiagnostics>,
}

impl Adjustment {
    pub(crate) fn of<F: Borrow<PointFit>>(fit: &Result<F, FitError>) -> Self {
        let done = fit.as_ref().ok().map(Borrow::borrow);
        Self {
            refusal: fit.as_ref().err().map(ToString::to_string),
            fit: done.map(|fit| PointsDiagnostics {
                noise_px: fit.noise_px,
                rms_px: fit.rms_px,
                chi2_per_point: fit.chi2_per_point,
                beyond: fit.beyond,
                sigma_px: 0.0,
            }),
            calibration: done.and_then(|fit| fit.calibration.as_ref()).map(Into::into),
        }
    }
}

/// The calibration of view 2 as estimated with the curve; view 1 is taken as exact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CalibrationDiagnostics {
    /// Shift of the image of view 2 against its camera, `[x, y]`, px.
    pub shift_px: [f64; 2],
    /// Turn of camera 2 about its optical axis, rad.
    pub roll_rad: f64,
    /// Unit direction in image 2 in which the shift is seen best.
    pub observed: [f64; 2],
    /// Posterior standard deviation of the shift in that direction, px.
    pub observed_sigma_px: f64,
    /// Unit direction in which it is seen worst: along the epipolar lines, where a shift changes
    /// depths only.
    pub unobserved: [f64; 2],
    /// Posterior standard deviation there, px: near the prior's if nothing was seen.
    pub unobserved_sigma_px: f64,
}

impl From<&CalibrationEstimate> for CalibrationDiagnostics {
    fn from(estimate: &CalibrationEstimate) -> Self {
        Self {
            shift_px: estimate.shift_px,
            roll_rad: estimate.roll_rad,
            observed: estimate.observed,
            observed_sigma_px: estimate.observed_sigma_px,
            unobserved: estimate.unobserved,
            unobserved_sigma_px: estimate.unobserved_sigma_px,
        }
    }
}

/// How well a fitted curve explains the outlines of both masks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutlineDiagnostics {
    /// Outline that the curve does not explain, as [`Judgement::unexplained`]: the misfit of every
    /// boundary point of both views beyond 0.8 px, at most 4 px, summed and divided by 10 px. 0 at the
    /// truth; no fraction, as it grows with the length of what is not explained.
    ///
    /// [`Judgement::unexplained`]: accurate_fit::Judgement::unexplained
    pub unexplained: f64,
    /// Curve that the masks do not show, as [`Judgement::outside`]: its distance from them beyond 1 px,
    /// at most 4 px, summed over both images in steps that are 1 px long on average and divided by 10 px.
    /// 0 at the truth; no fraction either.
    ///
    /// [`Judgement::outside`]: accurate_fit::Judgement::outside
    pub outside: f64,
    /// Mean squared residual of the boundary points, px²; 1/18 at the truth.
    pub chi_per_point: f64,
    /// By how much the likeliest other curve (somewhere more than 5 px away) is less likely, as
    /// [`Evidence::margin`]; none if there is no other.
    pub margin: Option<f64>,
    /// Pairs of walks that were fitted.
    pub fits: usize,
    /// Pixels of each view's mask that were left out before the search: pieces found in an image
    /// that are fainter than the rest or that the other view speaks against.
    pub strays_px: [usize; 2],
    /// What bears on whether the curve is the right one.
    pub evidence: Evidence,
}

/// What came of fitting a curve on to the grey levels of both images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IntensityDiagnostics {
    /// Why the curve stayed as it was; none if it is the one that explains the grey levels.
    pub refusal: Option<String>,
    /// By how much the pictures speak for this curve and against the one that the maps had made the
    /// likeliest, as a score; none if they agree.
    pub overruled_by: Option<f64>,
    /// By how much more of the end that is shown least, px, the curve goes on than pictures and segmentation
    /// show; none where the body is no thin one.
    pub lacking_px: Option<f64>,
    /// What was cut off at the begin and the end of the curve for that, px.
    pub cut_px: [f64; 2],
    /// Farthest that the curve was moved in either image, its ends aside, px.
    pub moved_px: Option<f64>,
    /// Darkest that the body is drawn in each view, in standard deviations of the noise around it.
    pub contrast_to_noise: Option<[f64; 2]>,
    /// Radius of the body in each view, px, as the width of its blurred cross-section tells it.
    pub radius_px: Option<[f64; 2]>,
}

impl Diagnostics {
    pub(crate) fn of_joint(
        result: &JointResult,
        strays_px: [usize; 2],
        along_epipolar_line: &[bool],
    ) -> Self {
        let judgement = &result.fit.judgement;
        Self {
            mean_epipolar_distance_px: result.mean_distance_px,
            max_epipolar_distance_px: None,
            trace_coverage: result.coverage,
            trace_jumps: [0; 2],
            matched_fraction: [1.0; 2],
            view2_reversed: false,
            dropped_pairs: 0,
            along_epipolar_line: share(along_epipolar_line),
            suspicions: result.suspicions.clone(),
            outline: Some(OutlineDiagnostics {
                unexplained: judgement.unexplained,
                outside: judgement.outside,
                chi_per_point: judgement.chi_per_point(),
                margin: result.evidence.margin,
                fits: result.fits,
                strays_px,
                evidence: result.evidence,
            }),
            grey_levels: result.grey_levels.clone(),
            calibration: result.calibration.as_ref().map(CalibrationDiagnostics::from),
            not_adjusted: None,
            points_fit: None,
            direction_margin_px: None,
            closed: false,
            careful_look: None,
        }
    }

    pub(crate) fn of_free_match(
        matched: &FreeMatch,
        counts: [usize; 2],
        along_epipolar_line: &[bool],
        adjustment: Adjustment,
        sigma_px: f64,
    ) -> Self {
        let Adjustment { refusal, fit, calibration } = adjustment;
        let fit = fit.map(|fit| PointsDiagnostics { sigma_px, ..fit });
        let fraction = |range: &Range<usize>, count: usize| range.len() as f64 / count as f64;
        let matched_fraction =
            [fraction(&matched.matched1, counts[0]), fraction(&matched.matched2, counts[1])];
        // One view may see more of the body, at either end; that each sees what the other does not is rare.
        let both = [matched_fraction[0].max(matched_fraction[1]); 2];
        let mut suspicions = suspicions(matched.mean_epipolar_distance_px, 1.0, both);
        let misfit = fit.is_some_and(|fit| {
            fit.chi2_per_point > MOST_CHI2_PER_POINT && fit.rms_px[1] > MISFIT_PX
        });
        suspicions.extend(misfit.then_some(Suspicion::Misfit));
        suspicions.extend((sigma_px > MOST_SIGMA_PX).then_some(Suspicion::Uncertain));
        let matched_points = matched.matched1.len() + matched.matched2.len();
        let beyond = fit.map_or(0, |fit| fit.beyond[0] + fit.beyond[1]);
        let left_out = (counts[0] + counts[1] + beyond).saturating_sub(matched_points) as f64;
        let is_bought = matched.margin_px.is_some_and(|margin| margin < BOUGHT_MARGIN_PX)
            && left_out > BOUGHT_SHARE * (counts[0] + counts[1]) as f64;
        suspicions.extend(is_bought.then_some(Suspicion::Ambiguous));
        suspicions.extend(refusal.is_some().then_some(Suspicion::NotAdjusted));
        suspicions.sort_unstable();
        Self {
            mean_epipolar_distance_px: matched.mean_epipolar_distance_px,
            max_epipolar_distance_px: refusal.as_ref().and_then(|_| {
                matched.points.iter().map(|p| p.epipolar_distance_px).max_by(f64::total_cmp)
            }),
            trace_coverage: [1.0; 2],
            trace_jumps: [0; 2],
            matched_fraction,
            view2_reversed: matched.reversed,
            dropped_pairs: matched.dropped,
            along_epipolar_line: share(along_epipolar_line),
            suspicions,
            outline: None,
            grey_levels: None,
            calibration,
            not_adjusted: refusal,
            points_fit: fit,
            // Infinite if the other direction is impossible.
            direction_margin_px: matched.margin_px.filter(|margin| margin.is_finite()),
            closed: false,
            careful_look: None,
        }
    }

    pub(crate) fn of(
        matched: &CurveReconstruction,
        traces: &Traces,
        along_epipolar_line: &[bool],
    ) -> Self {
        let fraction = |mut indices: Vec<usize>, total: usize| {
            indices.sort_unstable();
            indices.dedup();
            indices.len() as f64 / total as f64
        };
        let (first, second) = matched.pairs.iter().copied().unzip();
        Self {
            mean_epipolar_distance_px: matched.mean_epipolar_distance_px(),
            max_epipolar_distance_px: matched
                .points
                .iter()
                .map(|p| p.epipolar_distance_px)
                .max_by(f64::total_cmp),
            trace_coverage: traces.coverage,
            trace_jumps: traces.jumps,
            matched_fraction: [
                fraction(first, traces.points1.len()),
                fraction(second, traces.points2.len()),
            ],
            view2_reversed: traces.view2_reversed,
            dropped_pairs: matched.dropped,
            along_epipolar_line: share(along_epipolar_line),
            suspicions: suspicions(matched.mean_epipolar_distance_px(), 2.0, traces.coverage),
            outline: None,
            grey_levels: None,
            calibration: None,
            not_adjusted: None,
            points_fit: None,
            direction_margin_px: None,
            closed: false,
            careful_look: None,
        }
    }
}

fn share(flags: &[bool]) -> f64 {
    flags.iter().filter(|f| **f).count() as f64 / flags.len().max(1) as f64
}

/// Rounded points leave 1 if the curve is right, all the pixels that a line crosses 1.6 on average over its
/// directions, and 2 if it runs diagonally.
const MOST_CHI2_PER_POINT: f64 = 2.0;

/// Most that the position of a curve may be in doubt across it, px.
const MOST_SIGMA_PX: f64 = 2.0;

/// A match in the wrong direction leaves out what does not fit. Where the other direction costs hardly more,
/// px a point, and such a share of the points is left out, it may be that.
const BOUGHT_MARGIN_PX: f64 = 0.06;
const BOUGHT_SHARE: f64 = 0.02;

/// Points without noise lie no farther from a spline than it bends between its knots, px.
const MISFIT_PX: f64 = 0.05;

/// A trace that leaves out more of a skeleton than a few spurs.
const LEAST_COVERAGE: f64 = 0.95;

/// What ordered curves alone can tell: curves that belong together agree to a fraction of a pixel,
/// wrong orders and directions are off by pixels.
fn suspicions(mean_distance_px: f64, most_px: f64, coverage: [f64; 2]) -> Vec<Suspicion> {
    [
        (mean_distance_px > most_px, Suspicion::ViewsDisagree),
        (coverage[0].min(coverage[1]) < LEAST_COVERAGE, Suspicion::Uncovered),
    ]
    .into_iter()
    .filter_map(|(holds, reason)| holds.then_some(reason))
    .collect()
}
