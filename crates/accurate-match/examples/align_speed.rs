//! How long the alignment takes with the fast kernel and with the plain one, in turns on the same
//! curves: `cargo run --release -p accurate-match --example align_speed -- 2048`.
//!
//! Prints the median times, their ratio, and whether the answers are the same.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use std::hint::black_box;
use std::time::Instant;

use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Fundamental, Pixel, View1, View2};
use accurate_match::{CostModel, DistanceKind, TieOrder, align_curves, align_rows};

const TURNS: usize = 7;

fn main() {
    let points = std::env::args().nth(1).map_or(2048, |text| text.parse().unwrap());
    // A rectified pair: epipolar lines are rows. View 2 is sampled unevenly and half a pixel off.
    let rectified = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
    let f = Fundamental::from_matrix(rectified).unwrap();
    let at = |s: f64| (250.0 + 200.0 * (9.0 * s).cos(), 250.0 + 200.0 * (1.0 + 6.0 * s).sin());
    let along = |k: usize| k as f64 / points as f64;
    let one: Vec<Pixel<View1>> = (0..points)
        .map(|k| {
            let (x, y) = at(along(k));
            Pixel::new(x, y)
        })
        .collect();
    let two: Vec<Pixel<View2>> = (0..points)
        .map(|k| {
            let (x, y) = at(along(k) + 0.01 * (9.0 * along(k)).sin());
            Pixel::new(0.9 * x, y + 0.5 * (40.0 * along(k)).sin())
        })
        .collect();
    let ties = TieOrder::UpLeftDiagonal;
    for (name, two) in [("together", two.clone()), ("apart", two.into_iter().rev().collect())] {
        let costs = CostModel::new(&f, &one, &two, DistanceKind::View1).unwrap();
        let (mut fast, mut plain, mut same) = (Vec::new(), Vec::new(), true);
        for _ in 0..TURNS {
            let start = Instant::now();
            let a = black_box(align_curves(&costs, ties).unwrap());
            fast.push(start.elapsed().as_secs_f64() * 1e3);
            let start = Instant::now();
            let fill = |i: usize, row: &mut [f64]| costs.fill_row(i, row);
            let b = black_box(align_rows(points, points, fill, ties).unwrap());
            plain.push(start.elapsed().as_secs_f64() * 1e3);
            same &= a == b;
        }
        let median = |times: &mut Vec<f64>| {
            times.sort_by(f64::total_cmp);
            (times[TURNS / 2], times[0])
        };
        let ((fast, fast_least), (plain, plain_least)) = (median(&mut fast), median(&mut plain));
        println!(
            "{points} points, {name}: fast {fast:.2} ms (least {fast_least:.2}), plain {plain:.2} ms \
             (least {plain_least:.2}), ratio {:.1}, same answer: {same}",
            plain / fast
        );
    }
}
