use std::marker::PhantomData;

use nalgebra::{Matrix3, Vector3};

use crate::error::finite;
use crate::{Camera, GeomError, Pixel, View, View1, View2};

/// The fundamental matrix that turns a pixel of view `B` into its epipolar line in view `A`:
/// `p_aᵀ F p_b = 0`. Scaled to Frobenius norm 1.
///
/// With `(R, t)` from camera `B` to camera `A` (`x_a = R x_b + t`),
/// `F = K_a⁻ᵀ [t]ₓ R K_b⁻¹`.
///
/// # Source
/// ACCURATE, section 2.2. The paper leaves the direction of `(R, t)` open; this is the only reading
/// in which `d(n1, n2)` is a distance of a point of view 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fundamental<A, B> {
    matrix: Matrix3<f64>,
    views: PhantomData<(A, B)>,
}

impl<A: View, B: View> Fundamental<A, B> {
    /// From the cameras of view `A` and view `B`. A zero baseline has no fundamental matrix; a
    /// [`Rig`](crate::Rig) has refused it already, hence crate-private.
    ///
    /// # Errors
    /// As [`from_matrix`](Self::from_matrix): focal lengths may be so long that all entries vanish.
    pub(crate) fn from_cameras(camera_a: &Camera, camera_b: &Camera) -> Result<Self, GeomError> {
        let a_from_b_rotation = camera_a.r() * camera_b.r_inverse();
        let a_from_b_translation = camera_a.t() - a_from_b_rotation * camera_b.t();
        let f = camera_a.k_inverse().transpose()
            * a_from_b_translation.cross_matrix()
            * a_from_b_rotation
            * camera_b.k_inverse();
        Self::from_matrix(f)
    }

    /// From a 3 x 3 matrix with `p_aᵀ F p_b = 0`, of any scale.
    ///
    /// # Errors
    /// [`GeomError::NotFinite`] if an entry is not finite or all are zero, or their squares are.
    pub fn from_matrix(matrix: Matrix3<f64>) -> Result<Self, GeomError> {
        let norm = matrix.norm();
        if !norm.is_normal() {
            return Err(GeomError::NotFinite { what: "norm of F".into(), value: norm });
        }
        Ok(Self { matrix: matrix / norm, views: PhantomData })
    }

    /// The 3 x 3 matrix, Frobenius norm 1.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.matrix
    }

    /// The matrix of the swapped roles: `p_bᵀ Fᵀ p_a = 0`.
    pub fn transpose(&self) -> Fundamental<B, A> {
        Fundamental { matrix: self.matrix.transpose(), views: PhantomData }
    }

    /// The epipolar line in view `A` of a pixel of view `B`.
    ///
    /// # Errors
    /// [`GeomError::AtEpipole`] if the pixel is the epipole of view `B`; [`GeomError::NotFinite`] if it is
    /// NaN or so far away that its line is.
    pub fn line(&self, pixel_b: Pixel<B>) -> Result<EpipolarLine<A>, GeomError> {
        let pixel = pixel_b.homogeneous();
        let line = self.matrix * pixel;
        let normal = line.x.hypot(line.y);
        // At the epipole the terms of `F p` cancel and what is left is rounding noise, which must
        // not pass for a line: it is compared with the terms, not with itself. The second test is
        // for the line at infinity.
        let scale = self.terms(pixel_b).max(line.norm());
        finite(scale, || format!("line of the pixel ({}, {})", pixel_b.x, pixel_b.y))?;
        if normal <= 1e-12 * scale {
            return Err(GeomError::AtEpipole { view: B::NUMBER, x: pixel_b.x, y: pixel_b.y });
        }
        Ok(EpipolarLine { coefficients: line / normal, view: PhantomData })
    }

    /// The norm of what [`line`](Self::line) adds up for its normal: what rounding is relative to.
    fn terms(&self, pixel_b: Pixel<B>) -> f64 {
        let terms = self.matrix.abs() * pixel_b.homogeneous().abs();
        terms.x.hypot(terms.y)
    }

    /// The algebraic residual `p_aᵀ F p_b` (no unit; depends on the scale of `F`).
    pub fn residual(&self, pixel_a: Pixel<A>, pixel_b: Pixel<B>) -> f64 {
        pixel_a.homogeneous().dot(&(self.matrix * pixel_b.homogeneous()))
    }
}

/// A line `a x + b y + c = 0` in view `V` with `a² + b² = 1`, so that its value at a pixel is the
/// signed distance in px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpipolarLine<V> {
    coefficients: Vector3<f64>,
    view: PhantomData<V>,
}

impl<V: View> EpipolarLine<V> {
    /// `(a, b, c)` with `a² + b² = 1`.
    pub fn coefficients(&self) -> &Vector3<f64> {
        &self.coefficients
    }

    /// Signed distance of a pixel to the line, px.
    pub fn signed_distance(&self, pixel: Pixel<V>) -> f64 {
        self.coefficients.x * pixel.x + self.coefficients.y * pixel.y + self.coefficients.z
    }

    /// Distance of a pixel to the line, px.
    pub fn distance(&self, pixel: Pixel<V>) -> f64 {
        self.signed_distance(pixel).abs()
    }
}

/// Distance in view 1, px, of `p1` to the epipolar line of `p2`: the paper's `d(n1, n2)`.
///
/// # Errors
/// [`GeomError::AtEpipole`] if `p2` is the epipole.
///
/// # Source
/// ACCURATE, section 2.2.
pub fn epipolar_distance(
    f: &Fundamental<View1, View2>,
    p1: Pixel<View1>,
    p2: Pixel<View2>,
) -> Result<f64, GeomError> {
    Ok(f.line(p2)?.distance(p1))
}

/// Root mean square of the two point-to-line distances, one in each view, px.
///
/// # Errors
/// [`GeomError::AtEpipole`] if either pixel is an epipole.
pub fn symmetric_epipolar_distance(
    f: &Fundamental<View1, View2>,
    p1: Pixel<View1>,
    p2: Pixel<View2>,
) -> Result<f64, GeomError> {
    let d1 = f.line(p2)?.distance(p1);
    let d2 = f.transpose().line(p1)?.distance(p2);
    Ok(d1.hypot(d2) * std::f64::consts::FRAC_1_SQRT_2)
}

/// Sampson distance, px: to first order the length of the least correction of `(p1, p2)` that makes
/// the rays meet.
///
/// # Errors
/// [`GeomError::AtEpipole`] if both pixels are epipoles (then no correction is defined);
/// [`GeomError::NotFinite`] if one is NaN or too far away for a number.
///
/// # Source
/// Hartley and Zisserman, Multiple View Geometry, 2nd ed., eq. 11.9.
pub fn sampson_distance(
    f: &Fundamental<View1, View2>,
    p1: Pixel<View1>,
    p2: Pixel<View2>,
) -> Result<f64, GeomError> {
    let line1 = f.matrix() * p2.homogeneous();
    let line2 = f.matrix().transpose() * p1.homogeneous();
    let gradient = line1.x.hypot(line1.y).hypot(line2.x.hypot(line2.y));
    // As for a line: what is left of terms that cancel is no gradient.
    let terms = f.terms(p2).hypot(f.transpose().terms(p1));
    let scale = terms.max(line1.norm().hypot(line2.norm()));
    finite(scale, || "epipolar lines of two pixels".into())?;
    if gradient <= 1e-12 * scale {
        return Err(GeomError::AtEpipole { view: 2, x: p2.x, y: p2.y });
    }
    Ok(p1.homogeneous().dot(&line1).abs() / gradient)
}
