use std::path::Path;

use accurate3d::io::{BitDepth, GreyImage, PairContents, write_pair};
use accurate3d::synth::{
    CalibrationError, CaseOptions, Family, SynthCase, XrayOptions, generate, render_xray,
};
use rayon::prelude::*;

use super::xray;
use crate::args::{CasesArgs, Disturbances, PointsKind, SynthArgs, SynthCommand};
use crate::console::Console;
use crate::failure::Failure;

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
    let bar = console.progress(args.count as usize, "generating");
    let last = args
        .first
        .checked_add(args.count)
        .ok_or_else(|| Failure::new(Failure::USAGE, "--first plus --count is too large"))?;
    (args.first..last).into_par_iter().try_for_each(|index| {
        let case = generate(family, args.seed, index, &options)?;
        let images = args.xray.then(|| xray_images(&case));
        let dir = out.join(format!("case_{index:03}"));
        write_pair(&dir, &contents_of(case, args.points, images))?;
        bar.inc(1);
        Ok::<(), Failure>(())
    })?;
    bar.finish_and_clear();
    console.remark(&format!("{} cases of {} in {}", args.count, family, out.display()));
    Ok(())
}

/// A generated case as the contents of a pair folder.
pub fn contents_of(
    case: SynthCase,
    points: PointsKind,
    images: Option<[GreyImage; 2]>,
) -> PairContents {
    PairContents {
        source: Some(format!(
            "accurate synth {} seed {} case {}",
            case.family, case.seed, case.index
        )),
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
