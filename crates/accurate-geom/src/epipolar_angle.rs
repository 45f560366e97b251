use std::marker::PhantomData;

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::error::finite;
use crate::{Camera, GeomError, Pixel, Rig, View, View1, View2};

/// The least sine of the angle between a ray and the baseline at which its plane is defined.
const LEAST_SINE: f64 = 1e-12;

/// The angle of a pixel's epipolar plane about the baseline.
///
/// The plane spanned by the baseline and the ray of a pixel turns about the baseline as the pixel
/// moves; pixels that correspond lie in one plane and so have equal angles, whichever view they
/// are in. One number per pixel replaces the pair of pixel and epipolar line, and stays defined
/// with the epipole inside the image or at infinity.
///
/// To first order `|phi1 - phi2| / hypot(g1, g2)`, with `g` the gradients per px, is the Sampson
/// distance of a pair in px.
#[derive(Debug, Clone)]
pub struct EpipolarAngle {
    view1: AngleOfView<View1>,
    view2: AngleOfView<View2>,
}

/// An epipolar angle and how fast it changes in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngleSample {
    /// Angle about the baseline, radians, in `(-π, π]`; 0 in the plane of the mean optical axis.
    pub phi: f64,
    /// Derivative of `phi` with respect to `(x, y)`, radians per px: across the epipolar line.
    pub gradient: Vector2<f64>,
    /// Norm of `gradient`, radians per px.
    pub gradient_per_px: f64,
}

impl EpipolarAngle {
    /// The angles of a rig. They are measured from the mean direction of the two optical axes, so
    /// that the wrap at ±π lies behind the cameras. If that direction runs along the baseline, any
    /// other is as good and one is chosen.
    pub fn new(rig: &Rig) -> Self {
        let (camera1, camera2) = (rig.camera1(), rig.camera2());
        // A rig has refused a zero baseline.
        let baseline = (camera2.centre() - camera1.centre()).normalize();
        let mean_axis = optical_axis(camera1) + optical_axis(camera2);
        let across = |v: Vector3<f64>| v - baseline * baseline.dot(&v);
        let mut zero = across(mean_axis);
        if !(zero.norm() > 1e-6) {
            let least = baseline.iamin();
            zero = across(Vector3::ith(least, 1.0));
        }
        let zero = zero.normalize();
        let quarter = baseline.cross(&zero);
        Self {
            view1: AngleOfView::new(camera1, baseline, zero, quarter),
            view2: AngleOfView::new(camera2, baseline, zero, quarter),
        }
    }

    /// The angle of a pixel of view 1.
    ///
    /// # Errors
    /// [`GeomError::AtEpipole`] if its ray runs along the baseline, [`GeomError::NotFinite`] if the
    /// pixel is not finite or so far away that its ray is not.
    pub fn view1(&self, pixel: Pixel<View1>) -> Result<AngleSample, GeomError> {
        self.view1.sample(pixel)
    }

    /// The angle of a pixel of view 2.
    ///
    /// # Errors
    /// As [`view1`](Self::view1).
    pub fn view2(&self, pixel: Pixel<View2>) -> Result<AngleSample, GeomError> {
        self.view2.sample(pixel)
    }
}

fn optical_axis(camera: &Camera) -> Vector3<f64> {
    camera.r_inverse().column(2).into_owned()
}

#[derive(Debug, Clone)]
struct AngleOfView<V> {
    /// Homogeneous pixel to (component at phi = 0, component at phi = π/2, component along the
    /// baseline) of its ray.
    components: Matrix3<f64>,
    view: PhantomData<V>,
}

impl<V: View> AngleOfView<V> {
    fn new(
        camera: &Camera,
        baseline: Vector3<f64>,
        zero: Vector3<f64>,
        quarter: Vector3<f64>,
    ) -> Self {
        let frame =
            Matrix3::from_rows(&[zero.transpose(), quarter.transpose(), baseline.transpose()]);
        let components = frame * camera.r_inverse() * camera.k_inverse();
        Self { components, view: PhantomData }
    }

    fn sample(&self, pixel: Pixel<V>) -> Result<AngleSample, GeomError> {
        if !pixel.is_finite() {
            let value = if pixel.x.is_finite() { pixel.y } else { pixel.x };
            return Err(GeomError::NotFinite {
                what: format!("pixel of view {}", V::NUMBER),
                value,
            });
        }
        let ray = self.components * pixel.homogeneous();
        let length = ray.norm();
        finite(length, || format!("length of the ray of a pixel of view {}", V::NUMBER))?;
        let across = (ray.x * ray.x + ray.y * ray.y).sqrt();
        if !(across > LEAST_SINE * length) {
            return Err(GeomError::AtEpipole { view: V::NUMBER, x: pixel.x, y: pixel.y });
        }
        // d atan2(b, a) = (a db - b da) / (a² + b²)
        let (a, b) = (ray.x / across, ray.y / across);
        let slope = |axis: usize| {
            (a * self.components[(1, axis)] - b * self.components[(0, axis)]) / across
        };
        let gradient = Vector2::new(slope(0), slope(1));
        let phi = ray.y.atan2(ray.x);
        Ok(AngleSample { phi, gradient, gradient_per_px: gradient.norm() })
    }
}
