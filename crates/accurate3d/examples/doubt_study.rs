//! What tells wrong reconstructions from right ones, before the truth is known.
//!
//! `doubt_study run SCENE SEED CASES >> FILE` reconstructs generated masks and writes one line of JSON a
//! case: the evidence, the true Hausdorff distance in px and the seconds taken. Scenes: `easy`, `medium`,
//! `hard`, `carm`, `sim-paper`, `helix`; `medium-discs`; `medium-turned` by 0.05 degrees and `carm-off` by
//! 0.03 degrees and 0.3 px, both with the calibration estimated.
//!
//! `doubt_study limits FILE...` tries limits of doubt on such lines: for every number of wrong ones (beyond
//! 5 px) that any limits flag, those that flag the fewest right ones.
#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::error::Error;
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

use accurate3d::eval::curve_scores;
use accurate3d::fit::CalibrationPriors;
use accurate3d::geom::{Camera, Point3, Rig};
use accurate3d::synth::{CalibrationError, CaseOptions, Family, generate};
use accurate3d::{DoubtLimits, Evidence, InputKind, Method, Params, ViewPair, reconstruct};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

type Failure = Box<dyn Error + Send + Sync>;

const WRONG_PX: f64 = 5.0;

#[derive(Serialize, Deserialize)]
struct Line {
    scene: String,
    seed: u64,
    index: u64,
    hausdorff_px: f64,
    seconds: f64,
    evidence: Evidence,
}

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["run", scene, seed, cases] => run(scene, seed.parse()?, cases.parse()?),
        ["limits", ref files @ ..] if !files.is_empty() => limits(files),
        _ => Err("run SCENE SEED CASES, or limits FILE...".into()),
    }
}

fn run(scene: &str, seed: u64, cases: u64) -> Result<(), Failure> {
    let (family, discs, off) = match scene {
        "medium-discs" => (Family::Medium, 2, None),
        "medium-turned" => (Family::Medium, 0, Some((0.05, 0.0))),
        "carm-off" => (Family::Carm, 0, Some((0.03, 0.3))),
        name => (Family::from_str(name)?, 0, None),
    };
    let options = CaseOptions {
        occlusion_discs: discs.min(1)..=discs,
        calibration_error: off
            .map(|(rotation_deg, shift_px)| CalibrationError { rotation_deg, shift_px }),
        ..CaseOptions::default()
    };
    let lines: Vec<String> = (0..cases)
        .into_par_iter()
        .map(|index| {
            let case = generate(family, seed, index, &options)?;
            let (rig, truth) = (case.rig.clone(), case.truth.clone());
            let mut params = Params::new(InputKind::Mask, Method::Accurate);
            params.robust.calibration = off.map(|_| CalibrationPriors::DEFAULT);
            let begin = seconds();
            let found = reconstruct(&ViewPair::from(case), &params)?;
            let seconds = seconds() - begin;
            let unit_per_px = unit_per_px(&rig, &truth);
            let scores = curve_scores(&found.positions(), &truth, 0.5 * unit_per_px)?;
            let outline = found.diagnostics.outline.ok_or("no outline diagnostics")?;
            let line = Line {
                scene: scene.to_owned(),
                seed,
                index,
                hausdorff_px: scores.hausdorff / unit_per_px,
                seconds,
                evidence: outline.evidence,
            };
            Ok(serde_json::to_string(&line)?)
        })
        .collect::<Result<_, Failure>>()?;
    lines.iter().for_each(|line| println!("{line}"));
    Ok(())
}

/// Time this thread has spent on a processor (Linux), which other programs do not lengthen; else since
/// 1970.
fn seconds() -> f64 {
    let on_cpu = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let ns = on_cpu.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    ns.map_or_else(
        || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |t| t.as_secs_f64()),
        |ns| 1e-9 * ns,
    )
}

fn unit_per_px(rig: &Rig, truth: &[Point3]) -> f64 {
    let depth = |camera: &Camera| {
        let sum: f64 = truth.iter().map(|p| camera.depth(p)).sum();
        sum / truth.len() as f64 / camera.k()[(0, 0)].abs()
    };
    (depth(rig.camera1()) + depth(rig.camera2())) / 2.0
}

fn limits(files: &[&str]) -> Result<(), Failure> {
    let mut lines: Vec<Line> = Vec::new();
    for file in files {
        for text in std::fs::read_to_string(file)?.lines() {
            lines.push(serde_json::from_str(text)?);
        }
    }
    let count = |limits: &DoubtLimits, wrong: bool| {
        let these = lines.iter().filter(|line| (line.hausdorff_px > WRONG_PX) == wrong);
        these.filter(|line| !line.evidence.suspicions(limits).is_empty()).count()
    };
    let wrong = lines.iter().filter(|line| line.hausdorff_px > WRONG_PX).count();
    println!("{} cases, {wrong} wrong", lines.len());
    println!("wrong flagged, right flagged, limits");
    let mut best: BTreeMap<usize, (usize, DoubtLimits)> = BTreeMap::new();
    for limits in grid() {
        let (flagged, alarms) = (count(&limits, true), count(&limits, false));
        let known = best.entry(flagged).or_insert((alarms, limits));
        if alarms < known.0 {
            *known = (alarms, limits);
        }
    }
    for (flagged, (alarms, limits)) in best {
        println!("{flagged:4} {alarms:4} {limits:?}");
    }
    for limits in [DoubtLimits::MASKS, DoubtLimits::MAPS] {
        println!("{:4} {:4} {limits:?} (as it is)", count(&limits, true), count(&limits, false));
    }
    Ok(())
}

fn grid() -> impl Iterator<Item = DoubtLimits> {
    let unexplained = [0.03, 0.04, 0.06, 0.08, 0.12, 0.2];
    let each = unexplained.into_iter().flat_map(|unexplained| {
        [0.5, 0.6, 0.7, 1.0].map(|unexplained_at_bridges| DoubtLimits {
            unexplained,
            unexplained_at_bridges,
            ..DoubtLimits::MASKS
        })
    });
    let each = each.flat_map(|limits| {
        [0.066, 0.068, 0.072, 0.08]
            .map(|chi_per_point_px2| DoubtLimits { chi_per_point_px2, ..limits })
    });
    let each = each.flat_map(|limits| {
        [1.0, 1.5, 2.0, 2.5, 3.0, 4.0].map(|margin| DoubtLimits { margin, ..limits })
    });
    each.flat_map(|limits| {
        [1.1, 1.2, 1.3, 1.5, 1.7, 1.9].map(|sigma_px| DoubtLimits { sigma_px, ..limits })
    })
}
