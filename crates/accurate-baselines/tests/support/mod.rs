//! Rigs and curves with exact truth.
#![allow(dead_code)]

use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Pixel, Point3, Rig, View1, View2};

/// A camera at `distance` from the origin, turned by `angle` degrees about the world's z axis,
/// looking at the origin; focal length 1988 px, 512 x 2048 px. At distance 200, 1 unit is 10 px.
pub fn turntable_camera(angle_degrees: f64, distance: f64) -> Camera {
    let k = Matrix3::new(1988.0, 0.0, 256.0, 0.0, 1988.0, 1024.0, 0.0, 0.0, 1.0);
    // Camera frame: x along the world's y, y against the world's z, z against the world's x.
    let look = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0);
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -angle_degrees.to_radians());
    let size = ImageSize { width: 512, height: 2048 };
    Camera::new(k, look * turn.matrix(), Vector3::new(0.0, 0.0, distance), size).unwrap()
}

pub fn turntable_rig(angle_degrees: f64) -> Rig {
    let (a, b) = (turntable_camera(0.0, 200.0), turntable_camera(angle_degrees, 200.0));
    Rig::new(a, b, LengthUnit::Unit).unwrap()
}

pub type Views = (Vec<Pixel<View1>>, Vec<Pixel<View2>>);

/// Both images of every point, exact.
pub fn images(rig: &Rig, points: &[Point3]) -> Views {
    points.iter().map(|p| rig.project(p).unwrap()).unzip()
}

/// Both images as a tracer of integer pixels sees them: rounded, repetitions removed.
pub fn rounded_images(rig: &Rig, points: &[Point3]) -> Views {
    let (mut a, mut b) = images(rig, points);
    a.iter_mut().for_each(|p| *p = Pixel::new(p.x.round(), p.y.round()));
    b.iter_mut().for_each(|p| *p = Pixel::new(p.x.round(), p.y.round()));
    a.dedup();
    b.dedup();
    (a, b)
}

pub fn sampled(count: usize, curve: impl Fn(f64) -> Point3) -> Vec<Point3> {
    (0..count).map(|k| curve(k as f64 / (count - 1) as f64)).collect()
}

/// A slanted line, 60 units tall.
pub fn line(s: f64) -> Point3 {
    Point3::new(4.0 - 9.0 * s, -6.0 + 11.0 * s, -30.0 + 60.0 * s)
}

/// 100 degrees of a circle of radius 40 in a tilted plane, never along an epipolar line.
pub fn arc(s: f64) -> Point3 {
    let a = (-50.0 + 100.0 * s).to_radians();
    Point3::new(14.0 * a.cos() - 10.0, 20.0 * a.cos() - 15.0, 40.0 * a.sin())
}

/// One turn of radius 8 over a height of 70: rises all the way.
pub fn helix(s: f64) -> Point3 {
    let a = 6.0 * s;
    Point3::new(8.0 * a.cos(), 8.0 * a.sin(), -35.0 + 70.0 * s)
}

/// Up, then level for 12 units (along the epipolar lines of the turntable), then up again.
pub fn shelf(s: f64) -> Point3 {
    let level = |x: f64| x.clamp(0.0, 1.0) * x.clamp(0.0, 1.0) * (3.0 - 2.0 * x.clamp(0.0, 1.0));
    let z = -20.0 + 20.0 * level(2.5 * s) + 20.0 * level(2.5 * s - 1.5);
    Point3::new(3.0 * s, -10.0 + 20.0 * level((s - 0.2) / 0.6), z)
}

/// Distance of a point to the nearest of many samples of a curve, refined on the two segments that
/// meet there.
pub fn distance_to_curve(point: &Point3, truth: &[Point3]) -> f64 {
    truth
        .windows(2)
        .map(|w| {
            let along = w[1] - w[0];
            let share = ((point - w[0]).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (point - (w[0] + along * share)).norm()
        })
        .fold(f64::INFINITY, f64::min)
}
