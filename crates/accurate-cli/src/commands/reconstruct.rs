use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use accurate3d::fit::CalibrationPriors;
use accurate3d::io::{PairParts, Truth, find_pairs, hash_file, hash_pair, pair_files, read_pair};
use accurate3d::seg::network::NetworkSegmenter;
use accurate3d::seg::{Polarity, Segmenter, Watch};
use accurate3d::{
    Closure, InputKind, Method, NOT_FOR_CLINICAL_USE, Params, Reconstruction, ViewPair,
    reconstruct, reconstruct_images, segment_images,
};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::eval::table_scores;
use super::outputs::Outputs;
use crate::args::{EngineChoice, Mirror, ReconstructArgs};
use crate::code::Code;
use crate::console::Console;
use crate::failure::Failure;
use crate::segmentation::segmenter;
use crate::text::places;
use crate::two_views::{NEVER_THE_SAME, are_files, files_behind, pair_of_files};

/// What one run reads.
enum Source {
    Folder(PathBuf),
    /// Two views given as files.
    Files,
}

/// `accurate reconstruct`: every pair on its own; one that fails does not stop the others.
///
/// `config` is the config file that gives the same run; every result's folder gets it.
pub fn run(args: &ReconstructArgs, config: &str, console: &Console) -> Result<(), Failure> {
    refuse_what_takes_no_effect(args)?;
    let jobs = jobs(args, config)?;
    let read = places(&everything_read(args, &jobs));
    for (_, outputs) in &jobs {
        outputs.check(&read)?;
    }
    let segmenter = match args.input {
        InputKind::Image => Some(segmenter(&args.model, console)?),
        InputKind::Points | InputKind::Mask => None,
    };
    let (bar, watch) =
        (console.progress(jobs.len(), "reconstructing"), console.windows(jobs.len()));
    let results: Vec<Result<Done, Failure>> = jobs
        .par_iter()
        .map(|(source, out)| {
            let result = one(source, out, args, segmenter.as_ref(), &watch);
            bar.inc(1);
            result
        })
        .collect();
    bar.finish_and_clear();
    let total = results.len();
    let mut first_failure = None;
    let (mut failed, mut suspect) = (0, Vec::new());
    for (result, (source, _)) in results.into_iter().zip(&jobs) {
        match result {
            Ok(done) => {
                if console.json {
                    console.json(&done.json)?;
                } else {
                    console.data(&done.line)?;
                }
                if let Some(remark) = &done.remark {
                    console.remark(remark);
                }
                suspect.extend(done.suspect);
            }
            Err(failure) => {
                failed += 1;
                if let (Source::Folder(pair), true) = (source, total > 1) {
                    console.failure_of("pair", &pair.display().to_string(), &failure);
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

/// Every file behind the inputs, and what lies in their folders though this run may not look at it.
fn everything_read(args: &ReconstructArgs, jobs: &[(Source, Outputs)]) -> Vec<PathBuf> {
    const ALL: PairParts =
        PairParts { points: true, masks: true, images: true, truth: Truth::IfPresent };
    let mut read: Vec<PathBuf> = args.inputs.iter().chain(&args.truth).cloned().collect();
    read.extend(args.views.cameras.iter().flat_map(|path| files_behind(path)));
    for (source, _) in jobs {
        if let Source::Folder(dir) = source {
            read.extend(pair_files(dir, ALL));
        }
    }
    read
}

/// Options that the method would pass over without a word.
fn refuse_what_takes_no_effect(args: &ReconstructArgs) -> Result<(), Failure> {
    let of_accurate = [
        (args.refine_calibration, "--refine-calibration"),
        (args.closed == Closure::Closed, "--closed yes"),
    ];
    let of_images = [
        (args.grey.polarity() == Polarity::BodyBright, "--photometric monochrome1"),
        (args.model.model.is_some(), "--model"),
        (args.model.onnxruntime.is_some(), "--onnxruntime"),
        (args.model.engine != EngineChoice::Auto, "--engine"),
        (args.model.mirror != Mirror::Opposite, "--mirror"),
    ];
    let refused = |message: String, hint: String| {
        Err(Failure::new(Failure::USAGE, message).with_hint(hint + ", or leave the option out"))
    };
    let given = |options: &[(bool, &'static str)]| {
        options.iter().find(|(given, _)| *given).map(|(_, option)| *option)
    };
    match (given(&of_accurate), given(&of_images)) {
        (Some(option), _) if args.method != Method::Accurate => refused(
            format!("the method `{}` knows no {option}", args.method),
            "take --method accurate".into(),
        ),
        (_, Some(option)) if args.input != InputKind::Image => refused(
            format!("--input {} reads no images, which {option} is for", args.input),
            "take --input image".into(),
        ),
        _ => Ok(()),
    }
}

/// A written result.
struct Done {
    /// What a reader should know beside.
    remark: Option<String>,
    /// One line for a reader.
    line: String,
    /// The same as `result.json`.
    json: Value,
    /// The case, if there are reasons to doubt it.
    suspect: Option<String>,
}

/// What is read, with the places each result goes to.
fn jobs(args: &ReconstructArgs, config: &str) -> Result<Vec<(Source, Outputs)>, Failure> {
    let outputs = Outputs::of(args, config)?;
    if are_files(args) {
        return Ok(vec![(Source::Files, outputs)]);
    }
    let of_files = [
        args.truth.is_some().then_some("--truth"),
        (!args.frame.is_empty()).then_some("--frame"),
        (!args.views.views.is_empty()).then_some("--views"),
        args.views.stated.given(),
    ];
    if let Some(option) = of_files.into_iter().flatten().next() {
        let message = format!("{option} is for two views given as files");
        return Err(Failure::new(Failure::USAGE, message)
            .with_hint("a pair folder says this itself: docs/conventions.md"));
    }
    let mut pairs = Vec::new();
    for path in &args.inputs {
        match find_pairs(path) {
            Ok(found) => pairs.extend(found),
            // Told when its turn comes: it does not stop the others.
            Err(_) if args.inputs.len() > 1 => pairs.push(path.clone()),
            Err(error) => return Err(error.into()),
        }
    }
    if let [only] = pairs.as_slice()
        && args.inputs.first() == Some(only)
    {
        return Ok(vec![(Source::Folder(only.clone()), outputs)]);
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
        jobs.push((Source::Folder(pair), outputs.in_folder(out)));
    }
    Ok(jobs)
}

/// A pair as read, what to call its place, and the files behind it with their hashes.
struct Read {
    pair: ViewPair,
    shown: String,
    inputs: Vec<Value>,
    /// Why the report does not show all of the pair.
    left_out: Option<String>,
}

/// Refuses points that are no curve yet.
fn check_points(pair: &ViewPair) -> Result<(), Failure> {
    let counts = pair.points.as_ref().map(|(one, two)| [one.len(), two.len()]);
    for (view, count) in (1..).zip(counts.into_iter().flatten()) {
        if count < 2 {
            let message = format!("{}: {count} point in view {view}", pair.id);
            return Err(Failure::new(Failure::BAD_INPUT, message)
                .with_hint("a curve takes two points at least, in order along the body"));
        }
    }
    Ok(())
}

/// Refuses one picture, or one list of points, in the place of both views.
fn check_views(pair: &ViewPair) -> Result<(), Failure> {
    let points = pair.points.as_ref().is_some_and(|(one, two)| {
        one.len() == two.len() && one.iter().zip(two).all(|(a, b)| a.point() == b.point())
    });
    let masks = pair.masks.as_ref().is_some_and(|[one, two]| one == two);
    let images = pair.images.as_ref().is_some_and(|[one, two]| one == two);
    for (same, what) in [(points, "points"), (masks, "masks"), (images, "images")] {
        if same {
            let message = format!("{}: the {what} of both views are the same", pair.id);
            return Err(Failure::new(Failure::BAD_INPUT, message).with_hint(NEVER_THE_SAME));
        }
    }
    Ok(())
}

/// Refuses what is no curve, before anything is written.
fn check_curve(reconstruction: &Reconstruction) -> Result<(), Failure> {
    if reconstruction.points.len() >= 2 && reconstruction.length() > 0.0 {
        return Ok(());
    }
    let points = reconstruction.points.len();
    let message = format!("{}: {points} point, which is no curve", reconstruction.id);
    Err(Failure::new(Code::NoMatch, message).with_hint(
        "almost nothing of the two views goes together: are points and cameras of the same image size?",
    ))
}

fn read(source: &Source, args: &ReconstructArgs, has_report: bool) -> Result<Read, Failure> {
    let dir = match source {
        Source::Folder(dir) => dir,
        Source::Files => {
            let (pair, files) = pair_of_files(args)?;
            let mut inputs = Vec::new();
            for file in files.iter().filter(|file| file.is_file()) {
                let hash = hash_file(file)?;
                inputs.push(json!({"file": file.display().to_string(), "blake3": hash}));
            }
            let names: Vec<String> = args.inputs.iter().map(|p| p.display().to_string()).collect();
            let shown = names.join(", ");
            return Ok(Read { pair: pair.into(), shown, inputs, left_out: None });
        }
    };
    let parts = PairParts {
        points: args.input == InputKind::Points,
        masks: args.input == InputKind::Mask,
        images: args.input == InputKind::Image,
        truth: Truth::IfPresent,
    };
    // A report also shows what the method does not read.
    let more = PairParts {
        masks: parts.masks || (has_report && dir.join("masks").is_dir()),
        images: parts.images || (has_report && dir.join("images").is_dir()),
        ..parts
    };
    let (pair, left_out) = match read_pair(dir, more) {
        // What the method does not read is no reason to fail.
        Err(error) if more != parts => (read_pair(dir, parts)?, Some(error.to_string())),
        pair => (pair?, None),
    };
    let (pair, shown) = (ViewPair::from(pair), dir.display().to_string());
    Ok(Read { pair, shown, inputs: hashed(dir, parts)?, left_out })
}

/// The files that a pair folder's parts lie in, with their hashes.
pub fn hashed(dir: &Path, parts: PairParts) -> Result<Vec<Value>, Failure> {
    let describe = |(file, hash): (PathBuf, String)| {
        let file = file.strip_prefix(dir).unwrap_or(&file).display().to_string();
        json!({"file": file, "blake3": hash})
    };
    Ok(hash_pair(dir, parts)?.into_iter().map(describe).collect())
}

fn one(
    source: &Source,
    out: &Outputs,
    args: &ReconstructArgs,
    segmenter: Option<&NetworkSegmenter>,
    watch: &Watch<'_>,
) -> Result<Done, Failure> {
    let Read { mut pair, shown, inputs, left_out } = read(source, args, out.has_report())?;
    let polarity = args.grey.polarity();
    pair.images = pair.images.map(|both| both.map(|image| polarity.with_body_dark(image)));
    check_points(&pair)?;
    check_views(&pair)?;
    let pair = match segmenter {
        Some(segmenter) => segment_images(pair, segmenter, watch)?,
        None => pair,
    };
    let mut params = Params::new(args.input, args.method);
    params.robust.calibration = args.refine_calibration.then_some(CalibrationPriors::DEFAULT);
    params.closure = args.closed;
    let (reconstruction, seen) = match segmenter {
        Some(segmenter) => reconstruct_images(&pair, &params, segmenter, watch)?,
        None => (reconstruct(&pair, &params)?, None),
    };
    let pair = seen.unwrap_or(pair);
    check_curve(&reconstruction)?;
    let mut result = result_json(&shown, inputs, &pair, &params, &reconstruction)?;
    if let Some(segmenter) = segmenter {
        result["parameters"]["segmentation"] = Value::from(segmenter.describe());
        result["parameters"]["photometric"] = Value::from(args.grey.photometric.name());
    }
    out.write(&pair, &reconstruction, &result)?;
    let doubted = !reconstruction.diagnostics.suspicions.is_empty();
    let remark = left_out.map(|why| format!("{}: the report shows less: {why}", reconstruction.id));
    Ok(Done {
        remark,
        line: summary(&reconstruction),
        json: result,
        suspect: doubted.then(|| reconstruction.id.clone()),
    })
}

/// What `result.json` says.
pub fn result_json(
    shown: &str,
    inputs: Vec<Value>,
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
    Ok(json!({
        "case": reconstruction.id,
        "pair": shown,
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
    let reasons = d.reasons().join(", ");
    let suspect = if reasons.is_empty() { reasons } else { format!(", suspect: {reasons}") };
    format!(
        "{}: {} points, {} {}, mean epipolar distance {:.2} px, coverage {:.1} % / {:.1} %{suspect}",
        reconstruction.id,
        reconstruction.points.len(),
        four_digits(reconstruction.length()),
        reconstruction.unit,
        d.mean_epipolar_distance_px,
        100.0 * d.trace_coverage[0] * d.matched_fraction[0],
        100.0 * d.trace_coverage[1] * d.matched_fraction[1],
    )
}

/// A length of any unit, to four digits at least and one decimal.
fn four_digits(length: f64) -> String {
    let decimals = (3 - length.abs().max(1e-6).log10().floor() as i32).max(1);
    format!("{length:.*}", decimals as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_digits_in_any_unit() {
        for (length, said) in
            [(708.06, "708.1"), (12345.6, "12345.6"), (0.116_63, "0.1166"), (0.0, "0.000000000")]
        {
            assert_eq!(four_digits(length), said);
        }
    }
}
