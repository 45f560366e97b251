use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use accurate3d::fit::CalibrationPriors;
use accurate3d::io::{PairParts, Truth, find_pairs, hash_pair, read_pair};
use accurate3d::seg::network::NetworkSegmenter;
use accurate3d::seg::{Segmenter, unwatched};
use accurate3d::{
    InputKind, NOT_FOR_CLINICAL_USE, Params, Reconstruction, ViewPair, reconstruct, segment_images,
};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::eval::table_scores;
use super::outputs::Outputs;
use crate::args::ReconstructArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::segmentation::segmenter;

/// `accurate reconstruct`: every pair on its own; one that fails does not stop the others.
pub fn run(args: &ReconstructArgs, console: &Console) -> Result<(), Failure> {
    let jobs = jobs(args)?;
    let segmenter = match args.input {
        InputKind::Image => Some(segmenter(&args.model, console)?),
        InputKind::Points | InputKind::Mask => None,
    };
    let bar = console.progress(jobs.len(), "reconstructing");
    let results: Vec<Result<Done, Failure>> = jobs
        .par_iter()
        .map(|(dir, out)| {
            let result = one(dir, out, args, segmenter.as_ref());
            bar.inc(1);
            result
        })
        .collect();
    bar.finish_and_clear();
    let total = results.len();
    let mut first_failure = None;
    let (mut failed, mut suspect) = (0, Vec::new());
    for result in results {
        match result {
            Ok(done) => {
                if console.json {
                    console.json(&done.json)?;
                } else {
                    console.data(&done.line)?;
                }
                suspect.extend(done.suspect);
            }
            Err(failure) => {
                failed += 1;
                if total > 1 {
                    console.remark(&failure.to_string());
                }
                first_failure.get_or_insert(failure);
            }
        }
    }
    match first_failure {
        None if args.strict && !suspect.is_empty() => {
            let message =
                format!("{} of {total} results suspect: {}", suspect.len(), suspect.join(", "));
            Err(Failure::new(Failure::SUSPECT, message)
                .with_hint("look at the picture (--picture) before you use them"))
        }
        None => Ok(()),
        Some(failure) if total == 1 => Err(failure),
        Some(failure) => Err(failure.about(format!("{failed} of {total} pairs failed"))),
    }
}

/// A written result.
struct Done {
    /// One line for a reader.
    line: String,
    /// The same as `result.json`.
    json: Value,
    /// The case, if there are reasons to doubt it.
    suspect: Option<String>,
}

/// Pair folders with the places each result goes to.
fn jobs(args: &ReconstructArgs) -> Result<Vec<(PathBuf, Outputs)>, Failure> {
    let outputs = Outputs::of(args)?;
    let mut pairs = Vec::new();
    for path in &args.pairs {
        pairs.extend(find_pairs(path)?);
    }
    if let [only] = pairs.as_slice()
        && args.pairs.first() == Some(only)
    {
        return Ok(vec![(only.clone(), outputs)]);
    }
    if let Some(file) = outputs.files.first() {
        let message =
            format!("{} is one file, but there are {} pairs", file.display(), pairs.len());
        return Err(Failure::new(Failure::USAGE, message)
            .with_hint("give a folder, and --also for what each case's folder shall hold"));
    }
    let below = outputs.folder.clone().unwrap_or_default();
    let mut taken: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    let mut jobs = Vec::new();
    for pair in pairs {
        let name = pair.canonicalize().ok().and_then(|p| p.file_name().map(|n| n.to_owned()));
        let out = below.join(name.unwrap_or_else(|| "case".into()));
        if let Some(other) = taken.insert(out.clone(), pair.clone()) {
            return Err(Failure::new(
                Failure::USAGE,
                format!(
                    "{} and {} would both write to {}",
                    other.display(),
                    pair.display(),
                    out.display()
                ),
            )
            .with_hint("run them with different --out folders"));
        }
        jobs.push((pair, outputs.in_folder(out)));
    }
    Ok(jobs)
}

fn one(
    dir: &Path,
    out: &Outputs,
    args: &ReconstructArgs,
    segmenter: Option<&NetworkSegmenter>,
) -> Result<Done, Failure> {
    let parts = PairParts {
        points: args.input == InputKind::Points,
        masks: args.input == InputKind::Mask,
        images: args.input == InputKind::Image,
        truth: Truth::IfPresent,
    };
    // A report also shows what the method does not read.
    let shown = PairParts {
        masks: parts.masks || (out.has_report() && dir.join("masks").is_dir()),
        images: parts.images || (out.has_report() && dir.join("images").is_dir()),
        ..parts
    };
    let pair = ViewPair::from(read_pair(dir, shown)?);
    let pair = match segmenter {
        Some(segmenter) => segment_images(pair, segmenter, &unwatched)?,
        None => pair,
    };
    let mut params = Params::new(args.input, args.method);
    params.robust.calibration = args.refine_calibration.then_some(CalibrationPriors::DEFAULT);
    params.closure = args.closed;
    let reconstruction = reconstruct(&pair, &params)?;
    let mut result = result_json(dir, parts, &pair, &params, &reconstruction)?;
    if let Some(segmenter) = segmenter {
        result["parameters"]["segmentation"] = Value::from(segmenter.describe());
    }
    out.write(&pair, &reconstruction, &result)?;
    let doubted = !reconstruction.diagnostics.suspicions.is_empty();
    Ok(Done {
        line: summary(&reconstruction),
        json: result,
        suspect: doubted.then(|| reconstruction.id.clone()),
    })
}

/// What `result.json` says.
pub fn result_json(
    dir: &Path,
    parts: PairParts,
    pair: &ViewPair,
    params: &Params,
    reconstruction: &Reconstruction,
) -> Result<Value, Failure> {
    let scores = match &pair.truth {
        Some(truth) => table_scores(&reconstruction.positions(), truth)?,
        None => Value::Null,
    };
    let parameters: Value = params
        .described()
        .into_iter()
        .map(|(stage, text)| (stage.to_owned(), Value::from(text)))
        .collect::<serde_json::Map<_, _>>()
        .into();
    let inputs: Vec<Value> = hash_pair(dir, parts)?
        .into_iter()
        .map(|(file, hash)| {
            let file = file.strip_prefix(dir).unwrap_or(&file).display().to_string();
            json!({"file": file, "blake3": hash})
        })
        .collect();
    Ok(json!({
        "case": reconstruction.id,
        "pair": dir.display().to_string(),
        "method": reconstruction.method.name(),
        "input": reconstruction.input.name(),
        "unit": reconstruction.unit.label(),
        "points": reconstruction.points.len(),
        "length": reconstruction.length(),
        "diagnostics": reconstruction.diagnostics,
        "stretches_along_epipolar_lines": reconstruction.weak_stretches(),
        "scores": scores,
        "parameters": parameters,
        "inputs": inputs,
        "version": env!("CARGO_PKG_VERSION"),
        "note": NOT_FOR_CLINICAL_USE,
    }))
}

/// One line for a reader.
pub fn summary(reconstruction: &Reconstruction) -> String {
    let d = &reconstruction.diagnostics;
    let suspect = if d.suspicions.is_empty() {
        String::new()
    } else {
        let reasons: Vec<String> = d.suspicions.iter().map(|s| s.to_string()).collect();
        format!(", suspect: {}", reasons.join(", "))
    };
    format!(
        "{}: {} points, {:.1} {}, mean epipolar distance {:.2} px, coverage {:.1} % / {:.1} %{suspect}",
        reconstruction.id,
        reconstruction.points.len(),
        reconstruction.length(),
        reconstruction.unit,
        d.mean_epipolar_distance_px,
        100.0 * d.trace_coverage[0] * d.matched_fraction[0],
        100.0 * d.trace_coverage[1] * d.matched_fraction[1],
    )
}
