use nalgebra::Vector3;

use super::Triangulator;
use super::two_view::TwoView;
use crate::{GeomError, Point2};

/// Midpoint of the shortest segment between the two rays.
///
/// # Source
/// Hartley and Sturm, Triangulation, CVIU 68(2), 1997, section 4.
pub(super) fn solve(g: &TwoView, p1: &Point2, p2: &Point2) -> Result<Vector3<f64>, GeomError> {
    let (d1, d2) = (g.view1.unit_ray(p1), g.view2.unit_ray(p2));
    let normal = d1.cross(&d2);
    let sine_squared = normal.norm_squared();
    let sine = sine_squared.sqrt();
    if !(sine >= Triangulator::LEAST_SINE) {
        return Err(GeomError::ParallelRays { sine, least: Triangulator::LEAST_SINE });
    }
    // Feet of the common perpendicular. Triple products keep their relative accuracy for small
    // angles, where 1 - (d1·d2)² would cancel.
    let depth1 = g.baseline.cross(&d2).dot(&normal) / sine_squared;
    let depth2 = g.baseline.cross(&d1).dot(&normal) / sine_squared;
    let foot1 = g.view1.centre + depth1 * d1;
    let foot2 = g.view2.centre + depth2 * d2;
    Ok(0.5 * (foot1 + foot2))
}
