use accurate_geom::{GeomError, Point3};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitBall;

use super::{BALL, Draft, direction, loop_draft, loop_rig};
use crate::spline::natural_spline;

/// A stretch is tangent if its direction is within this of the epipolar direction.
pub(crate) const MAX_ANGLE_DEG: f64 = 5.0;
/// Least length of a stretch that counts.
pub(crate) const MIN_LENGTH_PX: f64 = 10.0;
/// Stretches that one of the views must have.
pub(crate) const MIN_STRETCHES: usize = 3;

/// A spline that alternates between runs within an epipolar plane and steps across the planes.
///
/// A curve in an epipolar plane projects onto an epipolar line in both views. The spline follows
/// its runs only nearly, so the caller counts the stretches and draws again if there are too few.
pub(super) fn draw(curve: &mut ChaCha8Rng, rig: &mut ChaCha8Rng) -> Result<Draft, GeomError> {
    let rig = loop_rig(rig)?;
    let (centre1, centre2) = (rig.camera1().centre(), rig.camera2().centre());
    let baseline = (centre2 - centre1).normalize();

    let start: [f64; 3] = curve.sample(UnitBall);
    let mut here = Point3::from(Vector3::from(start) * (0.6 * BALL));
    let mut knots = Vec::new();
    let mut along = if curve.random_bool(0.5) { 1.0 } else { -1.0 };
    let mut across = if curve.random_bool(0.5) { 1.0 } else { -1.0 };
    for _ in 0..curve.random_range(4..=6) {
        let sight = (here - centre1).normalize();
        let normal = sight.cross(&baseline).normalize();
        // Within 35 degrees of the baseline: far from both lines of sight, so that the run is
        // seen at nearly its full length.
        let (s, c) = curve.random_range(-35_f64..35.0).to_radians().sin_cos();
        let run = (baseline * c + baseline.cross(&normal) * s) * along;
        let length = curve.random_range(40.0..70.0);
        knots.extend([here, here + run * (0.5 * length), here + run * length]);
        here += run * length;
        let step = (normal * across * 1.5 + run * 0.5 + direction(curve) * 0.6).normalize();
        here += step * curve.random_range(50.0..90.0);
        if curve.random_bool(0.6) {
            along = -along;
        }
        // Turn back towards the middle before the ball ends.
        if here.coords.dot(&normal) * across > 0.4 * BALL || curve.random_bool(0.3) {
            across = -across;
        }
    }
    Ok(loop_draft(natural_spline(&knots, 192), rig))
}
