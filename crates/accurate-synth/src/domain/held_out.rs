//! A second generator that shares no model with the first: what it draws tells how a network does
//! on images of another kind. Never used for training.

use std::f64::consts::TAU;

use accurate_geom::Point2;
use nalgebra::Vector2;
use ndarray::{Array2, Axis};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::label::{tube_mask, visible_pieces, wire_mask};
use super::{XraySample, check_side, in_image};
use crate::SynthError;
use crate::background::bilinear;
use crate::mask::covered;
use crate::rng::named_rng;

/// Distance of the vertices of a wire, px.
pub(super) const STEP_PX: f64 = 0.5;

/// Image `index` of the set `seed` of the held-out generator.
///
/// Its anatomy is noise with a power-law spectrum, ellipsoids and a bar phantom; its wires are
/// chains of clothoids (curvature linear in arc length) of varying width, with a flat profile and a
/// coil at the tip; its noise is Gaussian, correlated by a box and by rows; its blur is a disc.
/// What it shares with [`draw_xray`](super::draw_xray) is the meaning of the labels.
///
/// # Errors
/// [`SynthError::BadOption`] for a side outside 64 to 4096 px.
///
/// # Cost
/// About 0.1 s for 512 x 512 px.
pub fn draw_xray_held_out(side_px: u32, seed: u64, index: u64) -> Result<XraySample, SynthError> {
    check_side(side_px)?;
    let stream = |what: &str| named_rng("xray-held-out", seed, index, what);
    let side = side_px as usize;
    let mut depth = scene(&mut stream("scene"), side);

    let mut rng = stream("wire");
    let wire = Wire::draw(&mut rng, side as f64);
    let dense = rng.random_range(0.25..1.2);
    let mut exposure = stream("exposure");
    let field = round_field(&mut exposure, side as f64);
    let visible = |p: &Point2| field.is_none_or(|(c, r)| (p - c).norm() < r - 0.5);
    let pieces = visible_pieces(
        &wire.points,
        |s| wire.radius_px(s),
        |p| visible(p) && in_image(p, side as f64, 0.5 * wire.width_px),
    );
    let mut shadow = Array2::zeros((side, side));
    wire.add_to(&mut shadow, dense);
    depth += &shadow;

    let inverted = exposure.random_bool(0.1);
    let image = expose(&mut exposure, &depth, field, inverted);
    Ok(XraySample {
        image,
        mask: wire_mask(side_px, &pieces, visible),
        tube: tube_mask(side_px, &pieces),
        centreline: pieces,
        inverted,
    })
}

/// Optical depth behind the wire.
fn scene(rng: &mut ChaCha8Rng, side: usize) -> Array2<f64> {
    const NODES: usize = 130;
    // A sum of plane waves: 2 to 40 cycles across the image, amplitude falling as a power.
    let power = rng.random_range(1.0..2.0);
    let strength = rng.random_range(0.1..0.5);
    let waves: Vec<_> = (0..48)
        .map(|k| {
            let cycles = 0.7 * 40_f64.powf(f64::from(k) / 47.0);
            let (heading, phase) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU));
            let turn = TAU * cycles / NODES as f64;
            (turn * heading.cos(), turn * heading.sin(), phase, strength * cycles.powf(-power))
        })
        .collect();
    let ellipsoids: Vec<_> = (0..rng.random_range(2..9_u32)).map(|_| ellipsoid(rng)).collect();
    let grid = Array2::from_shape_fn((NODES, NODES), |(row, column)| {
        let (x, y) = (column as f64, row as f64);
        let noise: f64 =
            waves.iter().map(|(u, v, phase, size)| size * (u * x + v * y + phase).cos()).sum();
        let (x, y) = (x / NODES as f64, y / NODES as f64);
        let organs: f64 = ellipsoids.iter().map(|e| e.depth(x, y)).sum();
        (0.6 + noise + organs).max(0.0)
    });
    let step = (NODES - 2) as f64 / side as f64;
    let mut depth = Array2::from_shape_fn((side, side), |(row, column)| {
        bilinear(&grid, column as f64 * step, row as f64 * step)
    });
    if rng.random_bool(0.3) {
        // A bar phantom: wide bars, far wider than any wire.
        let (pitch, heading) = (rng.random_range(40.0..110.0), rng.random_range(0.0..TAU));
        let (cos, sin) = (heading.cos(), heading.sin());
        let bar = rng.random_range(0.05..0.25);
        for ((row, column), value) in depth.indexed_iter_mut() {
            let along = (column as f64 * cos + row as f64 * sin) / pitch;
            *value += if along.rem_euclid(1.0) < 0.5 { bar } else { 0.0 };
        }
    }
    depth
}

/// A solid ellipsoid seen from the front, in units of the image's side.
struct Ellipsoid {
    x: f64,
    y: f64,
    a: f64,
    b: f64,
    turn: (f64, f64),
    strength: f64,
}

fn ellipsoid(rng: &mut ChaCha8Rng) -> Ellipsoid {
    Ellipsoid {
        x: rng.random_range(-0.1..1.1),
        y: rng.random_range(-0.1..1.1),
        a: rng.random_range(0.05..0.5),
        b: rng.random_range(0.05..0.5),
        turn: f64::sin_cos(rng.random_range(0.0..TAU)),
        strength: rng.random_range(-0.3..0.6),
    }
}

impl Ellipsoid {
    fn depth(&self, x: f64, y: f64) -> f64 {
        let (sin, cos) = self.turn;
        let (dx, dy) = (x - self.x, y - self.y);
        let (u, v) = ((cos * dx + sin * dy) / self.a, (cos * dy - sin * dx) / self.b);
        self.strength * (1.0 - u * u - v * v).max(0.0).sqrt()
    }
}

/// A wire whose width varies, with a coil at its tip.
pub(super) struct Wire {
    pub points: Vec<Point2>,
    pub width_px: f64,
    wave: (f64, f64, f64),
    coil_from_px: f64,
    coil_pitch_px: f64,
}

impl Wire {
    /// A chain of clothoids.
    fn draw(rng: &mut ChaCha8Rng, side: f64) -> Self {
        let width_px = rng.random_range(1.2..7.0);
        let mut points = clothoids(rng, side);
        // At least a third of the side inside; a curve that leaves at once is drawn again.
        for _ in 0..20 {
            let inside = |p: &&Point2| (0.0..side).contains(&p.x) && (0.0..side).contains(&p.y);
            if points.iter().filter(inside).count() as f64 * STEP_PX >= side / 3.0 {
                break;
            }
            points = clothoids(rng, side);
        }
        Self::along(rng, width_px, points)
    }

    /// Along vertices [`STEP_PX`] apart.
    pub fn along(rng: &mut ChaCha8Rng, width_px: f64, points: Vec<Point2>) -> Self {
        let length_px = (points.len() - 1) as f64 * STEP_PX;
        let wave =
            (rng.random_range(0.0..0.2), rng.random_range(60.0..200.0), rng.random_range(0.0..TAU));
        let coil_px = if rng.random_bool(0.5) { rng.random_range(20.0..70.0) } else { 0.0 };
        Self {
            points,
            width_px,
            wave,
            coil_from_px: length_px - coil_px,
            coil_pitch_px: rng.random_range(2.5..4.0),
        }
    }

    pub fn radius_px(&self, s: f64) -> f64 {
        let (amplitude, period, phase) = self.wave;
        (0.5 * self.width_px * (1.0 + amplitude * (TAU * s / period + phase).sin())).max(0.5)
    }

    /// Adds a flat profile with edges one pixel soft: the largest of what each vertex covers, so
    /// that strands that cross do not add up (unlike the first generator's).
    pub fn add_to(&self, shadow: &mut Array2<f64>, dense: f64) {
        let (height, width) = shadow.dim();
        for (k, at) in self.points.iter().enumerate() {
            let s = k as f64 * STEP_PX;
            let radius = self.radius_px(s);
            let winding = (TAU * s / self.coil_pitch_px).cos();
            let value = if s >= self.coil_from_px { dense * (1.3 + 0.4 * winding) } else { dense };
            let reach = radius + 0.5;
            for row in covered(at.y - reach, at.y + reach, height as u32) {
                for column in covered(at.x - reach, at.x + reach, width as u32) {
                    let d = (column as f64 - at.x).hypot(row as f64 - at.y);
                    let covered = value * (radius + 0.5 - d).clamp(0.0, 1.0);
                    let place = &mut shadow[[row, column]];
                    *place = place.max(covered);
                }
            }
        }
    }
}

/// Curvature linear in arc length from knot to knot, the knots drawn independently.
fn clothoids(rng: &mut ChaCha8Rng, side: f64) -> Vec<Point2> {
    let mut at = Point2::new(rng.random_range(0.1..0.9) * side, rng.random_range(0.1..0.9) * side);
    let mut heading = rng.random_range(0.0..TAU);
    let tight = rng.random_range(0.5..9.0) / side;
    let mut curvature = 0.0;
    let mut points = vec![at];
    for _ in 0..rng.random_range(4..14_u32) {
        let next = tight * rng.sample::<f64, _>(StandardNormal);
        let steps = (rng.random_range(0.06..0.25) * side / STEP_PX).ceil();
        for k in 0..steps as usize {
            heading += (curvature + (next - curvature) * k as f64 / steps) * STEP_PX;
            at += Vector2::new(heading.cos(), heading.sin()) * STEP_PX;
            points.push(at);
        }
        curvature = next;
    }
    points
}

/// Centre and radius of a round field, in a third of the images.
fn round_field(rng: &mut ChaCha8Rng, side: f64) -> Option<(Point2, f64)> {
    let radius = rng.random_range(0.45..0.55) * side;
    rng.random_bool(0.33).then_some((Point2::new(side / 2.0, side / 2.0), radius))
}

/// Disc blur, correlated noise, a linear window between extremes, eight bits.
pub(super) fn expose(
    rng: &mut ChaCha8Rng,
    depth: &Array2<f64>,
    field: Option<(Point2, f64)>,
    inverted: bool,
) -> Array2<u8> {
    let mut image = depth.mapv(|d| (-d).exp());
    disc_blur(&mut image, rng.random_range(0.0..1.8));
    let mean = image.mean().unwrap_or(1.0);
    let grain = mean * rng.random_range(0.005..0.06);
    let rows = grain * rng.random_range(0.0..0.3);
    let noise = Array2::from_shape_simple_fn(image.dim(), || rng.sample::<f64, _>(StandardNormal));
    let (height, width) = image.dim();
    for row in 0..height {
        let stripe = rows * rng.sample::<f64, _>(StandardNormal);
        for column in 0..width {
            // A 2 x 2 box of white noise has half its deviation.
            let (up, left) = (row.saturating_sub(1), column.saturating_sub(1));
            let box_mean =
                noise[[row, column]] + noise[[up, column]] + noise[[row, left]] + noise[[up, left]];
            let value = &mut image[[row, column]];
            *value += 0.5 * grain * box_mean * (*value / mean).max(0.0).sqrt() + stripe;
        }
    }
    let in_field = |row: usize, column: usize| {
        field.is_none_or(|(c, r)| (Point2::new(column as f64, row as f64) - c).norm() < r)
    };
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for ((row, column), value) in image.indexed_iter() {
        if in_field(row, column) {
            (low, high) = (low.min(*value), high.max(*value));
        }
    }
    let scale = 1.0 / (high - low).max(1e-9);
    Array2::from_shape_fn(image.dim(), |(row, column)| {
        let shown = if in_field(row, column) { (image[[row, column]] - low) * scale } else { 0.0 };
        // The cast saturates at both ends.
        (255.0 * if inverted { 1.0 - shown } else { shown }).round() as u8
    })
}

/// Mean over a disc with a soft rim, by adding shifted copies; the border value continues outside.
fn disc_blur(image: &mut Array2<f64>, radius_px: f64) {
    let reach = radius_px.ceil() as isize;
    if reach == 0 {
        return;
    }
    let source = image.clone();
    let (rows, columns) = source.dim();
    let mut taps = Vec::new();
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let weight = (radius_px + 0.5 - (dx as f64).hypot(dy as f64)).clamp(0.0, 1.0);
            if weight > 0.0 {
                taps.push((dy, dx, weight));
            }
        }
    }
    let sum: f64 = taps.iter().map(|(_, _, weight)| weight).sum();
    for (row, mut out) in image.axis_iter_mut(Axis(0)).enumerate() {
        out.fill(0.0);
        for (dy, dx, weight) in &taps {
            let from = source.row(row.saturating_add_signed(*dy).min(rows - 1));
            for (column, value) in out.iter_mut().enumerate() {
                *value += weight / sum * from[column.saturating_add_signed(*dx).min(columns - 1)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_lie_on_the_wire_and_an_index_is_an_image() {
        for index in 0..6 {
            let sample = draw_xray_held_out(128, 7, index).unwrap();
            assert_eq!(sample, draw_xray_held_out(128, 7, index).unwrap());
            let points: Vec<&Point2> = sample.centreline.iter().flat_map(|p| &p.points).collect();
            assert!(!points.is_empty());
            for ((row, column), set) in sample.mask.indexed_iter() {
                if *set {
                    let at = Point2::new(column as f64, row as f64);
                    let near = points.iter().any(|p| (at - **p).norm() <= 1.2 * 3.5 + STEP_PX);
                    assert!(near, "{index} ({column}, {row})");
                }
            }
        }
        assert!(matches!(draw_xray_held_out(10, 7, 0), Err(SynthError::BadOption { .. })));
    }

    #[test]
    fn a_disc_keeps_constants_and_mass() {
        let mut flat = Array2::from_elem((20, 21), 3.0);
        disc_blur(&mut flat, 1.7);
        assert!(flat.iter().all(|v| (v - 3.0_f64).abs() < 1e-12));
        let mut dot = Array2::zeros((21, 21));
        dot[[10, 10]] = 1.0;
        disc_blur(&mut dot, 1.7);
        assert!((dot.sum() - 1.0_f64).abs() < 1e-12);
    }
}
