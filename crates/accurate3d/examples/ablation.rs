//! What each step of `accurate` mode on masks buys: one step off at a time.
//!
//! `cargo run --release -p accurate3d --example ablation -- [cases] [seed] [part of a step's name]`
//! prints a Markdown table;
//! distances in world units (about 1 px), point to polyline, both ways.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

use accurate3d::eval::{curve_scores, quantile};
use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::{InputKind, Method, Params, RobustParams, SecondLook, ViewPair, reconstruct};
use rayon::prelude::*;

const RIGHT_PX: f64 = 5.0;

fn main() {
    let mut args = std::env::args().skip(1);
    let cases: u64 = args.next().map_or(100, |a| a.parse().expect("number of cases"));
    let seed: u64 = args.next().map_or(7, |a| a.parse().expect("seed"));
    let only = args.next().unwrap_or_default();
    println!("| step off | family | below 5 px | Overall median | Hausdorff median |");
    println!("|---|---|---:|---:|---:|");
    for (name, params) in variants().into_iter().filter(|(name, _)| name.contains(&only)) {
        for family in [Family::Easy, Family::Medium, Family::Hard] {
            let scores: Vec<Option<(f64, f64)>> = (0..cases)
                .into_par_iter()
                .map(|index| score(family, seed, index, &params))
                .collect();
            let found: Vec<(f64, f64)> = scores.iter().flatten().copied().collect();
            let right = found.iter().filter(|(_, hausdorff)| *hausdorff < RIGHT_PX).count();
            let median = |values: Vec<f64>| quantile(&values, 0.5).unwrap_or(f64::NAN);
            println!(
                "| {name} | {family} | {:.2} | {:.3} | {:.2} |",
                right as f64 / cases as f64,
                median(found.iter().map(|s| s.0).collect()),
                median(found.iter().map(|s| s.1).collect()),
            );
        }
    }
}

fn variants() -> Vec<(&'static str, Params)> {
    let ours = Params::new(InputKind::Mask, Method::Accurate);
    let with = |change: fn(&mut RobustParams)| {
        let mut params = ours.clone();
        change(&mut params.robust);
        params
    };
    vec![
        ("nothing (accurate mode)", ours.clone()),
        ("other walks: the cheapest of each view only", with(|r| r.walks.walks = 1)),
        (
            "judging: the best proposal is taken",
            with(|r| {
                r.max_fits = 1;
                r.finalists = 1;
                r.repaired = 0;
            }),
        ),
        ("convergence before the last choice", with(|r| r.finalists = 1)),
        ("likelihood: the best score is taken", with(|r| r.contenders = 0.0)),
        ("exchanged stretches and other ways", with(|r| r.exchange = false)),
        ("repair of ends and uncovered outline", with(|r| r.repaired = 0)),
        ("turned looks in doubt", with(|r| r.turned = false)),
        ("a second look in doubt", with(|r| r.second_look = SecondLook::Never)),
        ("the walks' own cost in the choice", with(|r| r.walk_weight = 0.0)),
        ("angles in the proposals", with(|r| r.propose.energy_weight = 0.0)),
        ("everything (paper mode)", Params::new(InputKind::Mask, Method::Paper)),
    ]
}

/// Overall and Hausdorff distance; `None` if no curve came out.
fn score(family: Family, seed: u64, index: u64, params: &Params) -> Option<(f64, f64)> {
    let case = generate(family, seed, index, &CaseOptions::default()).unwrap();
    let truth = case.truth.clone();
    let curve = reconstruct(&ViewPair::from(case), params).ok()?;
    let scores = curve_scores(&curve.positions(), &truth, 0.5).ok()?;
    Some((scores.overall, scores.hausdorff))
}
