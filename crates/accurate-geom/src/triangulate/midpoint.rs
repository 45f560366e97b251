use super::method::Method;
use super::solution::Solution;
use super::two_view::{Parallax, TwoView};
use crate::number::{Number, add_scaled, constant, cross, dot, scaled};

/// Midpoint of the shortest segment between the two rays.
///
/// # Source
/// Hartley and Sturm, Triangulation, CVIU 68(2), 1997, section 4.
#[derive(Debug, Clone, Copy)]
pub(super) struct Midpoint;

impl Method for Midpoint {
    #[inline(always)]
    fn solve<N: Number>(g: &TwoView, p1: &[N; 2], p2: &[N; 2]) -> Solution<N> {
        let (d1, d2) = g.bounded_rays(p1, p2);
        let normal = cross(&d1, &d2);
        // Feet of the common perpendicular. Triple products keep their relative accuracy for small
        // angles, where 1 - (d1·d2)² would cancel.
        let baseline = constant(p1[0], &g.baseline.into());
        let share = p1[0].all(1.0) / dot(&normal, &normal);
        let depth1 = dot(&cross(&baseline, &d2), &normal) * share;
        let depth2 = dot(&cross(&baseline, &d1), &normal) * share;
        let foot1 = add_scaled(&g.view1.centre_as(p1[0]), depth1, &d1);
        let foot2 = add_scaled(&g.view2.centre_as(p1[0]), depth2, &d2);
        let half = p1[0].all(0.5);
        Solution {
            position: scaled(half, &add_scaled(&foot1, half.all(1.0), &foot2)),
            parallax: Parallax::between(&d1, &d2, &normal),
            open: half.all(0.0),
        }
    }
}
