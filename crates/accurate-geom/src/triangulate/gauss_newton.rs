use nalgebra::{Matrix3, Point2, Vector2, Vector3};

use super::dlt;
use super::solution::Solution;
use super::two_view::{PinholeView, TwoView};
use crate::GeomError;

const MAX_STEPS: usize = 60;

/// Least sum of squared reprojection errors (px²) by Gauss-Newton with Levenberg-Marquardt damping,
/// from the DLT point. Steps that raise the cost are refused, so the result is never worse than DLT.
///
/// # Source
/// Hartley and Sturm, Triangulation, CVIU 68(2), 1997, equation 2 (the cost).
pub(super) fn solve(g: &TwoView, p1: &[f64; 2], p2: &[f64; 2]) -> Result<Solution<f64>, GeomError> {
    let start = dlt::solve(g, p1, p2)?;
    let mut x = Vector3::from(start.position);
    let (p1, p2) = (&Point2::from(*p1), &Point2::from(*p2));
    // At infinity, or in the principal plane of a camera: no image, nothing to improve.
    let Some(mut system) = System::at(g, &x, p1, p2) else {
        return Ok(start);
    };
    let mut damping = 0.0;
    for _ in 0..MAX_STEPS {
        let Some(step) = system.step(damping) else {
            damping = if damping == 0.0 { 1e-6 } else { damping * 10.0 };
            continue;
        };
        let candidate = x + step;
        let improved = System::at(g, &candidate, p1, p2).filter(|next| next.cost <= system.cost);
        match improved {
            Some(next) => {
                x = candidate;
                system = next;
                damping *= 0.1;
                if damping < 1e-9 {
                    damping = 0.0;
                }
            }
            None => damping = if damping == 0.0 { 1e-6 } else { damping * 10.0 },
        }
        // Steps below the rounding of x itself change nothing more.
        if step.norm() <= 4.0 * f64::EPSILON * x.norm() {
            break;
        }
    }
    Ok(Solution { position: x.into(), ..start })
}

/// Normal equations of one linearisation.
struct System {
    cost: f64,
    gradient: Vector3<f64>,
    hessian: Matrix3<f64>,
}

impl System {
    /// `None` where a projection does not exist or overflows.
    fn at(g: &TwoView, x: &Vector3<f64>, p1: &Point2<f64>, p2: &Point2<f64>) -> Option<Self> {
        let mut system = Self { cost: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
        for (view, p) in [(&g.view1, p1), (&g.view2, p2)] {
            system.add(view, x, p);
        }
        (system.cost.is_finite() && system.hessian.iter().all(|v| v.is_finite())).then_some(system)
    }

    fn add(&mut self, view: &PinholeView, x: &Vector3<f64>, p: &Point2<f64>) {
        let m = &view.pixel_from_direction;
        let h = m * (x - view.centre);
        let image = Vector2::new(h.x / h.z, h.y / h.z);
        let residual = image - p.coords;
        let row3 = m.row(2);
        for axis in 0..2 {
            let jacobian = ((m.row(axis) - image[axis] * row3) / h.z).transpose();
            self.gradient += jacobian * residual[axis];
            self.hessian += jacobian * jacobian.transpose();
        }
        self.cost += residual.norm_squared();
    }

    /// The step that solves `(H + damping diag H) s = -g`.
    fn step(&self, damping: f64) -> Option<Vector3<f64>> {
        let mut h = self.hessian;
        for i in 0..3 {
            h[(i, i)] *= 1.0 + damping;
        }
        let step = -h.cholesky()?.solve(&self.gradient);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}
