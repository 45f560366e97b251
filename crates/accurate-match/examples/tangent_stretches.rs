//! Wires that run along epipolar lines in places: what bridging by arc length is worth there.
//!
//! `cargo run -p accurate-match --example tangent_stretches`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Pixel, Point3, Polyline, Rig, View};
use accurate_match::{CurveMatcher, Ecdp, FreeMatchParams, FreeMatcher, TangencyParams};

/// A camera 1200 units from the origin, turned by `degrees` about the vertical axis: 1 unit is about
/// 1 px.
fn camera(degrees: f64) -> Camera {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let k = Matrix3::new(1200.0, 0.0, 256.0, 0.0, 1200.0, 256.0, 0.0, 0.0, 1.0);
    let r = Matrix3::new(cos, -sin, 0.0, 0.0, 0.0, -1.0, sin, cos, 0.0);
    Camera::new(k, r, Vector3::new(0.0, 0.0, 1200.0), ImageSize { width: 512, height: 512 })
        .unwrap()
}

/// Wire `k`: its height, and with it the epipolar angle, rises and falls.
fn wire(k: u32, s: f64) -> Point3 {
    let k = f64::from(k);
    let phase = 0.9 * k;
    Point3::new(
        60.0 * (4.0 * s + phase).cos() + 30.0 * (9.0 * s + 2.0 * phase).sin(),
        50.0 * (5.0 * s + 3.0 * phase).sin(),
        220.0 * (s - 0.5) + 35.0 * ((8.0 + k / 4.0) * s + phase).sin(),
    )
}

/// Points 1 px apart, on whole pixels if `whole`.
fn view<V: View>(
    truth: &[Point3],
    whole: bool,
    project: impl Fn(&Point3) -> Pixel<V>,
) -> Vec<Pixel<V>> {
    let pixels: Vec<_> = truth.iter().map(project).collect();
    let line = Polyline::from_pixels(&pixels).unwrap();
    let mut points = line.resample(1.0).unwrap().to_pixels::<V>();
    if whole {
        points.iter_mut().for_each(|p| *p = Pixel::new(p.x.round(), p.y.round()));
        points.dedup();
    }
    points
}

fn main() {
    let rig = Rig::new(camera(0.0), camera(80.0), LengthUnit::Unit).unwrap();
    let free =
        |tangency| FreeMatcher::new(FreeMatchParams { tangency, ..FreeMatchParams::DEFAULT });
    let trusting = TangencyParams { max_sine: 0.0, ..TangencyParams::DEFAULT };
    for (whole, tangency) in
        [(false, TangencyParams::DEFAULT), (true, TangencyParams::WHOLE_PIXELS)]
    {
        println!("{}", if whole { "whole pixels" } else { "exact points" });
        let matchers: [(&str, Box<dyn CurveMatcher>); 3] = [
            ("corner to corner", Box::new(Ecdp::default())),
            ("all trusted", Box::new(free(trusting))),
            ("bridged", Box::new(free(tangency))),
        ];
        for (name, matcher) in matchers {
            let (mut mean, mut max) = (0.0, 0.0);
            for k in 0..20 {
                let truth: Vec<_> = (0..=4000).map(|n| wire(k, f64::from(n) / 4000.0)).collect();
                let curve1 = view(&truth, whole, |x| rig.project(x).unwrap().0);
                let curve2 = view(&truth, whole, |x| rig.project(x).unwrap().1);
                let found = matcher.reconstruct(&curve1, &curve2, &rig).unwrap();
                let line = Polyline::new(truth).unwrap();
                let errors: Vec<f64> =
                    found.points.iter().map(|p| line.closest(&p.position).distance).collect();
                mean += errors.iter().sum::<f64>() / errors.len() as f64 / 20.0;
                max += errors.iter().copied().fold(0.0, f64::max) / 20.0;
            }
            println!("  {name:17} mean error {mean:.4}, mean of the greatest {max:.3} units");
        }
    }
}
