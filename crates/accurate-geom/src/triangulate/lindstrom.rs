use super::method::Method;
use super::midpoint::Midpoint;
use super::solution::Solution;
use super::two_view::TwoView;
use crate::number::{Number, add_scaled, constant, cross, dot, scaled};

/// Moves both pixels least so that their rays meet, then intersects the rays.
///
/// # Source
/// Lindstrom, Triangulation made easy, CVPR 2010, listing 3 (`niter2`). The paper works in
/// calibrated coordinates; the derivation holds for any bilinear constraint `p1ᵀ F p2 = 0` on
/// points with third coordinate 1, so `F` is used here and the correction is least in px.
#[derive(Debug, Clone, Copy)]
pub(super) struct LindstromNiter2;

impl Method for LindstromNiter2 {
    #[inline(always)]
    fn solve<N: Number>(g: &TwoView, p1: &[N; 2], p2: &[N; 2]) -> Solution<N> {
        let (q1, q2) = correct(g, p1, p2);
        // The corrected rays meet to rounding; the midpoint is then their intersection.
        Midpoint::solve(g, &q1, &q2)
    }
}

/// The corrected pixels.
#[inline(always)]
fn correct<N: Number>(g: &TwoView, p1: &[N; 2], p2: &[N; 2]) -> ([N; 2], [N; 2]) {
    // F = M1ᵀ [b]ₓ M2 with M the map from pixels to directions. Kept in factors: c below is the
    // triple product of two rays and the baseline, free of the cancellation in p1ᵀ F p2.
    let like = p1[0];
    let (d1, d2) = (g.view1.ray(p1), g.view2.ray(p2));
    let baseline = constant(like, &g.baseline.into());
    let (plane2, plane1) = (cross(&baseline, &d2), cross(&d1, &baseline));
    let [f_row0, f_row1] = g.fundamental_2x2;
    let rows = [constant(like, &f_row0), constant(like, &f_row1)];
    let columns = [[rows[0][0], rows[1][0]], [rows[0][1], rows[1][1]]];
    let mut n1 = g.view1.along_pixel_axes(&plane2);
    let mut n2 = g.view2.along_pixel_axes(&plane1);

    let zero = like.all(0.0);
    let a = dot(&n1, &[dot(&rows[0], &n2), dot(&rows[1], &n2)]);
    let b = like.all(0.5) * (dot(&n1, &n1) + dot(&n2, &n2));
    let c = dot(&d1, &plane2);
    // For gross errors the quadratic may have no real root; its vertex is then the nearest to one.
    let d = (b * b - a * c).larger(zero).sqrt();
    // If both pixels are epipoles there is nothing to correct along.
    let lambda = (b + d).if_positive(c / (b + d), zero);
    let (step1, step2) = (scaled(lambda, &n1), scaled(lambda, &n2));
    let minus = like.all(-1.0);
    n1 = add_scaled(&n1, minus, &[dot(&rows[0], &step2), dot(&rows[1], &step2)]);
    n2 = add_scaled(&n2, minus, &[dot(&columns[0], &step1), dot(&columns[1], &step1)]);
    (moved(p1, &step1, &n1), moved(p2, &step2, &n2))
}

/// `p` less the part of `step` that is along `n`.
#[inline(always)]
fn moved<N: Number>(p: &[N; 2], step: &[N; 2], n: &[N; 2]) -> [N; 2] {
    let squared = dot(n, n);
    let part = dot(step, n) / squared;
    let x = squared.if_positive(n[0] * part, step[0]);
    let y = squared.if_positive(n[1] * part, step[1]);
    [p[0] - x, p[1] - y]
}
