//! How well `accurate` mode does on ordered points, beside the paper's, and whether its covariances
//! hold what they say.
//!
//! `cargo run --release -p accurate3d --example points_study -- [cases] [seed] [exact|rounded] [families]`
//! prints one line a family: point-to-polyline distances in px at the truth's depth, both ways, and
//! how often the 95 % ellipse across the curve is passed by the truth. A case that is off by more
//! than 5 px, or was not adjusted, gets a line of its own.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

use accurate3d::eval::{CurveScores, curve_scores, quantile};
use accurate3d::geom::Point3;
use accurate3d::geom::nalgebra::{Matrix3x2, Vector3};
use accurate3d::synth::{CaseOptions, Family, SynthCase, generate};
use accurate3d::{InputKind, Method, Params, Reconstruction, ViewPair, reconstruct};
use rayon::prelude::*;

/// 95 % quantile of chi² with 2 degrees of freedom.
const CHI2_95: f64 = 5.991;
/// Every so many points are asked for their ellipse: neighbours are not independent.
const STRIDE: usize = 10;
const FAR_PX: f64 = 5.0;

struct Result {
    scores: CurveScores,
    paper: CurveScores,
    px: f64,
    covered: Option<(usize, usize)>,
}

fn main() {
    let mut args = std::env::args().skip(1);
    let cases: u64 = args.next().map_or(20, |a| a.parse().expect("number of cases"));
    let seed: u64 = args.next().map_or(1000, |a| a.parse().expect("seed"));
    let exact = args.next().is_some_and(|a| a == "exact");
    let families: Vec<Family> = args.map(|a| a.parse().expect("family")).collect();
    let families = if families.is_empty() { Family::ALL.to_vec() } else { families };
    println!(
        "family      Overall  median Max  mean Max  worst Max | paper: Overall  mean Max | 95 % ellipses"
    );
    for family in families {
        let results: Vec<Result> = (0..cases)
            .into_par_iter()
            .filter_map(|index| run(family, seed, index, exact))
            .collect();
        let all = |value: fn(&Result) -> f64| results.iter().map(value).collect::<Vec<f64>>();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let worst = all(|r| r.scores.hausdorff / r.px);
        let (inside, asked) =
            results.iter().filter_map(|r| r.covered).fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
        println!(
            "{:10} {:8.4} {:11.4} {:9.4} {:10.4} | {:14.4} {:9.4} | {:.3} of {} curves",
            family.to_string(),
            mean(&all(|r| r.scores.overall / r.px)),
            quantile(&worst, 0.5).unwrap_or(f64::NAN),
            mean(&worst),
            worst.iter().copied().fold(0.0, f64::max),
            mean(&all(|r| r.paper.overall / r.px)),
            mean(&all(|r| r.paper.hausdorff / r.px)),
            inside as f64 / asked as f64,
            results.len(),
        );
    }
}

fn run(family: Family, seed: u64, index: u64, exact: bool) -> Option<Result> {
    let case = generate(family, seed, index, &CaseOptions::default()).unwrap();
    let px = unit_per_px(&case);
    let truth = case.truth.clone();
    let points = if exact { case.exact_points.clone() } else { case.rounded_points.clone() };
    let pair = ViewPair { points: Some(points), ..ViewPair::from(case) };
    let found = |method| reconstruct(&pair, &Params::new(InputKind::Points, method));
    let ours = match found(Method::Accurate) {
        Ok(ours) => ours,
        Err(error) => {
            println!("  {error}");
            return None;
        }
    };
    let score = |r: &Reconstruction| curve_scores(&r.positions(), &truth, 0.5 * px).unwrap();
    let scores = score(&ours);
    let refused = &ours.diagnostics.not_adjusted;
    if scores.hausdorff > FAR_PX * px || refused.is_some() {
        println!("  {}: {:.2} px, {refused:?}", ours.id, scores.hausdorff / px);
    }
    let covered = covered(&ours, &truth);
    Some(Result { scores, paper: score(&found(Method::Paper).ok()?), px, covered })
}

/// Depth of the truth's middle over the focal length of view 1.
fn unit_per_px(case: &SynthCase) -> f64 {
    let camera = case.rig.camera1();
    let depth: f64 =
        case.truth.iter().map(|p| camera.depth(p)).sum::<f64>() / case.truth.len() as f64;
    depth / camera.k()[(0, 0)].abs()
}

/// Points whose ellipse across the curve the truth passes, of how many.
fn covered(found: &Reconstruction, truth: &[Point3]) -> Option<(usize, usize)> {
    let covariances = found.covariances.as_ref()?;
    let points = found.positions();
    let places: Vec<usize> =
        (STRIDE..points.len().saturating_sub(STRIDE)).step_by(STRIDE).collect();
    let inside = |&&k: &&usize| {
        let tangent = (points[k + 1] - points[k - 1]).normalize();
        let first = tangent.cross(&Vector3::ith(tangent.iamin(), 1.0)).normalize();
        let plane = Matrix3x2::from_columns(&[first, tangent.cross(&first)]);
        let spread = plane.transpose() * covariances[k] * plane;
        let off = truth
            .windows(2)
            .map(|w| {
                let e = w[1] - w[0];
                let s = ((points[k] - w[0]).dot(&e) / e.norm_squared()).clamp(0.0, 1.0);
                w[0] + e * s - points[k]
            })
            .min_by(|a, b| a.norm().total_cmp(&b.norm()))
            .unwrap_or_default();
        let off = plane.transpose() * off;
        spread.try_inverse().is_some_and(|inverse| off.dot(&(inverse * off)) <= CHI2_95)
    };
    Some((places.iter().filter(inside).count(), places.len()))
}
