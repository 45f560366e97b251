//! How well `accurate` mode does on rings.
//!
//! `cargo run --release -p accurate3d --example ring_study -- [rings] [seed]` prints a line for exact
//! points, whole pixels and masks: how many rings are right (Hausdorff distance below 5 px), the
//! mean and the largest distance of those, and how many of the wrong and of the right ones are doubted.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

#[path = "../tests/support/rings.rs"]
mod rings;

use rayon::prelude::*;
use rings::{Ring, Shown, reconstruct_ring, ring_pair};

const PX_PER_UNIT: f64 = 1.2;
const WRONG_PX: f64 = 5.0;

fn main() {
    let mut args = std::env::args().skip(1);
    let count: u64 = args.next().map_or(100, |a| a.parse().expect("number of rings"));
    let seed: u64 = args.next().map_or(1000, |a| a.parse().expect("seed"));
    println!("shown   right  mean px  largest px  wrong and doubted  right but doubted  failed");
    for shown in [Shown::Exact, Shown::Whole, Shown::Masks] {
        let all: Vec<_> = (0..count)
            .into_par_iter()
            .map(|index| {
                let ring = Ring::generate(seed, index);
                let found = reconstruct_ring(&ring_pair(&ring, index, shown)).ok()?;
                let scores = ring.scores(&found.positions());
                let px = [scores.overall, scores.hausdorff].map(|d| d * PX_PER_UNIT);
                Some((px, !found.diagnostics.suspicions.is_empty()))
            })
            .collect();
        let (right, wrong): (Vec<_>, Vec<_>) =
            all.iter().flatten().partition(|([_, largest], _)| *largest < WRONG_PX);
        let doubted = |list: &[([f64; 2], bool)]| list.iter().filter(|(_, doubt)| *doubt).count();
        println!(
            "{:6} {:3}/{:3} {:8.4} {:11.3} {:13}/{:3} {:15}/{:3} {:7}",
            format!("{shown:?}"),
            right.len(),
            count,
            right.iter().map(|(px, _)| px[0]).sum::<f64>() / right.len() as f64,
            right.iter().map(|(px, _)| px[1]).fold(0.0, f64::max),
            doubted(&wrong),
            wrong.len(),
            doubted(&right),
            right.len(),
            all.iter().filter(|found| found.is_none()).count(),
        );
    }
}
