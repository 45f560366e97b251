use accurate_fit::{FitError, IntensityFit, IntensityFitParams, fit_intensities};
use accurate_geom::Rig;
use ndarray::Array2;

use super::RobustParams;
use super::joint::JointResult;
use crate::IntensityDiagnostics;

/// A curve of the maps is right to a few pixels or is another curve: what is carried farther than this,
/// px, was carried off by something else in the picture.
const MOST_MOVED_PX: f64 = 8.0;
/// Bodies thicker than this, px, are drawn by a segmentation as they are, hooks and all, and their edges
/// say more than blots of one width; thinner ones it draws thicker.
const MOST_RADIUS_PX: f64 = 1.35;

/// The curve fitted on to the grey levels of the images that its maps were made of, and what came of
/// it. Where that fails, or is carried off, or the body is no thin one, the curve stays as it was.
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
    let diagnostics = IntensityDiagnostics::of(&fitted);
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
    fn of(fitted: &Result<IntensityFit, FitError>) -> Self {
        let fit = fitted.as_ref().ok();
        Self {
            refusal: match fitted {
                Err(error) => Some(error.to_string()),
                Ok(fit) => reason_against(fit),
            },
            moved_px: fit.map(|fit| fit.moved_px),
            contrast_to_noise: fit.map(|fit| fit.contrast_to_noise),
            radius_px: fit.map(|fit| fit.radius_px),
        }
    }
}

fn reason_against(fit: &IntensityFit) -> Option<String> {
    let radius_px = 0.5 * (fit.radius_px[0] + fit.radius_px[1]);
    if fit.moved_px > MOST_MOVED_PX {
        Some(format!("carried off by {:.1} px, {MOST_MOVED_PX} at most", fit.moved_px))
    } else if radius_px > MOST_RADIUS_PX {
        Some(format!(
            "a body of radius {radius_px:.2} px is drawn as it is, {MOST_RADIUS_PX} at most"
        ))
    } else {
        None
    }
}
