use std::path::PathBuf;

use accurate3d::FigureKind;
use clap::Args;

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
    /// The picture, .svg or .png.
    #[arg(short, long, value_name = "FILE")]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the pair, the curve, the scores and the picture.
    #[arg(short, long, value_name = "DIR", default_value = "out/demo")]
    pub out: PathBuf,
}
