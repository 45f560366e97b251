use nalgebra::{Matrix4, SVD};

use super::method::Method;
use super::number::{Number, add_scaled, constant, dot, scaled};
use super::solution::Solution;
use super::two_view::TwoView;
use crate::GeomError;

const MAX_SVD_ITERATIONS: usize = 200;

/// Steps of the inverse iteration, after which the singular value decomposition has to do. Pixels
/// that are wrong by a few px need two.
const MAX_STEPS: usize = 8;

/// A step that moves the unit 4-vector by no more has arrived.
const ARRIVED: f64 = 64.0 * f64::EPSILON;

/// Linear triangulation: the unit 4-vector that least violates `x P₃ - P₁ = 0` and
/// `y P₃ - P₂ = 0` of both views.
///
/// The rows keep their usual weights (depth times pixel error); only one common factor is taken
/// out. The unit of the 4-vector is the baseline, so that its four entries are comparable.
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
        let (r, reciprocal) = triangular(equations(g, p1, p2));
        let like = p1[0];
        // Any start that is not orthogonal to the answer, which no rig singles out.
        let start = constant(like, &[0.4, 0.5, 0.6, 1.0]);
        let mut x = unit(&back_substituted(&r, &reciprocal, &start));
        let mut change = like.all(1.0);
        // Positive until a lane has settled; from then on it keeps its vector, so that it does not
        // depend on its neighbours.
        let mut open = like.all(1.0);
        let mut steps = 0;
        while steps < MAX_STEPS && !open.all_at_most(0.0) {
            let forward = forward_substituted(&r, &reciprocal, &x);
            let next = unit(&back_substituted(&r, &reciprocal, &forward));
            let mut moved = (next[0] - x[0]).abs();
            for k in 1..4 {
                moved = moved.larger((next[k] - x[k]).abs());
            }
            // Steps shrink by a constant factor: the error left is about moved · moved / change.
            let next_open = (moved - like.all(ARRIVED))
                .smaller(moved * moved - like.all(f64::EPSILON) * change);
            for k in 0..4 {
                x[k] = open.if_positive(next[k], x[k]);
            }
            change = open.if_positive(moved, change);
            open = open.if_positive(next_open, open);
            steps += 1;
        }
        let weight = x[3];
        Solution {
            position: scaled(like.all(1.0) / weight, &[x[0], x[1], x[2]]),
            sine: like.all(1.0),
            weight,
            open,
        }
    }
}

/// The columns of A, its largest entry 1.
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
                at_centre = at_centre + value * centre[c];
            }
            a[3][offset + row] = like.all(0.0) - at_centre;
        }
    }
    let mut largest = like.all(0.0);
    for column in &a {
        for &value in column {
            largest = value.abs().larger(largest);
        }
    }
    let factor = like.all(1.0) / largest;
    let mut k = 0;
    while k < 4 {
        a[k] = scaled(factor, &a[k]);
        k += 1;
    }
    a
}

/// R of A = QR by modified Gram-Schmidt, and the reciprocals of its diagonal. The diagonal is kept
/// above one rounding of A: an exact null vector is then found like any other.
#[inline(always)]
fn triangular<N: Number>(mut a: [[N; 4]; 4]) -> ([[N; 4]; 4], [N; 4]) {
    let like = a[0][0];
    let mut r = [[like.all(0.0); 4]; 4];
    let mut reciprocal = [like; 4];
    for k in 0..4 {
        let length = dot(&a[k], &a[k]).sqrt().larger(like.all(f64::EPSILON));
        reciprocal[k] = like.all(1.0) / length;
        let q = scaled(reciprocal[k], &a[k]);
        for j in k + 1..4 {
            r[k][j] = dot(&q, &a[j]);
            a[j] = add_scaled(&a[j], like.all(0.0) - r[k][j], &q);
        }
    }
    (r, reciprocal)
}

/// z of R z = y.
#[inline(always)]
fn back_substituted<N: Number>(r: &[[N; 4]; 4], reciprocal: &[N; 4], y: &[N; 4]) -> [N; 4] {
    let z3 = y[3] * reciprocal[3];
    let z2 = (y[2] - r[2][3] * z3) * reciprocal[2];
    let z1 = (y[1] - r[1][2] * z2 - r[1][3] * z3) * reciprocal[1];
    let z0 = (y[0] - r[0][1] * z1 - r[0][2] * z2 - r[0][3] * z3) * reciprocal[0];
    [z0, z1, z2, z3]
}

/// y of Rᵀ y = x.
#[inline(always)]
fn forward_substituted<N: Number>(r: &[[N; 4]; 4], reciprocal: &[N; 4], x: &[N; 4]) -> [N; 4] {
    let y0 = x[0] * reciprocal[0];
    let y1 = (x[1] - r[0][1] * y0) * reciprocal[1];
    let y2 = (x[2] - r[0][2] * y0 - r[1][2] * y1) * reciprocal[2];
    let y3 = (x[3] - r[0][3] * y0 - r[1][3] * y1 - r[2][3] * y2) * reciprocal[3];
    [y0, y1, y2, y3]
}

#[inline(always)]
fn unit<N: Number>(v: &[N; 4]) -> [N; 4] {
    scaled(v[0].all(1.0) / dot(v, v).sqrt(), v)
}

/// [`Dlt`], by singular value decomposition where the iteration has not settled.
///
/// # Errors
/// [`GeomError::NoConvergence`].
pub(super) fn solve(g: &TwoView, p1: &[f64; 2], p2: &[f64; 2]) -> Result<Solution<f64>, GeomError> {
    let found = Dlt::solve(g, p1, p2);
    if found.settled() { Ok(found) } else { by_decomposition(g, p1, p2) }
}

fn by_decomposition(g: &TwoView, p1: &[f64; 2], p2: &[f64; 2]) -> Result<Solution<f64>, GeomError> {
    let columns = equations(g, p1, p2);
    let a = Matrix4::from_fn(|row, column| columns[column][row]);
    let failed = |iterations| GeomError::NoConvergence {
        what: "the singular value decomposition of DLT",
        iterations,
    };
    let svd = SVD::try_new_unordered(a, false, true, f64::EPSILON, MAX_SVD_ITERATIONS)
        .ok_or_else(|| failed(MAX_SVD_ITERATIONS))?;
    let v_t = svd.v_t.ok_or_else(|| failed(0))?;
    let x = v_t.row(svd.singular_values.imin()).transpose();
    let position = (x.xyz() / x.w).into();
    Ok(Solution { position, sine: 1.0, weight: x.w, open: 0.0 })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Rotation3, Vector3};
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
        fn the_iteration_finds_what_the_decomposition_finds(
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
            let expected = by_decomposition(&g, &p1, &p2).unwrap();
            // Both are exact for some A + E with |E| of some roundings of |A|; that turns the
            // vector by |E| / (σ₃ - σ₄). Position = xyz / w magnifies by (1 + |position|²) / |w|
            // at most, w being 1 / sqrt(1 + |position|²).
            let gap = sigma[2] - sigma[3];
            let turned = 128.0 * f64::EPSILON * sigma[0] / gap;
            let position = Vector3::from(expected.position);
            let tolerance = turned * (1.0 + position.norm_squared());
            let off = (Vector3::from(found.position) - position).norm();
            prop_assert!(off <= tolerance, "{off:e} > {tolerance:e}, {sigma}");
        }
    }
}
