use nalgebra::{Matrix3, Vector3};

use super::Triangulator;
use crate::{Camera, GeomError, Point2, Point3, Rig};

/// One camera in the frame of [`TwoView`].
#[derive(Debug, Clone)]
pub(super) struct PinholeView {
    /// `K R`: world direction to homogeneous pixel.
    pub pixel_from_direction: Matrix3<f64>,
    /// `R⁻¹ K⁻¹`: homogeneous pixel to world direction.
    pub direction_from_pixel: Matrix3<f64>,
    /// Camera centre, in baselines.
    pub centre: Vector3<f64>,
}

impl PinholeView {
    fn new(camera: &Camera, centre: Vector3<f64>) -> Self {
        Self {
            pixel_from_direction: camera.k() * camera.r(),
            direction_from_pixel: camera.r_inverse() * camera.k_inverse(),
            centre,
        }
    }

    /// Direction of the ray of a pixel; z in the camera frame is 1.
    pub fn ray(&self, p: &Point2) -> Vector3<f64> {
        self.direction_from_pixel * Vector3::new(p.x, p.y, 1.0)
    }

    /// Unit direction of the ray of a pixel, safe from overflow.
    pub fn unit_ray(&self, p: &Point2) -> Vector3<f64> {
        let ray = self.ray(p);
        (ray / ray.amax()).normalize()
    }
}

/// Two cameras with their centres at `-b/2` and `b/2`, `|b| = 1`: the world moved and scaled, not
/// turned.
#[derive(Debug, Clone)]
pub(super) struct TwoView {
    pub view1: PinholeView,
    pub view2: PinholeView,
    /// Unit vector from centre 1 to centre 2.
    pub baseline: Vector3<f64>,
    origin: Point3,
    scale: f64,
}

impl TwoView {
    pub fn new(rig: &Rig) -> Self {
        let (c1, c2) = (rig.camera1().centre(), rig.camera2().centre());
        // A rig has refused a zero baseline.
        let scale = (c2 - c1).norm();
        let baseline = (c2 - c1) / scale;
        Self {
            view1: PinholeView::new(rig.camera1(), -0.5 * baseline),
            view2: PinholeView::new(rig.camera2(), 0.5 * baseline),
            baseline,
            origin: nalgebra::center(&c1, &c2),
            scale,
        }
    }

    pub fn to_world(&self, x: &Vector3<f64>) -> Point3 {
        self.origin + self.scale * x
    }

    pub fn check_parallax(&self, p1: &Point2, p2: &Point2) -> Result<(), GeomError> {
        let sine = self.view1.unit_ray(p1).cross(&self.view2.unit_ray(p2)).norm();
        // NaN (overflow in a ray) fails the comparison and is refused with it.
        if sine >= Triangulator::LEAST_SINE {
            Ok(())
        } else {
            Err(GeomError::ParallelRays { sine, least: Triangulator::LEAST_SINE })
        }
    }
}
