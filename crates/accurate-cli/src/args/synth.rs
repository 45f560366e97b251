use std::path::PathBuf;

use accurate3d::synth::Family;
use clap::{Args, Subcommand, ValueEnum};

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
    /// Which generator draws: `held-out` and `phantom` share no model with `training` and are for
    /// evaluation.
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
    /// Mostly pictures of pairs, half of them of C-arms: what a trained network goes on with.
    Pairs,
    /// Another background, wire, blur and noise.
    HeldOut,
    /// Wires in a transparent vessel phantom.
    Phantom,
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
