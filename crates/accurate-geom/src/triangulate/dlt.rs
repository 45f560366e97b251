use nalgebra::{Matrix4, SVD, Vector3};

use super::Triangulator;
use super::two_view::{PinholeView, TwoView};
use crate::{GeomError, Point2};

const MAX_SVD_ITERATIONS: usize = 200;

/// Linear triangulation: the unit 4-vector that least violates `x P₃ - P₁ = 0` and
/// `y P₃ - P₂ = 0` of both views, by singular value decomposition (not of `AᵀA`, which would
/// halve the digits).
///
/// The rows keep their usual weights (depth times pixel error); only one common factor is taken
/// out. The unit of the 4-vector is the baseline, so that its four entries are comparable.
///
/// # Source
/// Hartley and Sturm, Triangulation, CVIU 68(2), 1997, section 5.1 (Linear-Eigen).
pub(super) fn solve(g: &TwoView, p1: &Point2, p2: &Point2) -> Result<Vector3<f64>, GeomError> {
    let mut a = Matrix4::zeros();
    for (index, (view, p)) in [(&g.view1, p1), (&g.view2, p2)].into_iter().enumerate() {
        for (row, equation) in equations(view, p).into_iter().enumerate() {
            let offset = -equation.dot(&view.centre);
            a.set_row(2 * index + row, &equation.push(offset).transpose());
        }
    }
    let a = a / a.amax();
    let svd = SVD::try_new_unordered(a, false, true, f64::EPSILON, MAX_SVD_ITERATIONS).ok_or(
        GeomError::NoConvergence {
            what: "the singular value decomposition of DLT",
            iterations: MAX_SVD_ITERATIONS,
        },
    )?;
    let Some(v_t) = svd.v_t else {
        return Err(GeomError::NoConvergence { what: "DLT", iterations: 0 });
    };
    let x = v_t.row(svd.singular_values.imin()).transpose();
    if !(x.w.abs() >= Triangulator::LEAST_SINE) {
        return Err(GeomError::PointAtInfinity { weight: x.w });
    }
    Ok(x.xyz() / x.w)
}

/// Normals of the two planes through the centre that meet in the ray of `p`.
fn equations(view: &PinholeView, p: &Point2) -> [Vector3<f64>; 2] {
    let m = &view.pixel_from_direction;
    let (row1, row2, row3) = (m.row(0), m.row(1), m.row(2));
    [(p.x * row3 - row1).transpose(), (p.y * row3 - row2).transpose()]
}
