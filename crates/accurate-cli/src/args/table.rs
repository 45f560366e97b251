use std::path::PathBuf;

use accurate3d::table::{Format, ScoreKind};
use accurate3d::{InputKind, Method};
use clap::{Args, ValueEnum};

use super::camera::StatedArgs;
use super::{Disturbances, ModelArgs, PointsKind};

#[derive(Debug, Args)]
pub struct EvalArgs {
    /// The curve: csv, ply, vtp, npy, npz or mrk.json.
    pub curve: PathBuf,
    /// The truth: csv, ply, vtp, npy, npz or mrk.json, points in order, in the unit of the curve.
    #[arg(long, value_name = "FILE")]
    pub truth: PathBuf,
    /// Arc length between the samples of the point-to-polyline scores, in the curve's unit
    /// (default: a 4000th of the truth's length; more where the curve is over ten times as long).
    #[arg(long, value_name = "LENGTH")]
    pub spacing: Option<f64>,
    /// Pair folder whose cameras give reprojection errors in px.
    #[arg(long, value_name = "DIR")]
    pub pair: Option<PathBuf>,
    /// The camera of a further view that took no part, in any file that `accurate camera show` reads:
    /// how far the curve's image lies from what that view shows.
    #[arg(long, value_name = "CAMERA", requires = "seen")]
    pub third: Option<PathBuf>,
    /// Which view of that file, by name, where it holds more.
    #[arg(long, value_name = "NAME", requires = "third")]
    pub view: Option<String>,
    #[command(flatten)]
    pub stated: StatedArgs,
    /// What that view shows: a mask, or points (CSV).
    #[arg(long, value_name = "MASK|CSV", requires = "third")]
    pub seen: Option<PathBuf>,
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
    /// Write the scores and doubts of every case here, and say how many of the wrong curves are suspect.
    #[arg(long, value_name = "FILE.csv")]
    pub per_case: Option<PathBuf>,
    /// Estimate a small shift and turn of camera 2 together with the curve (accurate mode only).
    #[arg(long)]
    pub refine_calibration: bool,
    /// Instead of a table: measure every cell of this file and compare it with its accepted
    /// interval.
    #[arg(long, value_name = "CELLS.csv", conflicts_with_all = [
        "set", "method", "input", "seeds", "cases", "points", "scores", "format", "out", "per_case",
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

/// A published experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Experiment {
    /// Table 1: every method on the simulation's and the phantom's sets.
    Table1,
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
