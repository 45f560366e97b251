//! Many candidate curves per view, a few pairs worth a closer look.
//!
//! `cargo run -p accurate-match --example propose`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::time::Instant;

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, EpipolarAngle, ImageSize, LengthUnit, Pixel, Point3, Rig, View};
use accurate_match::{FreeEnds, FreeMatcher, ProposeParams, SignalCurve, propose_pairs};

/// A camera 1200 units from the origin, turned by `degrees` about the vertical axis.
fn camera(degrees: f64) -> Camera {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let k = Matrix3::new(1200.0, 0.0, 256.0, 0.0, 1200.0, 256.0, 0.0, 0.0, 1.0);
    let r = Matrix3::new(cos, -sin, 0.0, 0.0, 0.0, -1.0, sin, cos, 0.0);
    Camera::new(k, r, Vector3::new(0.0, 0.0, 1200.0), ImageSize { width: 512, height: 512 })
        .unwrap()
}

/// Wire `k` of a family that shares the first half.
fn wire(k: usize, s: f64) -> Point3 {
    let bend = if s > 0.5 { (k as f64 * k as f64 * 0.37).sin() * (s - 0.5) * 120.0 } else { 0.0 };
    let (sin, cos) = (7.0 * s).sin_cos();
    Point3::new(50.0 * cos + bend, 40.0 * sin - bend, 150.0 * (s - 0.5) + 0.8 * bend)
}

fn candidates<V: View>(project: impl Fn(Point3) -> Pixel<V>) -> Vec<Vec<Pixel<V>>> {
    let curve = |k| (0..=430).map(|n| project(wire(k, f64::from(n) / 430.0))).collect();
    (0..64).map(curve).collect()
}

fn curves<V: View>(points: &[Vec<Pixel<V>>]) -> Vec<SignalCurve<'_, V>> {
    points
        .iter()
        .map(|p| SignalCurve { points: p, cost: 0.0, free: FreeEnds::NONE, doubled_px: 0.0 })
        .collect()
}

fn main() {
    let rig = Rig::new(camera(0.0), camera(80.0), LengthUnit::Unit).unwrap();
    let points1 = candidates(|x| rig.project(&x).unwrap().0);
    let mut points2 = candidates(|x| rig.project(&x).unwrap().1);
    points2.iter_mut().skip(1).step_by(2).for_each(|points| points.reverse());
    let angles = EpipolarAngle::new(&rig);
    let (curves1, curves2) = (curves(&points1), curves(&points2));

    let start = Instant::now();
    let proposals = propose_pairs(&angles, &curves1, &curves2, &ProposeParams::DEFAULT).unwrap();
    println!("{} proposals in {:.2?}", proposals.len(), start.elapsed());
    for p in proposals.iter().take(8) {
        println!(
            "view 1 {:2}, view 2 {:2} {}: score {:.3}, energy {:.2} px², ends {:.2}",
            p.i,
            p.j,
            if p.reversed { "reversed" } else { "        " },
            p.score,
            p.energy_px2,
            p.end_penalty
        );
    }
    let right = proposals.iter().filter(|p| p.i == p.j && p.reversed == (p.j % 2 == 1)).count();
    println!("{right} of 64 true pairs among them");

    let best = proposals[0];
    let start = Instant::now();
    let found = FreeMatcher::default()
        .match_directed(&points1[best.i], &points2[best.j], best.reversed, &rig)
        .unwrap();
    println!("the best matched in full: {} points in {:.2?}", found.points.len(), start.elapsed());
}
