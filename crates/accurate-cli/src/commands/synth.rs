use std::fs;
use std::ops::Range;
use std::path::Path;

use accurate3d::io::{BitDepth, GreyImage, PairContents, write_pair};
use accurate3d::synth::{
    CalibrationError, CaseOptions, Family, SynthCase, XrayOptions, generate, render_xray,
};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::xray;
use crate::args::{CasesArgs, Disturbances, PointsKind, SynthArgs, SynthCommand};
use crate::console::Console;
use crate::failure::Failure;
use crate::text::{make_folder, read_text, remove_file, write_text};

/// What the source of a generated case begins with.
const SOURCE: &str = "accurate synth";
/// Stands in a case's folder while it is written.
const UNFINISHED: &str = ".accurate-synth-unfinished";

/// `accurate synth`: pair folders of a family, or single X-ray images.
pub fn run(args: &SynthArgs, console: &Console) -> Result<(), Failure> {
    match (&args.images, args.cases.family, &args.cases.out) {
        (Some(SynthCommand::Xray(xray)), _, _) => xray::run(xray, console),
        (None, Some(family), Some(out)) => generate_cases(family, out, &args.cases, console),
        _ => Err(Failure::new(Failure::USAGE, "a family and --out, or `xray`, are missing")),
    }
}

/// One pair folder a case.
fn generate_cases(
    family: Family,
    out: &Path,
    args: &CasesArgs,
    console: &Console,
) -> Result<(), Failure> {
    let options = case_options(&args.disturbances);
    let last = args
        .first
        .checked_add(args.count)
        .ok_or_else(|| Failure::new(Failure::USAGE, "--first plus --count is too large"))?;
    make_folder(out)?;
    refuse_other_sets(out, &format!("{SOURCE} {family} seed {} ", args.seed), args.first..last)?;
    let bar = console.progress(args.count as usize, "generating");
    (args.first..last).into_par_iter().try_for_each(|index| {
        let case = generate(family, args.seed, index, &options)?;
        let images = args.xray.then(|| xray_images(&case));
        let dir = out.join(format!("case_{index:03}"));
        begin(&dir, images.is_some())?;
        write_pair(&dir, &contents_of(case, args.points, images))?;
        remove_file(&dir.join(UNFINISHED))?;
        bar.inc(1);
        Ok::<(), Failure>(())
    })?;
    bar.finish_and_clear();
    if console.json {
        return console.json(&json!({
            "folder": out.display().to_string(),
            "family": family.to_string(),
            "seed": args.seed,
            "first": args.first,
            "cases": args.count,
        }));
    }
    console.remark(&format!("{} cases of {} in {}", args.count, family, out.display()));
    Ok(())
}

/// A folder holds cases of one family and seed: those of another one would be taken for more of them.
///
/// # Errors
/// [`Failure::USAGE`] if an earlier run left a case of another `set` that this run does not write again.
fn refuse_other_sets(out: &Path, set: &str, written: Range<u64>) -> Result<(), Failure> {
    let unread = |error| Failure::new(Failure::IO, format!("{}: {error}", out.display()));
    let mut others = Vec::new();
    for entry in fs::read_dir(out).map_err(unread)? {
        let entry = entry.map_err(unread)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let index = name.strip_prefix("case_").and_then(|index| index.parse::<u64>().ok());
        let stays = index.is_some_and(|index| !written.contains(&index));
        let is_other = |source: String| source.starts_with(SOURCE) && !source.starts_with(set);
        if stays && source_of(&entry.path()).is_some_and(is_other) {
            others.push(name);
        }
    }
    let Some(first) = others.iter().min() else { return Ok(()) };
    let (folder, n) = (out.display(), others.len());
    let message = format!("{folder} holds cases of another set ({n}, the first {first})");
    Err(Failure::new(Failure::USAGE, message)
        .with_hint("give another --out, or remove that folder first"))
}

/// What made a case, by its `meta.json`.
fn source_of(case: &Path) -> Option<String> {
    let described: Value = serde_json::from_str(&read_text(&case.join("meta.json")).ok()?).ok()?;
    described["source"].as_str().map(str::to_owned)
}

/// Marks a case's folder as being written, and removes what an earlier run wrote there and this run will
/// not: images belong to the cameras and the curve that they were drawn with. `meta.json` goes too, as the
/// mark of a whole pair.
///
/// # Errors
/// [`Failure::USAGE`] for a folder that holds a pair, or parts of one, that this command has not made.
fn begin(dir: &Path, draws_images: bool) -> Result<(), Failure> {
    const PARTS: [&str; 6] =
        ["meta.json", "calibration", "points", "masks", "images", "annotations"];
    let mark = dir.join(UNFINISHED);
    // With the mark it is a run that was stopped, which begins anew.
    let is_ours = mark.is_file() || source_of(dir).is_some_and(|source| source.starts_with(SOURCE));
    if !is_ours && PARTS.iter().any(|part| dir.join(part).exists()) {
        let message = format!("{} is there, and `{SOURCE}` has not made it", dir.display());
        return Err(Failure::new(Failure::USAGE, message)
            .with_hint("give another --out, or remove that folder first"));
    }
    make_folder(dir)?;
    write_text(&mark, "")?;
    if !draws_images {
        for view in ["L", "R"] {
            remove_file(&dir.join(format!("images/view_{view}.png")))?;
        }
        // Left where it holds something else.
        let _ = fs::remove_dir(dir.join("images"));
    }
    remove_file(&dir.join("meta.json"))
}

/// A generated case as the contents of a pair folder.
pub fn contents_of(
    case: SynthCase,
    points: PointsKind,
    images: Option<[GreyImage; 2]>,
) -> PairContents {
    PairContents {
        source: Some(format!("{SOURCE} {} seed {} case {}", case.family, case.seed, case.index)),
        case_id: case.id,
        rig: case.rig,
        points: Some(match points {
            PointsKind::Rounded => case.rounded_points,
            PointsKind::Exact => case.exact_points,
        }),
        masks: Some(case.masks),
        images,
        truth: Some(case.truth),
    }
}

fn xray_images(case: &SynthCase) -> [GreyImage; 2] {
    render_xray(case, &XrayOptions::default())
        .map(|image| GreyImage { values: image.mapv(f32::from), depth: BitDepth::Sixteen })
}

/// The generator's options for what the command line disturbs.
pub fn case_options(disturbances: &Disturbances) -> CaseOptions {
    let error = CalibrationError {
        rotation_deg: disturbances.calibration_rotation_deg,
        shift_px: disturbances.calibration_shift_px,
    };
    let (fewest, most) = disturbances.occlusions.unwrap_or((0, 0));
    CaseOptions {
        mask_thickness_px: disturbances.mask_thickness_px,
        occlusion_discs: fewest..=most,
        occlusion_radius_px: disturbances.occlusion_radius_px,
        calibration_error: (error.rotation_deg != 0.0 || error.shift_px != 0.0).then_some(error),
        ..CaseOptions::default()
    }
}
