//! The cameras of the families.

use accurate_geom::{Camera, GeomError, ImageSize, Point3};
use nalgebra::{Matrix3, RowVector3, Vector3};

/// A pinhole of the given focal lengths and principal point, px.
pub(crate) fn intrinsics(fx: f64, fy: f64, cx: f64, cy: f64) -> Matrix3<f64> {
    Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
}

/// A camera on a sphere about `target`, at azimuth `angle_deg` from the +x axis (about world z) and
/// elevation `tilt_deg` (below 90), looking at `target`; world z is up.
///
/// With a positive f_y the image shows z upwards (rows grow downwards). A C-arm's `K` with a
/// negative f_y expects camera axes turned by half a turn about the viewing direction; the picture
/// then is upright again and mirrored left to right.
pub(crate) fn orbit(
    k: Matrix3<f64>,
    size: ImageSize,
    target: &Point3,
    distance: f64,
    angle_deg: f64,
    tilt_deg: f64,
) -> Result<Camera, GeomError> {
    let (sin_a, cos_a) = angle_deg.to_radians().sin_cos();
    let (sin_t, cos_t) = tilt_deg.to_radians().sin_cos();
    let forward = -Vector3::new(cos_a * cos_t, sin_a * cos_t, sin_t);
    let right = Vector3::new(-sin_a, cos_a, 0.0);
    let down = forward.cross(&right);
    let half_turn = if k[(1, 1)] < 0.0 { -1.0 } else { 1.0 };
    let r = Matrix3::from_rows(&[
        RowVector3::from(right.transpose()) * half_turn,
        RowVector3::from(down.transpose()) * half_turn,
        forward.transpose(),
    ]);
    let t = -(r * target.coords) + Vector3::new(0.0, 0.0, distance);
    Camera::new(k, r, t, size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn world_z_points_up_in_the_image_for_either_sign_of_f_y() {
        let size = ImageSize { width: 500, height: 500 };
        let target = Point3::new(3.0, -2.0, 7.0);
        for fy in [1200.0, -1200.0] {
            let camera =
                orbit(intrinsics(1200.0, fy, 250.0, 250.0), size, &target, 700.0, 33.0, -12.0)
                    .unwrap();
            assert!((camera.depth(&target) - 700.0).abs() < 1e-9);
            let above = camera.project(&(target + Vector3::z())).unwrap();
            assert!((above.x - 250.0).abs() < 1e-9 && above.y < 249.0, "{above}");
        }
    }
}
