//! The planned error against the measured one; `examples/plan_study.rs` measures more shapes.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "support/planned_views.rs"]
mod planned_views;

use accurate_synth::Family;
use planned_views::{expected_and_draws, median, rank_correlation, scene};

#[test]
fn the_expected_error_ranks_second_views_as_the_measured_one_does() {
    for family in [Family::SimPaper, Family::Carm] {
        let (shape, first) = scene(family, 1, 0);
        let draws = expected_and_draws(&shape, &first, 20.0, 3);
        let pairs: Vec<_> = draws.iter().map(|(e, draws)| (*e, median(draws))).collect();
        assert!(pairs.len() >= 30, "{}", pairs.len());
        let correlation = rank_correlation(&pairs);
        println!("{family}: {} views, rank correlation {correlation:.3}", pairs.len());
        assert!(correlation >= 0.9, "{family} {correlation}: {pairs:?}");
    }
}
