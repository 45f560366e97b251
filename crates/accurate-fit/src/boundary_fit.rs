use accurate_geom::{Curve3, Pixel, Point3, Rig, View, View1, View2};

use crate::curve::{dense_points, from_curve, to_curve};

use crate::judgement::{Judgement, UnexplainedStretch, judge, unexplained_stretches};
use crate::minimise::{Minimiser, Priors};
use crate::outline_problem::{OutlineProblem, Settings, State};
use crate::projector::{Nuisance, Projector};
use crate::uniform_spline::UniformSpline;
use crate::{FitError, Outline};

/// Both outlines, and where the curve is allowed to leave them.
#[derive(Debug, Clone)]
pub struct OutlinePair<'a> {
    outline1: &'a Outline<View1>,
    outline2: &'a Outline<View2>,
    bridges: [Vec<[f64; 4]>; 2],
}

impl<'a> OutlinePair<'a> {
    /// The outlines of view 1 and view 2.
    pub fn new(outline1: &'a Outline<View1>, outline2: &'a Outline<View2>) -> Self {
        Self { outline1, outline2, bridges: Default::default() }
    }

    /// Allows the curve to run outside the masks within 4 px of these straight stretches: gaps that
    /// a tracer bridged.
    pub fn with_bridges(
        mut self,
        bridges1: &[(Pixel<View1>, Pixel<View1>)],
        bridges2: &[(Pixel<View2>, Pixel<View2>)],
    ) -> Self {
        self.bridges = [flat(bridges1), flat(bridges2)];
        self
    }
}

fn flat<V: View>(bridges: &[(Pixel<V>, Pixel<V>)]) -> Vec<[f64; 4]> {
    bridges
        .iter()
        .filter(|(a, b)| a.is_finite() && b.is_finite())
        .map(|(a, b)| [a.x, a.y, b.x, b.y])
        .collect()
}

/// Parameters of [`fit_outlines`]. Lengths in the world are converted to px at the curve's mean
/// magnification, so that they mean the same in every unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlineFitParams {
    /// Distance of the spline's knots along the curve, px.
    pub knot_spacing_px: f64,
    /// Weight of the squared second differences of the control points (at 10 px spacing), 1/px².
    pub lambda2: f64,
    /// Weight of the squared third differences of the control points (at 10 px spacing), 1/px².
    pub lambda3: f64,
    /// The same in the first third of the iterations; geometric mean in the second third.
    pub lambda3_start: f64,
    /// Largest number of Levenberg-Marquardt steps.
    pub iterations: usize,
    /// Scale of the Cauchy weights at the end, px. Digitisation is off by at most 0.71 px.
    pub cauchy_scale_px: f64,
    /// The same at the start; it shrinks by 0.7 per step.
    pub cauchy_scale_start_px: f64,
    /// Boundary points farther than this from the fitted outline are no data, px.
    pub reach_px: f64,
    /// The same in the first two thirds of the iterations.
    pub reach_start_px: f64,
    /// Use every 4th boundary point in the first two steps and every 2nd in the next two.
    pub subsample: bool,
    /// Weight of a curve sample outside the mask, per px of curve.
    pub outside_weight: f64,
    /// First Levenberg-Marquardt damping, relative to the diagonal.
    pub damping: f64,
    /// Stop when a step lowers the cost by less than this fraction.
    pub tolerance: f64,
}

impl OutlineFitParams {
    /// For a start within a few px of the truth.
    pub const DEFAULT: Self = Self {
        knot_spacing_px: 10.0,
        lambda2: 0.005,
        lambda3: 0.3,
        lambda3_start: 0.3,
        iterations: 10,
        cauchy_scale_px: 0.7,
        cauchy_scale_start_px: 2.0,
        reach_px: 3.0,
        reach_start_px: 3.0,
        subsample: true,
        outside_weight: 0.3,
        damping: 2e-3,
        tolerance: 1e-5,
    };

    /// For a start that may run along the wrong strand for a stretch: stiff first, then softer.
    pub const ANNEALED: Self = Self {
        lambda3_start: 30.0,
        iterations: 15,
        cauchy_scale_start_px: 4.0,
        reach_start_px: 6.0,
        subsample: false,
        ..Self::DEFAULT
    };

    fn validate(&self) -> Result<(), FitError> {
        let positive = [
            ("knot_spacing_px", self.knot_spacing_px),
            ("lambda3", self.lambda3),
            ("lambda3_start", self.lambda3_start),
            ("cauchy_scale_px", self.cauchy_scale_px),
            ("cauchy_scale_start_px", self.cauchy_scale_start_px),
            ("reach_px", self.reach_px),
            ("reach_start_px", self.reach_start_px),
            ("damping", self.damping),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        for (name, value) in [
            ("lambda2", self.lambda2),
            ("outside_weight", self.outside_weight),
            ("tolerance", self.tolerance),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        Ok(())
    }

    /// Settings of one iteration for a spline with knots `spacing_px` apart.
    pub(crate) fn settings(&self, iteration: usize, scale: &SmoothnessScale) -> Settings {
        let stage = (3 * iteration / self.iterations.max(1)).min(2);
        let share = stage as f64 / 2.0;
        let lambda3 = self.lambda3_start.powf(1.0 - share) * self.lambda3.powf(share);
        let decayed = self.cauchy_scale_start_px * 0.7f64.powi(iteration as i32);
        let stride = match iteration {
            0 | 1 if self.subsample => 4,
            2 | 3 if self.subsample => 2,
            _ => 1,
        };
        Settings {
            reach_px: if stage < 2 { self.reach_start_px } else { self.reach_px },
            scale_px: decayed.max(self.cauchy_scale_px),
            stride,
            lambda2: self.lambda2 * scale.second,
            lambda3: lambda3 * scale.third,
            outside_weight: self.outside_weight,
        }
    }
}

/// Turns smoothness weights per px at 10 px knot spacing into weights for the control points at
/// hand: world unit, and the spacing they really have (`D3 c ~ spacing³ c'''`, summed over
/// `length / spacing` terms).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SmoothnessScale {
    pub(crate) second: f64,
    pub(crate) third: f64,
}

impl SmoothnessScale {
    pub(crate) fn new(spline: &UniformSpline, px_per_unit: f64) -> Self {
        let spacing_px = spline.length(8) * px_per_unit / spline.spans() as f64;
        let ratio = 10.0 / spacing_px;
        let unit = px_per_unit * px_per_unit;
        Self { second: unit * ratio.powi(3), third: unit * ratio.powi(5) }
    }
}

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
    let (minimiser, steps, converged) = run(problem, spline, params)?;
    finish(minimiser, steps, converged)
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
    let (problem, spline) = pose(curve, outlines, rig, params.knot_spacing_px)?;
    let half_px = [0, 1].map(|v| problem.outlines[v].half_thickness_px);
    let scale = SmoothnessScale::new(&spline, problem.px_per_unit);
    let settings = final_settings(params, &scale);
    let state = State { spline, half_px, nuisance: Nuisance::default() };
    let mut evaluation = problem.evaluation(state);
    for _ in 0..3 {
        problem.evaluate(&mut evaluation, &settings)?;
        for view in 0..2 {
            let distances = evaluation.rows.iter().filter(|r| r.view == view && !r.outside);
            let (sum, n) = distances.fold((0.0, 0usize), |(s, n), r| (s + r.distance, n + 1));
            if n > 0 {
                evaluation.state.half_px[view] = sum / n as f64;
            }
        }
    }
    problem.evaluate(&mut evaluation, &settings)?;
    Ok(judge(&problem, &evaluation))
}

/// Settings under which a fit is judged.
pub(crate) fn final_settings(params: &OutlineFitParams, scale: &SmoothnessScale) -> Settings {
    let last = OutlineFitParams { subsample: false, ..*params };
    let settings = last.settings(params.iterations.max(1) + 2, scale);
    Settings { scale_px: params.cauchy_scale_px, ..settings }
}

/// The problem of a curve and its outlines, and the curve with knots of the asked spacing.
pub(crate) fn pose<'a>(
    start: &Curve3,
    outlines: &'a OutlinePair<'_>,
    rig: &Rig,
    knot_spacing_px: f64,
) -> Result<(OutlineProblem<'a>, UniformSpline), FitError> {
    let projectors = Projector::pair(rig);
    let (spline, px_per_unit) = respaced(start, &projectors, knot_spacing_px)?;
    let problem = OutlineProblem {
        outlines: [&outlines.outline1.data, &outlines.outline2.data],
        bridges: [&outlines.bridges[0], &outlines.bridges[1]],
        projectors,
        steps: (knot_spacing_px / 1.5).ceil().clamp(2.0, 64.0) as usize,
        px_per_unit,
        floor: std::env::var("FLOOR").ok().and_then(|v| v.parse().ok()).unwrap_or(1e9),
    };
    Ok((problem, spline))
}

/// The curve as a uniform spline with knots `knot_spacing_px` apart, and the px per world unit.
pub(crate) fn respaced(
    curve: &Curve3,
    projectors: &[Projector; 2],
    knot_spacing_px: f64,
) -> Result<(UniformSpline, f64), FitError> {
    let points = dense_points(curve);
    let px_per_unit = px_per_unit(&points, projectors)?;
    let length: f64 = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let spans = spans_for(length * px_per_unit, knot_spacing_px)?;
    if let Some(same) = from_curve(curve) {
        let spacing_px = length * px_per_unit / same.spans() as f64;
        if (spacing_px / knot_spacing_px - 1.0).abs() < 0.15 {
            return Ok((same, px_per_unit));
        }
    }
    Ok((UniformSpline::through(&points, spans)?, px_per_unit))
}

/// Number of spans for a curve of `length_px`.
pub(crate) fn spans_for(length_px: f64, knot_spacing_px: f64) -> Result<usize, FitError> {
    // No image is larger than 2^16 px; a curve may wind, but not that much.
    if !(length_px > 1.0 && length_px < 1e6) {
        return Err(FitError::BadLength { length_px });
    }
    Ok((length_px / knot_spacing_px).round().clamp(3.0, 20_000.0) as usize)
}

/// Mean magnification of both views over the points.
pub(crate) fn px_per_unit(points: &[Point3], projectors: &[Projector; 2]) -> Result<f64, FitError> {
    let mut sum = 0.0;
    for point in points {
        for (projector, view) in projectors.iter().zip(1..) {
            let depth = projector.depth(&point.coords);
            if !(depth > 0.0) {
                return Err(FitError::NotInFront { view, depth });
            }
            sum += projector.px_per_unit(&point.coords);
        }
    }
    Ok(sum / (2 * points.len().max(1)) as f64)
}

fn run<'a>(
    problem: OutlineProblem<'a>,
    spline: UniformSpline,
    params: &OutlineFitParams,
) -> Result<(Minimiser<'a>, usize, bool), FitError> {
    let scale = SmoothnessScale::new(&spline, problem.px_per_unit);
    let half_px = [0, 1].map(|v| problem.outlines[v].half_thickness_px);
    let start = State { spline, half_px, nuisance: Nuisance::default() };
    let mut minimiser = Minimiser::new(problem, start, params.damping, Priors::default())?;
    let mut steps = 0;
    let mut converged = false;
    for iteration in 0..params.iterations {
        let settings = params.settings(iteration, &scale);
        let drop = minimiser.step(&settings)?;
        steps += 1;
        // Not before the schedule has arrived at its last settings.
        if drop < params.tolerance && settings == final_settings(params, &scale) {
            converged = true;
            break;
        }
    }
    minimiser.refresh(&final_settings(params, &scale))?;
    Ok((minimiser, steps, converged))
}

pub(crate) fn finish(
    minimiser: Minimiser<'_>,
    steps: usize,
    converged: bool,
) -> Result<OutlineFit, FitError> {
    let Minimiser { problem, current, .. } = minimiser;
    Ok(OutlineFit {
        judgement: judge(&problem, &current),
        unexplained: unexplained_stretches(&problem, &current),
        half_thickness_px: current.state.half_px,
        curve: to_curve(&current.state.spline)?,
        steps,
        converged,
    })
}
