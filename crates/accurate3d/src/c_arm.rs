use accurate_geom::Camera;
use accurate_geom::nalgebra::{Matrix3, Vector3};

/// World to camera of a C-arm at primary angle `a` (LAO positive) and secondary angle `b` (cranial
/// positive), rad. World: the isocentre, x to the patient's left, y posterior, z to the head.
///
/// # Source
/// DICOM PS3.3 C.8.7.5, as [`accurate_io`] reads it.
pub(crate) fn arm(a: f64, b: f64) -> Matrix3<f64> {
    let u = Vector3::new(a.cos(), a.sin(), 0.0);
    let d = Vector3::new(a.sin() * b.cos(), -a.cos() * b.cos(), b.sin());
    Matrix3::from_rows(&[u.transpose(), d.cross(&u).transpose(), d.transpose()])
}

/// Where a C-arm stands.
pub(crate) struct ArmPlace {
    pub(crate) primary_rad: f64,
    pub(crate) secondary_rad: f64,
    /// What the image axes are to the arm's own: quarter turns, nothing between.
    pub(crate) image_from_arm: Matrix3<f64>,
}

impl ArmPlace {
    /// The place of a camera; `None` if it is no C-arm that looks at the world's origin with its image
    /// axes along the arm's.
    pub(crate) fn of(camera: &Camera) -> Option<Self> {
        let (r, t) = (camera.r(), camera.t());
        // Rounding of a calibration file.
        let tolerance = 10.0 * Camera::ROTATION_TOLERANCE;
        if !(t.z > 0.0 && t.x.hypot(t.y) <= tolerance * t.z) {
            return None;
        }
        let d = r.row(2).transpose();
        let (primary_rad, secondary_rad) = (d.x.atan2(-d.y), d.z.clamp(-1.0, 1.0).asin());
        let image_from_arm = r * arm(primary_rad, secondary_rad).transpose();
        let straight = |v: &f64| v.abs() < 1e-3 || (v.abs() - 1.0).abs() < 1e-3;
        let image_from_arm =
            image_from_arm.iter().all(straight).then(|| image_from_arm.map(f64::round))?;
        Some(Self { primary_rad, secondary_rad, image_from_arm })
    }
}
