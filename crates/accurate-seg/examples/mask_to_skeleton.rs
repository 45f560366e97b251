//! Draws a winding wire 3.2 px thick that crosses itself, thins it and prints both as text.
//!
//! ```console
//! $ cargo run -p accurate-seg --example mask_to_skeleton
//! ```
#![allow(clippy::print_stdout)]

use accurate_seg::{Mask, SegError, Skeleton, median_width_px};
use ndarray::Array2;

fn main() -> Result<(), SegError> {
    // A wire that runs to the right and turns back on itself twice.
    let centreline: Vec<(f64, f64)> = (0..=600)
        .map(|k| f64::from(k) / 600.0)
        .map(|t| (8.0 + 56.0 * t - 13.0 * (14.0 * t).sin(), 12.5 - 10.0 * (14.0 * t).cos()))
        .collect();
    let near = |row: usize, col: usize| {
        let distance = |&(x, y): &(f64, f64)| (x - col as f64).hypot(y - row as f64);
        centreline.iter().any(|point| distance(point) <= 1.6)
    };
    let mask = Mask::from_array(Array2::from_shape_fn((26, 72), |(row, col)| near(row, col)))?;
    let skeleton = Skeleton::of(&mask)?;

    println!("{mask}\n{}", skeleton.mask());
    println!(
        "{} px of skeleton, ends {:?}, {} junctions, median width {:.1} px",
        skeleton.pixels().len(),
        skeleton.endpoints(),
        skeleton.junctions()?.len(),
        median_width_px(&mask)?
    );
    Ok(())
}
