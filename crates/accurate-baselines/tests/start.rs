//! Views that do not begin at the same point of the body.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
mod support;

use accurate_baselines::{Baert, Hoffmann};
use accurate_match::CurveMatcher;
use support::*;

#[test]
fn a_view_that_begins_later_than_the_other_costs_no_more_than_the_part_it_misses() {
    let rig = turntable_rig(40.0);
    let truth = sampled(3000, helix);
    let (a, b) = rounded_images(&rig, &truth);
    let (late1, late2) = (&a[300..], &b[300..]);
    let methods: [&dyn CurveMatcher; 2] = [&Baert::default(), &Hoffmann::default()];
    for method in methods {
        for (view1, view2) in [(late1, &b[..]), (&a[..], late2)] {
            let found = method.reconstruct(view1, view2, &rig).unwrap();
            let worst = found.points.iter().map(|p| distance_to_curve(&p.position, &truth));
            // Both views, smoothed, are right to about half a pixel: 0.05 / sin 40° units.
            assert!(worst.fold(0.0, f64::max) < 0.15, "{}", method.name());
            assert!(found.points.len() as f64 > 0.9 * (a.len() - 300) as f64);
        }
    }
}
