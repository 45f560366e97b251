//! Reads a pair folder and reconstructs it:
//! `cargo run -p accurate3d --example reconstruct_sample -- datasets/samples/loop`.
#![allow(clippy::print_stdout)]

use std::path::Path;

use accurate3d::io::{PairParts, Truth, read_pair};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let dir = std::env::args().nth(1).ok_or("give a pair folder")?;
    let parts = PairParts { masks: true, truth: Truth::IfPresent, ..PairParts::default() };
    let pair = ViewPair::from(read_pair(Path::new(&dir), parts)?);
    let curve = reconstruct(&pair, &Params::new(InputKind::Mask, Method::Paper))?;
    println!(
        "{}: {} points, {:.1} {}, mean epipolar distance {:.2} px",
        curve.id,
        curve.points.len(),
        curve.length(),
        curve.unit,
        curve.diagnostics.mean_epipolar_distance_px
    );
    if let Some(truth) = &pair.truth {
        let scores = accurate3d::eval::table_scores(&curve.positions(), truth)?;
        println!("Overall {:.3}, Max Err {:.3}", scores.overall, scores.max_error);
    }
    Ok(())
}
