use std::f64::consts::TAU;

use accurate_geom::Point2;
use nalgebra::Vector2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Distance of the vertices, px.
pub(crate) const STEP_PX: f64 = 0.5;

/// How a device ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Tip {
    /// As the shaft runs.
    Plain,
    /// One bend of this angle (radians) and radius (px).
    Hook { angle: f64, radius_px: f64 },
    /// A spiral of this many turns, its radius shrinking from the first to the second, px.
    Pigtail { turns: f64, from_px: f64, to_px: f64 },
}

/// A smooth random curve in the image: curvature that wanders, loops, and a tip.
pub(crate) struct Wander {
    /// Length of the shaft, px.
    pub length_px: f64,
    /// Standard deviation of the curvature, 1/px.
    pub bending: f64,
    /// Length over which the curvature forgets itself, px.
    pub memory_px: f64,
    /// Full turns on the way: start (part of the length) and radius, px.
    pub loops: Vec<(f64, f64)>,
    /// The far end.
    pub tip: Tip,
    /// Centre and radius of the disc that the curve turns back to; `None` leaves it free.
    pub home: Option<(Point2, f64)>,
}

impl Wander {
    /// The polyline from `start`, vertices [`STEP_PX`] apart.
    pub fn draw(&self, rng: &mut ChaCha8Rng, start: Point2, heading: f64) -> Vec<Point2> {
        let mut pen = Pen { at: start, heading, points: vec![start] };
        let keep = (-STEP_PX / self.memory_px).exp();
        let kick = self.bending * (1.0 - keep * keep).sqrt();
        let mut curvature = self.bending * rng.sample::<f64, _>(StandardNormal);
        let steps = (self.length_px / STEP_PX) as usize;
        for k in 0..steps {
            for (_, radius) in self.loops.iter().filter(|(at, _)| (at * steps as f64) as usize == k)
            {
                let side = if curvature < 0.0 { -1.0 } else { 1.0 };
                pen.arc(side * TAU * rng.random_range(0.9..1.1), radius / 2.0, *radius);
            }
            curvature = curvature * keep + kick * rng.sample::<f64, _>(StandardNormal);
            pen.step(curvature + self.steering(&pen));
        }
        let side = if rng.random_bool(0.5) { -1.0 } else { 1.0 };
        match self.tip {
            Tip::Plain => {}
            Tip::Hook { angle, radius_px } => pen.arc(side * angle, radius_px, radius_px),
            Tip::Pigtail { turns, from_px, to_px } => {
                let parts = (turns * 8.0).ceil();
                for part in 0..parts as usize {
                    let radius = from_px + (to_px - from_px) * part as f64 / parts;
                    pen.arc(side * turns * TAU / parts, 0.0, radius);
                }
            }
        }
        pen.points
    }

    /// Curvature that leads back home: at most that of a circle of a quarter of its size.
    fn steering(&self, pen: &Pen) -> f64 {
        let Some((centre, radius)) = self.home else { return 0.0 };
        let out = pen.at - centre;
        let excess = (out.norm() / radius - 0.75).clamp(0.0, 0.5) / 0.5;
        let inward = (-out.y).atan2(-out.x) - pen.heading;
        // A curve that runs straight away turns as hard as one that runs across.
        let turn = if inward.cos() < 0.0 { 1_f64.copysign(inward.sin()) } else { inward.sin() };
        excess * turn * 4.0 / radius
    }
}

struct Pen {
    at: Point2,
    heading: f64,
    points: Vec<Point2>,
}

impl Pen {
    fn step(&mut self, curvature: f64) {
        self.heading += curvature * STEP_PX;
        self.at += Vector2::new(self.heading.cos(), self.heading.sin()) * STEP_PX;
        self.points.push(self.at);
    }

    /// Turns by `angle` at `radius`, the curvature setting in over `ramp` px.
    fn arc(&mut self, angle: f64, ramp: f64, radius: f64) {
        let steps = ((angle.abs() * radius + ramp) / STEP_PX).ceil().max(1.0);
        let side = angle.signum();
        for k in 0..steps as usize {
            let s = k as f64 * STEP_PX;
            let rise = if ramp > 0.0 { (s / ramp).min(1.0) } else { 1.0 };
            self.step(side * rise / radius);
        }
    }
}

/// A point on the image border and a heading into the image.
pub(crate) fn entry(rng: &mut ChaCha8Rng, side_px: f64) -> (Point2, f64) {
    let along = rng.random_range(0.05..0.95) * side_px;
    let slant = rng.random_range(-0.9..0.9);
    match rng.random_range(0..4_u32) {
        0 => (Point2::new(-6.0, along), slant),
        1 => (Point2::new(side_px + 5.0, along), std::f64::consts::PI + slant),
        2 => (Point2::new(along, -6.0), std::f64::consts::FRAC_PI_2 + slant),
        _ => (Point2::new(along, side_px + 5.0), -std::f64::consts::FRAC_PI_2 + slant),
    }
}

/// A value whose logarithm is uniform between those of the ends.
pub(crate) fn log_uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    let part: f64 = rng.random();
    (low.ln() + (high.ln() - low.ln()) * part).exp()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn vertices_are_one_step_apart_and_a_hook_turns_by_its_angle() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let wander = Wander {
            length_px: 100.0,
            bending: 0.0,
            memory_px: 50.0,
            loops: vec![(0.5, 20.0)],
            tip: Tip::Hook { angle: 2.0, radius_px: 10.0 },
            home: None,
        };
        let points = wander.draw(&mut rng, Point2::new(0.0, 0.0), 0.0);
        assert!(points.windows(2).all(|w| ((w[1] - w[0]).norm() - STEP_PX).abs() < 1e-12));
        // Shaft, one turn of at most 1.1 with its ramp, the hook with its ramp.
        let length = (points.len() - 1) as f64 * STEP_PX;
        let turn = TAU * 20.0;
        assert!((100.0 + 0.9 * turn..=100.0 + 1.1 * turn + 10.0 + 32.0).contains(&length));
    }

    #[test]
    fn a_curve_with_a_home_comes_back() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let home = Point2::new(256.0, 256.0);
            let wander = Wander {
                length_px: 2000.0,
                bending: 0.003,
                memory_px: 60.0,
                loops: vec![],
                tip: Tip::Plain,
                home: Some((home, 256.0)),
            };
            let points = wander.draw(&mut rng, home, 1.0);
            // It may leave the disc by little more than the radius of its turn.
            assert!(points.iter().all(|p| (p - home).norm() < 2.0 * 256.0), "{seed}");
        }
    }
}
