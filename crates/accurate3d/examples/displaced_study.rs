//! How often the doctor finds by curves that pixels are not those that the cameras hold for: a lens
//! left in, a picture moved, and nothing done, in many random rigs with twelve wires each.
//!
//! `cargo run --release -p accurate3d --example displaced_study -- [RIGS] [SEED]`
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

#[path = "../tests/support/displaced_wires.rs"]
mod displaced_wires;
#[path = "../tests/support/mistaken_rigs.rs"]
#[allow(dead_code)] // The mistakes are for another study.
mod mistaken_rigs;

use accurate3d::doctor::Mistake;
use displaced_wires::{Done, Outcome, outcomes};
use rayon::prelude::*;

fn main() {
    let number = |at: usize, default: u64| {
        std::env::args().nth(at).map_or(default, |word| word.parse().expect("a number"))
    };
    let (rigs, seed) = (number(1, 50), number(2, 1000));
    let all: Vec<(u64, Outcome)> = (0..rigs)
        .into_par_iter()
        .flat_map_iter(|index| outcomes(seed, index).into_iter().map(move |o| (index, o)))
        .collect();
    println!("{rigs} rigs of twelve wires, seed {seed}");
    println!("done      made  shows  said  named");
    for (name, is) in [
        ("lens", (|d| matches!(d, Done::Lens(..))) as fn(&Done) -> bool),
        ("moved", |d| matches!(d, Done::Moved(..))),
    ] {
        let made: Vec<_> = all.iter().filter(|(_, o)| is(&o.done)).collect();
        let shows: Vec<_> = made.iter().filter(|(_, o)| o.shows()).collect();
        let count = |f: fn(&Outcome) -> bool| shows.iter().filter(|(_, o)| f(o)).count();
        println!(
            "{name:<8} {:>5}  {:>5} {:>5}  {:>5}",
            made.len(),
            shows.len(),
            count(said),
            count(Outcome::named)
        );
        for (index, o) in shows.iter().filter(|(_, o)| !said(o)).take(8) {
            println!(
                "    rig {index}: {:?}, {:.1} px, {} places, {:?}",
                o.done, o.off_px, o.turning_places, o.told.findings
            );
        }
    }
    let sound: Vec<_> = all.iter().filter(|(_, o)| o.done == Done::Nothing).collect();
    let alarms: Vec<_> = sound.iter().filter(|(_, o)| o.alarm()).collect();
    println!("nothing  {:>5}; alarms {}", sound.len(), alarms.len());
    for (index, o) in alarms.iter().take(8) {
        println!(
            "    rig {index}: {:?} {} {:?}",
            o.told.verdict, o.turning_places, o.told.findings
        );
    }
}

/// Whether at least it is said that these are not the pixels that the cameras hold for.
fn said(outcome: &Outcome) -> bool {
    outcome
        .told
        .findings
        .iter()
        .any(|f| matches!(f.mistake, Mistake::LensNotRemoved { .. } | Mistake::PixelsDisplaced(_)))
}
