use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Curve3, Pixel, Rig, View1, View2};

use crate::covariance::CurveCovariance;
use crate::curve::{from_curve, to_curve};
use crate::normal::{NormalEquations, THIRD_DIFFERENCE};
use crate::occam::occam;
use crate::outline_params::SmoothnessScale;
use crate::point_data::{Matched, PointData, matched};
use crate::point_problem::{
    PointEvaluation, PointProblem, PointSettings, PointState, huber_weight,
};
use crate::pool::{Pool, changed, largest};
use crate::pose::px_per_unit;
use crate::projector::Nuisance;
use crate::projector::Projector;
use crate::selected_inverse::SelectedInverse;
use crate::{CalibrationEstimate, CalibrationPriors, FitError, start_curve};

/// Parameters of [`fit_points`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointFitParams {
    /// Distance of the spline's knots along the curve, px.
    pub knot_spacing_px: f64,
    /// Standard deviation of a point across the curve, px; `None`: 1/√12 if all coordinates are
    /// integers (rounding), else estimated from the residuals.
    pub noise_px: Option<f64>,
    /// Residuals beyond so many standard deviations are weighed down.
    pub huber_sigmas: f64,
    /// Variance of a residual in units of the noise: above 1 because neighbouring points repeat each
    /// other's error.
    pub noise_inflation: f64,
    /// Standard deviation of the window over which bending is pooled along the curve, px.
    pub window_px: f64,
    /// Per view, whether its first and its last point may lie beyond what the other view sees.
    /// Otherwise they are the body's ends, and fitted in both coordinates.
    pub free_ends: [[bool; 2]; 2],
    /// Levenberg-Marquardt steps before the smoothness is estimated.
    pub first_steps: usize,
    /// Most updates of noise and smoothness.
    pub rounds: usize,
    /// A match whose pairs are farther apart on average is refused, px; with a calibration to be found,
    /// farther by three standard deviations of its shift.
    pub max_mean_distance_px: f64,
    /// A match that leaves more than this of a curve without partner is refused.
    pub min_coverage: f64,
    /// How wrong the calibration of view 2 may be; `None`: it is exact. Else a shift of image 2 and a
    /// roll of its camera are unknowns.
    pub calibration: Option<CalibrationPriors>,
}

impl PointFitParams {
    /// For points about 1 px apart.
    pub const DEFAULT: Self = Self {
        knot_spacing_px: 10.0,
        noise_px: None,
        huber_sigmas: 3.0,
        noise_inflation: 3.0,
        window_px: 50.0,
        free_ends: [[false; 2]; 2],
        first_steps: 8,
        rounds: 12,
        max_mean_distance_px: 1.0,
        min_coverage: 0.98,
        calibration: None,
    };

    fn validate(&self) -> Result<(), FitError> {
        for (name, value) in [
            ("knot_spacing_px", self.knot_spacing_px),
            ("noise_px", self.noise_px.unwrap_or(1.0)),
            ("huber_sigmas", self.huber_sigmas),
            ("noise_inflation", self.noise_inflation),
            ("window_px", self.window_px),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        for (name, value) in [
            ("max_mean_distance_px", self.max_mean_distance_px),
            ("min_coverage", self.min_coverage),
        ] {
            if !(value >= 0.0) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        self.calibration.map_or(Ok(()), |priors| priors.validate())
    }
}

/// A curve fitted to two ordered curves of points.
#[derive(Debug, Clone)]
pub struct PointFit {
    /// The fitted curve.
    pub curve: Curve3,
    /// Standard deviation of a point across the curve, px: known or estimated.
    pub noise_px: f64,
    /// Root mean square of the residuals across the curve, px: at the start curve and at the end.
    pub rms_px: [f64; 2],
    /// Parameter on [`PointFit::curve`] of every point of curve 1 and curve 2, never falling.
    pub parameters: [Vec<f64>; 2],
    /// Points of each view that lie beyond a free end and were not used.
    pub beyond: [usize; 2],
    /// Mean epipolar distance of the pairs it started from, px.
    pub mean_distance_px: f64,
    /// Matched fraction of the less matched view.
    pub coverage: f64,
    /// Levenberg-Marquardt steps that lowered the cost.
    pub steps: usize,
    /// Mean of the squared residuals in units of the noise's variance: about 1 where the curve explains
    /// the points. Where the noise was estimated it says nothing: less than 1 by what the curve takes up,
    /// and far less where the noise stands at its least.
    pub chi2_per_point: f64,
    /// -2 ln of the probability of the points (Laplace's approximation), up to a constant of the
    /// points: of several fits to the same points the one with the least is the likeliest, since a
    /// wrong start is paid for in residuals or in bends that nothing asks for.
    pub surprise: f64,
    /// Uncertainty of the curve, which includes what the calibration leaves uncertain if that was
    /// estimated.
    pub covariance: CurveCovariance,
    /// What the points say about the calibration of view 2, if asked.
    pub calibration: Option<CalibrationEstimate>,
}

/// Smoothness at the start, as [`OutlineFitParams::lambda3`](crate::OutlineFitParams::lambda3).
const LAMBDA3_START: f64 = 0.3;
/// How far along the curve a point may be off its first place, and how far later, px.
const WINDOWS_PX: [f64; 2] = [24.0, 8.0];
/// Variance of a residual in units of the noise, for the covariance: set so that 95 % ellipses hold
/// the truth about 95 % of the time on average over the generated families. Less than what smooths
/// best.
const COVARIANCE_INFLATION: f64 = 2.0;
/// No centreline is known better than this, px.
const LEAST_NOISE_PX: f64 = 1e-3;

/// Bundle adjustment of one 3D B-spline to two ordered curves.
///
/// The residual of a point is its distance from the projected curve in its own view: the parameter
/// of each point is eliminated, no point needs a partner once the fit runs. Huber weights,
/// Levenberg-Marquardt with acceptance, association within a window and in order; noise and
/// smoothness along the curve are estimated together with it (restricted maximum likelihood), since
/// exact and rounded points, straight shafts and helices want smoothness that differs by orders of
/// magnitude.
///
/// `pairs` are matched indices of `curve1` and `curve2`, in order.
///
/// # Errors
/// [`FitError::BadMatch`] if the pairs are no basis for a refinement, which would lock their mistakes
/// in; [`FitError::TooFewPoints`], [`FitError::NotFinite`], [`FitError::BadPair`],
/// [`FitError::BadParameter`], [`FitError::BadLength`], [`FitError::NotInFront`],
/// [`FitError::Singular`].
///
/// # Source
/// Nurutdinova and Fitzgibbon, Towards Pointless Structure from Motion, ICCV 2015 (parameters per
/// point); Xiao and Li, NURBS-based stereo, 2005. Smoothness: as
/// [`fit_outlines_adaptively`](crate::fit_outlines_adaptively).
///
/// # Cost
/// O(points · window) per step.
pub fn fit_points(
    curve1: &[Pixel<View1>],
    curve2: &[Pixel<View2>],
    pairs: &[(usize, usize)],
    rig: &Rig,
    params: &PointFitParams,
) -> Result<PointFit, FitError> {
    params.validate()?;
    let start = matched(curve1, curve2, pairs, rig, params)?;
    let mut fitter = Fitter::new(&start, rig, params)?;
    let before = fitter.rms();
    let mut steps = 0;
    for _ in 0..params.first_steps {
        steps += usize::from(fitter.step()?);
    }
    fitter.settings.window = WINDOWS_PX[1] / fitter.spacing_px;
    let mut relaxation = 2.0;
    for _ in 0..params.rounds {
        let change = fitter.update(params, relaxation)?;
        // Doubled steps may swing; the last ones are plain.
        if change < 0.3 {
            relaxation = 1.0;
        }
        steps += usize::from(fitter.step()?);
        if change < 0.03 {
            break;
        }
    }
    fitter.finish(&start, params, before, steps)
}

struct Fitter<'a> {
    problem: PointProblem<'a>,
    current: PointEvaluation,
    trial: PointEvaluation,
    normal: NormalEquations,
    settings: PointSettings,
    damping: f64,
    spacing_px: f64,
    noise_px: f64,
    noise_known: bool,
    pool: Pool,
}

impl<'a> Fitter<'a> {
    fn new(start: &'a Matched, rig: &Rig, params: &PointFitParams) -> Result<Self, FitError> {
        let curve = start_curve(&start.points, &start.arc_px, params.knot_spacing_px)?;
        let length_px = start.arc_px[start.arc_px.len() - 1] - start.arc_px[0];
        let Some(spline) = from_curve(&curve) else {
            return Err(FitError::BadLength { length_px });
        };
        let spans = spline.spans() as f64;
        let spacing_px = length_px / spans;
        let projectors = Projector::pair(rig);
        let px_per_unit = px_per_unit(&start.points, &projectors)?;
        let scale = SmoothnessScale::new(&spline, px_per_unit);
        let parameters = [0, 1].map(|view| {
            let places = &start.data[view].arc_px;
            places.iter().map(|s| ((s - start.arc_px[0]) / spacing_px).clamp(0.0, spans)).collect()
        });
        let noise = params.noise_px.or_else(|| rounding(&start.data));
        let noise_px = noise.unwrap_or(ROUNDING_PX);
        let settings = PointSettings {
            lambda3: LAMBDA3_START * scale.third,
            huber_px: params.huber_sigmas * noise_px,
            window: WINDOWS_PX[0] / spacing_px,
        };
        let problem = PointProblem {
            data: &start.data,
            projectors,
            steps: (params.knot_spacing_px / 1.5).ceil().clamp(2.0, 64.0) as usize,
            local_smoothness: vec![1.0; spline.spans()],
            nuisance_weights: params
                .calibration
                .map(|priors| priors.weights(params.noise_inflation * noise_px * noise_px)),
        };
        let globals = if params.calibration.is_some() { 3 } else { 0 };
        let normal = NormalEquations::new(spline.control.len(), globals)?;
        let pool = Pool::new(params.window_px / spacing_px, spline.spans());
        let mut current =
            PointEvaluation::new(PointState { spline, parameters, nuisance: Nuisance::default() });
        problem.evaluate(&mut current, &settings)?;
        let trial = current.clone();
        Ok(Self {
            problem,
            current,
            trial,
            normal,
            settings,
            damping: 2e-3,
            spacing_px,
            noise_px,
            noise_known: noise.is_some(),
            pool,
        })
    }

    /// One Levenberg-Marquardt step; false if none lowers the cost.
    fn step(&mut self) -> Result<bool, FitError> {
        let Self { problem, current, trial, normal, settings, damping, .. } = self;
        let before = problem.cost(current, &current.rows, settings);
        problem.assemble(current, settings, normal);
        for _ in 0..6 {
            if let Ok(step) = normal.solve(*damping) {
                trial.state.clone_from(&current.state);
                let controls = 3 * trial.state.spline.control.len();
                trial.state.spline.add(&step[..controls]);
                if problem.nuisance_weights.is_some() {
                    trial.state.nuisance.add(&step[controls..]);
                }
                // A step behind a camera is a step too long.
                if problem.evaluate(trial, settings).is_ok()
                    && problem.cost(trial, &current.rows, settings) <= before
                {
                    std::mem::swap(current, trial);
                    *damping = (*damping / 4.0).max(1e-7);
                    return Ok(true);
                }
            }
            *damping = (*damping * 8.0).min(1e3);
        }
        Ok(false)
    }

    fn inverse(&mut self) -> Result<SelectedInverse, FitError> {
        self.problem.assemble(&self.current, &self.settings, &mut self.normal);
        // Rounding only: the motion of control points along the curve is tied by the prior alone.
        self.normal.factorise(1e-10)?.selected_inverse()
    }

    /// Estimates noise and smoothness at the current curve; returns the largest change of a
    /// logarithm.
    fn update(&mut self, params: &PointFitParams, relaxation: f64) -> Result<f64, FitError> {
        let inverse = self.inverse()?;
        let mut change = 0.0;
        if !self.noise_known {
            // Residuals over what is left of their number once the curve has taken its share.
            let mut free = 0.0;
            for (k, factor) in self.problem.local_smoothness.iter().enumerate() {
                let spread = inverse.combination(k, &THIRD_DIFFERENCE).trace();
                free += self.settings.lambda3 * factor * spread;
            }
            let taken = self.normal.unknowns() as f64 - free;
            let huber = self.settings.huber_px;
            let rows = self.current.rows.iter().filter(|row| row.used);
            let (sum, count) = rows.fold((0.0, 0.0), |(s, n), row| {
                let r = row.residual;
                (s + huber_weight(r, huber) * r * r, n + 1.0)
            });
            let noise = (sum / (count - taken).max(1.0)).sqrt().max(LEAST_NOISE_PX);
            change = (noise / self.noise_px).ln().abs();
            self.noise_px = noise;
            self.settings.huber_px = params.huber_sigmas * noise;
        }
        let variance = params.noise_inflation * self.noise_px * self.noise_px;
        self.problem.nuisance_weights = params.calibration.map(|priors| priors.weights(variance));
        let control = &self.current.state.spline.control;
        let lambda3 = self.settings.lambda3;
        let factors = &self.problem.local_smoothness;
        let changes = self.pool.log_changes(factors, &inverse, control, variance, lambda3);
        self.problem.local_smoothness = changed(factors, &changes, relaxation);
        Ok(largest(&changes).max(change))
    }

    /// Root mean square residual, px.
    fn rms(&self) -> f64 {
        let used = self.current.rows.iter().filter(|row| row.used);
        let (sum, n) = used.fold((0.0, 0usize), |(s, n), row| (s + row.residual.powi(2), n + 1));
        (sum / n.max(1) as f64).sqrt()
    }

    /// [`PointFit::surprise`] at the current curve.
    fn surprise(&self, inverse: &SelectedInverse, params: &PointFitParams) -> f64 {
        let variance = params.noise_inflation * self.noise_px * self.noise_px;
        // Repeated errors count once: so many residuals are worth `1 / noise_inflation` each. A point
        // beyond a free end counts as one of the size of the noise, or leaving points out would pay.
        let rows = self.current.rows.len() as f64;
        let unused = self.current.rows.iter().filter(|row| !row.used).count() as f64;
        let cost = self.problem.cost(&self.current, &self.current.rows, &self.settings) / variance
            + unused / params.noise_inflation;
        let scale = rows / params.noise_inflation * variance.ln();
        // The calibration's priors too are given in units of the variance, which is estimated.
        let unknowns = self.normal.unknowns();
        let factors = &self.problem.local_smoothness;
        cost + scale + occam(inverse, unknowns, variance, self.settings.lambda3, factors)
    }

    fn finish(
        mut self,
        start: &Matched,
        params: &PointFitParams,
        rms_before_px: f64,
        steps: usize,
    ) -> Result<PointFit, FitError> {
        let mut inverse = self.inverse()?;
        let surprise = self.surprise(&inverse, params);
        let variance = COVARIANCE_INFLATION * self.noise_px * self.noise_px;
        if let Some(priors) = params.calibration {
            // What only a prior holds keeps the prior's spread, whatever residuals are worth here.
            self.problem.nuisance_weights = Some(priors.weights(variance));
            inverse = self.inverse()?;
        }
        let first = 3 * self.current.state.spline.control.len();
        let calibration = params.calibration.map(|_| {
            let Nuisance { shift_px, roll } = self.current.state.nuisance;
            let spread = Matrix3::from_fn(|a, b| variance * inverse.get(first + a, first + b));
            CalibrationEstimate::new(shift_px, roll, spread)
        });
        let rms = self.rms();
        let chi2_per_point = (rms / self.noise_px).powi(2);
        let state = self.current.state;
        let end = state.spline.spans() as f64;
        let beyond = [0, 1].map(|view| {
            let [at_start, at_end] = start.data[view].free;
            let outside = |u: &&f64| (at_start && **u <= 0.0) || (at_end && **u >= end);
            state.parameters[view].iter().filter(outside).count()
        });
        Ok(PointFit {
            curve: to_curve(&state.spline)?,
            noise_px: self.noise_px,
            rms_px: [rms_before_px, rms],
            beyond,
            mean_distance_px: start.mean_distance_px,
            coverage: start.coverage,
            steps,
            chi2_per_point,
            surprise,
            calibration,
            covariance: CurveCovariance::new(state.spline.control.len(), |i, j| {
                inverse.block(i, j) * variance
            }),
            parameters: state.parameters,
        })
    }
}

/// Standard deviation of rounding to integers: U(-1/2, 1/2).
const ROUNDING_PX: f64 = 0.288_675_134_594_812_9;

/// [`ROUNDING_PX`] if every coordinate is an integer.
fn rounding(data: &[PointData; 2]) -> Option<f64> {
    let integers =
        data.iter().all(|d| d.points.iter().all(|p| p[0] % 1.0 == 0.0 && p[1] % 1.0 == 0.0));
    integers.then_some(ROUNDING_PX)
}
