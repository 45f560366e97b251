use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::GreyArgs;

/// Which network segments, and what runs it.
#[derive(Debug, Args)]
pub struct ModelArgs {
    /// The segmentation model (default: the built-in one).
    #[arg(long, value_name = "FILE.accmodel")]
    pub model: Option<PathBuf>,
    /// What runs the network: `auto` takes ONNX Runtime where its library is named, else rten.
    #[arg(long, value_enum, default_value_t = EngineChoice::Auto)]
    pub engine: EngineChoice,
    /// Library of ONNX Runtime, libonnxruntime.so.* (default: the variable ORT_DYLIB_PATH, which `auto`
    /// passes over where it names none).
    #[arg(long, value_name = "LIBRARY")]
    pub onnxruntime: Option<PathBuf>,
    /// Which mirror images of an image the network sees as well; in doubt `reconstruct` takes all.
    #[arg(long, value_enum, default_value_t = Mirror::Opposite)]
    pub mirror: Mirror,
}

/// Mirror images that probabilities are averaged over; the more, the steadier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Mirror {
    /// None.
    Never,
    /// That along both axes, a half turn: twice the time.
    Opposite,
    /// All: four times the time.
    All,
}

/// What runs a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EngineChoice {
    /// ONNX Runtime where its library is named, else rten.
    Auto,
    /// Pure Rust, built in.
    Rten,
    /// ONNX Runtime, from its library.
    Ort,
}

#[derive(Debug, Args)]
pub struct SegmentArgs {
    /// Grey images of 8 or 16 bits (PNG, JPEG, TIFF, PNM, BMP) or DICOM runs.
    #[arg(required = true, value_name = "IMAGE")]
    pub images: Vec<PathBuf>,
    /// Frame of DICOM runs, from 0 (default: the mean over all frames, for bodies at rest); outputs are
    /// then named NAME_frameINDEX_...
    #[arg(long, value_name = "INDEX")]
    pub frame: Option<u32>,
    /// Folder for NAME_mask.png, NAME_probability.png (16 bits), NAME_overlay.png and
    /// NAME_centreline.csv (the ridge of the probability between the pixels, with the width there).
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
    /// Probability above which a pixel begins the body, 0 to 1 (default: the model's own). Weaker
    /// pixels down to 0.6 of it are taken where they hang together with such a one.
    #[arg(long, value_name = "P", value_parser = probability)]
    pub threshold: Option<f32>,
    #[command(flatten)]
    pub grey: GreyArgs,
    #[command(flatten)]
    pub model: ModelArgs,
}

fn probability(text: &str) -> Result<f32, String> {
    let value = text.parse().ok().filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

#[derive(Debug, Subcommand)]
pub enum ModelCommand {
    /// Describe a model: name, network, pre- and post-processing, card.
    Info {
        /// The model (default: the built-in one).
        model: Option<PathBuf>,
    },
    /// Check a model from its hash to its weights, and run it once with every engine that is there.
    Verify {
        /// The model (default: the built-in one).
        model: Option<PathBuf>,
        /// Library of ONNX Runtime (default: the variable ORT_DYLIB_PATH).
        #[arg(long, value_name = "LIBRARY")]
        onnxruntime: Option<PathBuf>,
    },
    /// Make a model of a folder of nnU-Net v2's results and its network exported to ONNX.
    Import(ImportArgs),
    /// Make a model of a network and its description.
    Pack {
        /// The network, ONNX with its weights inside.
        network: PathBuf,
        /// The description, JSON: what `accurate --json model info` prints as `manifest`.
        #[arg(long, value_name = "FILE.json")]
        manifest: PathBuf,
        /// The model to write.
        #[arg(short, long, value_name = "FILE.accmodel")]
        out: PathBuf,
    },
}

#[derive(Debug, Args)]
pub struct ImportArgs {
    /// Folder with plans.json and dataset.json.
    pub folder: PathBuf,
    /// The exported network; it must give logits (default: the folder's only .onnx file).
    #[arg(long, value_name = "FILE.onnx")]
    pub network: Option<PathBuf>,
    /// The model to write.
    #[arg(short, long, value_name = "FILE.accmodel")]
    pub out: PathBuf,
    /// Name of the model (default: that of the file).
    #[arg(long)]
    pub name: Option<String>,
    /// Configuration of the plans that was trained.
    #[arg(long, default_value = "2d")]
    pub configuration: String,
    /// Labels that are the body (default: all but the background).
    #[arg(long, value_delimiter = ',', value_name = "LABELS")]
    pub foreground: Vec<String>,
    /// Axes that training mirrored along, 0 rows and 1 columns; empty for none. The plans do not
    /// say; nnU-Net's own trainer takes both.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0,1",
        value_name = "AXES",
        value_parser = parse_axis
    )]
    pub mirror_axes: Vec<Option<u8>>,
}

/// One of a list of axes. The empty list is one empty word.
fn parse_axis(word: &str) -> Result<Option<u8>, String> {
    match word.trim() {
        "" => Ok(None),
        "0" => Ok(Some(0)),
        "1" => Ok(Some(1)),
        _ => Err("expected 0 (rows), 1 (columns), both (0,1) or nothing".to_owned()),
    }
}
