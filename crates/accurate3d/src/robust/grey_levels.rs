use accurate_fit::{FitError, IntensityFit, IntensityFitParams, fit_intensities};
use accurate_geom::Rig;
use ndarray::Array2;

use super::RobustParams;
use super::joint::JointResult;
use crate::IntensityDiagnostics;

/// A curve of the maps is right to a few pixels or is another curve: what is carried farther than this,
/// px, was carried off by something else in the picture.
const MOST_MOVED_PX: f64 = 8.0;

/// The curve fitted on to the grey levels of the images that its maps were made of, and what came of
/// it. Where that fails, or is carried off, the curve stays as it was.
pub(crate) fn on_grey_levels(
    mut result: JointResult,
    images: &[Array2<f32>; 2],
    given_rig: &Rig,
    params: &RobustParams,
) -> (JointResult, IntensityDiagnostics) {
    let start = &result.fit.curve;
    // Under the cameras that the curve was fitted under, and no others.
    let calibration = params.calibration.as_ref().zip(result.calibration.as_ref());
    let calibration = calibration
        .map(|(priors, found)| (priors, [found.shift_px[0], found.shift_px[1], found.roll_rad]));
    let fitted =
        fit_intensities(start, images, given_rig, &IntensityFitParams::DEFAULT, calibration);
    let diagnostics = IntensityDiagnostics::of(&fitted, MOST_MOVED_PX);
    if let (None, Ok(IntensityFit { curve, covariance, calibration, .. })) =
        (&diagnostics.refusal, fitted)
    {
        result.fit.curve = curve;
        result.fit.covariance = Some(covariance);
        result.calibration = calibration;
    }
    (result, diagnostics)
}

impl IntensityDiagnostics {
    fn of(fitted: &Result<IntensityFit, FitError>, most_moved_px: f64) -> Self {
        let fit = fitted.as_ref().ok();
        let moved_px = fit.map(|fit| fit.moved_px);
        let carried_off = moved_px.filter(|moved| *moved > most_moved_px);
        let carried_off = carried_off
            .map(|moved| format!("carried off by {moved:.1} px, {most_moved_px} at most"));
        Self {
            refusal: fitted.as_ref().err().map(ToString::to_string).or(carried_off),
            moved_px,
            contrast_to_noise: fit.map(|fit| fit.contrast_to_noise),
            blur_sigma_px: fit.map(|fit| fit.blur_sigma_px),
        }
    }
}
