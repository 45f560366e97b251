use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Curve3, Rig};

use crate::boundary_fit::{finish, run};
use crate::extrapolation::Extrapolation;
use crate::judgement::judge;
use crate::minimise::{Minimiser, Priors};
use crate::occam::occam;
use crate::outline_params::{SmoothnessScale, final_settings};
use crate::outline_problem::Settings;
use crate::pool::{Pool, largest};
use crate::pose::pose;
use crate::projector::Nuisance;
use crate::selected_inverse::SelectedInverse;
use crate::{FitError, OutlineFit, OutlineFitParams, OutlinePair};

/// Parameters of [`fit_outlines_adaptively`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdaptiveParams {
    /// Most updates of the smoothness.
    pub rounds: usize,
    /// Standard deviation of the window over which bending is pooled along the curve, px.
    pub window_px: f64,
    /// Variance of a residual in units of the 1/18 px² of one boundary point. Above 1 because
    /// neighbouring boundary points repeat each other's digitisation error.
    pub noise_inflation: f64,
    /// How much more of the outline may become unexplained before the smoothing stops; in the
    /// units of [`Judgement::unexplained`](crate::Judgement::unexplained).
    pub max_unexplained: f64,
    /// A curve that leaves more than `max_unexplained` is tried again with knots at half the
    /// distance, but not closer than this, px.
    pub min_knot_spacing_px: f64,
}

impl AdaptiveParams {
    /// Tuned on generated wires of all families.
    pub const DEFAULT: Self = Self {
        rounds: 8,
        window_px: 50.0,
        noise_inflation: 3.0,
        max_unexplained: 0.05,
        min_knot_spacing_px: 4.0,
    };

    /// Variance of a residual, px².
    pub(crate) const fn variance_px2(&self) -> f64 {
        self.noise_inflation / 18.0
    }

    pub(crate) fn validate(&self) -> Result<(), FitError> {
        for (name, value) in
            [("window_px", self.window_px), ("noise_inflation", self.noise_inflation)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        for (name, value) in [
            ("max_unexplained", self.max_unexplained),
            ("min_knot_spacing_px", self.min_knot_spacing_px),
        ] {
            if !(value >= 0.0) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        Ok(())
    }
}

/// [`fit_outlines`](crate::fit_outlines), then as smooth as the outlines say the body is.
///
/// No fixed smoothness suits a J tip and a straight shaft, or a helix and a random curve. The third
/// differences of the control points are taken as normal variables whose variance changes slowly
/// along the curve; it is estimated together with the curve by expectation maximisation: the
/// observed squares plus what the data leave uncertain, pooled over a window. Where a curve runs
/// along the epipolar lines the data leave much uncertain, and the smoothness that its other
/// components show carries the depth over.
///
/// # Errors
/// As [`fit_outlines`](crate::fit_outlines).
///
/// # Source
/// Dempster, Laird and Rubin, J. R. Statist. Soc. B 39, 1977, for the variance of random effects;
/// the steps are doubled in the logarithm, which converges in half the rounds, and extrapolated
/// (Anderson, J. ACM 12, 1965).
///
/// # Cost
/// About twice [`fit_outlines`](crate::fit_outlines).
pub fn fit_outlines_adaptively(
    start: &Curve3,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    params: &OutlineFitParams,
    adaptive: &AdaptiveParams,
) -> Result<OutlineFit, FitError> {
    params.validate()?;
    adaptive.validate()?;
    Ok(fit_posterior(start, outlines, rig, params, adaptive, Priors::default())?.fit)
}

/// A fit with what the data say about the nuisance parameters.
pub(crate) struct Posterior {
    pub(crate) fit: OutlineFit,
    pub(crate) nuisance: Nuisance,
    /// Covariance of shift (px) and roll (rad); zero if they are no unknowns.
    pub(crate) nuisance_covariance: Matrix3<f64>,
}

/// The adaptive fit, with knots closer where needed.
pub(crate) fn fit_posterior(
    start: &Curve3,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    params: &OutlineFitParams,
    adaptive: &AdaptiveParams,
    priors: Priors,
) -> Result<Posterior, FitError> {
    let fitted = fit_with_knots(start, outlines, rig, params, adaptive, priors)?;
    let halved =
        OutlineFitParams { knot_spacing_px: 0.5 * params.knot_spacing_px, ..params.settled() };
    let unexplained = |p: &Posterior| p.fit.judgement.unexplained + p.fit.judgement.outside;
    if unexplained(&fitted) <= adaptive.max_unexplained
        || halved.knot_spacing_px < adaptive.min_knot_spacing_px
    {
        return Ok(fitted);
    }
    // Perhaps it bends more than knots so far apart can.
    let finer = fit_with_knots(&fitted.fit.curve, outlines, rig, &halved, adaptive, priors)?;
    let gain = unexplained(&fitted) - unexplained(&finer);
    Ok(if gain > adaptive.max_unexplained { finer } else { fitted })
}

fn fit_with_knots(
    start: &Curve3,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    params: &OutlineFitParams,
    adaptive: &AdaptiveParams,
    priors: Priors,
) -> Result<Posterior, FitError> {
    let (mut problem, spline) = pose(start, outlines, rig, params.knot_spacing_px)?;
    problem.calibrating = priors.nuisance_weights.is_some();
    let (mut minimiser, steps, converged) = run(problem, spline, params, priors)?;
    let Smoothed { steps: more, inverse, settings } = smooth(&mut minimiser, params, adaptive)?;
    let variance = adaptive.variance_px2();
    let nuisance = minimiser.current.state.nuisance;
    let nuisance_covariance = if priors.nuisance_weights.is_some() {
        let first = 3 * minimiser.current.state.spline.control.len() + 2;
        Matrix3::from_fn(|a, b| variance * inverse.get(first + a, first + b))
    } else {
        Matrix3::zeros()
    };
    let surprise = surprise(&minimiser, &inverse, &settings, adaptive);
    let fit = finish(minimiser, params, steps + more, converged, Some((&inverse, variance)))?;
    let fit = OutlineFit { surprise: Some(surprise), ..fit };
    Ok(Posterior { fit, nuisance, nuisance_covariance })
}

/// [`OutlineFit::surprise`] at the current curve, which is smoothed under `settings` and judged.
fn surprise(
    minimiser: &Minimiser<'_>,
    inverse: &SelectedInverse,
    settings: &Settings,
    adaptive: &AdaptiveParams,
) -> f64 {
    let Minimiser { problem, current, .. } = minimiser;
    let spline = &current.state.spline;
    let variance = adaptive.variance_px2();
    // A boundary point that is no datum counts as one of the size of the noise, or leaving points out
    // would pay.
    let points = problem.outlines.iter().map(|outline| outline.points.len()).sum::<usize>();
    let used = current.rows.iter().filter(|row| row.held && !row.outside).count();
    let unused = points.saturating_sub(used) as f64 / adaptive.noise_inflation;
    let cost = problem.cost(current, settings) + minimiser.prior_cost(current);
    let factors = &problem.local_smoothness;
    let unknowns = 3 * spline.control.len();
    // What no third difference holds is where the curve begins, in which direction and how bent: nine
    // unknowns of the body, spread evenly, whatever the distance h of the knots. In the first control
    // points, whose differences are h and h² times those, their density is that of h^-9.
    let free = 18.0 * spline.spacing_px(problem.px_per_unit).ln();
    cost / variance + unused + free + occam(inverse, unknowns, variance, settings.lambda3, factors)
}

/// What [`smooth`] did.
struct Smoothed {
    steps: usize,
    /// Of the final normal matrix ...
    inverse: SelectedInverse,
    /// ... and what it was assembled under.
    settings: Settings,
}

/// Alternates smoothness and curve.
fn smooth(
    minimiser: &mut Minimiser<'_>,
    params: &OutlineFitParams,
    adaptive: &AdaptiveParams,
) -> Result<Smoothed, FitError> {
    let spline = &minimiser.current.state.spline;
    let scale = SmoothnessScale::new(spline, minimiser.problem.px_per_unit);
    let settings = final_settings(params, &scale);
    minimiser.refresh(&settings)?;
    // Smoothness must not pull a tip in or a loop open.
    let allowed =
        judge(&minimiser.problem, &minimiser.current).unexplained + adaptive.max_unexplained;
    let start = minimiser.current.state.clone();
    // It hardly ever does: to watch every step for it would take half as long again.
    let unwatched = Settings { judged: false, ..settings };
    let mut steps = alternate(minimiser, &unwatched, adaptive, allowed)?;
    minimiser.refresh(&settings)?;
    if judge(&minimiser.problem, &minimiser.current).unexplained > allowed {
        minimiser.restart(start);
        steps += alternate(minimiser, &settings, adaptive, allowed)?;
    }
    let inverse = inverse(minimiser, &settings)?;
    Ok(Smoothed { steps, inverse, settings })
}

/// Steps of smoothness and curve from equal smoothness, until the former changes no more. If they are
/// judged, those after which more than `allowed` is unexplained are taken back. Returns their number.
fn alternate(
    minimiser: &mut Minimiser<'_>,
    settings: &Settings,
    adaptive: &AdaptiveParams,
    allowed: f64,
) -> Result<usize, FitError> {
    /// No logarithm of the smoothness changes by more in the last round.
    const REST: f64 = 0.1;
    let spline = &minimiser.current.state.spline;
    let windows = spline.control.len() - 3;
    let spacing_px = spline.spacing_px(minimiser.problem.px_per_unit);
    let pool = Pool::new(adaptive.window_px / spacing_px, windows);
    let variance = adaptive.variance_px2();
    let mut factors = vec![1.0; windows];
    minimiser.problem.local_smoothness.clone_from(&factors);
    let mut extrapolation = Extrapolation::default();
    let mut steps = 0;
    // Doubled in the logarithm until that proves too bold.
    let mut relaxation = 2.0;
    for _ in 0..adaptive.rounds {
        let inverse = inverse(minimiser, settings)?;
        let control = &minimiser.current.state.spline.control;
        let changes = pool.log_changes(&factors, &inverse, control, variance, settings.lambda3);
        let next = extrapolation.next(&factors, &changes, relaxation);
        let before = std::mem::replace(&mut factors, next);
        minimiser.problem.local_smoothness.clone_from(&factors);
        minimiser.step(settings)?;
        steps += 1;
        if settings.judged && judge(&minimiser.problem, &minimiser.current).unexplained > allowed {
            minimiser.undo();
            factors = before;
            minimiser.problem.local_smoothness.clone_from(&factors);
            extrapolation = Extrapolation::default();
            relaxation -= 1.0;
            if relaxation == 0.0 {
                break;
            }
            continue;
        }
        if largest(&changes) < REST {
            break;
        }
    }
    Ok(steps)
}

/// The inverse of the undamped normal matrix at the current state.
pub(crate) fn inverse(
    minimiser: &mut Minimiser<'_>,
    settings: &Settings,
) -> Result<SelectedInverse, FitError> {
    minimiser.assemble(settings)?;
    // Rounding only: an unknown that nothing constrains must not stop the fit.
    minimiser.normal.factorise(1e-9)?.selected_inverse()
}
