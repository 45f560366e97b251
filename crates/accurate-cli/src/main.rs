//! The command `accurate`: two calibrated views in, a 3D curve out.
//!
//! stdout is data, stderr is prose; every error has a code, ends in a hint where there is one, and is
//! JSON with `--json`.

// Printing is this binary's job; the libraries below it never do.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod code;
mod commands;
mod config;
mod console;
mod dicom_child;
mod failure;
mod raster;
mod segmentation;
mod text;
mod two_views;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches};

use crate::args::Cli;
use crate::failure::Failure;

fn main() -> ExitCode {
    let words: Vec<_> = std::env::args_os().collect();
    // As asked for on the command line alone: an unreadable config file is reported in that form too.
    let json = words.iter().any(|word| word == "--json");
    match run(words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) if json => {
            eprintln!("{}", failure.json());
            failure.exit_code()
        }
        Err(failure) => {
            let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
            eprintln!("{}", failure.styled(colour));
            failure.exit_code()
        }
    }
}

fn run(words: Vec<std::ffi::OsString>) -> Result<(), Failure> {
    // Before anything else takes memory: this process may be the limited reader of one file.
    if words.get(1).is_some_and(|word| word == dicom_child::WORD) {
        return dicom_child::child(&words);
    }
    // What a config file says stands before what the user says, and the last word wins.
    let command = Cli::command().args_override_self(true);
    let words = config::expand(&command, words)?;
    let matches = command.clone().get_matches_from(words);
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    commands::run(&cli, &config::effective(&command, &matches))
}
