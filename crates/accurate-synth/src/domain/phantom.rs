//! Wires in a transparent vessel phantom, as biplane laboratories film them: a bright bath, the walls
//! of a silicone aorta with its branches, connectors, and little noise. For evaluation, never for
//! training.

use std::f64::consts::{PI, TAU};

use accurate_geom::Point2;
use nalgebra::Vector2;
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::held_out::{STEP_PX, Wire, expose};
use super::label::{tube_mask, visible_pieces, wire_mask};
use super::{XraySample, check_side, in_image};
use crate::SynthError;
use crate::mask::covered;
use crate::polyline::{arc_lengths, resample};
use crate::rng::named_rng;

/// Image `index` of the set `seed` of the vessel phantom.
///
/// An arch of wandering width with up to four branches, whose walls darken where they are seen from the
/// side, filled with a fluid that absorbs a little more than the bath; connectors, screws and the edges
/// of the box around it. The wire runs up one limb of the arch or a branch and on within the vessel,
/// from wall to wall, now and then over itself. Drawn as the held-out generator draws wires (a flat
/// profile, a coil at the tip), with its exposure; nothing of it is drawn by what
/// [`draw_xray`](super::draw_xray) draws with, whose bench phantoms are blocks and hollow tubes.
///
/// # Errors
/// [`SynthError::BadOption`] for a side outside 64 to 4096 px.
///
/// # Cost
/// About 0.1 s for 512 x 512 px.
pub fn draw_xray_phantom(side_px: u32, seed: u64, index: u64) -> Result<XraySample, SynthError> {
    check_side(side_px)?;
    let stream = |what: &str| named_rng("xray-phantom", seed, index, what);
    let side = f64::from(side_px);
    let mut rng = stream("vessels");
    let vessels = Vessels::draw(&mut rng, side);
    let mut depth = vessels.depth(&mut rng, side_px);
    add_fittings(&mut rng, &mut depth, &vessels);

    let mut rng = stream("wire");
    let width_px = (rng.random_range(1.5..4.5) * side / 512.0).max(1.2);
    let path = vessels.path(&mut rng, width_px);
    let wire = Wire::along(&mut rng, width_px, path);
    let mut shadow = Array2::zeros(depth.dim());
    wire.add_to(&mut shadow, rng.random_range(0.2..1.0));
    depth += &shadow;

    let visible = |p: &Point2| in_image(p, side, 0.5 * wire.width_px);
    let pieces = visible_pieces(&wire.points, |s| wire.radius_px(s), visible);
    let image = expose(&mut stream("exposure"), &depth, None, false);
    Ok(XraySample {
        image,
        mask: wire_mask(side_px, &pieces, |_| true),
        tube: tube_mask(side_px, &pieces),
        centreline: pieces,
        inverted: false,
    })
}

/// A tube: vertices [`STEP_PX`] apart, and its radius at each, px.
struct Vessel {
    points: Vec<Point2>,
    radius_px: Vec<f64>,
}

/// An arch, then its branches, each of which begins on the arch.
struct Vessels {
    all: Vec<Vessel>,
    /// Where on the arch each branch begins, as vertices.
    origins: Vec<usize>,
}

impl Vessels {
    fn draw(rng: &mut ChaCha8Rng, side: f64) -> Self {
        // A hook: up from the bottom edge, half round, and down on the other side.
        let radius = rng.random_range(0.16..0.26) * side;
        let (x, y) = (rng.random_range(0.4..0.6) * side, rng.random_range(0.35..0.5) * side);
        let flip = if rng.random_bool(0.5) { -1.0 } else { 1.0 };
        let lean = rng.random_range(-0.12..0.12);
        let short = rng.random_range(0.15..0.4) * side;
        let long = side - y + 20.0;
        let arc = PI * radius;
        let bow = (rng.random_range(0.0..0.12) * side, rng.random_range(0.7..1.6));
        let at = |s: f64| {
            let (u, v) = if s < long {
                let left = (long - s) / long;
                (-radius - bow.0 * (PI * bow.1 * left).sin() * left, long - s)
            } else if s < long + arc {
                let turn = PI * (s - long) / arc;
                (-radius * turn.cos(), -radius * turn.sin())
            } else {
                (radius, s - long - arc)
            };
            Point2::new(x + flip * (u + lean * v), y + v)
        };
        let steps = ((long + arc + short) / STEP_PX) as usize;
        let wide = rng.random_range(0.04..0.075) * side;
        let swell = (rng.random_range(0.0..0.25), rng.random_range(0.0..TAU));
        let arch = Vessel {
            points: (0..=steps).map(|k| at(k as f64 * STEP_PX)).collect(),
            radius_px: (0..=steps)
                .map(|k| wide * (1.0 + swell.0 * (TAU * k as f64 / steps as f64 + swell.1).sin()))
                .collect(),
        };
        let mut all = vec![arch];
        let mut origins = Vec::new();
        for _ in 0..rng.random_range(1..5_u32) {
            let turn = rng.random_range(0.25..0.75);
            let origin = ((long + turn * arc) / STEP_PX) as usize;
            let start = all[0].points[origin];
            // Outwards, off the arch.
            let out = (start - Point2::new(x, y)).normalize();
            let mut heading = out.y.atan2(out.x) + rng.random_range(-0.4..0.4);
            let (bend, period) = (rng.random_range(0.0..4.0) / side, rng.random_range(0.3..0.9));
            let (length, narrow) = (rng.random_range(0.3..0.7) * side, rng.random_range(0.2..0.5));
            let phase = rng.random_range(0.0..TAU);
            let mut points = vec![start];
            for k in 0..(length / STEP_PX) as usize {
                let s = k as f64 * STEP_PX / side;
                heading += bend * (TAU * s / period + phase).sin() * STEP_PX;
                points.push(points[k] + Vector2::new(heading.cos(), heading.sin()) * STEP_PX);
            }
            let radius_px = vec![narrow * wide; points.len()];
            all.push(Vessel { points, radius_px });
            origins.push(origin);
        }
        Self { all, origins }
    }

    /// Optical depth of the bath, the walls and the fluid. Shape (side, side).
    fn depth(&self, rng: &mut ChaCha8Rng, side_px: u32) -> Array2<f64> {
        let side = side_px as usize;
        // The distance from the nearest axis in radii of its vessel; branches open into the arch.
        let mut radii = Array2::from_elem((side, side), f64::INFINITY);
        for vessel in &self.all {
            for (at, radius) in vessel.points.iter().zip(&vessel.radius_px) {
                for row in covered(at.y - radius, at.y + radius, side_px) {
                    for column in covered(at.x - radius, at.x + radius, side_px) {
                        let away = (column as f64 - at.x).hypot(row as f64 - at.y) / radius;
                        let least: &mut f64 = &mut radii[[row, column]];
                        *least = least.min(away);
                    }
                }
            }
        }
        let wall = rng.random_range(0.2..0.7);
        let thick = rng.random_range(0.06..0.18);
        let fluid = rng.random_range(0.0..0.12);
        let slope = Vector2::new(rng.random_range(-0.2..0.2), rng.random_range(-0.2..0.2));
        let bath = rng.random_range(0.2..0.8);
        let chord = |radius: f64, away: f64| (radius * radius - away * away).max(0.0).sqrt();
        Array2::from_shape_fn((side, side), |(row, column)| {
            let place = Vector2::new(column as f64, row as f64) / side as f64;
            let away = radii[[row, column]];
            let (outer, inner) = (chord(1.0, away), chord(1.0 - thick, away));
            bath + slope.dot(&place) + wall * (outer - inner) + fluid * inner
        })
    }

    /// The way of a wire: along the arch from its long limb, into a branch or on round, off the axis by
    /// turns; some come back upon themselves.
    fn path(&self, rng: &mut ChaCha8Rng, width_px: f64) -> Vec<Point2> {
        let arch = &self.all[0];
        let branch = rng.random_range(0..=self.origins.len());
        let mut axis: Vec<(Point2, f64)> = Vec::new();
        let with_radius = |vessel: &Vessel, upto: usize| -> Vec<(Point2, f64)> {
            let radii = vessel.radius_px.iter().copied();
            vessel.points.iter().copied().zip(radii).take(upto).collect()
        };
        let part = rng.random_range(0.55..1.0);
        if branch == 0 {
            axis.extend(with_radius(arch, (part * arch.points.len() as f64) as usize));
        } else {
            let vessel = &self.all[branch];
            // A wire rounds the corner within the width of the branch.
            let before = (2.0 * vessel.radius_px[0] / STEP_PX) as usize;
            axis.extend(with_radius(arch, self.origins[branch - 1].saturating_sub(before)));
            let mut way = with_radius(vessel, (part * vessel.points.len() as f64) as usize);
            way.drain(..before.min(way.len() / 2));
            axis.extend(way);
        }
        // From wall to wall: the offset swings with the arc, within what the vessel leaves.
        let (period, phase) = (rng.random_range(60.0..240.0), rng.random_range(0.0..TAU));
        let swing = rng.random_range(0.2..0.85);
        let offset: Vec<Point2> = axis
            .iter()
            .enumerate()
            .map(|(k, (at, radius))| {
                let next = axis[(k + 1).min(axis.len() - 1)].0;
                let last = axis[k.saturating_sub(1)].0;
                let along = (next - last).normalize();
                let free = (radius - width_px).max(0.0) * swing;
                let aside = free * (TAU * k as f64 * STEP_PX / period + phase).sin();
                at + Vector2::new(-along.y, along.x) * aside
            })
            .collect();
        let smooth = smoothed(&offset, 40);
        let length_px = arc_lengths(&smooth).last().copied().unwrap_or(0.0);
        let mut path = resample(&smooth, (length_px / STEP_PX).round().max(1.0) as usize + 1);
        if rng.random_bool(0.5) {
            hook(rng, &mut path, width_px);
        }
        path
    }
}

/// The mean over `reach` neighbours to both sides; the ends stay.
fn smoothed(points: &[Point2], reach: usize) -> Vec<Point2> {
    let last = points.len() - 1;
    (0..points.len())
        .map(|k| {
            let near = reach.min(k).min(last - k);
            let sum: Vector2<f64> = points[k - near..=k + near].iter().map(|p| p.coords).sum();
            Point2::from(sum / (2 * near + 1) as f64)
        })
        .collect()
}

/// Bends the tip back over the wire, as a J.
fn hook(rng: &mut ChaCha8Rng, path: &mut Vec<Point2>, width_px: f64) {
    let n = path.len();
    let (a, b) = (path[n.saturating_sub(3)], path[n - 1]);
    let mut heading = (b.y - a.y).atan2(b.x - a.x);
    let radius = width_px * rng.random_range(3.0..8.0);
    let side = if rng.random_bool(0.5) { -1.0 } else { 1.0 };
    let steps = rng.random_range(2.0..5.5) * radius / STEP_PX;
    for _ in 0..steps as usize {
        heading += side * STEP_PX / radius;
        let last = path[path.len() - 1];
        path.push(last + Vector2::new(heading.cos(), heading.sin()) * STEP_PX);
    }
}

/// Connectors at the ends of vessels, screws, and the edges of the box.
fn add_fittings(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, vessels: &Vessels) {
    let side = depth.nrows() as f64;
    let mut discs = Vec::new();
    for vessel in &vessels.all[1..] {
        let end = vessel.points.len() - 1;
        discs.push((vessel.points[end], 1.5 * vessel.radius_px[end], rng.random_range(0.1..0.4)));
    }
    for _ in 0..rng.random_range(0..7_u32) {
        let at = Point2::new(rng.random_range(0.0..side), rng.random_range(0.0..side));
        discs.push((at, rng.random_range(0.006..0.016) * side, rng.random_range(0.3..1.5)));
    }
    let box_edges: Vec<_> = (0..rng.random_range(0..3_u32))
        .map(|_| {
            let wide = rng.random_range(0.01..0.04) * side;
            (rng.random_bool(0.5), rng.random_range(0.0..side), wide, rng.random_range(0.05..0.3))
        })
        .collect();
    for ((row, column), value) in depth.indexed_iter_mut() {
        let (x, y) = (column as f64, row as f64);
        for (at, radius, dense) in &discs {
            // A pixel soft at the rim.
            *value += dense * (radius + 0.5 - (x - at.x).hypot(y - at.y)).clamp(0.0, 1.0);
        }
        for (upright, from, wide, dense) in &box_edges {
            let away = (if *upright { x } else { y } - from).abs();
            *value += dense * (0.5 * wide + 0.5 - away).clamp(0.0, 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_is_an_image_and_its_wire_is_darker_than_what_is_beside_it() {
        for index in 0..8 {
            let sample = draw_xray_phantom(256, 7, index).unwrap();
            assert_eq!(sample, draw_xray_phantom(256, 7, index).unwrap());
            let length: usize = sample.centreline.iter().map(|piece| piece.points.len()).sum();
            assert!(length as f64 * STEP_PX > 256.0 / 3.0, "{index}: {length} vertices");
            // Two pixels off the wire's edge to both sides, on average.
            let (mut on, mut off, mut count) = (0.0, 0.0, 0);
            for piece in &sample.centreline {
                for k in (5..piece.points.len() - 5).step_by(5) {
                    let at = piece.points[k];
                    let along = (piece.points[k + 5] - piece.points[k - 5]).normalize();
                    let aside = Vector2::new(-along.y, along.x) * (piece.radius_px[k] + 3.0);
                    let grey = |p: Point2| {
                        let (row, column) = (p.y.round() as usize, p.x.round() as usize);
                        sample.image.get([row, column]).map(|v| f64::from(*v))
                    };
                    if let (Some(here), Some(a), Some(b)) =
                        (grey(at), grey(at + aside), grey(at - aside))
                    {
                        on += here;
                        off += 0.5 * (a + b);
                        count += 1;
                    }
                }
            }
            let (on, off) = (on / f64::from(count), off / f64::from(count));
            assert!(on + 5.0 < off, "{index}: {on} on the wire, {off} beside it");
        }
        assert!(matches!(draw_xray_phantom(10, 7, 0), Err(SynthError::BadOption { .. })));
    }
}
