//! The command `accurate`: two calibrated views in, a 3D curve out.
//!
//! stdout is data, stderr is prose; every error ends in a hint where there is one.

// Printing is this binary's job; the libraries below it never do.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod commands;
mod console;
mod failure;
mod text;

use clap::Parser;

fn main() -> std::process::ExitCode {
    let cli = args::Cli::parse();
    match commands::run(&cli) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            failure.exit_code()
        }
    }
}
