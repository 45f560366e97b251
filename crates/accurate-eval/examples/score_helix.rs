//! Scores a noisy, coarsely sampled helix against the exact one, over a few cases.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::time::Instant;

use accurate_eval::{
    DEFAULT_RESAMPLES, Dataset, EvalError, bootstrap_mean, curve_scores, published, table_scores,
};
use accurate_geom::Point3;

fn helix(points: usize, wobble_mm: f64, phase: f64) -> Vec<Point3> {
    (0..points)
        .map(|k| {
            let t = k as f64 / (points - 1) as f64;
            let angle = 12.0 * t;
            let radius = 15.0 + wobble_mm * (900.0 * t + phase).sin();
            Point3::new(radius * angle.cos(), radius * angle.sin(), 60.0 * t)
        })
        .collect()
}

fn main() -> Result<(), EvalError> {
    let truth = helix(2000, 0.0, 0.0);
    let found = helix(3000, 0.2, 0.0);

    let start = Instant::now();
    let table = table_scores(&found, &truth)?;
    let table_ms = start.elapsed().as_secs_f64() * 1e3;
    let start = Instant::now();
    let curve = curve_scores(&found, &truth, 0.1)?;
    let curve_ms = start.elapsed().as_secs_f64() * 1e3;
    println!("point sets ({table_ms:.1} ms): {table:?}");
    println!("curves ({curve_ms:.1} ms): {curve:?}");

    let overalls = (0..12)
        .map(|k| {
            Ok(table_scores(&helix(3000, 0.1 + 0.02 * f64::from(k), f64::from(k)), &truth)?.overall)
        })
        .collect::<Result<Vec<_>, EvalError>>()?;
    let overall = bootstrap_mean(&overalls, DEFAULT_RESAMPLES, "example/helix/overall")?;
    println!(
        "overall {:.4} mm [{:.4}, {:.4}], n = {}",
        overall.mean, overall.low, overall.high, overall.n
    );
    if let Some(row) = published("ours-points", Dataset::Phantom) {
        println!(
            "the paper's phantom, ordered points: {:.4} {}",
            row.scores.overall,
            row.dataset.unit()
        );
    }
    Ok(())
}
