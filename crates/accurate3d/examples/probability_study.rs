//! What the probability map adds to its mask in `accurate` mode: every pair is reconstructed twice,
//! strays left out, with the fit judged by the mask alone and by the map.
//!
//! On maps that were damaged on purpose (no network needed):
//! `cargo run -p accurate3d --example probability_study -- damaged medium 1000 20 [--calibrate]`.
//! On a network's maps: `... -- folder DIR [--calibrate]`, where DIR holds what
//! `accurate synth FAMILY --xray -o DIR` wrote, and in each `case_*` the folder `segmentation` of
//! `accurate segment case_*/images/*.png -o case_*/segmentation`.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::Path;

use accurate3d::eval::{curve_scores, table_scores};
use accurate3d::fit::CalibrationPriors;
use accurate3d::geom::Point3;
use accurate3d::io::{PairParts, Truth, find_pairs, read_grey, read_pair};
use accurate3d::seg::PostProcessing;
use accurate3d::synth::{
    CalibrationError, CaseOptions, Family, ProbabilityDamage, damaged_probabilities, generate,
};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};
use ndarray::Array2;
use rayon::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let calibrate = args.iter().any(|a| a == "--calibrate");
    let plain: Vec<&str> =
        args.iter().map(String::as_str).filter(|a| !a.starts_with("--")).collect();
    let pairs = match plain.as_slice() {
        ["damaged", family, seed, cases] => {
            damaged(family.parse()?, seed.parse()?, cases.parse()?, calibrate)?
        }
        ["folder", dir] => folder(Path::new(dir))?,
        _ => return Err("give `damaged FAMILY SEED CASES` or `folder DIR`".into()),
    };
    let scored: Vec<[Score; 2]> = pairs
        .par_iter()
        .map(|pair| [false, true].map(|by_map| Score::of(pair, by_map, calibrate)))
        .collect();
    for (pair, [mask, map]) in pairs.iter().zip(&scored) {
        println!("{:<18} mask {mask}   map {map}", pair.id);
    }
    for (name, which) in [("mask", 0), ("map", 1)] {
        println!("{name:>4}: {}", summary(scored.iter().map(|both| &both[which])));
    }
    Ok(())
}

fn damaged(
    family: Family,
    seed: u64,
    cases: u64,
    calibrate: bool,
) -> Result<Vec<ViewPair>, Box<dyn Error>> {
    let calibration_error =
        calibrate.then_some(CalibrationError { rotation_deg: 0.03, shift_px: 0.3 });
    let options = CaseOptions { calibration_error, ..CaseOptions::default() };
    (0..cases)
        .map(|index| {
            let case = generate(family, seed, index, &options)?;
            let maps = damaged_probabilities(&case, seed, &ProbabilityDamage::USUAL);
            segmented(ViewPair::from(case), maps)
        })
        .collect()
}

fn folder(dir: &Path) -> Result<Vec<ViewPair>, Box<dyn Error>> {
    let parts = PairParts { points: false, masks: false, images: true, truth: Truth::Required };
    find_pairs(dir)?
        .iter()
        .map(|case| {
            let map = |view: &str| {
                let file = case.join(format!("segmentation/view_{view}_probability.png"));
                Ok::<_, Box<dyn Error>>(read_grey(&file)?.values.mapv(|v| v / 65_535.0))
            };
            let mut pair = ViewPair::from(read_pair(case, parts)?);
            pair.id =
                case.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            segmented(pair, [map("L")?, map("R")?])
        })
        .collect()
}

fn segmented(mut pair: ViewPair, maps: [Array2<f32>; 2]) -> Result<ViewPair, Box<dyn Error>> {
    let mask = |map: &Array2<f32>| PostProcessing::DEFAULT.mask_of(map);
    pair.masks = Some([mask(&maps[0])?.into_array(), mask(&maps[1])?.into_array()]);
    pair.probabilities = Some(maps);
    Ok(pair)
}

/// Overall, Max and Hausdorff distance (world units, px), and chi per point; or why there is none.
struct Score(Result<[f64; 4], String>);

impl Score {
    fn of(pair: &ViewPair, by_probability: bool, calibrate: bool) -> Self {
        let mut params = Params::new(InputKind::Image, Method::Accurate);
        params.robust.by_probability = by_probability;
        params.robust.calibration = calibrate.then_some(CalibrationPriors::DEFAULT);
        let score = || -> Result<[f64; 4], Box<dyn Error>> {
            let truth = pair.truth.as_deref().ok_or("no truth")?;
            let result = reconstruct(pair, &params)?;
            let table = table_scores(&result.positions(), truth)?;
            let unit_per_px = unit_per_px(pair, truth);
            let curve = curve_scores(&result.positions(), truth, 0.5 * unit_per_px)?;
            let chi = result.explanation.candidates.first().map_or(f64::NAN, |c| c.chi_per_point);
            Ok([table.overall, table.max_error, curve.hausdorff / unit_per_px, chi])
        };
        Self(score().map_err(|e| e.to_string()))
    }
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.0 {
            Ok([overall, max, hausdorff, chi]) => {
                write!(f, "{overall:8.4} {max:8.4} {hausdorff:7.2} px chi {chi:.3}")
            }
            Err(reason) => write!(f, "failed: {reason}"),
        }
    }
}

fn unit_per_px(pair: &ViewPair, truth: &[Point3]) -> f64 {
    let camera = pair.rig.camera1();
    camera.depth(&truth[truth.len() / 2]) / camera.k()[(0, 0)].abs()
}

fn summary<'s>(scores: impl Iterator<Item = &'s Score>) -> String {
    let (found, failed): (Vec<&Score>, Vec<&Score>) = scores.partition(|s| s.0.is_ok());
    let values: Vec<[f64; 4]> = found.iter().filter_map(|s| s.0.clone().ok()).collect();
    if values.is_empty() {
        return format!("all {} failed", failed.len());
    }
    let n = values.len() as f64;
    let mean = |k: usize| values.iter().map(|v| v[k]).sum::<f64>() / n;
    let mut hausdorff: Vec<f64> = values.iter().map(|v| v[2]).collect();
    hausdorff.sort_by(f64::total_cmp);
    format!(
        "Overall {:.4}, Max {:.4}, Hausdorff median {:.2} px, {} of {} below 5 px, {} failed",
        mean(0),
        mean(1),
        hausdorff[hausdorff.len() / 2],
        hausdorff.iter().filter(|h| **h < 5.0).count(),
        values.len() + failed.len(),
        failed.len()
    )
}
