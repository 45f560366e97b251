use accurate3d::io::{PairParts, Truth, find_pairs, read_pair};
use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::{FigureKind, NOT_FOR_CLINICAL_USE, ViewPair, figure_svg};
use serde_json::json;

use crate::args::FigureArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::raster::{is_picture, write_picture};
use crate::text::make_place_apart;

/// Cases of the comparing figures, one a column.
const COLUMNS: u64 = 3;
/// Pixels of a PNG per unit of the figure: 840 for each panel, for print.
const PNG_SCALE: f32 = 2.0;

/// `accurate figure`: one picture, SVG or PNG.
pub fn run(args: &FigureArgs, console: &Console) -> Result<(), Failure> {
    if !is_picture(&args.out) {
        let message = format!("figures are written as .svg or .png, not as {}", args.out.display());
        return Err(Failure::new(Failure::USAGE, message));
    }
    make_place_apart(&args.out, &args.pairs)?;
    let cases = if args.pairs.is_empty() { generated(args.kind)? } else { given(args)? };
    write_picture(&args.out, &figure_svg(args.kind, &cases)?, PNG_SCALE)?;
    let ids: Vec<&str> = cases.iter().map(|case| case.id.as_str()).collect();
    if console.json {
        let out = args.out.display().to_string();
        return console.json(&json!({"figure": args.kind.name(), "cases": ids, "file": out}));
    }
    console.data(&args.out.display().to_string())?;
    console.remark(&format!("{} of {}. {NOT_FOR_CLINICAL_USE}", args.kind, ids.join(", ")));
    Ok(())
}

fn given(args: &FigureArgs) -> Result<Vec<ViewPair>, Failure> {
    let mut cases = Vec::new();
    for path in &args.pairs {
        for dir in find_pairs(path)? {
            let points = dir.join("points").is_dir();
            let parts = PairParts { points, masks: true, images: false, truth: Truth::IfPresent };
            cases.push(ViewPair::from(read_pair(&dir, parts)?));
        }
    }
    Ok(cases)
}

/// The demo's case, or the first cases of the set that a comparing figure is about.
fn generated(kind: FigureKind) -> Result<Vec<ViewPair>, Failure> {
    let (family, seed, indices) = match kind {
        FigureKind::Simulation => (Family::SimPaper, 1, 0..COLUMNS),
        FigureKind::Phantom => (Family::Carm, 1, 0..COLUMNS),
        FigureKind::Overview | FigureKind::Gctt | FigureKind::Ecdp => (Family::Medium, 2026, 4..5),
    };
    let case = |index| Ok(generate(family, seed, index, &CaseOptions::default())?.into());
    indices.map(case).collect()
}
