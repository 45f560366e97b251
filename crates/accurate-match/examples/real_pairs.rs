//! Matches real biplane X-ray pairs, of which each camera sees a different part of the wire.
//!
//! `cargo run -p accurate-match --example real_pairs -- path/to/pairs`
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use accurate_io::{PairParts, find_pairs, read_pair};
use accurate_match::{Ecdp, FreeMatcher, PointFlag};

fn main() {
    let Some(folder) = std::env::args().nth(1) else {
        println!("usage: real_pairs FOLDER (pair folders with points/points_L.csv and _R.csv)");
        return;
    };
    println!(
        "case      points      corner to corner  free ends  left out at ends  gaps  bridged  margin"
    );
    for case in find_pairs(folder.as_ref()).unwrap() {
        let needs = PairParts { points: true, ..PairParts::default() };
        let pair = read_pair(&case, needs).unwrap();
        let (curve1, mut curve2) = pair.points.unwrap();
        let found =
            FreeMatcher::default().match_best_direction(&curve1, &curve2, &pair.rig).unwrap();
        let ends = |range: &std::ops::Range<usize>, count| {
            format!("{}+{}", range.start, count - range.end)
        };
        let left_out =
            [ends(&found.matched1, curve1.len()), ends(&found.matched2, curve2.len())].join(" / ");
        let gaps =
            found.gaps1.iter().chain(&found.gaps2).map(ExactSizeIterator::len).sum::<usize>();
        let bridged = found.flags.iter().filter(|f| **f == PointFlag::Bridged).count();
        // Corner to corner, with the direction given away.
        if found.reversed {
            curve2.reverse();
        }
        let corners = Ecdp::default().align(&curve1, &curve2, &pair.rig).unwrap().mean_cost();
        println!(
            "{} {:4} / {:4} {corners:9.2} px {:13.2} px {left_out:>17} {gaps:5} {:6.1} % {:5.2} px{}",
            pair.case_id,
            curve1.len(),
            curve2.len(),
            found.mean_epipolar_distance_px,
            100.0 * bridged as f64 / found.flags.len() as f64,
            found.margin_px.unwrap(),
            if found.reversed { " reversed" } else { "" },
        );
    }
}
