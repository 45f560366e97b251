use nalgebra::{Matrix4, SVD};

use super::Triangulator;
use super::method::Method;
use super::solution::Solution;
use super::two_view::{Parallax, TwoView};
use crate::GeomError;
use crate::number::{Number, add_scaled, constant, dot, scaled};

const MAX_SVD_ITERATIONS: usize = 200;

/// Steps of the inverse iteration, after which the singular value decomposition has to do. Pixels
/// that are wrong by a few px need two.
const MAX_STEPS: usize = 8;

/// A step that moves the unit 4-vector by no more has arrived.
const ARRIVED: f64 = 64.0 * f64::EPSILON;

/// Linear triangulation: the unit 4-vector that least violates `x P₃ - P₁ = 0` and
/// `y P₃ - P₂ = 0` of both views.
///
/// The rows keep their usual weights (depth times pixel error). The unit of the 4-vector is the
/// baseline, so that its four entries are comparable.
///
/// The vector is found by inverse iteration with the factor R of A = QR, not with `AᵀA`, which
/// would halve the digits. Each step shrinks the error by (σ₄/σ₃)², which is tiny where the rays
/// nearly meet; where it is not, [`Solution::settled`] says so.
///
/// # Source
/// Hartley and Sturm, Triangulation, CVIU 68(2), 1997, section 5.1 (Linear-Eigen).
#[derive(Debug, Clone, Copy)]
pub(super) struct Dlt;

impl Method for Dlt {
    #[inline(always)]
    fn solve<N: Number>(g: &TwoView, p1: &[N; 2], p2: &[N; 2]) -> Solution<N> {
        let factor = Factor::of(equations(g, p1, p2));
        let like = p1[0];
        // Any start that is not orthogonal to the answer, which no rig singles out.
        let start = constant(like, &[0.4, 0.5, 0.6, 1.0]);
        let mut x = position(&factor.back(&start));
        let mut change = like.all(1.0);
        // Positive until a lane has settled; from then on it keeps its place, so that it does not
        // depend on its neighbours.
        let mut open = like.all(1.0);
        let mut steps = 0;
        while steps < MAX_STEPS && !open.all_at_most(0.0) {
            let next = position(&factor.back(&factor.forward(&x)));
            let moved = distance(&next, &x);
            // In the unit 4-vector a place is 1 + |x| times finer.
            let size = like.all(1.0) + next[0].abs().larger(next[1].abs()).larger(next[2].abs());
            // Steps shrink by a constant factor: the error left is about moved · moved / change.
            let next_open = (moved - like.all(ARRIVED) * size)
                .smaller(moved * moved - like.all(f64::EPSILON) * change * size);
            for k in 0..3 {
                x[k] = open.if_positive(next[k], x[k]);
            }
            change = open.if_positive(moved, change);
            open = open.if_positive(next_open, open);
            steps += 1;
        }
        Solution { position: x, parallax: Parallax::right_angle(like), open }
    }
}

/// The columns of A.
#[inline(always)]
fn equations<N: Number>(g: &TwoView, p1: &[N; 2], p2: &[N; 2]) -> [[N; 4]; 4] {
    let like = p1[0];
    let mut a = [[like; 4]; 4];
    for (offset, view, p) in [(0, &g.view1, p1), (2, &g.view2, p2)] {
        let m = &view.pixel_from_direction;
        let centre = view.centre_as(like);
        for row in 0..2 {
            let mut at_centre = like.all(0.0);
            for c in 0..3 {
                let value = p[row] * like.all(m[(2, c)]) - like.all(m[(row, c)]);
                a[c][offset + row] = value;
                at_centre = at_centre - value * centre[c];
            }
            a[3][offset + row] = at_centre;
        }
    }
    a
}

/// `AᵀA = Uᵀ D U` with U upper triangular, its diagonal 1, taken from A itself: R without roots.
struct Factor<N> {
    u: [[N; 4]; 4],
    /// 1 / D.
    weights: [N; 4],
}

impl<N: Number> Factor<N> {
    /// Modified Gram-Schmidt. D is kept above a rounding of A, squared: an exact null vector is then
    /// found like any other.
    #[inline(always)]
    fn of(mut a: [[N; 4]; 4]) -> Self {
        let like = a[0][0];
        let mut u = [[like.all(0.0); 4]; 4];
        let mut weights = [like; 4];
        let mut least = like.all(0.0);
        for k in 0..4 {
            let length_2 = dot(&a[k], &a[k]);
            if k == 0 {
                least = length_2 * like.all(f64::EPSILON * f64::EPSILON);
            }
            weights[k] = like.all(1.0) / length_2.larger(least);
            for j in k + 1..4 {
                u[k][j] = dot(&a[k], &a[j]) * weights[k];
                a[j] = add_scaled(&a[j], like.all(0.0) - u[k][j], &a[k]);
            }
        }
        Self { u, weights }
    }

    /// z of U z = y.
    #[inline(always)]
    fn back(&self, y: &[N; 4]) -> [N; 4] {
        let u = &self.u;
        let z2 = y[2] - u[2][3] * y[3];
        let z1 = y[1] - u[1][2] * z2 - u[1][3] * y[3];
        let z0 = y[0] - u[0][1] * z1 - u[0][2] * z2 - u[0][3] * y[3];
        [z0, z1, z2, y[3]]
    }

    /// y of Uᵀ D y = (x, 1).
    #[inline(always)]
    fn forward(&self, x: &[N; 3]) -> [N; 4] {
        let u = &self.u;
        let y0 = x[0];
        let y1 = x[1] - u[0][1] * y0;
        let y2 = x[2] - u[0][2] * y0 - u[1][2] * y1;
        let y3 = x[0].all(1.0) - u[0][3] * y0 - u[1][3] * y1 - u[2][3] * y2;
        let w = &self.weights;
        [y0 * w[0], y1 * w[1], y2 * w[2], y3 * w[3]]
    }
}

/// The place of a homogeneous 4-vector.
#[inline(always)]
fn position<N: Number>(v: &[N; 4]) -> [N; 3] {
    scaled(v[0].all(1.0) / v[3], &[v[0], v[1], v[2]])
}

/// The largest difference of two entries.
#[inline(always)]
fn distance<N: Number>(a: &[N; 3], b: &[N; 3]) -> N {
    (a[0] - b[0]).abs().larger((a[1] - b[1]).abs()).larger((a[2] - b[2]).abs())
}

/// [`Dlt`], by singular value decomposition where the iteration has not settled.
///
/// # Errors
/// [`GeomError::NoConvergence`], [`GeomError::PointAtInfinity`].
pub(super) fn solve(g: &TwoView, p1: &[f64; 2], p2: &[f64; 2]) -> Result<Solution<f64>, GeomError> {
    let found = Dlt::solve(g, p1, p2);
    if found.settled() { Ok(found) } else { by_decomposition(g, p1, p2) }
}

fn by_decomposition(g: &TwoView, p1: &[f64; 2], p2: &[f64; 2]) -> Result<Solution<f64>, GeomError> {
    let columns = equations(g, p1, p2);
    let a = Matrix4::from_fn(|row, column| columns[column][row]);
    let a = a / a.amax();
    let failed = |iterations| GeomError::NoConvergence {
        what: "the singular value decomposition of DLT",
        iterations,
    };
    let svd = SVD::try_new_unordered(a, false, true, f64::EPSILON, MAX_SVD_ITERATIONS)
        .ok_or_else(|| failed(MAX_SVD_ITERATIONS))?;
    let v_t = svd.v_t.ok_or_else(|| failed(0))?;
    let x = v_t.row(svd.singular_values.imin()).transpose();
    if !(x.w.abs() >= Triangulator::LEAST_SINE) {
        return Err(GeomError::PointAtInfinity { weight: x.w });
    }
    let position = (x.xyz() / x.w).into();
    Ok(Solution { position, parallax: Parallax::right_angle(1.0), open: 0.0 })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Rotation3, Vector3, Vector4};
    use proptest::prelude::*;

    use super::*;
    use crate::{Camera, ImageSize, LengthUnit, Rig};

    /// Two cameras at the distance 10 from the origin, `angle` apart.
    fn rig(angle: f64) -> Rig {
        let k = Matrix3::new(1000.0, 0.0, 256.0, 0.0, -1100.0, 250.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        let camera = |angle: f64| {
            let r = Rotation3::from_euler_angles(0.1, angle, 0.2).into_inner();
            Camera::new(k, r, Vector3::new(0.0, 0.0, 10.0), size).unwrap()
        };
        Rig::new(camera(0.0), camera(angle), LengthUnit::Millimetre).unwrap()
    }

    proptest! {
        #[test]
        fn the_iteration_finds_the_least_singular_vector(
            angle in 0.05..3.0_f64, p in prop::array::uniform4(0.0..512.0_f64), exact in any::<bool>(),
            x in prop::array::uniform3(-2.0..2.0_f64),
        ) {
            let rig = rig(angle);
            let g = TwoView::new(&rig);
            let (p1, p2) = if exact {
                let (p1, p2) = rig.project(&x.into()).unwrap();
                ([p1.x, p1.y], [p2.x, p2.y])
            } else {
                // Pixels that have nothing to do with each other.
                ([p[0], p[1]], [p[2], p[3]])
            };
            let found = Dlt::solve(&g, &p1, &p2);
            let columns = equations(&g, &p1, &p2);
            let a = Matrix4::from_fn(|row, column| columns[column][row]);
            let svd = a.svd(false, false);
            let sigma = svd.singular_values;
            if !found.settled() {
                // (σ₄/σ₃)^16 is then above the rounding that ends it: the two are close.
                prop_assert!(sigma[3] > 0.01 * sigma[2], "{sigma}");
                return Ok(());
            }
            // v = (position, 1) / |..| is the eigenvector of AᵀA of the least eigenvalue. A product of
            // AᵀA rounds by 4 ε σ₁² at most, each of its 16 entries and again in AᵀA v. (nalgebra's
            // decomposition leaves a residual that is larger by thousands now and then.)
            let p = found.position;
            let v = Vector4::new(p[0], p[1], p[2], 1.0).normalize();
            let b = a.transpose() * a;
            let rounding = 32.0 * f64::EPSILON * sigma[0] * sigma[0];
            let value = v.dot(&(b * v));
            let residual = (b * v - v * value).norm();
            prop_assert!(residual <= rounding, "{residual:e} > {rounding:e}, {sigma}");
            let least = sigma[3] * sigma[3];
            prop_assert!((value - least).abs() <= rounding, "{value} {least} {rounding:e}");
        }
    }
}
