use std::f64::consts::TAU;

use accurate_geom::{GeomError, ImageSize, LengthUnit, Point3, Rig};
use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::UnitBall;

use super::{Draft, direction};
use crate::rigs::{intrinsics, orbit};

/// Guidewires under the C-arm of the paper's phantom: source to detector 1195 mm, source to
/// isocentre 720 mm, two frames of one rotational run (about world z only).
pub(super) fn draw(curve: &mut ChaCha8Rng, rig: &mut ChaCha8Rng) -> Result<Draft, GeomError> {
    const SOD_MM: f64 = 720.0;
    // f_x = 1195 mm over a pixel pitch of 0.8 mm.
    let k = intrinsics(1493.75, -1493.75, 250.0, 250.0);
    let size = ImageSize { width: 500, height: 500 };
    let first_deg = rig.random_range(-60.0..30.0);
    let second_deg = first_deg + rig.random_range(25.0..60.0);
    let isocentre = Point3::origin();
    let rig = Rig::new(
        orbit(k, size, &isocentre, SOD_MM, first_deg, 0.0)?,
        orbit(k, size, &isocentre, SOD_MM, second_deg, 0.0)?,
        LengthUnit::Millimetre,
    )?;

    let diameter = if curve.random_bool(0.5) { 0.035 * 25.4 } else { 0.014 * 25.4 };
    let path = Path::draw(curve);
    // Large vessels run along the patient, whom the C-arm circles: seldom along a line of sight.
    let start = (Vector3::z() + direction(curve) * 0.8).normalize();
    let mut points = path.integrate(start, direction(curve));
    let (low, high) = points.iter().fold((points[0].coords, points[0].coords), |(l, h), p| {
        (l.inf(&p.coords), h.sup(&p.coords))
    });
    let offset: [f64; 3] = curve.sample(UnitBall);
    let shift = Vector3::from(offset) * 15.0 - (low + high) / 2.0;
    for point in &mut points {
        *point += shift;
    }
    Ok(Draft {
        curve: points,
        rig,
        wire_radius: diameter / 2.0,
        mask_diameter: Some(diameter),
        margin_px: 8.0,
    })
}

/// A unit-speed curve given by its curvature along two axes that move with it without twisting
/// (Bishop's frame): any smooth functions give a smooth wire, and bends have the radius they say.
struct Path {
    length_mm: f64,
    /// Three slow waves per axis: amplitude (1/mm) and phase.
    vessel: [[(f64, f64); 3]; 2],
    /// Arcs (start, end, radius in mm, direction of the bend in the moving frame): J tip, loop.
    arcs: Vec<(f64, f64, f64, f64)>,
}

impl Path {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let length_mm = rng.random_range(60.0..140.0);
        let mut wave =
            |k: f64| (rng.random_range(0.0..1.0) / (28.0 * k), rng.random_range(0.0..TAU));
        let vessel = [[wave(1.0), wave(2.0), wave(3.0)], [wave(1.0), wave(2.0), wave(3.0)]];

        // J tip: a hook of 140 to 200 degrees at the far end.
        let mut arcs = Vec::new();
        let hook = rng.random_range(140_f64..200.0).to_radians();
        let radius = rng.random_range(2.0..4.5);
        arcs.push((length_mm - hook * radius, f64::INFINITY, radius, rng.random_range(0.0..TAU)));
        // Every second wire that is long enough makes one full turn, as in a ventricle or an
        // aneurysm.
        let looped = rng.random_bool(0.5);
        let radius = rng.random_range(6.0..11.0);
        let turn = radius * TAU * rng.random_range(0.9..1.15);
        let start = rng.random_range(0.2..0.8) * (length_mm - turn - 25.0);
        if looped && start > 0.0 {
            arcs.push((start + 5.0, start + 5.0 + turn, radius, rng.random_range(0.0..TAU)));
        }
        Self { length_mm, vessel, arcs }
    }

    /// Curvature along both moving axes at arc length `s`, 1/mm.
    fn curvature(&self, s: f64) -> [f64; 2] {
        // Bends set in and fade over this length; a wire does not kink.
        const RAMP_MM: f64 = 2.0;
        let smooth = |x: f64| {
            let x = (x / RAMP_MM + 0.5).clamp(0.0, 1.0);
            x * x * (3.0 - 2.0 * x)
        };
        let mut curvature = [0, 1].map(|axis: usize| {
            let waves = self.vessel[axis].iter().zip([1.0, 2.0, 3.0]);
            waves
                .map(|((amplitude, phase), k)| {
                    amplitude * (TAU * k * s / self.length_mm + phase).cos()
                })
                .sum::<f64>()
        });
        for &(start, end, radius, bend) in &self.arcs {
            let strength = smooth(s - start) * smooth(end - s) / radius;
            curvature[0] += strength * bend.cos();
            curvature[1] += strength * bend.sin();
        }
        curvature
    }

    /// Integrates the frame in steps of 1/4000 of the length (at most 0.035 mm, turning by less
    /// than 0.02 rad: the chord leaves the arc by less than 1e-4 mm).
    fn integrate(&self, tangent: Vector3<f64>, helper: Vector3<f64>) -> Vec<Point3> {
        const STEPS: usize = 4000;
        let step = self.length_mm / STEPS as f64;
        let side = tangent
            .cross(&helper)
            .try_normalize(1e-9)
            .unwrap_or_else(|| tangent.cross(&Vector3::z()).normalize());
        let mut frame = [tangent, side, tangent.cross(&side)];
        let mut here = Point3::origin();
        let mut points = vec![here];
        for k in 0..STEPS {
            let [c1, c2] = self.curvature((k as f64 + 0.5) * step);
            // T' = c1 N1 + c2 N2, N1' = -c1 T, N2' = -c2 T: a rotation about c1 N2 - c2 N1.
            let half = Rotation3::new((frame[2] * c1 - frame[1] * c2) * (0.5 * step));
            here += half * frame[0] * step;
            frame = frame.map(|axis| half * (half * axis));
            points.push(here);
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::polyline::arc_lengths;

    #[test]
    fn wires_have_the_drawn_length_and_bend_no_tighter_than_a_j_tip() {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let path = Path::draw(&mut rng);
            let points = path.integrate(Vector3::x(), Vector3::y());
            let length = arc_lengths(&points)[4000];
            assert!((length - path.length_mm).abs() < 1e-9 * length);
            // J tip of 2 mm plus six waves at their largest.
            let tightest = 1.0 / 2.0 + 1.0 / 6.0 + 2.0 * (1.0 + 0.5 + 1.0 / 3.0) / 28.0;
            let step = length / 4000.0;
            for w in points.windows(3) {
                let bend = ((w[2] - w[1]) - (w[1] - w[0])).norm() / (step * step);
                assert!(bend <= tightest * 1.001, "{bend}");
            }
        }
    }
}
