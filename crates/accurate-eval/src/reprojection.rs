use accurate_geom::{Camera, Point3, Rig};

use crate::nearest::PolylineIndex;
use crate::resample::{check_spacing, resample};
use crate::{EvalError, check};

/// How far the image of a reconstruction lies from the image of the truth, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReprojectionRms {
    /// Root mean square in view 1, px.
    pub view1_px: f64,
    /// Root mean square in view 2, px.
    pub view2_px: f64,
}

/// Root mean square distance, in each view, of the projected reconstruction to the projected truth.
///
/// The reconstruction is resampled at equal arc length, at most `spacing_world` (world unit) apart;
/// the truth is projected vertex by vertex, for the image of a segment is a segment.
///
/// # Errors
/// [`EvalError::Projection`] if a point is not in front of a camera; [`EvalError::NotFinite`] if it is so
/// near to the plane of the camera that its image is infinite, [`EvalError::Overflow`] if images are so
/// far apart that the squares of their distances are; otherwise as
/// [`curve_scores`](crate::curve_scores).
pub fn reprojection_rms(
    reconstruction: &[Point3],
    truth: &[Point3],
    rig: &Rig,
    spacing_world: f64,
) -> Result<ReprojectionRms, EvalError> {
    check_spacing(spacing_world)?;
    check::points("truth", truth)?;
    let samples = resample("reconstruction", reconstruction, spacing_world)?;
    Ok(ReprojectionRms {
        view1_px: rms_px(&samples, truth, rig.camera1())?,
        view2_px: rms_px(&samples, truth, rig.camera2())?,
    })
}

fn rms_px(samples: &[Point3], truth: &[Point3], camera: &Camera) -> Result<f64, EvalError> {
    let line = PolylineIndex::new(&project("truth", truth, camera)?);
    let image = project("reconstruction", samples, camera)?;
    let sum: f64 = line.distances(&image).into_iter().map(|distance| distance.powi(2)).sum();
    check::result("root mean square reprojection error", (sum / image.len() as f64).sqrt())
}

fn project(
    which: &'static str,
    points: &[Point3],
    camera: &Camera,
) -> Result<Vec<[f64; 2]>, EvalError> {
    let project = |(index, point)| match camera.project(point) {
        Ok(pixel) if pixel.iter().all(|v| v.is_finite()) => Ok(pixel.coords.into()),
        // A depth next to zero sends the image to infinity.
        Ok(_) => Err(EvalError::NotFinite { which, index }),
        Err(source) => Err(EvalError::Projection { which, index, source }),
    };
    points.iter().enumerate().map(project).collect()
}
