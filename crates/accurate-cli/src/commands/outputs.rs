use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use accurate3d::io::{is_curve_file, remove_unfinished, write_curve, write_json};
use accurate3d::{Provenance, Reconstruction, ViewPair, picture_svg, report_html};
use clap::ValueEnum;
use serde_json::Value;

use crate::args::{Extra, ReconstructArgs};
use crate::failure::Failure;
use crate::raster::write_picture;
use crate::text::{
    check_folder, check_output, make_folder, make_place, refuse_what_is_read, remove_file,
    write_text,
};

/// Where the results of a command go: at most one folder, and single files.
#[derive(Debug, Clone, Default)]
pub struct Outputs {
    pub folder: Option<PathBuf>,
    pub extras: Vec<Extra>,
    pub files: Vec<PathBuf>,
    /// The config file that gives the same run, for the folder.
    pub config: Option<String>,
}

const CURVE: &str = "curve.csv";
const RESULT: &str = "result.json";
const CONFIG: &str = "config.toml";
/// What a file of results may end with.
const KNOWN: &str = ".csv, .ply, .vtp, .mrk.json, .npy, .npz, .parquet, .svg, .png, .html or .json";

/// What a file is to hold.
enum Kind {
    Curve,
    Picture,
    Report,
    Result,
}

impl Outputs {
    /// # Errors
    /// Two folders, or a file whose extension says nothing.
    pub fn of(args: &ReconstructArgs, config: &str) -> Result<Self, Failure> {
        let config = Some(config.to_owned());
        let mut outputs = Self { extras: args.also.clone(), config, ..Self::default() };
        for path in &args.out {
            if kind_of(path).is_some() && !ends_as_folder(path) {
                outputs.files.push(path.clone());
            } else if !is_folder_name(path) {
                let message = format!("{}: unknown extension", path.display());
                return Err(Failure::new(Failure::USAGE, message).with_hint(format!(
                    "known are {KNOWN}; for a folder of this name end it with /"
                )));
            } else if let Some(other) = &outputs.folder {
                let message = format!(
                    "{} and {} are both taken for folders",
                    other.display(),
                    path.display()
                );
                return Err(Failure::new(Failure::USAGE, message)
                    .with_hint(format!("one folder, and files ending in {KNOWN}")));
            } else {
                outputs.folder = Some(path.clone());
            }
        }
        if let Some(report) = &args.report {
            if !matches!(kind_of(report), Some(Kind::Report)) {
                let message = format!("the report is a .html file, not {}", report.display());
                return Err(Failure::new(Failure::USAGE, message));
            }
            outputs.files.push(report.clone());
        }
        if args.picture {
            outputs.extras.push(Extra::Picture);
        }
        if outputs.folder.is_none() && !outputs.extras.is_empty() {
            return Err(Failure::new(Failure::USAGE, "--also and --picture need a folder")
                .with_hint("add --out DIR, or name the files: --out wire.ply --out picture.svg"));
        }
        outputs.extras.dedup();
        Ok(outputs)
    }

    /// The same below another folder, for one of several pairs.
    pub fn in_folder(&self, folder: PathBuf) -> Self {
        Self { folder: Some(folder), ..self.clone() }
    }

    /// Whether a report is among them: it shows more of the pair than a method reads.
    pub fn has_report(&self) -> bool {
        self.extras.contains(&Extra::Report)
            || self.files.iter().any(|f| matches!(kind_of(f), Some(Kind::Report)))
    }

    /// Refuses, before the work, places that cannot be written to, and those of files that are read.
    pub fn check(&self, read: &BTreeSet<PathBuf>) -> Result<(), Failure> {
        let mut written = self.files.clone();
        if let Some(folder) = &self.folder {
            check_folder(folder)?;
            written.extend(own_names().map(|name| folder.join(name)));
        }
        written.iter().try_for_each(|file| {
            check_output(file)?;
            refuse_what_is_read(file, read)
        })
    }

    /// Writes everything, single files first: where one cannot be, the folder stays as it was. A folder that
    /// holds `result.json` is whole and of one run: an old one goes first, then what an earlier run wrote
    /// and this one does not; the new one comes last.
    pub fn write(
        &self,
        pair: &ViewPair,
        reconstruction: &Reconstruction,
        result: &Value,
    ) -> Result<(), Failure> {
        for file in &self.files {
            make_place(file)?;
            write_one(file, pair, reconstruction, result)?;
        }
        if let Some(folder) = &self.folder {
            make_folder(folder)?;
            // What a run that was killed while writing left here.
            remove_unfinished(folder)?;
            remove_earlier(folder)?;
            if let Some(config) = &self.config {
                write_text(&folder.join(CONFIG), config)?;
            }
            write_one(&folder.join(CURVE), pair, reconstruction, result)?;
            for extra in &self.extras {
                write_one(&folder.join(extra.file_name()), pair, reconstruction, result)?;
            }
            write_json(&folder.join(RESULT), result).map_err(Failure::of_output)?;
        }
        Ok(())
    }
}

/// Removes an earlier run's files from a folder, by the names that this program gives.
///
/// Only where its result or its config stands: in a folder of the user's own, a `curve.ply` is the
/// user's own. The config goes last, so that a removal which was stopped is gone on with.
fn remove_earlier(folder: &Path) -> Result<(), Failure> {
    if ![RESULT, CONFIG].iter().any(|name| folder.join(name).is_file()) {
        return Ok(());
    }
    own_names().try_for_each(|name| remove_file(&folder.join(name)))
}

/// Every name that this program gives in a folder of results: the result first, the config last.
fn own_names() -> impl Iterator<Item = &'static str> {
    let extras = Extra::value_variants().iter().map(|extra| extra.file_name());
    [RESULT].into_iter().chain(extras).chain([CURVE, CONFIG])
}

/// Whether a name that is no file of results may be a folder's.
fn is_folder_name(path: &Path) -> bool {
    path.extension().is_none() || path.is_dir() || ends_as_folder(path)
}

fn ends_as_folder(path: &Path) -> bool {
    path.as_os_str().as_encoded_bytes().ends_with(b"/")
}

fn kind_of(path: &Path) -> Option<Kind> {
    if is_curve_file(path) {
        return Some(Kind::Curve);
    }
    match path.extension()?.to_string_lossy().to_ascii_lowercase().as_str() {
        "svg" | "png" => Some(Kind::Picture),
        "html" | "htm" => Some(Kind::Report),
        "json" => Some(Kind::Result),
        _ => None,
    }
}

fn write_one(
    path: &Path,
    pair: &ViewPair,
    reconstruction: &Reconstruction,
    result: &Value,
) -> Result<(), Failure> {
    match kind_of(path) {
        Some(Kind::Picture) => write_picture(path, &picture_svg(pair, reconstruction), 1.0),
        Some(Kind::Report) => {
            let scores = Some(&result["scores"]).filter(|scores| !scores.is_null());
            let html = report_html(pair, reconstruction, scores, &provenance(result))?;
            write_text(path, &html)
        }
        Some(Kind::Result) => write_json(path, result).map_err(Failure::of_output),
        // Whatever else there is a name for is a curve; the writer refuses the rest.
        Some(Kind::Curve) | None => {
            write_curve(path, &reconstruction.curve_table()).map_err(Failure::of_output)
        }
    }
}

/// What `result.json` says of where the result comes from.
fn provenance(result: &Value) -> Provenance {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let parameters = result["parameters"].as_object();
    let inputs = result["inputs"].as_array();
    Provenance {
        version: text(&result["version"]),
        pair: text(&result["pair"]),
        parameters: parameters
            .into_iter()
            .flatten()
            .map(|(stage, value)| (stage.clone(), text(value)))
            .collect(),
        inputs: inputs
            .into_iter()
            .flatten()
            .map(|input| (text(&input["file"]), text(&input["blake3"])))
            .collect(),
    }
}
