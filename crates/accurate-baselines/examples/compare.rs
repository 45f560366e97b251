//! All baselines on one helix, seen by two cameras 40 degrees apart as integer pixels.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
#[path = "../tests/support/mod.rs"]
mod support;

use accurate_baselines::{NAMES, by_name};
use support::*;

fn main() {
    let rig = turntable_rig(40.0);
    for (shape, curve) in [("helix", helix as fn(f64) -> _), ("shelf", shelf)] {
        let truth = sampled(2000, curve);
        let (view1, view2) = rounded_images(&rig, &truth);
        println!("{shape}: {} and {} pixels; 1 px is 0.1 units", view1.len(), view2.len());
        for name in NAMES {
            let Some(method) = by_name(name) else { continue };
            match method.reconstruct(&view1, &view2, &rig) {
                Ok(found) => {
                    let errors =
                        found.points.iter().map(|p| distance_to_curve(&p.position, &truth));
                    let mean = errors.sum::<f64>() / found.points.len() as f64;
                    println!(
                        "  {name:15} {:4} points, mean error {mean:.4} units",
                        found.points.len()
                    );
                }
                Err(error) => println!("  {name:15} {error}"),
            }
        }
    }
}
