use std::f64::consts::{FRAC_PI_2, PI, TAU};

use accurate_geom::Point2;
use nalgebra::{Rotation2, Vector2};
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::stroke::{Profile, Stroke, add_stroke};
use super::wander::{STEP_PX, Tip, Wander, entry, log_uniform};
use crate::Family;
use crate::polyline::arc_lengths;
use crate::projection::Projection;
use crate::wires;

/// The wire to be found: centreline, width and how its density varies.
pub(crate) struct Target {
    /// Vertices, px, in order, at most 1 px apart.
    pub points: Vec<Point2>,
    /// Length, px.
    pub length_px: f64,
    /// Radius of the shaft, px.
    pub shaft_px: f64,
    tip_px: f64,
    tip_radius: f64,
    tip_density: f64,
    /// Bands: arc length of their middle, px.
    bands: Vec<f64>,
    band_half_px: f64,
    /// Slow changes of the angle to the beam: amplitude, period (px), phase.
    tilt: (f64, f64, f64),
}

impl Target {
    /// Adds its optical depth, `wire_depth` across the shaft.
    pub fn add_to(&self, depth: &mut Array2<f64>, wire_depth: f64) {
        add_stroke(
            depth,
            &Stroke {
                points: &self.points,
                radius_px: &|s| self.radius_px(s),
                depth: &|s| wire_depth * self.density(s),
                profile: Profile::Solid,
            },
        );
    }

    /// A wire of `width_px`, at least partly in the image.
    pub fn draw(rng: &mut ChaCha8Rng, side: f64, width_px: f64) -> Self {
        let mut points = shape(rng, side);
        for _ in 0..20 {
            if seen_px(&points, side) >= 0.15 * side {
                break;
            }
            points = shape(rng, side);
        }
        let length_px = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        let plain = rng.random_bool(0.5);
        let banded = rng.random_bool(0.15);
        let count = if banded { rng.random_range(1..5_u32) } else { 0 };
        Self {
            points,
            length_px,
            shaft_px: width_px / 2.0,
            tip_px: rng.random_range(10.0..80.0),
            tip_radius: if plain { 1.0 } else { rng.random_range(0.7..1.1) },
            tip_density: if plain { 1.0 } else { rng.random_range(1.0..2.0) },
            bands: (0..count).map(|_| rng.random_range(0.0..=1.0) * length_px).collect(),
            band_half_px: rng.random_range(1.5..5.0),
            tilt: (
                rng.random_range(0.0..0.3),
                rng.random_range(80.0..400.0),
                rng.random_range(0.0..TAU),
            ),
        }
    }

    /// Radius at arc length `s`, px, never below 1/2.
    pub fn radius_px(&self, s: f64) -> f64 {
        let tip = self.in_tip(s);
        let band = if self.in_band(s) { 1.35 } else { 1.0 };
        (self.shaft_px * (1.0 + (self.tip_radius - 1.0) * tip) * band).max(0.5)
    }

    /// Density relative to the thinnest place, at least 1.
    pub fn density(&self, s: f64) -> f64 {
        let (amplitude, period, phase) = self.tilt;
        let tilt = 1.0 + amplitude * (1.0 + (TAU * s / period + phase).sin());
        let band = if self.in_band(s) { 1.8 } else { 1.0 };
        tilt * (1.0 + (self.tip_density - 1.0) * self.in_tip(s)) * band
    }

    fn in_tip(&self, s: f64) -> f64 {
        ((s - (self.length_px - self.tip_px)) / 12.0).clamp(0.0, 1.0)
    }

    fn in_band(&self, s: f64) -> bool {
        self.bands.iter().any(|middle| (s - middle).abs() <= self.band_half_px)
    }
}

/// Length inside the image, px.
fn seen_px(points: &[Point2], side: f64) -> f64 {
    let inside = |p: &Point2| (0.0..side).contains(&p.x) && (0.0..side).contains(&p.y);
    points.windows(2).filter(|w| inside(&w[0])).map(|w| (w[1] - w[0]).norm()).sum()
}

fn shape(rng: &mut ChaCha8Rng, side: f64) -> Vec<Point2> {
    match rng.random_range(0..20_u32) {
        0..10 => wandering(rng, side),
        10 => of_family(rng, side, Family::Easy),
        11..13 => of_family(rng, side, Family::Medium),
        13..15 => of_family(rng, side, Family::Hard),
        15 => of_family(rng, side, Family::Helix),
        16..18 => of_family(rng, side, Family::Carm),
        _ => of_family(rng, side, Family::SimPaper),
    }
}

/// A wire that is pushed in from the border, or lies free.
fn wandering(rng: &mut ChaCha8Rng, side: f64) -> Vec<Point2> {
    let centre = Point2::new(side / 2.0, side / 2.0);
    let (start, heading) = if rng.random_bool(0.7) {
        entry(rng, side)
    } else {
        let mut free = || rng.random_range(0.1..0.9) * side;
        let start = Point2::new(free(), free());
        (start, rng.random_range(0.0..TAU))
    };
    let scale = side / 512.0;
    let tip = match rng.random_range(0..10_u32) {
        0..4 => Tip::Plain,
        4..6 => Tip::Hook {
            angle: rng.random_range(FRAC_PI_2..1.3 * PI),
            radius_px: rng.random_range(5.0..28.0) * scale,
        },
        6..8 => Tip::Hook {
            angle: rng.random_range(0.4..1.2),
            radius_px: rng.random_range(4.0..12.0) * scale,
        },
        _ => Tip::Pigtail {
            turns: rng.random_range(0.8..2.2),
            from_px: rng.random_range(14.0..30.0) * scale,
            to_px: rng.random_range(7.0..13.0) * scale,
        },
    };
    let loops = if rng.random_bool(0.25) { rng.random_range(1..4_u32) } else { 0 };
    let wander = Wander {
        length_px: log_uniform(rng, 0.35, 2.6) * side,
        bending: log_uniform(rng, 0.0008, 0.02) / scale,
        memory_px: rng.random_range(20.0..160.0) * scale,
        loops: (0..loops)
            .map(|_| (rng.random_range(0.1..0.9), rng.random_range(12.0..70.0) * scale))
            .collect(),
        tip,
        home: rng.random_bool(0.8).then_some((centre, side / 2.0)),
    };
    wander.draw(rng, start, heading)
}

/// One view of a wire of a family, turned, scaled and moved in the image plane.
fn of_family(rng: &mut ChaCha8Rng, side: f64, family: Family) -> Vec<Point2> {
    // The family draws from two streams; both continue this one.
    let mut rig_rng = rng.clone();
    rig_rng.set_stream(1);
    let Some(points) = wires::draw(family, rng, &mut rig_rng)
        .and_then(|draft| Projection::new(draft.rig.camera1(), &draft.curve))
        .ok()
        .map(|projection| projection.points)
        .filter(|points| points.len() > 1)
    else {
        return wandering(rng, side);
    };
    let turn = Rotation2::new(rng.random_range(0.0..TAU));
    let scale = side / 512.0 * rng.random_range(0.75..1.35);
    // A long wire is seen in part: any of its points may be near the middle of the image.
    let middle = if family == Family::SimPaper {
        points[rng.random_range(0..points.len())]
    } else {
        let sum = points.iter().fold(Vector2::zeros(), |sum, p| sum + p.coords);
        Point2::from(sum / points.len() as f64)
    };
    let mut near = || side * (0.5 + rng.random_range(-0.12..0.12));
    let place = Vector2::new(near(), near());
    let placed: Vec<_> =
        points.iter().map(|p| Point2::from(turn * (p - middle) * scale + place)).collect();
    every_step(&placed)
}

/// The same polyline with vertices one step apart.
fn every_step(points: &[Point2]) -> Vec<Point2> {
    let arc = arc_lengths(points);
    let length = arc.last().copied().unwrap_or(0.0);
    let count = (length / STEP_PX).ceil().max(1.0) as usize;
    let mut at = 0;
    (0..=count)
        .map(|k| {
            let s = length * k as f64 / count as f64;
            while at + 2 < arc.len() && arc[at + 1] < s {
                at += 1;
            }
            let span = arc[at + 1] - arc[at];
            let t = if span > 0.0 { ((s - arc[at]) / span).clamp(0.0, 1.0) } else { 0.0 };
            points[at] + (points[at + 1] - points[at]) * t
        })
        .collect()
}
