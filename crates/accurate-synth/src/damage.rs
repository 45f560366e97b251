//! What is taken away from a view, and what the nominal camera gets wrong.

use accurate_geom::{Camera, GeomError, Point2};
use nalgebra::{Rotation3, Unit, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitSphere;

use crate::projection::Projection;
use crate::{CalibrationError, CaseOptions, SynthError};

/// A disc of the image in which the wire is hidden.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Column of the centre, px.
    pub x: f64,
    /// Row of the centre, px.
    pub y: f64,
    /// Radius, px.
    pub radius_px: f64,
}

impl Disc {
    /// Whether the point at column `x`, row `y` (px) is hidden; the rim is.
    pub fn covers(&self, x: f64, y: f64) -> bool {
        (x - self.x).hypot(y - self.y) <= self.radius_px
    }
}

/// Arc length kept free of discs' centres and gaps at both tips, px.
const TIP_PX: f64 = 25.0;
/// Clearance of a disc's rim from a tip's cap, px: a tip must stay visible and its cap whole.
const CLEARANCE_PX: f64 = 2.0;
/// Draws of one disc before the curve counts as having no room: a curve of which one part in a
/// hundred is admissible fails with probability 4e-5.
const MAX_DRAWS: u32 = 1000;

/// Discs with centres on the projected curve at arc length U(25, L - 25) px, redrawn when they come
/// near a tip that lies close by in the image.
pub(crate) fn occlusions(
    rng: &mut ChaCha8Rng,
    view: u8,
    projection: &Projection,
    thickness_px: f64,
    options: &CaseOptions,
) -> Result<Vec<Disc>, SynthError> {
    let (radius_px, length_px) = (options.occlusion_radius_px, projection.length());
    let no_room =
        || SynthError::NoRoom { view, what: "an occlusion disc", size_px: radius_px, length_px };
    let count = rng.random_range(options.occlusion_discs.clone());
    if count > 0 && length_px <= 2.0 * TIP_PX {
        return Err(no_room());
    }
    let free_px = radius_px + thickness_px / 2.0 + CLEARANCE_PX;
    let tips = [projection.at(0.0), projection.at(length_px)];
    (0..count)
        .map(|_| {
            (0..MAX_DRAWS)
                .map(|_| projection.at(rng.random_range(TIP_PX..=length_px - TIP_PX)))
                .find(|centre: &Point2| tips.iter().all(|tip| (tip - centre).norm() > free_px))
                .map(|centre| Disc { x: centre.x, y: centre.y, radius_px })
                .ok_or_else(no_room)
        })
        .collect()
}

/// Missing stretches: sorted, disjoint intervals of arc length (px), at least 25 px from the tips.
pub(crate) fn gaps(
    rng: &mut ChaCha8Rng,
    view: u8,
    projection: &Projection,
    options: &CaseOptions,
) -> Result<Vec<(f64, f64)>, SynthError> {
    let length_px = projection.length();
    let count = rng.random_range(options.gaps.clone());
    let mut drawn = Vec::new();
    for _ in 0..count {
        let size_px = rng.random_range(options.gap_length_px.clone());
        let last_start = length_px - TIP_PX - size_px;
        if last_start < TIP_PX {
            return Err(SynthError::NoRoom { view, what: "a gap", size_px, length_px });
        }
        let start = rng.random_range(TIP_PX..=last_start);
        drawn.push((start, start + size_px));
    }
    drawn.sort_by(|a: &(f64, f64), b| a.0.total_cmp(&b.0));
    let mut merged: Vec<(f64, f64)> = Vec::with_capacity(drawn.len());
    for (start, end) in drawn {
        match merged.last_mut() {
            Some(last) if start <= last.1 => last.1 = last.1.max(end),
            _ => merged.push((start, end)),
        }
    }
    Ok(merged)
}

/// `camera` with the calibration error: rotated about its own centre, principal point moved.
pub(crate) fn miscalibrated(
    rng: &mut ChaCha8Rng,
    camera: &Camera,
    error: CalibrationError,
) -> Result<Camera, GeomError> {
    let axis: [f64; 3] = rng.sample(UnitSphere);
    let direction = rng.random_range(0.0..std::f64::consts::TAU);
    let turn = Rotation3::from_axis_angle(
        &Unit::new_normalize(Vector3::from(axis)),
        error.rotation_deg.to_radians(),
    );
    let mut k = *camera.k();
    k[(0, 2)] += error.shift_px * direction.cos();
    k[(1, 2)] += error.shift_px * direction.sin();
    Camera::new(k, turn * camera.r(), turn * camera.t(), camera.size())
}
