use std::f64::consts::TAU;

use accurate_geom::Point2;
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::stroke::{Profile, Stroke, add_stroke};
use super::target::Target;
use super::wander::{STEP_PX, Tip, Wander, entry, log_uniform};

/// Adds devices that are not the target. What tells each of them apart from a solid, even, thin,
/// long wire is its own kind: hollow, beaded, dashed, a mesh, short, or much wider.
///
/// `wire_depth` is the optical depth of the target's shaft (or of a usual one where there is none).
pub(crate) fn add_devices(
    rng: &mut ChaCha8Rng,
    depth: &mut Array2<f64>,
    target: Option<&Target>,
    wire_depth: f64,
) {
    if let Some(target) = target
        && rng.random_bool(0.25)
    {
        add_catheter_over(rng, depth, target, wire_depth);
    }
    let mut count = 0;
    while count < 5 && rng.random_bool(0.6) {
        count += 1;
        let strength = wire_depth * rng.random_range(0.3..1.2);
        match rng.random_range(0..9_u32) {
            0 | 1 => add_catheter(rng, depth, strength),
            2 => add_lead(rng, depth, strength),
            3 => add_dashed_wire(rng, depth, strength),
            4 => add_sutures(rng, depth, strength),
            5 => add_clips(rng, depth, strength),
            6 => add_beads(rng, depth, strength),
            7 => add_stent(rng, depth, strength),
            _ => add_instrument(rng, depth, strength),
        }
    }
}

fn add_even(depth: &mut Array2<f64>, points: &[Point2], radius: f64, value: f64, profile: Profile) {
    add_stroke(depth, &Stroke { points, radius_px: &|_| radius, depth: &|_| value, profile });
}

fn path(rng: &mut ChaCha8Rng, side: f64, length_px: f64, bending: f64) -> Vec<Point2> {
    let (start, heading) = entry(rng, side);
    let wander = Wander {
        length_px,
        bending,
        memory_px: 90.0,
        loops: vec![],
        tip: if rng.random_bool(0.3) {
            Tip::Hook { angle: rng.random_range(0.5..2.5), radius_px: rng.random_range(12.0..40.0) }
        } else {
            Tip::Plain
        },
        home: Some((Point2::new(side / 2.0, side / 2.0), side / 2.0)),
    };
    wander.draw(rng, start, heading)
}

/// A sheath or catheter: two dark walls. At least 5 px wide, so that the bore can be seen.
fn add_catheter(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    let length = rng.random_range(0.3..1.5) * side;
    let points = path(rng, side, length, 0.004);
    let radius = log_uniform(rng, 3.0, 11.0);
    let bore = rng.random_range(0.65..0.85);
    add_even(depth, &points, radius, strength, Profile::Hollow(bore));
    // A dense ring at the mouth of many sheaths.
    if rng.random_bool(0.4) {
        let end = &points[points.len().saturating_sub(8)..];
        add_even(depth, end, radius, strength, Profile::Solid);
    }
}

/// A catheter that the wire runs in: its walls lie beside the wire.
fn add_catheter_over(
    rng: &mut ChaCha8Rng,
    depth: &mut Array2<f64>,
    target: &Target,
    wire_depth: f64,
) {
    let covered = (rng.random_range(0.2..0.9) * target.points.len() as f64) as usize;
    if covered < 20 {
        return;
    }
    let radius = target.shaft_px * rng.random_range(1.0..2.0) + rng.random_range(2.0..5.0);
    let bore = rng.random_range(0.7..0.85);
    let strength = wire_depth * rng.random_range(0.2..0.8);
    add_even(depth, &target.points[..covered], radius, strength, Profile::Hollow(bore));
}

/// A pacing lead: a wound conductor, seen as fine bars, with wide electrodes near its end.
fn add_lead(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    let length = rng.random_range(0.4..1.4) * side;
    let points = path(rng, side, length, 0.006);
    let radius = rng.random_range(1.8..4.0);
    let period = rng.random_range(4.0..8.0);
    add_stroke(
        depth,
        &Stroke {
            points: &points,
            radius_px: &|s| radius * (0.8 + 0.2 * (TAU * s / period).cos()),
            depth: &|s| strength * (0.5 + 0.5 * (TAU * s / period).cos()),
            profile: Profile::Solid,
        },
    );
    let mut back = 4;
    for _ in 0..rng.random_range(1..4_u32) {
        let long = rng.random_range(10..24_usize);
        let Some(first) = points.len().checked_sub(back + long) else { break };
        add_even(depth, &points[first..first + long], radius * 1.8, strength, Profile::Solid);
        back += long + rng.random_range(16..60_usize);
    }
}

/// A wire of beads or a mapping catheter: bars with gaps as long as they are.
fn add_dashed_wire(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    let length = rng.random_range(0.3..1.2) * side;
    let points = path(rng, side, length, 0.006);
    let radius = rng.random_range(1.0..3.5);
    let dash = (rng.random_range(5.0..14.0) / STEP_PX) as usize;
    let gap = (rng.random_range(7.0..20.0) / STEP_PX) as usize;
    for first in (0..points.len()).step_by(dash + gap) {
        let last = (first + dash).min(points.len());
        add_even(depth, &points[first..last], radius, strength, Profile::Solid);
    }
}

/// Sternal sutures: short twisted loops of dense wire, in a row.
fn add_sutures(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    let mut at = Point2::new(rng.random_range(0.2..0.8) * side, rng.random_range(0.0..0.3) * side);
    let pitch = rng.random_range(0.12..0.25) * side;
    let radius = rng.random_range(0.8..1.6);
    for _ in 0..rng.random_range(1..6_u32) {
        let (a, b) = (rng.random_range(5.0..13.0), rng.random_range(3.0..8.0));
        let turn = rng.random_range(0.0..TAU);
        let mut points: Vec<_> = (0..=80)
            .map(|k| {
                let t = TAU * f64::from(k) / 80.0;
                let (u, v) = (a * t.cos(), b * t.sin());
                Point2::new(
                    at.x + turn.cos() * u - turn.sin() * v,
                    at.y + turn.sin() * u + turn.cos() * v,
                )
            })
            .collect();
        // The twisted ends.
        let end = points[points.len() - 1];
        let tail = rng.random_range(4.0..10.0);
        points.extend((1..=20).map(|k| {
            let s = tail * f64::from(k) / 20.0;
            let twist = 1.5 * (s * 1.6).sin();
            Point2::new(
                end.x + turn.cos() * s - turn.sin() * twist,
                end.y + turn.sin() * s + turn.cos() * twist,
            )
        }));
        add_even(depth, &points, radius, strength * 1.3, Profile::Solid);
        at.y += pitch;
        at.x += rng.random_range(-6.0..6.0);
    }
}

/// Surgical clips: short dense bars, often two in a V.
fn add_clips(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    for _ in 0..rng.random_range(1..7_u32) {
        let at = Point2::new(rng.random_range(0.0..side), rng.random_range(0.0..side));
        let turn = rng.random_range(0.0..TAU);
        let (long, radius) = (rng.random_range(5.0..14.0), rng.random_range(0.9..1.8));
        for open in [0.0, rng.random_range(0.1..0.5)] {
            let (cos, sin) = ((turn + open).cos(), (turn + open).sin());
            let bar: Vec<_> = (0..=20)
                .map(|k| {
                    let s = long * f64::from(k) / 20.0;
                    Point2::new(at.x + cos * s, at.y + sin * s)
                })
                .collect();
            add_even(depth, &bar, radius, strength * 1.3, Profile::Solid);
        }
    }
}

/// Calibration beads, electrodes and screws seen end-on: dense discs.
fn add_beads(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    for _ in 0..rng.random_range(1..9_u32) {
        let (x, y) = (rng.random_range(0.0..side), rng.random_range(0.0..side));
        let radius = log_uniform(rng, 1.5, 12.0);
        let ring = rng.random_bool(0.25);
        let (first, last) = ((y - radius - 1.0).max(0.0), (y + radius + 2.0).min(side));
        let (left, right) = ((x - radius - 1.0).max(0.0), (x + radius + 2.0).min(side));
        for row in first as usize..last as usize {
            for column in left as usize..right as usize {
                let r = (column as f64 - x).hypot(row as f64 - y);
                let mut cover = (radius - r + 0.5).clamp(0.0, 1.0);
                if ring {
                    cover -= (0.6 * radius - r + 0.5).clamp(0.0, 1.0);
                }
                depth[[row, column]] += strength * cover;
            }
        }
    }
}

/// A stent: a mesh of very fine struts within a tube.
fn add_stent(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    let axis = path(rng, side, side, 0.003);
    let long = (rng.random_range(50.0..160.0) / STEP_PX) as usize;
    if axis.len() <= long + 4 {
        return;
    }
    let first = rng.random_range(0..axis.len() - long - 2);
    let radius = rng.random_range(6.0..16.0);
    let pitch = rng.random_range(9.0..18.0);
    for strut in 0..6 {
        let phase = TAU * f64::from(strut) / 6.0;
        for hand in [-1.0, 1.0] {
            let points: Vec<_> = (0..long)
                .map(|k| {
                    let along = axis[first + k + 1] - axis[first + k];
                    let across = radius * (hand * k as f64 * STEP_PX / pitch + phase).cos();
                    axis[first + k] + nalgebra::Vector2::new(-along.y, along.x) * (across / STEP_PX)
                })
                .collect();
            add_even(depth, &points, 0.5, 0.35 * strength, Profile::Solid);
        }
    }
}

/// A rod, a needle holder, the probe of an echo machine: solid, but 18 px wide or more.
fn add_instrument(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>, strength: f64) {
    let side = depth.ncols() as f64;
    let length = rng.random_range(0.2..0.9) * side;
    let points = path(rng, side, length, 0.0008);
    let radius = rng.random_range(9.0..22.0);
    add_even(depth, &points, radius, strength.min(0.8), Profile::Solid);
}
