mod demo;
mod eval;
mod reconstruct;
mod synth;
mod table;
mod trace;

use crate::args::{Cli, Command};
use crate::console::Console;
use crate::failure::Failure;

/// Runs the command of a parsed command line.
pub fn run(cli: &Cli) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(cli.threads.into())
        .build_global()
        .map_err(|error| Failure::new(Failure::INTERNAL, error.to_string()))?;
    let console = Console::of(cli);
    match &cli.command {
        Command::Reconstruct(args) => reconstruct::run(args, &console),
        Command::Synth(args) => synth::run(args, &console),
        Command::Eval(args) => eval::run(args, &console),
        Command::Table(args) => table::run(args, &console),
        Command::Trace(args) => trace::run(args, &console),
        Command::Demo(args) => demo::run(args, &console),
    }
}
