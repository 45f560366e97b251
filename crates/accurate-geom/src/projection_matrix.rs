use nalgebra::{Matrix3, Matrix3x4, Vector3};

use crate::error::finite;
use crate::{Camera, GeomError, ImageSize};

/// A row of the left block that keeps less than this share of its length beside the others is
/// taken as dependent.
const LEAST_INDEPENDENT: f64 = 1e-12;

impl Camera {
    /// A camera from a 3 x 4 projection matrix of any positive scale: `P = λ K [R | t]`, `λ > 0`.
    ///
    /// The signs of the diagonal of `K` cannot be told from `P` alone. Here both focal lengths are
    /// positive, unless that would make `R` a reflection; then `f_y` (and the skew) takes the minus
    /// sign. The sign of `P` itself counts: `P` and `-P` give the same pixels, but in one of them
    /// the scene lies behind the camera; pass the one whose third row gives positive depths.
    ///
    /// For import only. A camera given as `K`, `R`, `t` keeps its own signs: nothing in this
    /// library takes its matrix apart again.
    ///
    /// # Errors
    /// [`GeomError::NotFinite`], [`GeomError::SingularProjection`] if the left 3 x 3 block is
    /// singular (a camera at infinity), [`GeomError::EmptyImage`].
    ///
    /// # Source
    /// Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 6.2.4 (RQ decomposition).
    pub fn from_projection_matrix(
        matrix: &Matrix3x4<f64>,
        size: ImageSize,
    ) -> Result<Self, GeomError> {
        for row in 0..3 {
            for column in 0..4 {
                finite(matrix[(row, column)], || format!("P[{row}][{column}]"))?;
            }
        }
        let row = |i: usize| -> Vector3<f64> { matrix.fixed_view::<1, 3>(i, 0).transpose() };
        let (m1, m2, m3) = (row(0), row(1), row(2));
        // Gram-Schmidt from the last row up, each projection done twice for orthogonality.
        let scale = m3.norm();
        if !(scale > 0.0) {
            return Err(GeomError::SingularProjection { row: 2 });
        }
        let r3 = m3 / scale;
        let ([cy], rest2) = split(&(m2 / scale), [&r3]);
        let fy = rest2.norm();
        if !(fy > LEAST_INDEPENDENT * m2.norm() / scale) {
            return Err(GeomError::SingularProjection { row: 1 });
        }
        let r2 = rest2 / fy;
        let ([cx, skew], rest1) = split(&(m1 / scale), [&r3, &r2]);
        let fx = rest1.norm();
        if !(fx > LEAST_INDEPENDENT * m1.norm() / scale) {
            return Err(GeomError::SingularProjection { row: 0 });
        }
        let r1 = rest1 / fx;
        let sign = if r1.cross(&r2).dot(&r3) < 0.0 { -1.0 } else { 1.0 };
        let k = Matrix3::new(fx, sign * skew, cx, 0.0, sign * fy, cy, 0.0, 0.0, 1.0);
        let r = Matrix3::from_rows(&[r1.transpose(), sign * r2.transpose(), r3.transpose()]);
        // Back substitution in K t = p4.
        let p4 = matrix.column(3) / scale;
        let tz = p4.z;
        let ty = (p4.y - cy * tz) / (sign * fy);
        let tx = (p4.x - cx * tz - sign * skew * ty) / fx;
        Self::new(k, r, Vector3::new(tx, ty, tz), size)
    }
}

/// Components of `v` along orthonormal `axes`, and what is left of it.
fn split<const N: usize>(v: &Vector3<f64>, axes: [&Vector3<f64>; N]) -> ([f64; N], Vector3<f64>) {
    let mut components = [0.0; N];
    let mut rest = *v;
    for _ in 0..2 {
        for (component, axis) in components.iter_mut().zip(axes) {
            let share = rest.dot(axis);
            *component += share;
            rest -= axis * share;
        }
    }
    (components, rest)
}
