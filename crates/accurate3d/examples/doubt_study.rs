//! What tells wrong reconstructions from right ones, before the truth is known.
//!
//! `doubt_study run SCENE SEED CASES >> FILE` reconstructs generated masks and writes one line of
//! comma-separated evidence a case (`accurate3d::Evidence::terms`), with the true Hausdorff
//! distance in px and the seconds taken in front. Scenes: `easy`, `medium`, `hard`, `carm`,
//! `sim-paper`, `helix`; `medium-discs`; `medium-turned` by 0.05 degrees and `carm-off` by 0.03 degrees
//! and 0.3 px, both with the calibration estimated.
//!
//! `doubt_study fit FILE...` fits a logistic rule (ridge, all terms standardised) to such lines and
//! prints its terms, and what share of the wrong (beyond 5 px) it flags at which cost, in the sample
//! and with every tenth case left out in turn.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

use accurate3d::eval::curve_scores;
use accurate3d::fit::CalibrationPriors;
use accurate3d::geom::nalgebra::{DMatrix, DVector};
use accurate3d::geom::{Camera, Point3, Rig};
use accurate3d::synth::{CalibrationError, CaseOptions, Family, generate};
use accurate3d::{Evidence, InputKind, Method, Params, ViewPair, reconstruct};
use rayon::prelude::*;

type Failure = Box<dyn Error + Send + Sync>;

const WRONG_PX: f64 = 5.0;

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["run", scene, seed, cases] => run(scene, seed.parse()?, cases.parse()?),
        ["fit", ref files @ ..] if !files.is_empty() => fit(files),
        _ => Err("run SCENE SEED CASES, or fit FILE...".into()),
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
            let terms: Vec<String> =
                outline.evidence.terms().iter().map(|v| format!("{v:.6}")).collect();
            Ok(format!(
                "{scene},{seed},{index},{:.3},{seconds:.3},{}",
                scores.hausdorff / unit_per_px,
                terms.join(",")
            ))
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

struct Line {
    wrong: bool,
    terms: Vec<f64>,
}

fn fit(files: &[&str]) -> Result<(), Failure> {
    let mut lines = Vec::new();
    for file in files {
        for text in std::fs::read_to_string(file)?.lines() {
            let fields: Vec<&str> = text.split(',').collect();
            let number = |k: usize| -> Result<f64, Failure> { Ok(fields[k].parse()?) };
            let evidence = (5..fields.len()).map(number).collect::<Result<Vec<f64>, Failure>>()?;
            lines.push(Line { wrong: number(3)? > WRONG_PX, terms: evidence });
        }
    }
    let wrong = lines.iter().filter(|line| line.wrong).count();
    println!("{} cases, {wrong} wrong", lines.len());
    let all: Vec<&Line> = lines.iter().collect();
    let rule = logistic(&all);
    println!("constant {:.3}", rule[0]);
    for (name, weight) in Evidence::TERMS.iter().zip(&rule[1..]) {
        println!("{name:22} {weight:8.3}");
    }
    const FOLDS: usize = 10;
    let mut left_out = vec![0.0; lines.len()];
    for fold in 0..FOLDS {
        let rest: Vec<&Line> =
            lines.iter().enumerate().filter(|(k, _)| k % FOLDS != fold).map(|(_, l)| l).collect();
        let rule = logistic(&rest);
        for k in (fold..lines.len()).step_by(FOLDS) {
            left_out[k] = score(&rule, &lines[k].terms);
        }
    }
    let inside: Vec<f64> = lines.iter().map(|l| score(&rule, &l.terms)).collect();
    for (name, scores) in [("in the sample", &inside), ("left out", &left_out)] {
        println!(
            "{name}: score above, wrong flagged of {wrong}, right flagged of {}",
            lines.len() - wrong
        );
        let mut cuts: Vec<f64> =
            scores.iter().zip(&lines).filter(|(_, l)| l.wrong).map(|(s, _)| *s).collect();
        cuts.sort_by(f64::total_cmp);
        for cut in cuts.iter().take(12) {
            let flagged = |wrong: bool| {
                scores.iter().zip(&lines).filter(|(s, l)| l.wrong == wrong && *s >= cut).count()
            };
            println!("{cut:8.3} {:4} {:4}", flagged(true), flagged(false));
        }
    }
    Ok(())
}

fn score(rule: &[f64], terms: &[f64]) -> f64 {
    rule[0] + rule[1..].iter().zip(terms).map(|(w, x)| w * x).sum::<f64>()
}

/// Constant and weights of the ridge-penalised logistic regression, by Newton's method.
fn logistic(lines: &[&Line]) -> Vec<f64> {
    const RIDGE: f64 = 1.0;
    let (n, p) = (lines.len(), Evidence::TERMS.len());
    let column = |k: usize| lines.iter().map(move |l| l.terms[k]);
    let means: Vec<f64> = (0..p).map(|k| column(k).sum::<f64>() / n as f64).collect();
    let scales: Vec<f64> = (0..p)
        .map(|k| {
            let variance = column(k).map(|x| (x - means[k]).powi(2)).sum::<f64>() / n as f64;
            variance.sqrt().max(1e-9)
        })
        .collect();
    let x = DMatrix::from_fn(n, p + 1, |i, k| match k.checked_sub(1) {
        None => 1.0,
        Some(k) => (lines[i].terms[k] - means[k]) / scales[k],
    });
    let mut beta = DVector::zeros(p + 1);
    for _ in 0..30 {
        let probability = (&x * &beta).map(|z: f64| 1.0 / (1.0 + (-z).exp()));
        let missing = DVector::from_fn(n, |i, _| f64::from(lines[i].wrong) - probability[i]);
        let mut gradient = x.transpose() * missing;
        let weighted =
            DMatrix::from_fn(n, p + 1, |i, k| x[(i, k)] * probability[i] * (1.0 - probability[i]));
        let mut hessian = x.transpose() * weighted;
        for k in 1..=p {
            gradient[k] -= RIDGE * beta[k];
            hessian[(k, k)] += RIDGE;
        }
        match hessian.cholesky() {
            Some(factor) => beta += factor.solve(&gradient),
            None => break,
        }
    }
    let mut rule: Vec<f64> = beta.iter().copied().collect();
    for k in 0..p {
        rule[k + 1] /= scales[k];
        rule[0] -= rule[k + 1] * means[k];
    }
    rule
}
