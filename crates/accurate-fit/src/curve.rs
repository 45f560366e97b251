use accurate_geom::{Curve3, Point3};

use crate::FitError;
use crate::uniform_spline::UniformSpline;

/// The clamped curve over `[0, spans]` that equals the uniform spline there: both are the twice
/// differentiable cubics between the same knots, only the outer basis functions differ.
///
/// By blossoms: `c_i = f(i-2, i-1, i)` becomes `P_0 = f(0,0,0)`, `P_1 = f(0,0,1)`, and so at the end.
pub(crate) fn to_curve(spline: &UniformSpline) -> Result<Curve3, FitError> {
    let c = &spline.control;
    let n = c.len();
    let spans = spline.spans();
    let mut control: Vec<Point3> = c.iter().map(|p| Point3::from(*p)).collect();
    let inner = |far, near| Point3::from((c[far] + 2.0 * c[near]) / 3.0);
    control[0] = spline.point(0.0).into();
    control[n - 1] = spline.point(spans as f64).into();
    (control[1], control[n - 2]) = (inner(2, 1), inner(n - 3, n - 2));
    let mut knots = vec![0.0; 4];
    knots.extend((1..spans).map(|k| k as f64));
    knots.extend([spans as f64; 4]);
    Ok(Curve3::new(knots, control)?)
}

/// The uniform spline that equals a clamped curve with equally spaced knots; `None` for other
/// knots, or fewer than two spans.
pub(crate) fn from_curve(curve: &Curve3) -> Option<UniformSpline> {
    let points = curve.control_points();
    let n = points.len();
    let (start, end) = curve.domain();
    let width = (end - start) / (n - 3) as f64;
    // 1e-9 of a span moves a point by that fraction of 10 px.
    let uniform = curve.knots()[3..=n]
        .iter()
        .enumerate()
        .all(|(k, knot)| (knot - start - k as f64 * width).abs() <= 1e-9 * width);
    if n < 5 || !uniform {
        return None;
    }
    let mut control: Vec<_> = points.iter().map(|p| p.coords).collect();
    let outer = |end: usize, near: usize, far: usize| {
        let c1 = (3.0 * points[near].coords - points[far].coords) / 2.0;
        (c1, 6.0 * points[end].coords - 4.0 * c1)
    };
    let (first, zeroth) = outer(0, 1, 2);
    let (last_but_one, last) = outer(n - 1, n - 2, n - 3);
    control[1] = first;
    control[n - 2] = last_but_one;
    // With two spans the third control point is the same seen from both ends.
    control[0] = zeroth - control[2];
    control[n - 1] = last - control[n - 3];
    Some(UniformSpline { control })
}

/// Points along a curve, as many in each stretch between knots: 16, or so many that they are `least`.
/// Ends included.
pub(crate) fn dense_points(curve: &Curve3, least: usize) -> Vec<Point3> {
    let breakpoints = curve.breakpoints();
    let each = least.div_ceil(breakpoints.len() - 1).max(16);
    let mut points = Vec::with_capacity(each * breakpoints.len());
    for pair in breakpoints.windows(2) {
        let width = pair[1] - pair[0];
        points.extend((0..each).map(|k| curve.at(pair[0] + width * k as f64 / each as f64)));
    }
    points.push(curve.at(curve.domain().1));
    points
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_uniform_spline_and_its_clamped_form_are_the_same_curve(
            control in prop::collection::vec((-1e2..1e2f64, -1e2..1e2f64, -1e2..1e2f64), 5..12),
        ) {
            let control = control.iter().map(|&(x, y, z)| Vector3::new(x, y, z)).collect();
            let spline = UniformSpline { control };
            let curve = to_curve(&spline).unwrap();
            // A dozen operations on numbers of order 1e2; the way back multiplies by up to 12.
            let tol = 1e3 * 100.0 * f64::EPSILON;
            for k in 0..=40 {
                let u = k as f64 / 40.0 * spline.spans() as f64;
                prop_assert!((curve.at(u).coords - spline.point(u)).norm() < tol);
            }
            let back = from_curve(&curve).unwrap();
            for (a, b) in back.control.iter().zip(&spline.control) {
                prop_assert!((a - b).norm() < tol, "{a} {b}");
            }
        }
    }
}
