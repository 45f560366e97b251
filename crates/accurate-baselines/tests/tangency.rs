//! A stretch along the epipolar lines: no crossing, or a cloud of them, tells where a point is.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
mod support;

use accurate_baselines::{Baert, Hoffmann};
use accurate_match::{CurveMatcher, CurveReconstruction};
use support::*;

fn largest_jump(curve: &CurveReconstruction) -> f64 {
    let steps = curve.points.windows(2).map(|w| (w[1].position - w[0].position).norm());
    steps.fold(0.0, f64::max)
}

fn worst(curve: &CurveReconstruction) -> f64 {
    let truth = sampled(1500, shelf);
    curve.points.iter().map(|p| distance_to_curve(&p.position, &truth)).fold(0.0, f64::max)
}

#[test]
fn gaps_at_a_tangency_are_filled_by_default_and_left_on_request() {
    let rig = turntable_rig(40.0);
    let (a, b) = rounded_images(&rig, &sampled(3000, shelf));
    let baert = Baert::default().reconstruct(&a, &b, &rig).unwrap();
    let filled = Hoffmann::default().reconstruct(&a, &b, &rig).unwrap();
    let open = Hoffmann { fill: false, ..Hoffmann::default() }.reconstruct(&a, &b, &rig).unwrap();
    println!(
        "jump: baert {} filled {} open {}",
        largest_jump(&baert),
        largest_jump(&filled),
        largest_jump(&open)
    );
    println!("worst: baert {} filled {} open {}", worst(&baert), worst(&filled), worst(&open));
    println!("points: {} {} {}", baert.points.len(), filled.points.len(), open.points.len());
    // Filled curves advance by about a pixel, 0.1 units, per point; the shelf is 12 units long.
    assert!(largest_jump(&baert) < 1.0 && largest_jump(&filled) < 1.0);
    assert!(largest_jump(&open) > 2.0 * largest_jump(&filled));
    assert!(open.points.len() < filled.points.len());
}

#[test]
fn correspondence_keeps_the_order_of_both_views() {
    let rig = turntable_rig(40.0);
    let (a, b) = rounded_images(&rig, &sampled(3000, shelf));
    let methods: [&dyn CurveMatcher; 2] = [&Baert::default(), &Hoffmann::default()];
    for method in methods {
        let found = method.reconstruct(&a, &b, &rig).unwrap();
        assert!(found.pairs.windows(2).all(|w| w[0].0 <= w[1].0 && w[0].1 <= w[1].1));
    }
}
