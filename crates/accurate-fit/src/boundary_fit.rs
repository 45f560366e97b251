use accurate_geom::{Curve3, Rig};

use crate::covariance::CurveCovariance;
use crate::curve::to_curve;
use crate::judgement::{Judgement, UnexplainedStretch, judge, unexplained_stretches};
use crate::minimise::{Minimiser, Priors};
use crate::outline_params::{SmoothnessScale, final_settings};
use crate::outline_problem::{OutlineProblem, Settings, State};
use crate::pose::pose;
use crate::projector::Nuisance;
use crate::selected_inverse::SelectedInverse;
use crate::uniform_spline::UniformSpline;
use crate::{FitError, OutlineFitParams, OutlinePair};

/// A curve fitted to both outlines.
#[derive(Debug, Clone)]
pub struct OutlineFit {
    /// The fitted curve.
    pub curve: Curve3,
    /// Half thickness of the body in each view, px.
    pub half_thickness_px: [f64; 2],
    /// How well it explains both outlines.
    pub judgement: Judgement,
    /// What it does not explain, worst first.
    pub unexplained: Vec<UnexplainedStretch>,
    /// Levenberg-Marquardt steps taken.
    pub steps: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
    /// Weight of the third differences along the curve, one per knot span, as
    /// [`OutlineFitParams::lambda3`]. All equal unless fitted adaptively.
    pub smoothness: Vec<f64>,
    /// Uncertainty of the curve; only of an adaptive fit, whose smoothness is the data's own.
    pub covariance: Option<CurveCovariance>,
    /// -2 ln of the probability of the outlines (Laplace's approximation), up to a constant of the
    /// outlines; only of an adaptive fit. Of several fits that explain the same outlines the one with
    /// the least is the likeliest: residuals and bends are weighed by what noise and smoothness were
    /// found to be.
    pub surprise: Option<f64>,
}

/// Fits one 3D curve to both outlines: every boundary point must lie one half thickness from the
/// projected curve.
///
/// At crossings the outline belongs to the nearest strand, a tip is a round cap, and every boundary
/// point is used once: crossings, overlaps, touching strands and tips need no special case. The half
/// thicknesses are unknowns of the fit. Robust (Cauchy) weights; curve outside the masks is drawn
/// back; Levenberg-Marquardt with new associations in every step, which is taken only if the bounded
/// robust cost falls.
///
/// # Errors
/// [`FitError::NotInFront`], [`FitError::BadLength`] for an unusable start,
/// [`FitError::BadParameter`], [`FitError::Singular`].
///
/// # Source
/// Our own; the association in the normal direction is that of active contours (Kass et al. 1988)
/// with the contour replaced by the outlines of a tube.
///
/// # Cost
/// O(boundary points + curve length · points within reach) per step, the banded solve is negligible.
pub fn fit_outlines(
    start: &Curve3,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    params: &OutlineFitParams,
) -> Result<OutlineFit, FitError> {
    params.validate()?;
    let (problem, spline) = pose(start, outlines, rig, params.knot_spacing_px)?;
    let (minimiser, steps, converged) = run(problem, spline, params, Priors::default())?;
    finish(minimiser, params, steps, converged, None)
}

/// The judgement of a given curve, without moving it; the half thicknesses are fitted.
///
/// # Errors
/// As [`fit_outlines`].
pub fn judge_curve(
    curve: &Curve3,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    params: &OutlineFitParams,
) -> Result<Judgement, FitError> {
    params.validate()?;
    // Close knots: the curve is to be judged, not smoothed.
    let spacing_px = params.knot_spacing_px.min(2.0);
    let (problem, spline) = pose(curve, outlines, rig, spacing_px)?;
    let half_px = [0, 1].map(|v| problem.outlines[v].half_thickness_px);
    let scale = SmoothnessScale::new(&spline, problem.px_per_unit);
    let settings = final_settings(params, &scale);
    let state = State { spline, half_px, nuisance: Nuisance::default() };
    let mut evaluation = problem.evaluation(state);
    for _ in 0..3 {
        problem.evaluate(&mut evaluation, &settings)?;
        for view in 0..2 {
            let distances =
                evaluation.rows.iter().filter(|r| r.view == view && r.passes && !r.outside);
            let (sum, n) = distances.fold((0.0, 0usize), |(s, n), r| (s + r.distance, n + 1));
            if n > 0 {
                evaluation.state.half_px[view] = sum / n as f64;
            }
        }
    }
    problem.evaluate(&mut evaluation, &settings)?;
    Ok(judge(&problem, &evaluation))
}

pub(crate) fn run<'a>(
    problem: OutlineProblem<'a>,
    spline: UniformSpline,
    params: &OutlineFitParams,
    priors: Priors,
) -> Result<(Minimiser<'a>, usize, bool), FitError> {
    let scale = SmoothnessScale::new(&spline, problem.px_per_unit);
    let half_px = [0, 1].map(|v| problem.outlines[v].half_thickness_px);
    let start = State { spline, half_px, nuisance: Nuisance::default() };
    let mut minimiser = Minimiser::new(problem, start, params.damping, priors)?;
    let last = final_settings(params, &scale);
    let mut steps = 0;
    let mut converged = false;
    for iteration in 0..params.iterations {
        let settings = params.settings(iteration, &scale);
        let drop = minimiser.step(&settings)?;
        steps += 1;
        // Not before the schedule has arrived at its last settings.
        if drop < params.tolerance && settings == (Settings { judged: false, ..last }) {
            converged = true;
            break;
        }
    }
    minimiser.refresh(&last)?;
    Ok((minimiser, steps, converged))
}

/// The result at the minimiser's current state; `posterior`: the inverse of its normal matrix and the
/// variance of a residual.
pub(crate) fn finish(
    minimiser: Minimiser<'_>,
    params: &OutlineFitParams,
    steps: usize,
    converged: bool,
    posterior: Option<(&SelectedInverse, f64)>,
) -> Result<OutlineFit, FitError> {
    let Minimiser { problem, current, .. } = minimiser;
    let spline = &current.state.spline;
    let controls = spline.control.len();
    let smoothness = (0..spline.spans())
        .map(|k| params.lambda3 * problem.local_smoothness.get(k).copied().unwrap_or(1.0))
        .collect();
    Ok(OutlineFit {
        judgement: judge(&problem, &current),
        unexplained: unexplained_stretches(&problem, &current),
        half_thickness_px: current.state.half_px,
        curve: to_curve(spline)?,
        steps,
        converged,
        smoothness,
        surprise: None,
        covariance: posterior.map(|(inverse, variance)| {
            CurveCovariance::new(controls, |i, j| inverse.block(i, j) * variance)
        }),
    })
}
