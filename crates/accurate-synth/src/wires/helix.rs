use std::f64::consts::TAU;

use accurate_geom::{GeomError, Point3};
use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Draft, direction, loop_draft, loop_rig};

/// Helices of radius 15 to 40 units, pitch 0.6 to 1.8 radii, as many turns as fit into 120 to 260
/// units of height (at most 8), in any direction but within 25 degrees of a line of sight, where
/// turns would project onto each other.
pub(super) fn draw(curve: &mut ChaCha8Rng, rig: &mut ChaCha8Rng) -> Result<Draft, GeomError> {
    let rig = loop_rig(rig)?;
    let sights = [rig.camera1(), rig.camera2()].map(|c| c.r().row(2).transpose());
    let axis = loop {
        let axis = direction(curve);
        if sights.iter().all(|sight| axis.dot(sight).abs() < 25_f64.to_radians().cos()) {
            break axis;
        }
    };
    let radius = curve.random_range(15.0..=40.0);
    let pitch = radius * curve.random_range(0.6..1.8);
    let turns = (curve.random_range(120.0..260.0_f64) / pitch).min(8.0);
    let phase = curve.random_range(0.0..TAU);
    let handedness = if curve.random_bool(0.5) { 1.0 } else { -1.0 };

    // No rotation takes z to -z uniquely: any will do there.
    let turn = Rotation3::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| Rotation3::from_euler_angles(std::f64::consts::PI, 0.0, 0.0));
    // 512 chords a turn leave the circle by radius (pi / 512)² / 2 < 0.001 units.
    let steps = (512.0 * turns).ceil();
    let helix = (0..=steps as usize).map(|k| {
        let at = turns * k as f64 / steps;
        let (s, c) = (phase + handedness * TAU * at).sin_cos();
        turn * Point3::new(radius * c, radius * s, pitch * (at - turns / 2.0))
    });
    Ok(loop_draft(helix.collect(), rig))
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn the_curvature_is_that_of_a_helix_of_radius_15_to_40() {
        for seed in 0..40 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let draft = draw(&mut rng, &mut ChaCha8Rng::seed_from_u64(seed + 1000)).unwrap();
            let bends: Vec<f64> = draft
                .curve
                .windows(3)
                .map(|w| ((w[2] - w[1]) - (w[1] - w[0])).norm() / (w[1] - w[0]).norm_squared())
                .collect();
            let (least, most) =
                bends.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), b| (l.min(*b), m.max(*b)));
            // Second differences of coordinates of 300 units, 0.2 units apart: 1e-13 / 0.04.
            assert!(most - least < 1e-10);
            // Radius of curvature = r (1 + (pitch / (2 pi r))²), the pitch at most 1.8 r; the
            // finite step of 1/512 turn changes it by less than 1e-5.
            let longest = 40.0 * (1.0 + (1.8 / TAU).powi(2));
            assert!(1.0 / most >= 15.0 * 0.999_99 && 1.0 / least <= longest * 1.000_01);
        }
    }
}
