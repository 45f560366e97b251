use std::f64::consts::TAU;

use accurate_geom::nalgebra::{Rotation3, Vector3};
use accurate_geom::{GeomError, Point3};
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
