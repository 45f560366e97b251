use crate::FitError;
use crate::outline_problem::Settings;
use crate::uniform_spline::UniformSpline;

/// Parameters of [`fit_outlines`](crate::fit_outlines). Lengths in the world are converted to px at the curve's mean
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
    /// Weight of a curve sample outside the mask, per px of curve on average over a view: by its length in
    /// space, for what hooks towards the camera has to be held too.
    pub outside_weight: f64,
    /// First Levenberg-Marquardt damping, relative to the diagonal.
    pub damping: f64,
    /// Stop when a step of the last third lowers the cost by less than this fraction.
    pub tolerance: f64,
}

/// No image is wider, and squares of residuals beside the square of a larger scale are lost in rounding.
const LARGEST: f64 = 1e5;

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

    /// For a start that is a fit already, of a curve that bends more than the usual knots and smoothness
    /// allow.
    pub const FINE: Self = Self {
        cauchy_scale_start_px: Self::DEFAULT.cauchy_scale_px,
        subsample: false,
        knot_spacing_px: 4.0,
        lambda3: 0.03,
        lambda3_start: 0.03,
        ..Self::DEFAULT
    };

    /// These for a start that is a converged fit: their last settings from the first step on.
    pub(crate) fn settled(&self) -> Self {
        Self {
            lambda3_start: self.lambda3,
            cauchy_scale_start_px: self.cauchy_scale_px,
            reach_start_px: self.reach_px,
            subsample: false,
            ..*self
        }
    }

    pub(crate) fn validate(&self) -> Result<(), FitError> {
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
            if !(value > 0.0 && value < LARGEST) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        for (name, value) in [
            ("lambda2", self.lambda2),
            ("outside_weight", self.outside_weight),
            ("tolerance", self.tolerance),
        ] {
            if !(0.0..LARGEST).contains(&value) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        Ok(())
    }

    /// Settings of one iteration for a spline with knots `spacing_px` apart.
    pub(crate) fn settings(&self, iteration: usize, scale: &SmoothnessScale) -> Settings {
        let all = self.iterations.max(1);
        let stage = u8::from(iteration >= all.div_ceil(3)) + u8::from(iteration >= all - all / 3);
        self.settings_of(stage, iteration, scale)
    }

    /// Settings of a third of the iterations: 0, 1 or 2.
    fn settings_of(&self, stage: u8, iteration: usize, scale: &SmoothnessScale) -> Settings {
        let share = f64::from(stage) / 2.0;
        let lambda3 = self.lambda3_start.powf(1.0 - share) * self.lambda3.powf(share);
        let decayed =
            self.cauchy_scale_start_px * 0.7f64.powi(i32::try_from(iteration).unwrap_or(i32::MAX));
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
            judged: false,
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
        let ratio = 10.0 / spline.spacing_px(px_per_unit);
        let unit = px_per_unit * px_per_unit;
        Self { second: unit * ratio.powi(3), third: unit * ratio.powi(5) }
    }
}

/// Settings under which a fit is judged.
pub(crate) fn final_settings(params: &OutlineFitParams, scale: &SmoothnessScale) -> Settings {
    let last = OutlineFitParams { subsample: false, ..*params };
    let settings = last.settings_of(2, usize::MAX, scale);
    Settings { scale_px: params.cauchy_scale_px, judged: true, ..settings }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SCALE: SmoothnessScale = SmoothnessScale { second: 1.0, third: 1.0 };

    proptest! {
        #[test]
        fn thirds_of_the_iterations_have_settings_of_their_own(
            iterations in 1..200usize,
            iteration in 0..200usize,
        ) {
            let params = OutlineFitParams { iterations, ..OutlineFitParams::ANNEALED };
            let settings = params.settings(iteration, &SCALE);
            let third = 3 * iteration / iterations;
            let expected = match third {
                0 => params.lambda3_start,
                1 => (params.lambda3_start * params.lambda3).sqrt(),
                _ => params.lambda3,
            };
            prop_assert!((settings.lambda3 / expected - 1.0).abs() < 1e-12);
            let reach = if third < 2 { params.reach_start_px } else { params.reach_px };
            prop_assert_eq!(settings.reach_px, reach);
        }
    }

    #[test]
    fn as_many_iterations_as_it_takes_end_with_the_last_settings_too() {
        let params = OutlineFitParams { iterations: usize::MAX, ..OutlineFitParams::ANNEALED };
        assert!(params.validate().is_ok());
        let last = final_settings(&params, &SCALE);
        assert_eq!((last.lambda3, last.reach_px, last.stride), (0.3, 3.0, 1));
        assert_eq!(params.settings(usize::MAX - 1, &SCALE), Settings { judged: false, ..last });
        assert_eq!(params.settings(0, &SCALE).lambda3, 30.0);
    }

    #[test]
    fn what_no_image_is_wide_enough_for_is_refused() {
        let default = OutlineFitParams::DEFAULT;
        for params in [
            OutlineFitParams { reach_px: 1e20, ..default },
            OutlineFitParams { reach_start_px: f64::MAX, ..default },
            OutlineFitParams { cauchy_scale_px: 1e8, ..default },
            OutlineFitParams { tolerance: f64::NAN, ..default },
        ] {
            assert!(matches!(params.validate(), Err(FitError::BadParameter { .. })));
        }
    }
}
