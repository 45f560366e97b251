//! Two synthetic views of a wire, on whole pixels and sampled differently, to a 3D curve.
//!
//! `cargo run -p accurate-match --example two_curves`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Pixel, Point3, Rig};
use accurate_match::{CurveMatcher, Ecdp, EcdpParams, RefineDirections, RefineRule};

/// A C-arm turned by `degrees` about the vertical axis, 720 mm from the wire.
fn c_arm(degrees: f64) -> Camera {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let k = Matrix3::new(1493.75, 0.0, 250.0, 0.0, -1493.75, 250.0, 0.0, 0.0, 1.0);
    let r = Matrix3::new(cos, -sin, 0.0, 0.0, 0.0, 1.0, -sin, -cos, 0.0);
    Camera::new(k, r, Vector3::new(0.0, 0.0, 720.0), ImageSize { width: 500, height: 500 }).unwrap()
}

/// A wire of three quarters of a turn, 60 mm high.
fn wire(s: f64) -> Point3 {
    let (sin, cos) = (4.7 * s).sin_cos();
    Point3::new(25.0 * cos, 25.0 * sin, 60.0 * (s - 0.5))
}

fn main() {
    let rig = Rig::new(c_arm(-27.0), c_arm(6.0), LengthUnit::Millimetre).unwrap();
    let sample = |n: i32| (0..n).map(move |k| rig_point(k, n));
    let curve1: Vec<_> = sample(240)
        .map(|x| rig.project(&x).unwrap().0)
        .map(|p| Pixel::new(p.x.round(), p.y.round()))
        .collect();
    let curve2: Vec<_> = sample(200)
        .map(|x| rig.project(&x).unwrap().1)
        .map(|p| Pixel::new(p.x.round(), p.y.round()))
        .collect();

    let signed = EcdpParams {
        refine: RefineRule::Signed,
        refine_directions: RefineDirections::Both,
        ..EcdpParams::PAPER
    };
    let truth: Vec<_> = (0..=4000).map(|k| wire(f64::from(k) / 4000.0)).collect();
    for (name, params) in [
        ("paper", EcdpParams::PAPER),
        ("paper + R", EcdpParams::PAPER_REFINED),
        ("signed R", signed),
    ] {
        let curve = Ecdp::new(params).reconstruct(&curve1, &curve2, &rig).unwrap();
        let error = |x: &Point3| truth.iter().map(|t| (x - t).norm()).fold(f64::INFINITY, f64::min);
        let errors: Vec<_> = curve.points.iter().map(|p| error(&p.position)).collect();
        println!(
            "{name:10} {} points, {} dropped, mean epipolar distance {:.3} px, mean error {:.3} {unit}, max {:.3} {unit}",
            curve.points.len(),
            curve.dropped,
            curve.mean_epipolar_distance_px(),
            errors.iter().sum::<f64>() / errors.len() as f64,
            errors.iter().copied().fold(0.0, f64::max),
            unit = rig.unit(),
        );
    }
}

fn rig_point(k: i32, n: i32) -> Point3 {
    wire(f64::from(k) / f64::from(n - 1))
}
