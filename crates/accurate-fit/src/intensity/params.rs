use crate::FitError;

/// Parameters of [`fit_intensities`](crate::fit_intensities).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntensityFitParams {
    /// Distance of the spline's knots along the curve, px.
    pub knot_spacing_px: f64,
    /// Weight of the squared third differences of the control points, 1 / px², beside squares of
    /// grey levels in standard deviations of their noise.
    pub lambda3: f64,
    /// Only pixels this near to the start are looked at, px.
    pub reach_px: f64,
    /// Only pixels farther than this from the start show the background, px.
    pub keep_off_px: f64,
    /// Standard deviation of the window over which the background is averaged, px.
    pub background_sigma_px: f64,
    /// Residuals beyond this count little, standard deviations of the noise.
    pub cauchy_scale: f64,
    /// By how much the start is continued at both ends, px: too long, an end is drawn back by what
    /// it darkens in vain; too short, nothing calls it out.
    pub extension_px: f64,
    /// Most Levenberg-Marquardt steps.
    pub iterations: usize,
    /// The fit rests when a step gains less than this, in units of half squares.
    pub tolerance: f64,
}

impl IntensityFitParams {
    /// Tuned on seeds 1000 to 1999 of the generated families.
    pub const DEFAULT: Self = Self {
        knot_spacing_px: 5.0,
        lambda3: 10.0,
        reach_px: 6.0,
        keep_off_px: 3.0,
        background_sigma_px: 5.0,
        cauchy_scale: 3.0,
        extension_px: 2.0,
        iterations: 25,
        tolerance: 0.02,
    };

    pub(super) fn validate(&self) -> Result<(), FitError> {
        for (name, value) in [
            ("knot_spacing_px", self.knot_spacing_px),
            ("lambda3", self.lambda3),
            ("reach_px", self.reach_px),
            ("keep_off_px", self.keep_off_px),
            ("background_sigma_px", self.background_sigma_px),
            ("cauchy_scale", self.cauchy_scale),
        ] {
            // No band is wider than an image.
            if !(value > 0.0 && value < 1e5) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        if !(0.0..1e3).contains(&self.extension_px) {
            let value = self.extension_px;
            return Err(FitError::BadParameter { name: "extension_px", value });
        }
        if !(self.tolerance >= 0.0) {
            return Err(FitError::BadParameter { name: "tolerance", value: self.tolerance });
        }
        Ok(())
    }
}
