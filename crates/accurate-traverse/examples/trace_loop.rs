//! Orders the pixels of a wire that crosses itself, given in raster order.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::time::Instant;

use accurate_geom::{Pixel, View1};
use accurate_traverse::{TraverseError, TraverseParams, endpoints, trace_single};

fn main() -> Result<(), TraverseError> {
    // A loop on a long lead, sampled densely and rounded to pixels.
    let mut curve: Vec<(i32, i32)> = Vec::new();
    for k in 0..40_000 {
        let s = f64::from(k) / 40_000.0 * 3.0 - 1.5;
        let x = 256.0 + 300.0 * (s.powi(3) - s);
        let y = 400.0 - 240.0 * s * s + 40.0 * s;
        let pixel = (y.round() as i32, x.round() as i32);
        if curve.last() == Some(&pixel) {
            continue;
        }
        // One pixel wide: a corner between two diagonal neighbours is not needed.
        if let [.., before, _] = curve[..]
            && pixel.0.abs_diff(before.0).max(pixel.1.abs_diff(before.1)) == 1
        {
            curve.pop();
        }
        curve.push(pixel);
    }
    let mut pixels = curve;
    pixels.sort_unstable();
    pixels.dedup();
    let skeleton: Vec<Pixel<View1>> =
        pixels.iter().map(|&(y, x)| Pixel::new(x.into(), y.into())).collect();

    let ends = endpoints(&skeleton)?;
    let start = Instant::now();
    let trace = trace_single(&skeleton, &TraverseParams::PAPER)?;
    let elapsed = start.elapsed();
    println!(
        "{} pixels, {} endpoints: {} in order over {:.0} px in {:.2} ms",
        skeleton.len(),
        ends.len(),
        trace.points.len(),
        trace.length_px(),
        elapsed.as_secs_f64() * 1e3
    );
    println!(
        "coverage {:.1} %, {} left, {} jumps, {} gaps",
        100.0 * trace.coverage,
        trace.left,
        trace.jumps.len(),
        trace.gaps.len()
    );
    Ok(())
}
