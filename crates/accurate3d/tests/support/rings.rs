//! Bent rings in two views, and how far a reconstruction is off one.

use accurate3d::eval::{CurveScores, curve_scores};
use accurate3d::geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate3d::geom::{Camera, ImageSize, LengthUnit, Pixel, Point3, Rig, View};
use accurate3d::{
    Closure, Error, InputKind, Method, Params, Reconstruction, ViewPair, reconstruct,
};
use ndarray::Array2;

const SIZE: u32 = 512;

/// Two cameras 60 degrees apart, 1000 units from the origin; one unit there is 1.2 px.
pub fn ring_rig() -> Rig {
    let camera = |degrees: f64| {
        let k = Matrix3::new(1200.0, 0.0, 255.5, 0.0, 1200.0, 255.5, 0.0, 0.0, 1.0);
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
        let t = Vector3::new(0.0, 0.0, 1000.0);
        Camera::new(k, *turn.matrix(), t, ImageSize { width: SIZE, height: SIZE }).unwrap()
    };
    Rig::new(camera(-30.0), camera(30.0), LengthUnit::Unit).unwrap()
}

/// An ellipse of 250 by 200 units in any direction, bent by its second and third harmonics.
pub struct Ring {
    turn: Rotation3<f64>,
    harmonics: [[Vector3<f64>; 2]; 2],
}

impl Ring {
    pub fn generate(seed: u64, index: u64) -> Self {
        let mut state = seed.wrapping_mul(0x0001_0000_0001) ^ index;
        let mut uniform = || {
            // SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let turn = Rotation3::from_euler_angles(0.9 * uniform(), 0.9 * uniform(), 3.0 * uniform());
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * uniform());
        let harmonics = [25.0, 12.5].map(|scale| [vector(scale), vector(scale)]);
        Self { turn, harmonics }
    }

    /// Once around from `phase` (rad) on; the first point is not repeated.
    pub fn points(&self, count: u32, phase: f64) -> Vec<Point3> {
        let at = |k: u32| {
            let a = phase + f64::from(k) / f64::from(count) * std::f64::consts::TAU;
            let mut point = Vector3::new(125.0 * a.cos(), 100.0 * a.sin(), 0.0);
            for (order, [cosine, sine]) in (2..).zip(&self.harmonics) {
                let a = f64::from(order) * a;
                point += cosine * a.cos() + sine * a.sin();
            }
            Point3::from(self.turn * point)
        };
        (0..count).map(at).collect()
    }

    /// Mean and largest distance of a curve from the ring, both ways.
    pub fn scores(&self, found: &[Point3]) -> CurveScores {
        let mut truth = self.points(4000, 0.0);
        truth.push(truth[0]);
        curve_scores(found, &truth, 0.2).unwrap()
    }
}

/// What of a ring is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// Sub-pixel points; view 2 begins elsewhere, and every other ring runs backwards in it.
    Exact,
    /// The same, rounded to whole pixels.
    Whole,
    /// Masks 3 px thick.
    Masks,
}

/// Ring `index` of a set, as `shown`.
pub fn ring_pair(ring: &Ring, index: u64, shown: Shown) -> ViewPair {
    let rig = ring_rig();
    let mut pair = ViewPair::new(format!("ring-{index:03}"), rig.clone());
    if shown == Shown::Masks {
        let dense = ring.points(6000, 0.0);
        pair.masks = Some([mask(rig.camera1(), &dense), mask(rig.camera2(), &dense)]);
    } else {
        let whole = shown == Shown::Whole;
        let mut other = ring.points(800, 0.3 + index as f64);
        if index % 2 == 1 {
            other.reverse();
        }
        let one = seen(rig.camera1(), &ring.points(900, 0.0), whole);
        pair.points = Some((one, seen(rig.camera2(), &other, whole)));
    }
    pair
}

/// The pair reconstructed as a ring.
pub fn reconstruct_ring(pair: &ViewPair) -> Result<Reconstruction, Error> {
    let input = if pair.masks.is_some() { InputKind::Mask } else { InputKind::Points };
    let params = Params { closure: Closure::Closed, ..Params::new(input, Method::Accurate) };
    reconstruct(pair, &params)
}

fn seen<V: View>(camera: &Camera, points: &[Point3], whole: bool) -> Vec<Pixel<V>> {
    let mut seen: Vec<Pixel<V>> = points
        .iter()
        .map(|p| camera.project(p).unwrap())
        .map(|p| if whole { Pixel::new(p.x.round(), p.y.round()) } else { Pixel::from(p) })
        .collect();
    seen.dedup();
    seen
}

const HALF_PX: f64 = 1.5;

fn mask(camera: &Camera, points: &[Point3]) -> Array2<bool> {
    let mut mask = Array2::from_elem((SIZE as usize, SIZE as usize), false);
    for point in points {
        let centre = camera.project(point).unwrap();
        let around = |c: f64| ((c - HALF_PX).ceil().max(0.0) as usize)..=(c + HALF_PX) as usize;
        for y in around(centre.y) {
            for x in around(centre.x) {
                if (x as f64 - centre.x).hypot(y as f64 - centre.y) <= HALF_PX {
                    mask[(y, x)] = true;
                }
            }
        }
    }
    mask
}
