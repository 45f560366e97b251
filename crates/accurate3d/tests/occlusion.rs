//! Something hides part of the body: the reconstruction goes on where the body must, not where it is seen.
#![allow(clippy::unwrap_used)]

use accurate3d::eval::curve_scores;
use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};

/// Hausdorff distance, px of view 1 at the truth's depth.
fn off_px(seed: u64, index: u64, most_discs: u32) -> f64 {
    let options = CaseOptions { occlusion_discs: 1..=most_discs, ..CaseOptions::default() };
    let case = generate(Family::Medium, seed, index, &options).unwrap();
    let (truth, camera) = (case.truth.clone(), case.rig.camera1().clone());
    let depth = truth.iter().map(|p| camera.depth(p)).sum::<f64>() / truth.len() as f64;
    let per_px = depth / camera.k()[(0, 0)].abs();
    let params = Params::new(InputKind::Mask, Method::Accurate);
    let found = reconstruct(&ViewPair::from(case), &params).unwrap();
    curve_scores(&found.positions(), &truth, 0.5 * per_px).unwrap().hausdorff / per_px
}

/// In these the shortest way between the two cut ends is 7 px from where the body turns.
#[test]
fn a_hairpin_turns_where_the_other_view_sees_it_turn_though_a_disc_hides_it() {
    for (seed, index, discs) in [(1085, 14, 1), (1086, 40, 2)] {
        let off = off_px(seed, index, discs);
        assert!(off < 1.0, "{seed}/{index}: {off:.2} px");
    }
}

/// Here the rim of the disc draws a fit aside that starts on the walks alone, by 4.8 px.
#[test]
fn a_start_that_spans_what_is_hidden_is_not_drawn_to_the_rim() {
    let off = off_px(1085, 27, 1);
    assert!(off < 1.0, "{off:.2} px");
}
