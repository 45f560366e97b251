use std::path::PathBuf;

use accurate3d::geom::{ImageSize, LengthUnit};
use accurate3d::synth::Family;
use accurate3d::table::{Format, ScoreKind};
use accurate3d::{Closure, FigureKind, InputKind, Method};
use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};

use crate::code::Code;

const VERSION: &str =
    concat!(env!("CARGO_PKG_VERSION"), "\nResearch software: not for clinical use.");

/// 3D reconstruction of thin flexible bodies (guidewires, catheters, continuum robots) from two
/// calibrated views.
///
/// Research software: not for clinical use.
#[derive(Debug, Parser)]
#[command(name = "accurate", version = VERSION, arg_required_else_help = true, after_help = EXAMPLES)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,

    /// Say less: errors only.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,

    /// Say more; repeat for more still.
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub verbose: u8,

    /// Print machine-readable JSON instead of prose on stdout.
    #[arg(long, global = true)]
    pub json: bool,

    /// TOML file with options of the commands; what stands on the command line wins over it.
    // Read before the command line is parsed, see `config.rs`.
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,

    /// Worker threads, at most 1024; 0 takes all cores. The results are the same for any number.
    #[arg(
        long,
        global = true,
        default_value_t = 0,
        value_name = "N",
        value_parser = clap::value_parser!(u16).range(0..=1024)
    )]
    pub threads: u16,
}

const EXAMPLES: &str = "\
Examples:
  accurate demo                                        a shipped pair, reconstructed and scored
  accurate reconstruct case_017 --input mask -o out    one pair folder
  accurate reconstruct case_017 -i mask -o wire.vtp -o wire.mrk.json -o report.html
  accurate eval out/curve.csv --truth case_017/annotations/guidewire_3D.ply
  accurate table                                       the paper's table, beside its figures
  accurate reproduce table1 -o out/table1              the same with hashes, to be verified
  accurate explain A021                                what an error means

Exit codes: 0 done; 1 internal error; 2 wrong usage; 3 no reconstruction found;
4 suspect result (--strict); 65 bad input; 66 input missing; 69 a needed part is not installed; 74 a file could not be read or written.";

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Reconstruct the 3D curve of one or more pair folders.
    Reconstruct(ReconstructArgs),
    /// Generate pair folders with exact truth from a seeded family.
    Synth(SynthArgs),
    /// Score a curve file against its truth.
    Eval(EvalArgs),
    /// Make the paper's comparison table, its published figures beside ours.
    Table(TableArgs),
    /// Order the pixels of one mask along its curve.
    Trace(TraceArgs),
    /// Find the thin body in images: mask, probability, skeleton over the image.
    Segment(SegmentArgs),
    /// Look at, check, make and import segmentation models.
    #[command(subcommand)]
    Model(ModelCommand),
    /// Reconstruct and score a shipped pair, with a picture.
    Demo(DemoArgs),
    /// Draw one of the paper's kinds of figure from our own data.
    Figure(FigureArgs),
    /// Run a published experiment and record what it was run with, so that it can be verified.
    Reproduce(ReproduceArgs),
    /// Run a recorded experiment again and compare every file.
    Verify(VerifyArgs),
    /// Show cameras of any known file in one convention, or convert them.
    #[command(subcommand)]
    Camera(CameraCommand),
    /// Say what the code of an error means and what to do about it.
    Explain(ExplainArgs),
    /// Print the completion script of a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Print the manual as roff: `accurate man | man -l -`.
    Man,
    /// About the file that --config reads.
    #[command(subcommand)]
    Config(ConfigCommand),
}

/// Which network segments, and what runs it.
#[derive(Debug, Args)]
pub struct ModelArgs {
    /// The segmentation model (default: the built-in one).
    #[arg(long, value_name = "FILE.accmodel")]
    pub model: Option<PathBuf>,
    /// What runs the network: `auto` takes ONNX Runtime where its library is named, else rten.
    #[arg(long, value_enum, default_value_t = EngineChoice::Auto)]
    pub engine: EngineChoice,
    /// Library of ONNX Runtime, libonnxruntime.so.* (default: the variable ORT_DYLIB_PATH).
    #[arg(long, value_name = "LIBRARY")]
    pub onnxruntime: Option<PathBuf>,
    /// Let the network see the mirrored images as well: steadier, up to four times the time.
    #[arg(long)]
    pub mirror: bool,
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

/// Meaning of an image's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Photometric {
    /// The body is darker than its surroundings.
    Monochrome2,
    /// The stored values are inverted: the body is brighter.
    Monochrome1,
}

#[derive(Debug, Args)]
pub struct SegmentArgs {
    /// Grey images of 8 or 16 bits: PNG, JPEG, TIFF, PNM, BMP.
    #[arg(required = true, value_name = "IMAGE")]
    pub images: Vec<PathBuf>,
    /// Folder for NAME_mask.png, NAME_probability.png (16 bits) and NAME_overlay.png.
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
    /// Probability above which a pixel begins the body, 0 to 1 (default: the model's own). Weaker
    /// pixels down to 0.6 of it are taken where they hang together with such a one.
    #[arg(long, value_name = "P")]
    pub threshold: Option<f32>,
    /// Whether the body is dark or bright in the stored values.
    #[arg(long, value_enum, default_value_t = Photometric::Monochrome2)]
    pub photometric: Photometric,
    #[command(flatten)]
    pub model: ModelArgs,
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
    #[arg(long, value_delimiter = ',', default_value = "0,1", value_name = "AXES")]
    pub mirror_axes: Vec<u8>,
}

#[derive(Debug, Subcommand)]
pub enum ConfigCommand {
    /// Print the JSON schema of the config file.
    Schema,
}

#[derive(Debug, Subcommand)]
pub enum CameraCommand {
    /// Print K, R, t and P = K [R | t] of every view, and what was assumed to get there.
    Show(CameraArgs),
    /// Write the cameras in another tool's format.
    Convert(ConvertArgs),
}

#[derive(Debug, Args)]
pub struct CameraArgs {
    /// DICOM XA, OpenCV YAML or XML (intrinsics and extrinsics may be two files), COLMAP text
    /// (folder), 3x4 matrices (text, CSV, NPY), MATLAB, DiffDRR or DeepDRR JSON, rig files, pair
    /// folders. The kind is told by content.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Image size, for files that state none.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub image_size: Option<ImageSize>,
    /// Unit of the world (mm, cm, m or unit), for files that state none.
    #[arg(long)]
    pub unit: Option<LengthUnit>,
}

#[derive(Debug, Args)]
pub struct ConvertArgs {
    #[command(flatten)]
    pub cameras: CameraArgs,
    /// The format to write.
    #[arg(long, value_enum)]
    pub to: CameraTarget,
    /// The file to write; for COLMAP a folder.
    #[arg(short, long, value_name = "OUT")]
    pub out: PathBuf,
}

/// A format that cameras are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CameraTarget {
    OpencvYaml,
    OpencvXml,
    Colmap,
    RigToml,
    RigJson,
    /// 3x4 matrices as text.
    PTxt,
    /// What `camera show --json` prints.
    ViewsJson,
}

fn parse_size(text: &str) -> Result<ImageSize, String> {
    let sides = text.split_once('x').map(|(w, h)| (w.parse(), h.parse()));
    match sides {
        Some((Ok(width), Ok(height))) if width > 0 && height > 0 => Ok(ImageSize { width, height }),
        _ => Err("expected WIDTHxHEIGHT in px, e.g. 512x512".to_owned()),
    }
}

#[derive(Debug, Args)]
pub struct ExplainArgs {
    /// A code such as A021; all of them without one.
    pub code: Option<Code>,
}

/// A published experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Experiment {
    /// Table 1: every method on the simulation's and the phantom's sets.
    Table1,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Figures:
  overview    masks, ordered curves, correspondences and the 3D curve
  gctt        the order that the paper's traversal and ours give to the same masks
  ecdp        epipolar distances of all pairs of points, and the pairs that ECDP chose
  simulation  curves of four methods on the truth, simulated cases
  phantom     the same on the phantom's stand-in")]
pub struct FigureArgs {
    /// overview, gctt, ecdp, simulation or phantom.
    pub kind: FigureKind,
    /// Pair folders to show (default: generated cases).
    #[arg(value_name = "PAIR")]
    pub pairs: Vec<PathBuf>,
    /// The SVG file.
    #[arg(short, long, value_name = "FILE.svg")]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
pub struct ReproduceArgs {
    /// What to run.
    #[arg(value_enum)]
    pub experiment: Experiment,
    /// Folder for the tables and manifest.json.
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
    /// Seeds of the generated sets.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,5")]
    pub seeds: Vec<u64>,
    /// Cases per seed; the paper's simulation test split has 26.
    #[arg(long, default_value_t = 26)]
    pub cases: u64,
    /// Cases per seed of the image rows, which take seconds each; 0 leaves them out.
    #[arg(long, default_value_t = 4)]
    pub image_cases: u64,
    #[command(flatten)]
    pub model: ModelArgs,
}

#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Folder that `accurate reproduce` wrote.
    pub dir: PathBuf,
    #[command(flatten)]
    pub model: ModelArgs,
}

#[derive(Debug, Args)]
pub struct ReconstructArgs {
    /// Pair folders, or folders that hold case_* pair folders.
    #[arg(required = true, value_name = "PAIR")]
    pub pairs: Vec<PathBuf>,
    /// What of the pair to read: points, mask or image.
    #[arg(short, long)]
    pub input: InputKind,
    /// accurate, paper, paper-refined, baert, baert-table, hoffmann, hoffmann-table or baur.
    #[arg(short, long, default_value_t)]
    pub method: Method,
    /// Folder for curve.csv and result.json (with several pairs, one folder a case below it), or a
    /// file whose extension says what it is to hold: .csv, .ply, .vtp, .mrk.json, .npy, .npz,
    /// .parquet, .svg (picture), .html (report), .json (result). May be given several times.
    #[arg(short, long, required = true, value_name = "DIR|FILE")]
    pub out: Vec<PathBuf>,
    /// Files to write into the folder besides curve.csv and result.json.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "KINDS")]
    pub also: Vec<Extra>,
    /// Also write picture.svg.
    #[arg(long)]
    pub picture: bool,
    /// Also write the report, one HTML page that needs no network; same as --out FILE.html.
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Estimate a small shift and turn of camera 2 together with the curve (accurate mode only).
    #[arg(long)]
    pub refine_calibration: bool,
    /// Whether the body is a ring without ends, yes or no (accurate mode only). Experimental: right
    /// on exact points that begin at the same place only; whole pixels and masks come out wrong.
    #[arg(long, default_value_t, value_name = "yes|no")]
    pub closed: Closure,
    /// Exit with code 4 if a result is suspect; it is written all the same.
    #[arg(long)]
    pub strict: bool,
    #[command(flatten)]
    pub model: ModelArgs,
}

/// A file that a result's folder may hold besides curve.csv and result.json.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Extra {
    Ply,
    /// VTK PolyData, for ParaView.
    Vtp,
    /// Markups of 3D Slicer.
    MrkJson,
    Npy,
    Npz,
    Parquet,
    /// picture.svg.
    Picture,
    /// report.html.
    Report,
}

impl Extra {
    pub const fn file_name(self) -> &'static str {
        match self {
            Self::Ply => "curve.ply",
            Self::Vtp => "curve.vtp",
            Self::MrkJson => "curve.mrk.json",
            Self::Npy => "curve.npy",
            Self::Npz => "curve.npz",
            Self::Parquet => "curve.parquet",
            Self::Picture => "picture.svg",
            Self::Report => "report.html",
        }
    }
}

#[derive(Debug, Args)]
#[command(
    after_help = families_help(),
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true
)]
pub struct SynthArgs {
    #[command(subcommand)]
    pub images: Option<SynthCommand>,
    #[command(flatten)]
    pub cases: CasesArgs,
}

#[derive(Debug, Subcommand)]
pub enum SynthCommand {
    /// Single labelled X-ray images, randomised, for training and testing a segmentation.
    Xray(XrayArgs),
}

#[derive(Debug, Args)]
pub struct CasesArgs {
    /// The family of curves.
    // `xray` does without: required unless that command is given.
    #[arg(required = true)]
    pub family: Option<Family>,
    /// How many cases.
    #[arg(short = 'n', long, default_value_t = 10)]
    pub count: u64,
    /// Index of the first case; the case of an index is the same whatever else is generated.
    #[arg(long, default_value_t = 0, value_name = "INDEX")]
    pub first: u64,
    /// Seed of the family's named random streams.
    #[arg(short, long, default_value_t = 0)]
    pub seed: u64,
    /// Folder for case_000, case_001, ...
    #[arg(short, long, value_name = "DIR", required = true)]
    pub out: Option<PathBuf>,
    /// Which ordered points to write.
    #[arg(long, value_enum, default_value_t = PointsKind::Rounded)]
    pub points: PointsKind,
    /// Also render X-ray-like images.
    #[arg(long)]
    pub xray: bool,
    #[command(flatten)]
    pub disturbances: Disturbances,
}

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("output").required(true).multiple(true).args(["shards", "sheet"]))]
pub struct XrayArgs {
    /// Folder for shard-000000.npy, ... (uint8, n x 3 x H x W: image, mask, tube) and shards.json;
    /// shards that are there are kept.
    #[arg(long, value_name = "DIR")]
    pub shards: Option<PathBuf>,
    /// A contact sheet (PNG): every image beside itself with its label.
    #[arg(long, value_name = "PNG")]
    pub sheet: Option<PathBuf>,
    /// Which generator draws: `held-out` shares no model with `training` and is for evaluation.
    #[arg(long, value_enum, default_value_t = XrayGenerator::Training)]
    pub generator: XrayGenerator,
    /// Draw wires onto these grey images instead (evaluation): image i onto file i modulo their
    /// number, a square of --size from its middle.
    #[arg(long, value_name = "IMAGE", num_args = 1.., conflicts_with = "generator")]
    pub onto: Vec<PathBuf>,
    /// How many images.
    #[arg(short = 'n', long, default_value_t = 24, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    pub count: u64,
    /// Index of the first image; the image of an index is the same whatever else is generated.
    #[arg(long, default_value_t = 0, value_name = "INDEX")]
    pub first: u64,
    /// Seed of the set: 2000 to train, 1500 to validate, 1 to 999 to evaluate.
    #[arg(short, long, default_value_t = 0)]
    pub seed: u64,
    /// Width and height of an image, px.
    #[arg(long, default_value_t = 512, value_name = "PX")]
    pub size: u32,
    /// Images per shard.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub per_shard: u64,
}

/// What draws single X-ray images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum XrayGenerator {
    /// The randomised domain that networks are trained on.
    Training,
    /// Another background, wire, blur and noise.
    HeldOut,
}

/// The two kinds of ordered points a generated case has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PointsKind {
    /// The paper's protocol: visible truth points, rounded to whole pixels.
    Rounded,
    /// Exact sub-pixel projections, about one a pixel.
    Exact,
}

#[derive(Debug, Args)]
pub struct Disturbances {
    /// Thickness of the wire in the masks, px (default: the family's own).
    #[arg(long, value_name = "PX")]
    pub mask_thickness_px: Option<f64>,
    /// Occlusion discs per view, e.g. 1-2.
    #[arg(long, value_name = "MIN-MAX", value_parser = parse_range)]
    pub occlusions: Option<(u32, u32)>,
    /// Radius of the occlusion discs, px.
    #[arg(long, value_name = "PX", default_value_t = 8.0)]
    pub occlusion_radius_px: f64,
    /// Rotation of camera 2 about its centre that the calibration does not know, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    pub calibration_rotation_deg: f64,
    /// Shift of camera 2's principal point that the calibration does not know, px.
    #[arg(long, value_name = "PX", default_value_t = 0.0)]
    pub calibration_shift_px: f64,
}

fn parse_range(text: &str) -> Result<(u32, u32), String> {
    let (low, high) = text.split_once('-').unwrap_or((text, text));
    match (low.trim().parse(), high.trim().parse()) {
        (Ok(low), Ok(high)) if low <= high => Ok((low, high)),
        _ => Err("expected MIN-MAX with MIN <= MAX, e.g. 1-2".to_owned()),
    }
}

fn families_help() -> String {
    let mut help = String::from("Families:\n");
    for family in Family::ALL {
        help.push_str(&format!("  {:<10} {}\n", family.to_string(), family.describe()));
    }
    help
}

#[derive(Debug, Args)]
pub struct EvalArgs {
    /// The curve: csv, ply, vtp or npy.
    pub curve: PathBuf,
    /// The truth: csv, ply, vtp or npy, points in order.
    #[arg(long, value_name = "FILE")]
    pub truth: PathBuf,
    /// Arc length between the samples of the point-to-polyline scores, in the curve's unit
    /// (default: a 4000th of the truth's length).
    #[arg(long, value_name = "LENGTH")]
    pub spacing: Option<f64>,
    /// Pair folder whose cameras give reprojection errors in px.
    #[arg(long, value_name = "DIR")]
    pub pair: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct TableArgs {
    /// A family (sim-paper, carm, easy, ...), or a folder of pair folders with truth.
    #[arg(long, default_value = "sim-paper")]
    pub set: String,
    /// Only these methods (default: all of the table).
    #[arg(long, value_delimiter = ',')]
    pub method: Vec<Method>,
    /// Only these inputs (default: all of the table).
    #[arg(long, value_delimiter = ',')]
    pub input: Vec<InputKind>,
    /// Seeds of a generated set.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,5")]
    pub seeds: Vec<u64>,
    /// Cases per seed; the paper's simulation test split has 26.
    #[arg(long, default_value_t = 26)]
    pub cases: u64,
    /// Ordered points of a generated set.
    #[arg(long, value_enum, default_value_t = PointsKind::Rounded)]
    pub points: PointsKind,
    /// Which scores: `table` as in the paper (points to points), or `polyline` (points to curve,
    /// both ways).
    #[arg(long, default_value_t)]
    pub scores: ScoreKind,
    /// md, csv, tex, html or json (default: a table for the terminal).
    #[arg(long)]
    pub format: Option<Format>,
    /// Write the table here instead of to stdout.
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Estimate a small shift and turn of camera 2 together with the curve (accurate mode only).
    #[arg(long)]
    pub refine_calibration: bool,
    /// Instead of a table: measure every cell of this file and compare it with its accepted
    /// interval.
    #[arg(long, value_name = "CELLS.csv", conflicts_with_all = [
        "set", "method", "input", "seeds", "cases", "points", "scores", "format", "out",
        "refine_calibration", "mask_thickness_px", "occlusions", "occlusion_radius_px",
        "calibration_rotation_deg", "calibration_shift_px",
    ])]
    pub check: Option<PathBuf>,
    /// With --check: set the accepted intervals of this row's cells to what was measured and write
    /// the file again.
    #[arg(long, value_name = "ROW", requires = "check")]
    pub accept: Option<String>,
    #[command(flatten)]
    pub disturbances: Disturbances,
    #[command(flatten)]
    pub model: ModelArgs,
}

#[derive(Debug, Args)]
pub struct TraceArgs {
    /// The mask image; any non-zero pixel is foreground.
    pub mask: PathBuf,
    /// Write the ordered points `x,y` here instead of to stdout.
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the pair, the curve, the scores and the picture.
    #[arg(short, long, value_name = "DIR", default_value = "out/demo")]
    pub out: PathBuf,
}
