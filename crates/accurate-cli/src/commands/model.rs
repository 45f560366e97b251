use std::path::{Path, PathBuf};

use accurate3d::io::{read_file, write_atomically};
use accurate3d::seg::network::{
    Engine, MAX_NETWORK_BYTES, Manifest, ModelBundle, NnunetFolder, OrtEngine, OrtRuntime,
    RtenEngine,
};
use ndarray::{Array2, Array3};
use serde_json::{Value, json};

use crate::args::{ImportArgs, ModelCommand};
use crate::console::Console;
use crate::failure::Failure;
use crate::segmentation::{bundle, library};
use crate::text::make_place_apart;

/// Largest plans.json, dataset.json or description, bytes.
const MAX_JSON_BYTES: u64 = 1 << 24;
/// Engines may differ by rounding: a network of 31 convolutions of up to 9 x 256 products each, with
/// logits of order 10, in float32.
const ENGINES_AGREE_TO: f32 = 1e-2;

/// `accurate model`.
pub fn run(command: &ModelCommand, console: &Console) -> Result<(), Failure> {
    match command {
        ModelCommand::Info { model } => info(&bundle(model.as_deref())?, console),
        ModelCommand::Verify { model, onnxruntime } => {
            verify(&bundle(model.as_deref())?, onnxruntime.as_ref(), console)
        }
        ModelCommand::Import(args) => import(args, console),
        ModelCommand::Pack { network, manifest, out } => {
            make_place_apart(out, [network, manifest])?;
            let manifest = Manifest::from_json(&read_file(manifest, MAX_JSON_BYTES)?)
                .map_err(|error| Failure::from(error).of_file(manifest))?;
            let bytes = read_file(network, MAX_NETWORK_BYTES)?;
            let bundle = ModelBundle::new(manifest, bytes.into())
                .map_err(|error| Failure::from(error).of_file(network))?;
            write(&bundle, out, console)
        }
    }
}

fn info(bundle: &ModelBundle, console: &Console) -> Result<(), Failure> {
    let facts = bundle.facts();
    if console.json {
        return console.json(&described(bundle));
    }
    let manifest = bundle.manifest();
    let [height, width] = manifest.tiling.window_px;
    let axes: Vec<&str> = manifest
        .mirror_axes
        .iter()
        .map(|axis| if *axis == 0 { "down" } else { "across" })
        .collect();
    let mut rows = vec![
        ("name", manifest.name.clone()),
        ("BLAKE3", bundle.hash().to_owned()),
        (
            "network",
            format!(
                "{} weights, {} operations, {} bytes, operator set {}",
                facts.parameters,
                facts.nodes,
                bundle.network().len(),
                facts.opset
            ),
        ),
        ("normalisation", manifest.normalisation.to_string()),
        (
            "images",
            match manifest.tiling.whole_up_to_px {
                0 => format!("in windows of {width} x {height} px"),
                most => format!("whole up to {most} px, else in windows of {width} x {height} px"),
            },
        ),
        ("mirrored", if axes.is_empty() { "never".to_owned() } else { axes.join(", ") }),
        ("mask", manifest.postprocessing.to_string()),
    ];
    rows.extend(manifest.card.iter().map(|(key, value)| {
        let words = match value {
            Value::String(text) => text.clone(),
            Value::Null => "not stated".to_owned(),
            other => other.to_string(),
        };
        (key.as_str(), words)
    }));
    let column = rows.iter().map(|(key, _)| key.len()).max().unwrap_or(0);
    rows.iter().try_for_each(|(key, value)| console.data(&format!("{key:<column$}  {value}")))
}

fn described(bundle: &ModelBundle) -> Value {
    let facts = bundle.facts();
    json!({
        "blake3": bundle.hash(),
        "weights": facts.parameters,
        "operations": facts.nodes,
        "operator_set": facts.opset,
        "network_bytes": bundle.network().len(),
        "fixed_size": facts.fixed_size,
        "manifest": bundle.manifest(),
    })
}

/// Reading the bundle has checked all that can be checked without an engine; this runs the engines.
fn verify(
    bundle: &ModelBundle,
    onnxruntime: Option<&PathBuf>,
    console: &Console,
) -> Result<(), Failure> {
    let threads = rayon::current_num_threads();
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(RtenEngine::new(bundle, threads)?)];
    if let Some(library) = library(onnxruntime) {
        engines.push(Box::new(OrtEngine::new(&OrtRuntime::load(&library)?, bundle, threads)?));
    }
    let multiple = bundle.manifest().network.multiple_px as usize;
    let sides = match bundle.facts().fixed_size {
        Some([rows, columns]) => (rows as usize, columns as usize),
        None => (2 * multiple, 2 * multiple),
    };
    // A wire on a slope, of mean about 0 and standard deviation about 1.
    let probe = Array2::from_shape_fn(sides, |(row, col)| {
        let slope = (row as f32 / sides.0 as f32 - 0.5) * 3.0;
        if row.abs_diff(col) < 2 { slope - 2.0 } else { slope }
    });
    let mut first: Option<Array3<f32>> = None;
    let mut largest = 0.0_f32;
    for engine in &engines {
        let logits = engine.logits(&probe)?;
        if let Some(value) = logits.iter().find(|v| !v.is_finite()) {
            return Err(Failure::new(
                Failure::BAD_INPUT,
                format!("{} gives {value} on a plain image", engine.describe()),
            ));
        }
        match &first {
            None => first = Some(logits),
            Some(other) => {
                for (a, b) in other.iter().zip(&logits) {
                    largest = largest.max((a - b).abs());
                }
            }
        }
    }
    if largest > ENGINES_AGREE_TO {
        return Err(Failure::new(
            Failure::BAD_INPUT,
            format!(
                "the engines differ by {largest} in a logit; expected at most {ENGINES_AGREE_TO}"
            ),
        ));
    }
    let names: Vec<String> = engines.iter().map(|e| e.describe()).collect();
    if console.json {
        let mut report = described(bundle);
        report["engines"] = json!(names);
        report["largest_difference"] = json!(largest);
        return console.json(&report);
    }
    console.data(&format!(
        "{}: sound, runs with {} (largest difference of a logit {largest:.1e})",
        bundle.manifest().name,
        names.join(" and ")
    ))
}

fn import(args: &ImportArgs, console: &Console) -> Result<(), Failure> {
    let network = match &args.network {
        Some(network) => network.clone(),
        None => only_network(&args.folder)?,
    };
    let read = [&network, &args.folder.join("plans.json"), &args.folder.join("dataset.json")];
    make_place_apart(&args.out, read)?;
    let name = match &args.name {
        Some(name) => name.clone(),
        None => args.out.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
    };
    let foreground: Vec<&str> = args.foreground.iter().map(String::as_str).collect();
    let bundle = NnunetFolder {
        name: &name,
        plans: &read_file(&args.folder.join("plans.json"), MAX_JSON_BYTES)?,
        dataset: &read_file(&args.folder.join("dataset.json"), MAX_JSON_BYTES)?,
        network: read_file(&network, MAX_NETWORK_BYTES)?.into(),
        configuration: &args.configuration,
        foreground: &foreground,
        mirror_axes: args.mirror_axes.iter().copied().flatten().collect(),
    }
    .to_bundle()
    .map_err(|error| Failure::from(error).of_file(&args.folder))?;
    write(&bundle, &args.out, console)
}

fn only_network(folder: &Path) -> Result<PathBuf, Failure> {
    let entries = std::fs::read_dir(folder).map_err(|error| {
        Failure::new(Failure::NO_INPUT, format!("{}: {error}", folder.display()))
    })?;
    let mut networks: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "onnx"))
        .collect();
    match (networks.pop(), networks.len()) {
        (Some(only), 0) => Ok(only),
        (last, others) => Err(Failure::new(
            Failure::NO_INPUT,
            format!(
                "{}: {} .onnx files, expected one",
                folder.display(),
                others + usize::from(last.is_some())
            ),
        )
        .with_hint("name the exported network with --network")),
    }
}

fn write(bundle: &ModelBundle, out: &Path, console: &Console) -> Result<(), Failure> {
    let bytes = bundle.to_bytes()?;
    write_atomically(out, |file| file.write_all(&bytes)).map_err(Failure::of_output)?;
    if console.json {
        return console.json(&described(bundle));
    }
    console.data(&format!("{}: {} bytes, BLAKE3 {}", out.display(), bytes.len(), bundle.hash()))
}
