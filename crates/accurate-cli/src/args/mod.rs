//! The command line: one file for the options of related commands.

mod camera;
mod command_line;
mod figure;
mod grey;
mod reconstruct;
mod segment;
mod synth;
mod table;

use std::path::PathBuf;

use clap::{ArgAction, Args, Parser, Subcommand};

pub use self::camera::{
    CameraArgs, CameraCommand, CameraTarget, ConvertArgs, DoctorArgs, PlanArgs, ViewArgs,
};
pub use self::command_line::{command_line, is_switch};
pub use self::figure::{DemoArgs, FigureArgs};
pub use self::grey::GreyArgs;
pub use self::reconstruct::{Extra, ReconstructArgs, TraceArgs, TraceMethod};
pub use self::segment::{EngineChoice, ImportArgs, Mirror, ModelArgs, ModelCommand, SegmentArgs};
pub use self::synth::{
    CasesArgs, Disturbances, PointsKind, SynthArgs, SynthCommand, XrayArgs, XrayGenerator,
};
pub use self::table::{EvalArgs, Experiment, ReproduceArgs, TableArgs, VerifyArgs};
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
  accurate reconstruct a.dcm b.dcm -i image -o out     two DICOM runs with their own geometry
  accurate reconstruct --cameras rig.toml a_mask.png b_mask.png -i mask -o out
  accurate eval out/curve.csv --truth case_017/annotations/guidewire_3D.ply
  accurate table                                       the paper's table, beside its figures
  accurate reproduce table1 -o out/table1              the same with hashes, to be verified
  accurate camera doctor a.dcm b.dcm --masks a.png b.png
  accurate explain A021                                what an error means

Exit codes: 0 done; 1 internal error, or a check (table --check, verify) that failed; 2 wrong usage; 3 no reconstruction found;
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
    /// Put the centreline of one mask in order.
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
    /// Show cameras of any known file in one convention, convert them, find what is wrong with them.
    #[command(subcommand)]
    Camera(CameraCommand),
    /// Say which second view sees a body best: the 3D error to expect over its angles.
    PlanViews(PlanArgs),
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

#[derive(Debug, Subcommand)]
pub enum ConfigCommand {
    /// Print the JSON schema of the config file.
    Schema,
}

#[derive(Debug, Args)]
pub struct ExplainArgs {
    /// A code such as A021; all of them without one.
    pub code: Option<Code>,
}
