//! A loop of wire, seen in two views: project it, triangulate it back from pixels rounded to
//! 0.1 px, fit a curve, and compare lengths.
//!
//! `cargo run -p accurate-geom --example loop_in_two_views`

#![allow(clippy::print_stdout)]

use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{
    Camera, Curve3, GeomError, ImageSize, LengthUnit, Pixel, Point3, Polyline3, Rig, Triangulation,
    Triangulator,
};

fn main() -> Result<(), GeomError> {
    // A C-arm: f_y < 0, 1195 mm from source to detector, 720 mm to the isocentre.
    let k = Matrix3::new(1493.75, 0.0, 250.0, 0.0, -1493.75, 250.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 500, height: 500 };
    let camera = |degrees: f64| {
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
        Camera::new(k, turn.into_inner(), Vector3::new(0.0, 0.0, 720.0), size)
    };
    let rig = Rig::new(camera(-27.2)?, camera(33.0)?, LengthUnit::Millimetre)?;

    let wire: Vec<Point3> = (0..=200)
        .map(|i| {
            let turn = f64::from(i) * 0.04;
            Point3::new(30.0 * turn.cos(), 30.0 * turn.sin(), 5.0 * turn - 20.0)
        })
        .collect();
    let truth = Polyline3::new(wire.clone())?;

    let tenth = |v: f64| (10.0 * v).round() / 10.0;
    for method in Triangulation::ALL {
        let triangulator = Triangulator::new(&rig, method);
        let mut found = Vec::new();
        for point in &wire {
            let (p1, p2) = rig.project(point)?;
            let p1 = Pixel::new(tenth(p1.x), tenth(p1.y));
            let p2 = Pixel::new(tenth(p2.x), tenth(p2.y));
            found.push(triangulator.triangulate(p1, p2)?);
        }
        let worst = found.iter().map(|p| truth.closest(p).distance).fold(0.0, f64::max);
        let curve = Curve3::smoothing(&found, 0.02)?;
        println!(
            "{method:>12}: {:.3} {} of {:.3}, points off by at most {worst:.4}",
            curve.arc_length(),
            rig.unit(),
            truth.length(),
        );
    }
    Ok(())
}
