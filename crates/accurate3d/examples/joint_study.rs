//! How well `accurate` does on generated masks, case by case, beside a fit that starts from the truth:
//! `cargo run -p accurate3d --example joint_study -- hard 1000 24 [--discs 1] [--turn 0.05] [--shift 0.3] [--nuisance] [--always]`.
//!
//! Every line shows what the method says about itself (un, off, chi per point, margin, mean epipolar
//! distance) and what the truth says (Hausdorff in px, Overall and Max of the table in world units).
//! `L` is how unlikely the curve is, as finalists are compared, `oracle` the same of the fit that starts
//! from the truth: a right curve that is likelier was not found by the search, one that is less likely was
//! passed over for what was taken. What that fit is off itself no search can mend: the outlines do not show
//! it. It is summed up last, under the given cameras.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::str::FromStr;
use std::time::Instant;

use accurate3d::eval::{curve_scores, table_scores};
use accurate3d::fit::{
    AdaptiveParams, CalibrationPriors, Outline, OutlineFitParams, OutlinePair,
    fit_outlines_adaptively,
};
use accurate3d::geom::{Curve3, Point3, Rig, View1, View2};
use accurate3d::synth::{CalibrationError, CaseOptions, Family, generate};
use accurate3d::{InputKind, Method, Params, SecondLook, ViewPair, reconstruct};
use ndarray::Array2;
use rayon::prelude::*;

/// Weights by which finalists are compared (`robust/score.rs`), the walks' cost and the forgiven cut faces
/// aside.
const SURPRISE_PER_SCORE: f64 = 12.0;
const MISFIT: f64 = 2.0;

struct Line {
    text: String,
    hausdorff_px: f64,
    overall_px: f64,
    table: [f64; 2],
    seconds: f64,
    suspect: bool,
    /// Hausdorff distance, px and world units, and Overall of the table of the fit from the truth.
    from_truth: Option<[f64; 3]>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (options_from, quiet) =
        (args.iter().position(|a| a.starts_with("--")), has(&args, "--quiet"));
    let plain = &args[..options_from.unwrap_or(args.len())];
    let [family, seed, cases, ..] = plain else {
        return Err("give a family, a seed and a number of cases".into());
    };
    let (family, seed, cases) = (Family::from_str(family)?, seed.parse()?, cases.parse::<u64>()?);
    let from = plain.get(3).map_or(Ok(0), |first| first.parse::<u64>())?;
    let discs = number(&args, "--discs")?.unwrap_or(0.0) as u32;
    let (turn, shift) = (number(&args, "--turn")?, number(&args, "--shift")?);
    let options = CaseOptions {
        occlusion_discs: discs.min(1)..=discs,
        calibration_error: (turn.is_some() || shift.is_some()).then(|| CalibrationError {
            rotation_deg: turn.unwrap_or(0.0),
            shift_px: shift.unwrap_or(0.0),
        }),
        ..CaseOptions::default()
    };
    let (nuisance, always) = (has(&args, "--nuisance"), has(&args, "--always"));
    let lines: Vec<Line> = (from..from + cases)
        .into_par_iter()
        .map(|index| {
            study(family, seed, index, &options, nuisance, always)
                .map_err(|e| format!("{index}: {e}"))
        })
        .collect::<Result<_, _>>()?;
    if !quiet {
        lines.iter().for_each(|line| println!("{}", line.text));
    }
    summary(&lines);
    Ok(())
}

fn has(args: &[String], name: &str) -> bool {
    args.iter().any(|a| a == name)
}

fn number(args: &[String], name: &str) -> Result<Option<f64>, Box<dyn Error>> {
    let value = args.iter().position(|a| a == name).and_then(|at| args.get(at + 1));
    Ok(value.map(|v| v.parse()).transpose()?)
}

fn study(
    family: Family,
    seed: u64,
    index: u64,
    options: &CaseOptions,
    nuisance: bool,
    always: bool,
) -> Result<Line, Box<dyn Error + Send + Sync>> {
    let case = generate(family, seed, index, options)?;
    let (rig, truth) = (case.rig.clone(), case.truth.clone());
    let [mask1, mask2] = case.masks.clone();
    let pair = ViewPair::from(case);
    let clock = Instant::now();
    let mut params = Params::new(InputKind::Mask, Method::Accurate);
    params.robust.calibration = nuisance.then_some(CalibrationPriors::DEFAULT);
    if always {
        params.robust.second_look = SecondLook::Always;
    }
    let found = reconstruct(&pair, &params)?;
    let seconds = clock.elapsed().as_secs_f64();

    let curve = found.positions();
    let unit_per_px = world_per_px(&rig, &truth);
    let scores = curve_scores(&curve, &truth, 0.5 * unit_per_px)?;
    let table = table_scores(&curve, &truth)?;
    let (one, two) =
        (Outline::<View1>::from_mask(mask1.view())?, Outline::<View2>::from_mask(mask2.view())?);
    let outlines = OutlinePair::new(&one, &two);
    let fitted = |points: &[Point3]| {
        let sparse: Vec<_> = points.iter().step_by(5).copied().collect();
        Curve3::interpolate(&sparse).ok()
    };
    let unlikeliness = |points: &[Point3]| {
        let start = fitted(points)?;
        let likeliness = |settings: &OutlineFitParams| {
            let adaptive = AdaptiveParams::DEFAULT;
            let fit = fit_outlines_adaptively(&start, &outlines, &rig, settings, &adaptive).ok()?;
            let judgement = fit.judgement;
            let misfit = judgement.unexplained + judgement.outside;
            Some((fit.surprise? / SURPRISE_PER_SCORE + MISFIT * misfit, judgement, fit.curve))
        };
        let fits =
            [OutlineFitParams::DEFAULT, OutlineFitParams::FINE].iter().filter_map(likeliness);
        fits.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let own = unlikeliness(&curve).map_or(f64::NAN, |(own, ..)| own);
    let from_truth = unlikeliness(&truth);
    let oracle = from_truth.as_ref().map_or_else(
        || "none".to_owned(),
        |(truth, j, _)| {
            let (un, off, chi) = (j.unexplained, j.outside, j.chi_per_point());
            format!("{truth:7.2} un {un:.2} off {off:.2} {chi:.4}")
        },
    );

    let from_truth = from_truth
        .map(|(.., fitted)| -> Result<_, Box<dyn Error + Send + Sync>> {
            let points = fitted.sample(curve.len());
            let hausdorff = curve_scores(&points, &truth, 0.5 * unit_per_px)?.hausdorff;
            Ok([hausdorff / unit_per_px, hausdorff, table_scores(&points, &truth)?.overall])
        })
        .transpose()?;

    let d = &found.diagnostics;
    let o = d.outline.ok_or("no outline diagnostics")?;
    let hausdorff_px = scores.hausdorff / unit_per_px;
    let suspect = !d.suspicions.is_empty();
    let text = format!(
        "{index:3} {:6.0} ms fits {:3} un {:6.2} off {:6.2} chi {:.4} margin {:7.2} dist {:5.2} cov {:.3} {:.3} | H {hausdorff_px:6.2} px overall {:.3} px table {:.3} {:.2} | L {own:7.2} oracle {oracle}{}{}",
        1e3 * seconds,
        o.fits,
        o.unexplained,
        o.outside,
        o.chi_per_point,
        o.margin.unwrap_or(f64::INFINITY),
        d.mean_epipolar_distance_px,
        d.trace_coverage[0],
        d.trace_coverage[1],
        scores.overall / unit_per_px,
        table.overall,
        table.max_error,
        if hausdorff_px > 5.0 { " WRONG" } else { "" },
        if suspect { format!(" suspect {:?}", d.suspicions) } else { String::new() },
    );
    let text = if hausdorff_px > 3.0 {
        format!(
            "{text}\n      truth {}\n      curve {}",
            farthest(&truth, &curve, &rig, [&mask1, &mask2], unit_per_px)?,
            farthest(&curve, &truth, &rig, [&mask1, &mask2], unit_per_px)?
        )
    } else {
        text
    };
    Ok(Line {
        text,
        hausdorff_px,
        overall_px: scores.overall / unit_per_px,
        table: [table.overall, table.max_error],
        seconds,
        suspect,
        from_truth,
    })
}

/// Where `from` is farthest from `to`: part of its length, distance, and what each view shows there.
fn farthest(
    from: &[Point3],
    to: &[Point3],
    rig: &Rig,
    masks: [&Array2<bool>; 2],
    unit_per_px: f64,
) -> Result<String, Box<dyn Error + Send + Sync>> {
    let nearest = |p: &Point3| to.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
    let (k, distance) = from
        .iter()
        .map(nearest)
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .ok_or("an empty curve")?;
    let mut text =
        format!("at {:.3}: {:.2} px", k as f64 / from.len() as f64, distance / unit_per_px);
    for (camera, mask) in [rig.camera1(), rig.camera2()].into_iter().zip(masks) {
        let p = camera.project(&from[k])?;
        let shown = mask.get([p.y.round() as usize, p.x.round() as usize]) == Some(&true);
        text += &format!(", ({:.0}, {:.0}) {}", p.x, p.y, if shown { "seen" } else { "hidden" });
    }
    Ok(text)
}

fn world_per_px(rig: &Rig, truth: &[Point3]) -> f64 {
    let depth = |camera: &accurate3d::geom::Camera| {
        let sum: f64 = truth.iter().map(|p| camera.depth(p)).sum();
        sum / truth.len() as f64 / camera.k()[(0, 0)].abs()
    };
    (depth(rig.camera1()) + depth(rig.camera2())) / 2.0
}

fn summary(lines: &[Line]) {
    let n = lines.len() as f64;
    let quantile = |value: fn(&Line) -> f64, q: f64| {
        let mut values: Vec<f64> = lines.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values[((values.len() - 1) as f64 * q).round() as usize]
    };
    let mean = |value: fn(&Line) -> f64| lines.iter().map(value).sum::<f64>() / n;
    let below = |px: f64| lines.iter().filter(|l| l.hausdorff_px < px).count() as f64 / n;
    println!(
        "n {n} below 5/2/1 px {:.3} {:.3} {:.3} | Hausdorff px median {:.2} p95 {:.2} | Overall px median {:.3} | table Overall mean {:.4} Max mean {:.3} | ms median {:.0} p95 {:.0}",
        below(5.0),
        below(2.0),
        below(1.0),
        quantile(|l| l.hausdorff_px, 0.5),
        quantile(|l| l.hausdorff_px, 0.95),
        quantile(|l| l.overall_px, 0.5),
        mean(|l| l.table[0]),
        mean(|l| l.table[1]),
        1e3 * quantile(|l| l.seconds, 0.5),
        1e3 * quantile(|l| l.seconds, 0.95),
    );
    let wrong = lines.iter().filter(|l| l.hausdorff_px > 5.0).count();
    let (missed, alarms) = (
        lines.iter().filter(|l| l.hausdorff_px > 5.0 && !l.suspect).count(),
        lines.iter().filter(|l| l.hausdorff_px <= 5.0 && l.suspect).count(),
    );
    let mut floors: Vec<[f64; 3]> = lines.iter().filter_map(|l| l.from_truth).collect();
    floors.sort_by(|a, b| a[1].total_cmp(&b[1]));
    if let Some(largest) =
        floors.get((floors.len().saturating_sub(1) as f64 * 0.95).round() as usize)
    {
        println!(
            "fit from the truth: {} of {} wrong | Hausdorff p95 {:.2} px {:.3} world | table Overall mean {:.4}",
            floors.iter().filter(|f| f[0] > 5.0).count(),
            floors.len(),
            largest[0],
            largest[1],
            floors.iter().map(|f| f[2]).sum::<f64>() / floors.len() as f64,
        );
    }
    println!("wrong {wrong}, of these not flagged {missed}; right but flagged {alarms}");
}
