mod camera;
mod demo;
mod doctor;
mod eval;
mod explain;
mod figure;
mod model;
mod outputs;
mod plan;
mod reconstruct;
mod reproduce;
mod segment;
mod shell;
mod synth;
mod table;
mod trace;
mod verify;
mod xray;

use crate::args::{Cli, Command};
use crate::console::Console;
use crate::failure::Failure;

/// Runs the command of a parsed command line. `config` is the config file that gives the same run.
pub fn run(cli: &Cli, config: &str) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(cli.threads.into())
        .build_global()
        .map_err(|error| Failure::new(Failure::INTERNAL, error.to_string()))?;
    let console = Console::of(cli);
    match &cli.command {
        Command::Reconstruct(args) => reconstruct::run(args, config, &console),
        Command::Synth(args) => synth::run(args, &console),
        Command::Eval(args) => eval::run(args, &console),
        Command::Table(args) => table::run(args, &console),
        Command::Figure(args) => figure::run(args, &console),
        Command::Trace(args) => trace::run(args, &console),
        Command::Segment(args) => segment::run(args, &console),
        Command::Model(command) => model::run(command, &console),
        Command::Demo(args) => demo::run(args, &console),
        Command::Reproduce(args) => reproduce::run(args, &console),
        Command::Verify(args) => verify::run(args, &console),
        Command::Camera(command) => camera::run(command, &console),
        Command::PlanViews(args) => plan::run(args, &console),
        Command::Explain(args) => explain::run(args, &console),
        Command::Completions { shell } => shell::completions(*shell, &console),
        Command::Man => shell::manual(&console),
        Command::Config(command) => shell::config(command, &console),
    }
}
