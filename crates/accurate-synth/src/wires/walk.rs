use std::ops::RangeInclusive;

use accurate_geom::{GeomError, Point3};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{StandardNormal, UnitBall};

use super::{BALL, Draft, direction, loop_draft, loop_rig};
use crate::spline::natural_spline;

/// The easy, medium and hard families: a natural cubic spline through a random walk in a ball.
pub(super) fn draw(
    curve: &mut ChaCha8Rng,
    rig: &mut ChaCha8Rng,
    control_points: RangeInclusive<u32>,
) -> Result<Draft, GeomError> {
    let count = curve.random_range(control_points);
    // 256 samples a segment: 0.5 units apart, off the spline by far less than 0.01 px.
    Ok(loop_draft(natural_spline(&walk(curve, count), 256), loop_rig(rig)?))
}

/// `count` points in the ball, 90 to 130 units apart; each direction is the last one plus normal
/// noise of 0.8 per axis. A step that would leave the ball is drawn again.
fn walk(rng: &mut ChaCha8Rng, count: u32) -> Vec<Point3> {
    const TURNING: f64 = 0.8;
    let start: [f64; 3] = rng.sample(UnitBall);
    let mut points = vec![Point3::from(Vector3::from(start) * BALL)];
    let mut heading = direction(rng);
    while points.len() < count as usize {
        let here = points[points.len() - 1];
        let (next_heading, next) = loop {
            let noise = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let tried = (heading + noise * TURNING).normalize();
            let next = here + tried * rng.random_range(90.0..130.0);
            // NaN (a heading cancelled by its noise) is refused as well. The noise has no bound,
            // so a way back in is always found, soon.
            if next.coords.norm() <= BALL {
                break (tried, next);
            }
        };
        heading = next_heading;
        points.push(next);
    }
    points
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn the_walk_stays_in_the_ball_with_steps_of_90_to_130() {
        for seed in 0..50 {
            let points = walk(&mut ChaCha8Rng::seed_from_u64(seed), 12);
            assert_eq!(points.len(), 12);
            assert!(points.iter().all(|p| p.coords.norm() <= BALL));
            let steps = points.windows(2).map(|w| (w[1] - w[0]).norm());
            assert!(steps.into_iter().all(|s| (89.999..130.001).contains(&s)));
        }
    }
}
