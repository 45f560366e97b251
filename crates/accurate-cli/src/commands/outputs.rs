use std::path::{Path, PathBuf};

use accurate3d::io::{is_curve_file, remove_unfinished, write_curve, write_json};
use accurate3d::{Provenance, Reconstruction, ViewPair, picture_svg, report_html};
use serde_json::Value;

use crate::args::{Extra, ReconstructArgs};
use crate::failure::Failure;
use crate::raster::write_picture;
use crate::text::{make_folder, write_text};

/// Where the results of a command go: at most one folder, and single files.
#[derive(Debug, Clone, Default)]
pub struct Outputs {
    pub folder: Option<PathBuf>,
    pub extras: Vec<Extra>,
    pub files: Vec<PathBuf>,
}

/// What a file is to hold.
enum Kind {
    Curve,
    Picture,
    Report,
    Result,
}

impl Outputs {
    /// # Errors
    /// Two folders, or two results of the same name.
    pub fn of(args: &ReconstructArgs) -> Result<Self, Failure> {
        let mut outputs = Self { extras: args.also.clone(), ..Self::default() };
        for path in &args.out {
            if kind_of(path).is_some() {
                outputs.files.push(path.clone());
            } else if let Some(other) = &outputs.folder {
                let message = format!(
                    "{} and {} are both taken for folders",
                    other.display(),
                    path.display()
                );
                return Err(Failure::new(Failure::USAGE, message).with_hint(
                    "one folder, and files ending in .csv, .ply, .vtp, .mrk.json, .npy, .npz, \
                     .parquet, .svg, .png, .html or .json",
                ));
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

    /// Writes everything; what depends on everything else, `result.json`, last.
    pub fn write(
        &self,
        pair: &ViewPair,
        reconstruction: &Reconstruction,
        result: &Value,
    ) -> Result<(), Failure> {
        if let Some(folder) = &self.folder {
            make_folder(folder)?;
            // What a run that was killed while writing left here.
            remove_unfinished(folder)?;
            write_one(&folder.join("curve.csv"), pair, reconstruction, result)?;
            for extra in &self.extras {
                write_one(&folder.join(extra.file_name()), pair, reconstruction, result)?;
            }
        }
        for file in &self.files {
            if let Some(parent) = file.parent().filter(|p| !p.as_os_str().is_empty()) {
                make_folder(parent)?;
            }
            write_one(file, pair, reconstruction, result)?;
        }
        if let Some(folder) = &self.folder {
            write_json(&folder.join("result.json"), result)?;
        }
        Ok(())
    }
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
        Some(Kind::Result) => Ok(write_json(path, result)?),
        // Whatever else there is a name for is a curve; the writer refuses the rest.
        Some(Kind::Curve) | None => Ok(write_curve(path, &reconstruction.curve_table())?),
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
