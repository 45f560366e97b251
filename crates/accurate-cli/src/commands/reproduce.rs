use std::collections::BTreeMap;
use std::path::Path;

use accurate3d::NOT_FOR_CLINICAL_USE;
use accurate3d::io::{hash_bytes, hash_file, write_json};
use accurate3d::synth::{CaseOptions, Family};
use accurate3d::table::{CaseSet, Format, Measuring, PointsProtocol, measure, paper_rows, render};
use serde::{Deserialize, Serialize};

use crate::args::{Experiment, ReproduceArgs};
use crate::console::Console;
use crate::failure::Failure;
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
    let (manifest, files) = table1(&args.seeds, args.cases, console)?;
    make_folder(&args.out)?;
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

/// The files of the experiment by name, and what they were made with.
pub fn table1(
    seeds: &[u64],
    cases: u64,
    console: &Console,
) -> Result<(Manifest, BTreeMap<String, String>), Failure> {
    if seeds.is_empty() || cases == 0 {
        return Err(Failure::new(Failure::USAGE, "the experiment has no case")
            .with_hint("give at least one seed and one case"));
    }
    let (mut files, mut data) = (BTreeMap::new(), BTreeMap::new());
    for (name, family) in [("simulation", Family::SimPaper), ("phantom", Family::Carm)] {
        let set = CaseSet::Generated {
            family,
            options: CaseOptions::default(),
            seeds: seeds.to_vec(),
            cases,
            points: PointsProtocol::Rounded,
        };
        data.insert(set.name(), set.fingerprint()?);
        let bar = console.progress(set.len(), name);
        let table = measure(&set, &paper_rows(), &Measuring::default(), &|| bar.inc(1))?;
        bar.finish_and_clear();
        for format in Format::ALL {
            files.insert(format!("table1-{name}.{}", format.name()), render(&table, format));
        }
    }
    let manifest = Manifest {
        experiment: "table1".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        binary_blake3: binary_hash()?,
        seeds: seeds.to_vec(),
        cases,
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
