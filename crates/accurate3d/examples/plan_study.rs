//! How well the expected error of second views ranks them: Spearman's correlation with the error
//! measured by simulation, shape by shape. What can be asked for at all is in the last number: the
//! correlation of the measured error in half of the draws with that in the other half.
//!
//! `cargo run --release -p accurate3d --example plan_study -- [SEED] [SHAPES PER FAMILY] [DRAWS]`
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

#[path = "../tests/support/planned_views.rs"]
mod planned_views;

use accurate_synth::Family;
use planned_views::{expected_and_draws, median, rank_correlation, scene};
use rayon::prelude::*;

fn main() {
    let number = |at: usize, default: u64| {
        std::env::args().nth(at).map_or(default, |word| word.parse().expect("a number"))
    };
    let (seed, shapes, draws) = (number(1, 1000), number(2, 3), number(3, 16) as usize);
    let families = [Family::Easy, Family::Medium, Family::SimPaper, Family::Carm];
    let jobs: Vec<(Family, u64)> =
        families.into_iter().flat_map(|f| (0..shapes).map(move |i| (f, i))).collect();
    let lines: Vec<(f64, String)> = jobs
        .into_par_iter()
        .map(|(family, index)| {
            let (shape, first) = scene(family, seed, index);
            let views = expected_and_draws(&shape, &first, 16.0, draws);
            let pairs: Vec<_> = views.iter().map(|(e, draws)| (*e, median(draws))).collect();
            let correlation = rank_correlation(&pairs);
            let half = |draws: &[f64], from: usize| {
                let half: Vec<f64> = draws.iter().skip(from).step_by(2).copied().collect();
                median(&half)
            };
            let halves: Vec<_> = views.iter().map(|(_, d)| (half(d, 0), half(d, 1))).collect();
            let measured = |f: fn(f64, f64) -> f64| pairs.iter().map(|p| p.1).fold(f64::NAN, f);
            let ratio: Vec<f64> = pairs.iter().map(|p| p.1 / p.0).collect();
            let mean = ratio.iter().sum::<f64>() / ratio.len() as f64;
            let line = format!(
                "{family} {index}: {} views, rank correlation {correlation:.3}; measured {:.3} to \
                 {:.3} mm, {mean:.2} of the expected; halves of the draws {:.3}",
                pairs.len(),
                measured(f64::min),
                measured(f64::max),
                rank_correlation(&halves),
            );
            (correlation, line)
        })
        .collect();
    for (_, line) in &lines {
        println!("{line}");
    }
    let mean = lines.iter().map(|l| l.0).sum::<f64>() / lines.len() as f64;
    let least = lines.iter().map(|l| l.0).fold(f64::INFINITY, f64::min);
    println!("mean {mean:.3}, least {least:.3}");
}
