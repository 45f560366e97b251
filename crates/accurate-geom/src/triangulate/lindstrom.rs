use nalgebra::{Matrix3x2, Vector3};

use super::midpoint;
use super::two_view::TwoView;
use crate::{GeomError, Point2};

/// Moves both pixels least so that their rays meet, then intersects the rays.
///
/// # Source
/// Lindstrom, Triangulation made easy, CVPR 2010, listing 3 (`niter2`). The paper works in
/// calibrated coordinates; the derivation holds for any bilinear constraint `p1ᵀ F p2 = 0` on
/// points with third coordinate 1, so `F` is used here and the correction is least in px.
pub(super) fn solve(g: &TwoView, p1: &Point2, p2: &Point2) -> Result<Vector3<f64>, GeomError> {
    let (q1, q2) = correct(g, p1, p2);
    // The corrected rays meet to rounding; the midpoint is then their intersection.
    midpoint::solve(g, &q1, &q2)
}

/// The corrected pixels.
pub(super) fn correct(g: &TwoView, p1: &Point2, p2: &Point2) -> (Point2, Point2) {
    // F = M1ᵀ [b]ₓ M2 with M the map from pixels to directions. Kept in factors: c below is the
    // triple product of two rays and the baseline, free of the cancellation in p1ᵀ F p2.
    let (d1, d2) = (g.view1.ray(p1), g.view2.ray(p2));
    let m1: Matrix3x2<f64> = g.view1.direction_from_pixel.fixed_columns::<2>(0).into();
    let m2: Matrix3x2<f64> = g.view2.direction_from_pixel.fixed_columns::<2>(0).into();
    let (plane2, plane1) = (g.baseline.cross(&d2), d1.cross(&g.baseline));
    let f22 = m1.transpose() * g.baseline.cross_matrix() * m2;
    let mut n1 = m1.transpose() * plane2;
    let mut n2 = m2.transpose() * plane1;

    let a = n1.dot(&(f22 * n2));
    let b = 0.5 * (n1.norm_squared() + n2.norm_squared());
    let c = d1.dot(&plane2);
    // For gross errors the quadratic may have no real root; its vertex is then the nearest to one.
    let d = (b * b - a * c).max(0.0).sqrt();
    if !(b + d > 0.0) {
        return (*p1, *p2); // both pixels are epipoles: nothing to correct along
    }
    let lambda = c / (b + d);
    let (step1, step2) = (lambda * n1, lambda * n2);
    n1 -= f22 * step2;
    n2 -= f22.transpose() * step1;
    let along = |step: nalgebra::Vector2<f64>, n: nalgebra::Vector2<f64>| {
        let squared = n.norm_squared();
        if squared > 0.0 { n * (step.dot(&n) / squared) } else { step }
    };
    (p1 - along(step1, n1), p2 - along(step2, n2))
}
