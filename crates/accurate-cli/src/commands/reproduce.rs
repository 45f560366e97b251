use std::collections::BTreeMap;
use std::path::Path;

use accurate3d::io::{hash_bytes, hash_file, write_json};
use accurate3d::seg::Segmenter;
use accurate3d::synth::{CaseOptions, Family};
use accurate3d::table::{
    CaseSet, Format, Measuring, PointsProtocol, Row, image_cases as image_cases_of, measure,
    paper_rows, render,
};
use accurate3d::{InputKind, NOT_FOR_CLINICAL_USE};
use serde::{Deserialize, Serialize};

use crate::args::{Experiment, ModelArgs, ReproduceArgs};
use crate::console::Console;
use crate::failure::Failure;
use crate::segmentation::segmenter;
use crate::text::{make_folder, write_text};

/// The file that says what a run was made with.
pub const MANIFEST: &str = "manifest.json";

/// What an experiment was run with and what came out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// `table1`.
    pub experiment: String,
    /// Version of the program.
    pub version: String,
    /// BLAKE3 of the program's file.
    pub binary_blake3: String,
    /// Seeds of the generated sets.
    pub seeds: Vec<u64>,
    /// Cases per seed.
    pub cases: u64,
    /// Cases per seed of the image rows.
    pub image_cases: u64,
    /// What segmented the images; none without image rows.
    pub segmentation: Option<String>,
    /// BLAKE3 of the cases of each set.
    pub data_blake3: BTreeMap<String, String>,
    /// BLAKE3 of every file beside the manifest.
    pub files_blake3: BTreeMap<String, String>,
    /// Not for clinical use.
    pub note: String,
}

/// `accurate reproduce table1`: the paper's table on both sets in every format, and the manifest.
pub fn run(args: &ReproduceArgs, console: &Console) -> Result<(), Failure> {
    let Experiment::Table1 = args.experiment;
    let size = Size { seeds: &args.seeds, cases: args.cases, image_cases: args.image_cases };
    make_folder(&args.out)?;
    let (manifest, files) = table1(size, &args.model, console)?;
    for (name, text) in &files {
        write_text(&args.out.join(name), text)?;
    }
    write_json(&args.out.join(MANIFEST), &manifest)?;
    if console.json {
        return console.json(&manifest);
    }
    for name in manifest.files_blake3.keys() {
        console.data(&args.out.join(name).display().to_string())?;
    }
    console.remark(&format!(
        "{} holds the hashes; `accurate verify {}` runs it again. {NOT_FOR_CLINICAL_USE}",
        args.out.join(MANIFEST).display(),
        args.out.display()
    ));
    Ok(())
}

/// How much of the experiment is run.
#[derive(Debug, Clone, Copy)]
pub struct Size<'a> {
    /// Seeds of the generated sets.
    pub seeds: &'a [u64],
    /// Cases per seed.
    pub cases: u64,
    /// Cases per seed of the image rows.
    pub image_cases: u64,
}

/// The files of the experiment by name, and what they were made with.
pub fn table1(
    size: Size<'_>,
    model: &ModelArgs,
    console: &Console,
) -> Result<(Manifest, BTreeMap<String, String>), Failure> {
    let Size { seeds, cases, image_cases } = size;
    if seeds.is_empty() || cases == 0 {
        return Err(Failure::new(Failure::USAGE, "the experiment has no case")
            .with_hint("give at least one seed and one case"));
    }
    let segmenter = match image_cases {
        0 => None,
        _ => Some(segmenter(model, console)?),
    };
    let (mut files, mut data) = (BTreeMap::new(), BTreeMap::new());
    let mut run = |name: String, set: &CaseSet, rows: &[Row], how: &Measuring<'_>| {
        data.insert(name.clone(), set.fingerprint()?);
        let bar = console.progress(set.len(), "measuring");
        let table = measure(set, rows, how, &|| bar.inc(1))?;
        bar.finish_and_clear();
        for format in Format::ALL {
            files.insert(format!("table1-{name}.{}", format.name()), render(&table, format));
        }
        Ok::<(), Failure>(())
    };
    let (of_images, others): (Vec<Row>, Vec<Row>) =
        paper_rows().into_iter().partition(|row| row.input == InputKind::Image);
    for (name, family) in [("simulation", Family::SimPaper), ("phantom", Family::Carm)] {
        let set = CaseSet::Generated {
            family,
            options: CaseOptions::default(),
            seeds: seeds.to_vec(),
            cases,
            points: PointsProtocol::Rounded,
        };
        run(name.to_owned(), &set, &others, &Measuring::default())?;
        if let Some(segmenter) = &segmenter {
            let (set, how) = image_cases_of(family, seeds, image_cases, segmenter);
            run(format!("{name}-images"), &set, &of_images, &how)?;
        }
    }
    let manifest = Manifest {
        experiment: "table1".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        binary_blake3: binary_hash()?,
        seeds: seeds.to_vec(),
        cases,
        image_cases,
        segmentation: segmenter.map(|segmenter| segmenter.describe()),
        data_blake3: data,
        files_blake3: files
            .iter()
            .map(|(name, text)| (name.clone(), hash_bytes(text.as_bytes())))
            .collect(),
        note: NOT_FOR_CLINICAL_USE.to_owned(),
    };
    Ok((manifest, files))
}

fn binary_hash() -> Result<String, Failure> {
    let path = std::env::current_exe()
        .map_err(|error| Failure::new(Failure::IO, format!("this program's file: {error}")))?;
    Ok(hash_file(Path::new(&path))?)
}
