//! The shipped sample pairs are what the generator makes today.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use accurate3d::geom::nalgebra::distance;
use accurate3d::io::{PairParts, Truth, read_pair};
use accurate3d::synth::{CaseOptions, Family, generate};

#[test]
fn shipped_samples_are_what_the_generator_makes() {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/samples");
    for (name, family, index) in
        [("bend", Family::Easy, 1), ("loop", Family::Medium, 2), ("wire", Family::Carm, 5)]
    {
        let parts = PairParts { points: true, masks: true, images: false, truth: Truth::Required };
        let pair = read_pair(&samples.join(name), parts).unwrap();
        let case = generate(family, 2026, index, &CaseOptions::default()).unwrap();
        // Masks are bits: they agree to the pixel. Curves agree up to the platform's sin and cos,
        // a few ulp of coordinates below 1000.
        assert_eq!(pair.masks.unwrap(), case.masks, "{name}");
        let tolerance = 64.0 * f64::EPSILON * 1000.0;
        let truth = pair.truth.unwrap();
        assert_eq!(truth.len(), case.truth.len(), "{name}");
        for (a, b) in truth.iter().zip(&case.truth) {
            assert!(distance(a, b) < tolerance, "{name}: {a} {b}");
        }
        let (points1, points2) = pair.points.unwrap();
        assert_eq!(points1.len(), case.exact_points.0.len(), "{name}");
        assert_eq!(points2.len(), case.exact_points.1.len(), "{name}");
    }
}
