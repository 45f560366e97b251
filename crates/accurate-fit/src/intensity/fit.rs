use accurate_geom::nalgebra::{Matrix3, Vector2};
use accurate_geom::{Curve3, Point2, Point3, Polyline2, Rig};
use ndarray::Array2;

use super::band::Band;
use super::dense_normal::DenseNormal;
use super::drawing::{Drawing, SAMPLES_PER_PX, radius_px};
use super::moved::farthest_apart;
use super::params::IntensityFitParams;
use crate::curve::{dense_points, to_curve};
use crate::outline_problem::smoothness;
use crate::pose::{POINTS_PER_SPAN, px_per_unit, spans_for};
use crate::projector::{Nuisance, Projector};
use crate::side_by_side::both_views;
use crate::uniform_spline::UniformSpline;
use crate::{CalibrationEstimate, CalibrationPriors, CurveCovariance, FitError};

/// Amplitude and blur of both views, shift and roll of view 2.
const GLOBALS: usize = 7;
/// The dense equations of more knots take seconds a step.
const MOST_SPANS: usize = 600;
/// Blur of a thin body in a sharp picture, px, and how far it may be from that.
pub(super) const BLUR_PX: f64 = 1.2;
const BLUR_SIGMA_PX: f64 = 0.3;
const BLUR_RANGE_PX: (f64, f64) = (0.7, 2.5);
/// How far back along the curve its end's direction is taken from, px.
const DIRECTION_PX: f64 = 3.0;

/// A curve fitted to the grey levels of both images.
#[derive(Debug, Clone)]
pub struct IntensityFit {
    /// The fitted curve.
    pub curve: Curve3,
    /// Its uncertainty, given that noise and smoothness are what was taken for them.
    pub covariance: CurveCovariance,
    /// What the curve says about the calibration of view 2, if that was among the unknowns.
    pub calibration: Option<CalibrationEstimate>,
    /// Radius of the body in each view, px, as the width of its blurred cross-section tells it.
    pub radius_px: [f64; 2],
    /// Darkest optical depth that the fitted body draws in each view, in standard deviations of the
    /// noise around it.
    pub contrast_to_noise: [f64; 2],
    /// Farthest that a point of the fitted curve lies from the start, or of the start from the fitted
    /// curve, in either image, px; the last 8 px at their ends aside, which are there to be moved.
    pub moved_px: f64,
    /// What the fit leaves unexplained of the pictures, and its priors: half squares of standard
    /// deviations, robust. Of fits by the same [`IntensityPair`] the least is the likeliest.
    pub cost: f64,
    /// Levenberg-Marquardt steps taken.
    pub steps: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
}

/// Moves a curve that is a few pixels off until, drawn as a thin absorber into both views, it explains
/// the pictures' grey levels best.
///
/// A segmentation says where a body is to a pixel or two and draws it wider than it is: a hook of a few
/// pixels at a tip is one blob to it. In the picture strands that lie upon one another, or run along
/// the line of sight, are darker, and a tip ends where the darkness does.
///
/// The optical depth beyond a smooth background is explained by Gaussian blots along the curve, as much
/// for each piece of its length as for any other, one amplitude and one blur per view. Robust (Cauchy)
/// weights keep what crosses the body out of it. `images` hold grey values, shape (height, width),
/// **bright where much passes** and proportional to it, or to its logarithm (a body then seems somewhat
/// darker on a dark background); their scale does not matter. `calibration`: priors of the correction
/// of view 2, and the shift x, shift y (px) and roll (rad) to start from; without it the rig is exact.
///
/// # Errors
/// [`FitError::NotSeenInImage`] where a view shows nothing dark along the curve, or is not a picture;
/// [`FitError::NotInFront`], [`FitError::BadLength`] for an unusable start or one longer than 600 knots;
/// [`FitError::BadParameter`], [`FitError::Singular`].
///
/// # Source
/// Our own; thin absorbers after Beer and Lambert, robust weights of Cauchy's distribution,
/// Levenberg-Marquardt with accept and reject.
///
/// # Cost
/// O(length · blur²) to draw and O(knots³) to solve per step.
pub fn fit_intensities(
    start: &Curve3,
    images: &[Array2<f32>; 2],
    rig: &Rig,
    params: &IntensityFitParams,
    calibration: Option<(&CalibrationPriors, [f64; 3])>,
) -> Result<IntensityFit, FitError> {
    IntensityPair::around(&[start], images, rig, params, calibration)?.fit(start)
}

/// Both pictures around curves that may explain them: what fits leave unexplained of the same pixels
/// can be compared.
#[derive(Debug)]
pub struct IntensityPair {
    pub(super) params: IntensityFitParams,
    priors: Option<CalibrationPriors>,
    nuisance: Nuisance,
    pub(super) projectors: [Projector; 2],
    pub(super) bands: [Band; 2],
}

impl IntensityPair {
    /// The pixels near any of the curves; parameters as of [`fit_intensities`]. What is no usable start
    /// is passed over here, unless it is the only one, and refused by [`IntensityPair::fit`].
    ///
    /// # Errors
    /// As [`fit_intensities`].
    pub fn around(
        curves: &[&Curve3],
        images: &[Array2<f32>; 2],
        rig: &Rig,
        params: &IntensityFitParams,
        calibration: Option<(&CalibrationPriors, [f64; 3])>,
    ) -> Result<Self, FitError> {
        params.validate()?;
        if let Some((priors, _)) = calibration {
            priors.validate()?;
        }
        let mut projectors = Projector::pair(rig);
        let nuisance = calibration
            .map_or(Nuisance::default(), |(_, [x, y, roll])| Nuisance { shift_px: [x, y], roll });
        projectors[1].set_nuisance(nuisance);
        let mut points = [Vec::new(), Vec::new()];
        let mut refused = None;
        for curve in curves {
            match Start::new(curve, &projectors, params) {
                Ok(start) => {
                    for (points, projector) in points.iter_mut().zip(&projectors) {
                        points.extend(shown(&start.spline, start.samples, projector));
                    }
                }
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        if let Some(error) = refused.filter(|_| points[0].is_empty()) {
            return Err(error);
        }
        let [band1, band2] =
            both_views(|view| Band::new(&images[view], &points[view], view as u8 + 1, params));
        let bands = [band1?, band2?];
        let priors = calibration.map(|(priors, _)| *priors);
        Ok(Self { params: *params, priors, nuisance, projectors, bands })
    }

    /// Fits a curve, one of those that the pair is around or near them.
    ///
    /// # Errors
    /// As [`fit_intensities`].
    pub fn fit(&self, start: &Curve3) -> Result<IntensityFit, FitError> {
        let (problem, mut state, given) = self.begin(start)?;
        let end = problem.minimise(&mut state, &self.params, f64::INFINITY)?;
        problem.finish(&state, &given, &end)
    }

    /// The same for a curve that is of no use unless its cost falls below `to_beat`. The fit ends early, and
    /// gives nothing, once the steps that are left could not bring it there: not if each gained as much as
    /// the better one of the last two, and the cost fell by another tenth at once, as it may where a curve
    /// slips into place. That is a guess and no bound.
    ///
    /// # Errors
    /// As [`fit_intensities`].
    pub fn fit_to_beat(
        &self,
        start: &Curve3,
        to_beat: f64,
    ) -> Result<Option<IntensityFit>, FitError> {
        let (problem, mut state, given) = self.begin(start)?;
        let end = problem.minimise(&mut state, &self.params, to_beat)?;
        if end.is_given_up { Ok(None) } else { problem.finish(&state, &given, &end).map(Some) }
    }

    /// The problem, where its solution starts, and the curve as it was given.
    fn begin(&self, start: &Curve3) -> Result<(Problem<'_>, State, Vec<Point3>), FitError> {
        let Start { given, spline, samples, scale, .. } =
            Start::new(start, &self.projectors, &self.params)?;
        let problem = Problem {
            bands: &self.bands,
            samples,
            lambda3: self.params.lambda3 * scale * scale,
            cauchy_scale: self.params.cauchy_scale,
            prior_weights: self.priors.map(|priors| priors.weights(1.0)),
        };
        let mut state = State {
            spline,
            projectors: self.projectors.clone(),
            nuisance: self.nuisance,
            amplitude: [0.0; 2],
            blur_px: [BLUR_PX; 2],
        };
        for view in 0..2 {
            state.amplitude[view] = problem
                .first_amplitude(&state, view)
                .ok_or(FitError::NotSeenInImage { view: view as u8 + 1 })?;
        }
        Ok((problem, state, given))
    }
}

/// Where a fit starts.
#[derive(Debug)]
pub(super) struct Start {
    /// The curve as it was given.
    given: Vec<Point3>,
    /// The curve, continued at its ends.
    pub(super) spline: UniformSpline,
    /// Its length, px.
    pub(super) length_px: f64,
    /// Pieces that it is drawn with.
    pub(super) samples: usize,
    /// Pixels per world unit.
    scale: f64,
}

impl Start {
    pub(super) fn new(
        curve: &Curve3,
        projectors: &[Projector; 2],
        params: &IntensityFitParams,
    ) -> Result<Self, FitError> {
        let given = dense_points(curve, 0);
        let scale = px_per_unit(&given, projectors)?;
        let longer =
            |points: &[_]| continued(points, params.extension_px / scale, DIRECTION_PX / scale);
        let length: f64 = longer(&given).windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        let length_px = scale * length;
        let spans = spans_for(length_px, params.knot_spacing_px)?.max(5);
        if spans > MOST_SPANS {
            return Err(FitError::BadLength { length_px });
        }
        let given = dense_points(curve, POINTS_PER_SPAN * spans);
        let spline = UniformSpline::through(&longer(&given), spans)?;
        let samples = (length_px * SAMPLES_PER_PX).ceil() as usize;
        Ok(Self { given, spline, length_px, samples, scale })
    }
}

/// Everything that stays the same while the curve moves.
struct Problem<'a> {
    bands: &'a [Band; 2],
    samples: usize,
    lambda3: f64,
    cauchy_scale: f64,
    /// Of shift x, shift y and roll, if they are unknowns.
    prior_weights: Option<[f64; 3]>,
}

/// How a fit ended.
struct End {
    steps: usize,
    converged: bool,
    /// Before it rested, since it could not win.
    is_given_up: bool,
}

#[derive(Clone)]
struct State {
    spline: UniformSpline,
    /// Under `nuisance`.
    projectors: [Projector; 2],
    nuisance: Nuisance,
    /// Optical depth per world unit of the curve.
    amplitude: [f64; 2],
    blur_px: [f64; 2],
}

impl State {
    fn moved(&self, step: &[f64]) -> Self {
        let mut next = self.clone();
        let (controls, globals) = step.split_at(3 * self.spline.control.len());
        next.spline.add(controls);
        for view in 0..2 {
            // An absorber does not shine.
            next.amplitude[view] =
                (self.amplitude[view] + globals[view]).max(0.05 * self.amplitude[view]);
            next.blur_px[view] =
                (self.blur_px[view] + globals[2 + view]).clamp(BLUR_RANGE_PX.0, BLUR_RANGE_PX.1);
        }
        next.nuisance.add(&globals[4..]);
        next.projectors[1].set_nuisance(next.nuisance);
        next
    }
}

impl Problem<'_> {
    fn drawing(&self, state: &State, view: usize, derivatives: bool) -> Drawing {
        let (projector, blur) = (&state.projectors[view], state.blur_px[view]);
        Drawing::new(&state.spline, self.samples, projector, blur, &self.bands[view], derivatives)
    }

    /// The amplitude that explains the picture best as the curve lies; `None` if that is no darkness.
    fn first_amplitude(&self, state: &State, view: usize) -> Option<f64> {
        let (band, drawing) = (&self.bands[view], self.drawing(state, view, false));
        amplitude(&drawing.depth, &band.depth).map(|amplitude| amplitude * band.noise)
    }

    fn residuals(&self, state: &State, view: usize, drawing: &Drawing) -> Vec<f64> {
        let band = &self.bands[view];
        let scale = state.amplitude[view] / band.noise;
        band.depth.iter().zip(&drawing.depth).map(|(seen, drawn)| scale * drawn - seen).collect()
    }

    fn cost(&self, state: &State) -> f64 {
        let c2 = self.cauchy_scale * self.cauchy_scale;
        let of_view = |view: usize| {
            let drawing = self.drawing(state, view, false);
            let residuals = self.residuals(state, view, &drawing);
            residuals.iter().map(|r| 0.5 * c2 * (r * r / c2).ln_1p()).sum::<f64>()
                + 0.5 * ((state.blur_px[view] - BLUR_PX) / BLUR_SIGMA_PX).powi(2)
        };
        let [cost1, cost2] = both_views(of_view);
        let mut cost = cost1 + cost2;
        cost += 0.5 * smoothness(&state.spline, 0.0, self.lambda3, &[]);
        if let Some(weights) = self.prior_weights {
            let values = state.nuisance.values();
            cost += weights.iter().zip(values).map(|(w, v)| 0.5 * w * v * v).sum::<f64>();
        }
        cost
    }

    fn equations(&self, state: &State) -> DenseNormal {
        let first_global = 3 * state.spline.control.len();
        let [mut normal, other] = both_views(|view| self.equations_of(state, view));
        normal.add_all(&other);
        normal.add_smoothness(&state.spline.control, self.lambda3);
        // What is no unknown is held where it is.
        let weights = self.prior_weights.unwrap_or([1.0; 3]);
        for (k, (weight, value)) in weights.into_iter().zip(state.nuisance.values()).enumerate() {
            normal.add(&[(first_global + 4 + k, 1.0)], value, weight);
        }
        normal
    }

    /// What one picture says.
    fn equations_of(&self, state: &State, view: usize) -> DenseNormal {
        let first_global = 3 * state.spline.control.len();
        let mut normal = DenseNormal::new(state.spline.control.len(), GLOBALS);
        let c2 = self.cauchy_scale * self.cauchy_scale;
        let mut sums = vec![0.0; first_global];
        let mut seen: Vec<usize> = Vec::new();
        let mut derivatives = Vec::new();
        let (band, drawing) = (&self.bands[view], self.drawing(state, view, true));
        let residuals = self.residuals(state, view, &drawing);
        let scale = state.amplitude[view] / band.noise;
        for ((row, drawn), residual) in drawing.rows.iter().zip(&drawing.depth).zip(residuals) {
            seen.clear();
            for (span, values) in &row.spans {
                for (k, value) in values.iter().enumerate() {
                    sums[3 * span + k] += scale * value;
                }
                seen.extend(*span..span + 4);
            }
            if seen.is_empty() {
                continue;
            }
            seen.sort_unstable();
            seen.dedup();
            derivatives.clear();
            for control in &seen {
                for k in 3 * control..3 * control + 3 {
                    derivatives.push((k, std::mem::take(&mut sums[k])));
                }
            }
            derivatives.push((first_global + view, drawn / band.noise));
            derivatives.push((first_global + 2 + view, scale * row.blur));
            if view == 1 && self.prior_weights.is_some() {
                let values = row.nuisance.iter().enumerate();
                derivatives.extend(values.map(|(k, v)| (first_global + 4 + k, scale * v)));
            }
            normal.add(&derivatives, residual, 1.0 / (1.0 + residual * residual / c2));
        }
        let off = (state.blur_px[view] - BLUR_PX) / BLUR_SIGMA_PX;
        normal.add(&[(first_global + 2 + view, 1.0 / BLUR_SIGMA_PX)], off, 1.0);
        normal
    }

    /// Levenberg-Marquardt, until a step gains next to nothing or what is left cannot come near the cost
    /// `to_beat` at its pace.
    fn minimise(
        &self,
        state: &mut State,
        params: &IntensityFitParams,
        to_beat: f64,
    ) -> Result<End, FitError> {
        const TRIES: usize = 6;
        /// Of the cost. From 0.06 on none of 45 fits that win (of 818, tuning seeds) is given up.
        const SUDDEN_GAIN: f64 = 0.1;
        let mut damping = 1e-3;
        let mut cost = self.cost(state);
        let mut gain = 0.0;
        for step in 1..=params.iterations {
            let normal = self.equations(state);
            let gain_before = std::mem::take(&mut gain);
            for _ in 0..TRIES {
                let next = state.moved(&normal.step(damping)?);
                let next_cost = self.cost(&next);
                if next_cost < cost {
                    gain = cost - next_cost;
                    (*state, cost) = (next, next_cost);
                    damping = (damping / 5.0).max(1e-7);
                    break;
                }
                damping *= 8.0;
            }
            if gain < params.tolerance {
                return Ok(End { steps: step, converged: true, is_given_up: false });
            }
            let hope = gain.max(gain_before) * (params.iterations - step) as f64;
            if (1.0 - SUDDEN_GAIN) * cost - hope > to_beat {
                return Ok(End { steps: step, converged: false, is_given_up: true });
            }
        }
        Ok(End { steps: params.iterations, converged: false, is_given_up: false })
    }

    fn finish(&self, state: &State, given: &[Point3], end: &End) -> Result<IntensityFit, FitError> {
        let inverse = self.equations(state).inverse()?;
        let controls = state.spline.control.len();
        let nuisance = 3 * controls + GLOBALS - 3;
        let nuisance_covariance = Matrix3::from_fn(|a, b| inverse.get(nuisance + a, nuisance + b));
        let mut moved_px = 0.0f64;
        let mut contrast_to_noise = [0.0; 2];
        for view in 0..2 {
            let projector = &state.projectors[view];
            let line = |points: Vec<Vector2<f64>>| {
                Polyline2::new(points.into_iter().map(Point2::from).collect())
            };
            let after = line(shown(&state.spline, self.samples, projector))?;
            let before = line(given.iter().map(|p| projector.project(&p.coords)).collect())?;
            moved_px = moved_px.max(farthest_apart(&before, &after));
            let drawing = self.drawing(state, view, false);
            let darkest = drawing.depth.iter().copied().fold(0.0, f64::max);
            contrast_to_noise[view] = state.amplitude[view] * darkest / self.bands[view].noise;
        }
        let Nuisance { shift_px, roll } = state.nuisance;
        Ok(IntensityFit {
            cost: self.cost(state),
            curve: to_curve(&state.spline)?,
            covariance: CurveCovariance::new(controls, |i, j| inverse.block(i, j)),
            calibration: self
                .prior_weights
                .map(|_| CalibrationEstimate::new(shift_px, roll, nuisance_covariance)),
            radius_px: state.blur_px.map(radius_px),
            contrast_to_noise,
            moved_px,
            steps: end.steps,
            converged: end.converged,
        })
    }
}

/// The multiple of what is drawn that explains best what is seen; `None` if that is no darkness.
pub(super) fn amplitude(drawn: &[f64], seen: &[f64]) -> Option<f64> {
    let along: f64 = drawn.iter().zip(seen).map(|(drawn, seen)| drawn * seen).sum();
    let square: f64 = drawn.iter().map(|drawn| drawn * drawn).sum();
    let amplitude = along / square;
    (amplitude > 0.0 && amplitude.is_finite()).then_some(amplitude)
}

/// The curve's image, by points less than a pixel apart.
fn shown(spline: &UniformSpline, samples: usize, projector: &Projector) -> Vec<Vector2<f64>> {
    let du = spline.spans() as f64 / samples as f64;
    (0..=samples).map(|k| projector.project(&spline.point(k as f64 * du))).collect()
}

/// The points, continued straight at both ends by `by`, in the direction of the last `over`.
fn continued(points: &[Point3], by: f64, over: f64) -> Vec<Point3> {
    let beyond = |end: Option<&Point3>, mut inwards: std::slice::Iter<'_, Point3>| {
        let end = end?;
        let back = inwards.find(|p| (*p - end).norm() >= over)?;
        Some(end + (end - back).try_normalize(0.0)? * by)
    };
    let reversed: Vec<_> = points.iter().rev().copied().collect();
    let mut all = Vec::with_capacity(points.len() + 2);
    all.extend(beyond(points.first(), points.iter()));
    all.extend_from_slice(points);
    all.extend(beyond(points.last(), reversed.iter()));
    all
}
