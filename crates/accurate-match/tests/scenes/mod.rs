//! Random rigs and curves shared by the tests.
#![allow(dead_code)] // each test binary uses its part

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Pixel, Point3, Rig, View, View1, View2};
use accurate_match::DistanceKind;
use proptest::prelude::*;

pub const KINDS: [DistanceKind; 4] =
    [DistanceKind::View1, DistanceKind::View2, DistanceKind::Symmetric, DistanceKind::Sampson];

/// Every random curve stays within this distance of the pixel origin, px.
pub const REACH_PX: f64 = 3000.0;

/// A camera at `centre` that looks at the origin, principal point (512, 512).
pub fn camera_at(centre: Vector3<f64>, fx: f64, fy: f64) -> Camera {
    let forward = -centre.normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let r = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let k = Matrix3::new(fx, 0.0, 512.0, 0.0, fy, 512.0, 0.0, 0.0, 1.0);
    Camera::new(k, r, -(r * centre), ImageSize { width: 1024, height: 1024 }).unwrap()
}

/// Cameras at azimuths 0 and `azimuth`, heights 0 and `height`, 200 from the axis.
pub fn rig(azimuth: f64, height: f64, f1: f64, f2: f64) -> Rig {
    let centre1 = Vector3::new(200.0, 0.0, 0.0);
    let centre2 = Vector3::new(200.0 * azimuth.cos(), 200.0 * azimuth.sin(), height);
    // The second f_y is negative, as in the paper's phantom rigs.
    Rig::new(camera_at(centre1, f1, f1), camera_at(centre2, f2, -f2), LengthUnit::Unit).unwrap()
}

/// Two views 20 to 120 degrees apart.
pub fn rigs() -> impl Strategy<Value = Rig> {
    (0.35..2.1, -60.0..60.0, 800.0..2500.0, 800.0..2500.0)
        .prop_map(|(azimuth, height, f1, f2)| rig(azimuth, height, f1, f2))
}

/// A point on a helix about the z axis; `s` runs from 0 to 1.
#[derive(Debug, Clone, Copy)]
pub struct Helix {
    pub radius: f64,
    pub pitch: f64,
    pub turns: f64,
    pub phase: f64,
}

impl Helix {
    pub fn at(&self, s: f64) -> Point3 {
        let angle = self.phase + s * self.turns * std::f64::consts::TAU;
        let z = self.pitch * self.turns * (s - 0.5);
        Point3::new(self.radius * angle.cos(), self.radius * angle.sin(), z)
    }

    /// `n` parameters over the whole curve, ends included; `warp` > -1 bunches them.
    pub fn parameters(n: usize, warp: f64) -> Vec<f64> {
        (0..n)
            .map(|k| k as f64 / (n - 1).max(1) as f64)
            .map(|s| (s + warp * s * s) / (1.0 + warp))
            .collect()
    }
}

pub fn helices() -> impl Strategy<Value = Helix> {
    (5.0..20.0, 5.0..25.0, 0.5..3.0, 0.0..6.2).prop_map(|(radius, pitch, turns, phase)| Helix {
        radius,
        pitch,
        turns,
        phase,
    })
}

pub fn view1(rig: &Rig, points: &[Point3]) -> Vec<Pixel<View1>> {
    points.iter().map(|p| rig.project(p).unwrap().0).collect()
}

pub fn view2(rig: &Rig, points: &[Point3]) -> Vec<Pixel<View2>> {
    points.iter().map(|p| rig.project(p).unwrap().1).collect()
}

/// A smooth random curve inside the image, `n` points about 1 px apart.
pub fn curves<V: View>(n: std::ops::RangeInclusive<usize>) -> impl Strategy<Value = Vec<Pixel<V>>> {
    let turns = prop::collection::vec(-0.3..0.3_f64, n);
    (300.0..700.0, 300.0..700.0, 0.0..6.2, turns).prop_map(|(x, y, heading, turns)| {
        let (mut x, mut y, mut heading): (f64, f64, f64) = (x, y, heading);
        let step = |turn: &f64| {
            heading += turn;
            x += heading.cos();
            y += heading.sin();
            Pixel::new(x, y)
        };
        turns.iter().map(step).collect()
    })
}

/// Random pixels without order: far from any curve.
pub fn scattered<V: View>(
    n: std::ops::RangeInclusive<usize>,
) -> impl Strategy<Value = Vec<Pixel<V>>> {
    prop::collection::vec((-1000.0..2000.0, -1000.0..2000.0), n)
        .prop_map(|points| points.into_iter().map(|(x, y)| Pixel::new(x, y)).collect())
}

/// The same pixels in the other view.
pub fn relabelled<V: View>(curve: &[Pixel<V>]) -> Vec<Pixel<V::Other>> {
    curve.iter().map(|p| Pixel::new(p.x, p.y)).collect()
}

/// Bound on the rounding error of one point-to-line distance, px: the unit normal and the offset
/// carry a few units in the last place of numbers up to the line's size, amplified when the pixel
/// that made the line is near its epipole: the raw normal is then a small difference. The rigs here
/// keep pixels at least 100 px from epipoles at most 1e5 px away, an amplification below 1e3.
pub const DISTANCE_TOLERANCE_PX: f64 = 1e3 * 8.0 * f64::EPSILON * REACH_PX;
