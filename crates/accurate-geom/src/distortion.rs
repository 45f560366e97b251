use nalgebra::{Matrix2, Vector2};

use crate::GeomError;
use crate::error::finite;

const MAX_NEWTON_STEPS: usize = 50;

/// Points on the way from the axis at which the model must not fold.
const FOLD_CHECKS: usize = 16;

/// Lens distortion in OpenCV's five-parameter model, acting on normalised image coordinates
/// `(x, y) = K⁻¹ p` (no unit) with `r² = x² + y²`:
///
/// ```text
/// x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
/// y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y
/// ```
///
/// # Source
/// Brown, Decentering distortion of lenses, Photogrammetric Engineering 32(3), 1966.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    /// Radial, r².
    pub k1: f64,
    /// Radial, r⁴.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
    /// Radial, r⁶.
    pub k3: f64,
}

impl Distortion {
    /// Checks that all five coefficients are finite.
    pub(crate) fn check(&self) -> Result<(), GeomError> {
        let named =
            [("k1", self.k1), ("k2", self.k2), ("p1", self.p1), ("p2", self.p2), ("k3", self.k3)];
        for (name, value) in named {
            finite(value, || name.into())?;
        }
        Ok(())
    }

    /// Ideal to distorted normalised coordinates.
    pub(crate) fn distort(&self, ideal: &Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        Vector2::new(
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    fn jacobian(&self, ideal: &Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        // d radial / d(r²), doubled: the chain rule brings 2x and 2y.
        let slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + 3.0 * r2 * self.k3));
        let mixed = slope * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y;
        Matrix2::new(
            radial + slope * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            mixed,
            mixed,
            radial + slope * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        )
    }

    /// Distorted to ideal normalised coordinates, by Newton's method with halved steps where a full
    /// one does not help. `Ok(None)`: the model folds between the axis and the solution, so that
    /// the solution is not the one a lens would give.
    pub(crate) fn undistort(
        &self,
        distorted: &Vector2<f64>,
    ) -> Result<Option<Vector2<f64>>, GeomError> {
        let mut ideal = *distorted;
        let mut error = self.distort(&ideal) - distorted;
        for iteration in 0..MAX_NEWTON_STEPS {
            let Some(step) = self.jacobian(&ideal).try_inverse().map(|inverse| inverse * error)
            else {
                return Ok(None);
            };
            // A step at rounding level cannot improve further.
            if step.norm() <= 4.0 * f64::EPSILON * ideal.norm() {
                return Ok((!self.folds_before(&ideal)).then_some(ideal));
            }
            let mut share = 1.0;
            loop {
                let candidate = ideal - share * step;
                let candidate_error = self.distort(&candidate) - distorted;
                if candidate_error.norm() < error.norm() {
                    (ideal, error) = (candidate, candidate_error);
                    break;
                }
                share *= 0.5;
                if share < 1e-3 {
                    // No descent: at the rounding of the residual this is convergence.
                    let settled = error.norm() <= 64.0 * f64::EPSILON * distorted.norm();
                    if settled {
                        return Ok((!self.folds_before(&ideal)).then_some(ideal));
                    }
                    let what = "undistortion";
                    return Err(GeomError::NoConvergence { what, iterations: iteration + 1 });
                }
            }
        }
        Err(GeomError::NoConvergence { what: "undistortion", iterations: MAX_NEWTON_STEPS })
    }

    fn folds_before(&self, ideal: &Vector2<f64>) -> bool {
        (1..=FOLD_CHECKS).any(|i| {
            let jacobian = self.jacobian(&(ideal * (i as f64 / FOLD_CHECKS as f64)));
            // Beyond two folds both eigenvalues are below 0, and their product above it again. The
            // Jacobian is symmetric, so that none is complex.
            !(jacobian.determinant() > 0.0 && jacobian.trace() > 0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wrong Jacobian would still converge, only slower, and misjudge folds: check it by itself.
    #[test]
    fn the_jacobian_is_that_of_finite_differences() {
        let lens = Distortion { k1: -0.3, k2: 0.2, p1: 0.03, p2: -0.05, k3: 0.1 };
        let h = 1e-5;
        for (x, y) in [(0.0, 0.0), (0.4, -0.7), (-0.9, 0.1), (0.3, 0.8)] {
            let p = Vector2::new(x, y);
            let jacobian = lens.jacobian(&p);
            for axis in 0..2 {
                let step = Vector2::ith(axis, h);
                let difference =
                    (lens.distort(&(p + step)) - lens.distort(&(p - step))) / (2.0 * h);
                // Third derivatives are below 50 here: h² / 6 of that, and rounding over h.
                let error = (difference - jacobian.column(axis)).norm();
                assert!(error < 10.0 * h * h + 4.0 * f64::EPSILON / h, "{error:e}");
            }
        }
    }
}
