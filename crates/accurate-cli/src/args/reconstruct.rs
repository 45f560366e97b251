use std::path::PathBuf;

use accurate3d::{Closure, InputKind, Method};
use clap::{Args, ValueEnum};

use super::{GreyArgs, ModelArgs, ViewArgs};

#[derive(Debug, Args)]
pub struct ReconstructArgs {
    /// Pair folders, or folders that hold case_* pair folders. Or the files of two views, view 1
    /// first: two DICOM XA runs with their own geometry (--input image), or with --cameras two
    /// files of points (CSV), masks or images.
    #[arg(required = true, value_name = "PAIR|FILE")]
    pub inputs: Vec<PathBuf>,
    /// What of the pair to read: points, mask or image.
    #[arg(short, long)]
    pub input: InputKind,
    #[command(flatten)]
    pub views: ViewArgs,
    /// The true curve of two views given as files (csv, ply, vtp, npy, npz or mrk.json), to score against.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Frame of DICOM runs, from 0; once for both views or once for each (default: the mean over all
    /// frames, for bodies at rest).
    #[arg(long, value_name = "INDEX")]
    pub frame: Vec<u32>,
    /// accurate, paper, paper-refined, baert, baert-table, hoffmann, hoffmann-table or baur.
    #[arg(short, long, default_value_t)]
    pub method: Method,
    /// Folder for curve.csv and result.json (with several pairs, one folder a case below it), or a
    /// file whose extension says what it is to hold: .csv, .ply, .vtp, .mrk.json, .npy, .npz,
    /// .parquet, .svg or .png (picture), .html (report), .json (result). May be given several times.
    #[arg(short, long, required_unless_present = "report", value_name = "DIR|FILE")]
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
    /// Whether the body is a ring without ends, yes or no (accurate mode only); points may begin
    /// anywhere and run either way
    #[arg(long, default_value_t, value_name = "yes|no")]
    pub closed: Closure,
    /// Exit with code 4 if a result is suspect; it is written all the same.
    #[arg(long)]
    pub strict: bool,
    #[command(flatten)]
    pub grey: GreyArgs,
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

/// How the skeleton of one mask is put in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TraceMethod {
    /// The cheapest walk along the whole body, between the pixels.
    Accurate,
    /// Greedy traversal of the published method (GCTT), pixel by pixel.
    Paper,
}

#[derive(Debug, Args)]
pub struct TraceArgs {
    /// The mask image; any non-zero pixel is foreground.
    pub mask: PathBuf,
    /// How pixels are put in order.
    #[arg(short, long, value_enum, default_value_t = TraceMethod::Accurate)]
    pub method: TraceMethod,
    /// Write the ordered points `x,y` here instead of to stdout.
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}
