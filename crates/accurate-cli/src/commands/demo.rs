use accurate3d::io::{PairParts, Truth, read_pair, write_pair};
use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::{InputKind, Method, NOT_FOR_CLINICAL_USE, Params, ViewPair, reconstruct};

use super::outputs::Outputs;
use super::reconstruct::{hashed, result_json, summary};
use super::synth::contents_of;
use crate::args::{DemoArgs, Extra, PointsKind};
use crate::console::Console;
use crate::failure::Failure;

/// The shipped pair: the same case as `datasets/samples/loop`, generated on the spot so that the
/// installed binary needs no data folder.
const FAMILY: Family = Family::Medium;
const SEED: u64 = 2026;
const INDEX: u64 = 2;

/// `accurate demo`: writes the pair, reads it back, reconstructs and scores it, draws the picture.
pub fn run(args: &DemoArgs, console: &Console) -> Result<(), Failure> {
    let dir = args.out.join("pair");
    let case = generate(FAMILY, SEED, INDEX, &CaseOptions::default())?;
    write_pair(&dir, &contents_of(case, PointsKind::Exact, None)).map_err(Failure::of_output)?;
    let parts = PairParts { points: true, masks: true, images: false, truth: Truth::Required };
    let pair = ViewPair::from(read_pair(&dir, parts)?);
    let params = Params::new(InputKind::Mask, Method::default());
    let reconstruction = reconstruct(&pair, &params)?;
    let result = result_json(
        &dir.display().to_string(),
        hashed(&dir, parts)?,
        &pair,
        &params,
        &reconstruction,
    )?;
    let outputs = Outputs {
        folder: Some(args.out.clone()),
        extras: vec![Extra::Ply, Extra::Vtp, Extra::MrkJson, Extra::Picture, Extra::Report],
        ..Outputs::default()
    };
    outputs.write(&pair, &reconstruction, &result)?;
    if console.json {
        return console.json(&result);
    }
    console.data(&summary(&reconstruction))?;
    let scores = &result["scores"];
    console.data(&format!(
        "against the truth, {}: Acc {:.3}, Comp {:.3}, Overall {:.3}, Max Err {:.3}",
        reconstruction.unit,
        scores["accuracy"].as_f64().unwrap_or(f64::NAN),
        scores["completeness"].as_f64().unwrap_or(f64::NAN),
        scores["overall"].as_f64().unwrap_or(f64::NAN),
        scores["max_error"].as_f64().unwrap_or(f64::NAN),
    ))?;
    console.remark(&format!(
        "written: {0}/report.html (open it), {0}/picture.svg, {0}/curve.csv, .ply, .vtp, .mrk.json, \
         {0}/result.json\n{1}",
        args.out.display(),
        NOT_FOR_CLINICAL_USE
    ));
    Ok(())
}
