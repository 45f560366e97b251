//! The curves of the families.

mod carm;
mod helix;
mod sim_paper;
mod tangency;
mod walk;

use accurate_geom::{GeomError, ImageSize, LengthUnit, Point3, Rig};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitSphere;

use crate::Family;
use crate::rigs::{intrinsics, orbit};

pub(crate) use tangency::{
    MAX_ANGLE_DEG as TANGENCY_MAX_ANGLE_DEG, MIN_LENGTH_PX as TANGENCY_MIN_LENGTH_PX,
    MIN_STRETCHES as TANGENCY_MIN_STRETCHES,
};

/// One draw of a family, before it is known to fit the images.
pub(crate) struct Draft {
    /// A dense polyline (two or more points, of positive length).
    pub curve: Vec<Point3>,
    /// The true rig.
    pub rig: Rig,
    /// Radius of the wire in the picture, world unit.
    pub wire_radius: f64,
    /// Diameter of the tube that the mask shows, world unit; `None`: the mask is 3 px thick.
    pub mask_diameter: Option<f64>,
    /// Distance that the projected curve keeps from the image border, px.
    pub margin_px: f64,
}

pub(crate) fn draw(
    family: Family,
    curve: &mut ChaCha8Rng,
    rig: &mut ChaCha8Rng,
) -> Result<Draft, GeomError> {
    match family {
        Family::SimPaper => sim_paper::draw(curve, rig),
        Family::Easy => walk::draw(curve, rig, 5..=5),
        Family::Medium => walk::draw(curve, rig, 5..=8),
        Family::Hard => walk::draw(curve, rig, 9..=12),
        Family::Helix => helix::draw(curve, rig),
        Family::Tangency => tangency::draw(curve, rig),
        Family::Carm => carm::draw(curve, rig),
    }
}

/// Radius of the ball that the loop families fill, world unit.
const BALL: f64 = 150.0;

/// The rig of the loop families: 512 x 512, f = d = 1200, camera 2 at 60 to 100 degrees, tilted by
/// up to 15; 1 px is 1 unit at the centre.
fn loop_rig(rng: &mut ChaCha8Rng) -> Result<Rig, GeomError> {
    let k = intrinsics(1200.0, 1200.0, 256.0, 256.0);
    let size = ImageSize { width: 512, height: 512 };
    let angle_deg = rng.random_range(60.0..100.0);
    let tilt_deg = rng.random_range(-15.0..15.0);
    let origin = Point3::origin();
    Rig::new(
        orbit(k, size, &origin, 1200.0, 0.0, 0.0)?,
        orbit(k, size, &origin, 1200.0, angle_deg, tilt_deg)?,
        LengthUnit::Unit,
    )
}

/// A case of the loop families: 3 px wires, 8 px from the border.
fn loop_draft(curve: Vec<Point3>, rig: Rig) -> Draft {
    Draft { curve, rig, wire_radius: 1.5, mask_diameter: None, margin_px: 8.0 }
}

/// A uniformly distributed direction.
fn direction(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from(rng.sample::<[f64; 3], _>(UnitSphere))
}
