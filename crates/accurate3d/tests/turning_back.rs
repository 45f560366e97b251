//! Masks that show more than the body: a spur that a thinning or a hand left, another wire across it. No curve
//! may run along it and come back over the body without a word.
#![allow(clippy::unwrap_used)]

use accurate3d::eval::curve_scores;
use accurate3d::synth::{CaseOptions, Family, SynthCase, generate};
use accurate3d::{InputKind, Method, Params, Reconstruction, Suspicion, ViewPair, reconstruct};
use ndarray::Array2;

/// A bar of 3 px from the middle of the body on, half of it to the other side if it crosses.
fn with_bar(
    mask: &Array2<bool>,
    at: [f64; 2],
    towards: [f64; 2],
    from_to: [f64; 2],
) -> Array2<bool> {
    let on = |y: usize, x: usize| {
        let (dx, dy) = (x as f64 - at[0], y as f64 - at[1]);
        let along = dx * towards[0] + dy * towards[1];
        let across = dx * towards[1] - dy * towards[0];
        (from_to[0]..=from_to[1]).contains(&along) && across.abs() <= 1.5
    };
    Array2::from_shape_fn(mask.dim(), |(y, x)| mask[(y, x)] || on(y, x))
}

/// The case with a bar square to the body at its middle, in the first view or in both.
fn barred(case: &SynthCase, from_to: [f64; 2], both: bool) -> ViewPair {
    let middle = case.truth.len() / 2;
    let near = |k: usize| case.rig.project(&case.truth[k]).unwrap();
    let (p, q) = (near(middle - 20), near(middle + 20));
    let square = |a: [f64; 2], b: [f64; 2]| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        [-dy / length, dx / length]
    };
    let at = near(middle);
    let [mask1, mask2] = &case.masks;
    let towards1 = square([p.0.x, p.0.y], [q.0.x, q.0.y]);
    let towards2 = square([p.1.x, p.1.y], [q.1.x, q.1.y]);
    let first = with_bar(mask1, [at.0.x, at.0.y], towards1, from_to);
    let second = match both {
        true => with_bar(mask2, [at.1.x, at.1.y], towards2, from_to),
        false => mask2.clone(),
    };
    ViewPair { masks: Some([first, second]), ..ViewPair::from(case.clone()) }
}

fn found(pair: &ViewPair) -> Reconstruction {
    reconstruct(pair, &Params::new(InputKind::Mask, Method::Accurate)).unwrap()
}

#[test]
fn a_spur_in_one_view_is_left_out_and_said() {
    for index in 0..4 {
        let case = generate(Family::Easy, 1914, index, &CaseOptions::default()).unwrap();
        for length in [5.0, 9.0] {
            let curve = found(&barred(&case, [0.0, length], false));
            let off = curve_scores(&curve.positions(), &case.truth, 0.5).unwrap().hausdorff;
            assert!(off < 3.0, "{index}, {length} px: {off} units of about a px");
            let doubts = &curve.diagnostics.suspicions;
            assert!(doubts.contains(&Suspicion::UnexplainedOutline), "{index}: {doubts:?}");
        }
    }
}

#[test]
fn a_wire_across_the_body_is_never_followed_without_doubt() {
    for (index, both) in [(0, false), (1, true)] {
        let case = generate(Family::Easy, 1914, index, &CaseOptions::default()).unwrap();
        let curve = found(&barred(&case, [-40.0, 40.0], both));
        assert!(!curve.diagnostics.suspicions.is_empty(), "{index}, both: {both}");
    }
}
