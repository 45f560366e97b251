use std::path::PathBuf;

use accurate3d::geom::{ImageSize, LengthUnit};
use accurate3d::io::ViewDefaults;
use clap::{Args, Subcommand, ValueEnum};

#[derive(Debug, Subcommand)]
pub enum CameraCommand {
    /// Print K, R, t and P = K [R | t] of every view, and what was assumed to get there.
    Show(CameraArgs),
    /// Write the cameras in another tool's format.
    Convert(ConvertArgs),
    /// Try the usual mistakes on two cameras, and name the one that explains what both views show.
    Doctor(DoctorArgs),
}

#[derive(Debug, Args)]
pub struct CameraArgs {
    /// DICOM XA, OpenCV YAML or XML (intrinsics and extrinsics may be two files), COLMAP text
    /// (folder), 3x4 matrices (text, CSV, NPY), MATLAB, DiffDRR or DeepDRR JSON, rig files, pair
    /// folders. The kind is told by content.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub stated: StatedArgs,
}

/// What a user states where a camera file does not.
#[derive(Debug, Args)]
pub struct StatedArgs {
    /// Image size, for camera files that state none.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub image_size: Option<ImageSize>,
    /// Unit of the world (mm, cm, m or unit), for camera files that state none.
    #[arg(long)]
    pub unit: Option<LengthUnit>,
}

impl StatedArgs {
    pub fn defaults(&self) -> ViewDefaults {
        ViewDefaults { image_size: self.image_size, unit: self.unit }
    }

    /// The first of these options that is given.
    pub fn given(&self) -> Option<&'static str> {
        let size = self.image_size.map(|_| "--image-size");
        size.or(self.unit.map(|_| "--unit"))
    }
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
#[command(after_help = "\
Examples:
  accurate camera doctor case_017                                    a pair folder
  accurate camera doctor a.dcm b.dcm --masks a_mask.png b_mask.png
  accurate camera doctor intrinsics.yml extrinsics.yml --matched beads_1.csv beads_2.csv
  accurate camera doctor rig.toml --points a.csv b.csv --points c.csv d.csv -o mended.toml")]
pub struct DoctorArgs {
    /// Files with the two cameras, of any kind that `accurate camera show` reads; or pair folders
    /// that share their cameras, whose points or masks are then what was seen.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The two views to take, by name, where the files hold more or another order.
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',')]
    pub views: Vec<String>,
    #[command(flatten)]
    pub stated: StatedArgs,
    /// Points of which row i of one file belongs to row i of the other (beads, tips): CSV with the
    /// columns x and y. They tell most.
    #[arg(long, num_args = 2, value_names = ["CSV1", "CSV2"])]
    pub matched: Vec<PathBuf>,
    /// Ordered points along the body, in either direction; may be given for several images.
    #[arg(long, num_args = 2, value_names = ["CSV1", "CSV2"])]
    pub points: Vec<PathBuf>,
    /// Masks of the body; may be given for several images.
    #[arg(long, num_args = 2, value_names = ["PNG1", "PNG2"])]
    pub masks: Vec<PathBuf>,
    /// Write the cameras with everything mended: a rig file, .toml or .json.
    #[arg(short, long, value_name = "RIG")]
    pub out: Option<PathBuf>,
    /// Exit with code 4 unless nothing is wrong.
    #[arg(long)]
    pub strict: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The second view has the optics and distances of the first. A camera that looks at the world's origin, as
a DICOM C-arm at its isocentre, turns about it, and the angles are its own; any other camera turns about
the middle of the shape, from (0, 0).")]
pub struct PlanArgs {
    /// The body as far as it is known: a curve file (csv, ply, vtp, npy, npz, mrk.json), points in order,
    /// in the world of the first view.
    #[arg(long, value_name = "CURVE")]
    pub shape: PathBuf,
    /// The first view: a DICOM XA run, or any file that `accurate camera show` reads.
    #[arg(long, value_name = "FILE")]
    pub first: PathBuf,
    /// Which view of that file, by name, where it holds more.
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    #[command(flatten)]
    pub stated: StatedArgs,
    /// Primary angles that the second view may have, degrees.
    #[arg(long, value_name = "MIN..MAX", default_value = "-90..90", value_parser = parse_angles,
        allow_hyphen_values = true)]
    pub primary: AngleRange,
    /// Secondary angles that the second view may have, degrees.
    #[arg(long, value_name = "MIN..MAX", default_value = "-45..45", value_parser = parse_angles,
        allow_hyphen_values = true)]
    pub secondary: AngleRange,
    /// Step of both angles, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 5.0)]
    pub step: f64,
    /// Standard deviation of a traced centreline, px.
    #[arg(long, value_name = "PX", default_value_t = 0.5)]
    pub sigma_px: f64,
    /// Files to write, by extension: .svg or .png (heat map), .csv (every view).
    #[arg(short, long, value_name = "FILE")]
    pub out: Vec<PathBuf>,
}

/// A range of angles, degrees.
#[derive(Debug, Clone, Copy)]
pub struct AngleRange(pub [f64; 2]);

fn parse_angles(text: &str) -> Result<AngleRange, String> {
    let ends = text.split_once("..").map(|(low, high)| (low.trim().parse(), high.trim().parse()));
    match ends {
        Some((Ok(low), Ok(high))) if low <= high => Ok(AngleRange([low, high])),
        _ => Err("expected MIN..MAX in degrees, e.g. -60..60".to_owned()),
    }
}

/// The cameras of two views whose data is given as files.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// A file with cameras, of any kind that `accurate camera show` reads; several times for
    /// several files, view 1 first.
    #[arg(long, value_name = "FILE")]
    pub cameras: Vec<PathBuf>,
    /// The two views to take, by name, where the files hold more or another order.
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',')]
    pub views: Vec<String>,
    #[command(flatten)]
    pub stated: StatedArgs,
}
