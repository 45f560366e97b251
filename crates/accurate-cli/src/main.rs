//! The command `accurate`: two calibrated views in, a 3D curve out.
//!
//! stdout is data, stderr is prose; every error has a code, ends in a hint where there is one, and is
//! JSON with `--json`.

// Printing is this binary's job; the libraries below it never do.
#![allow(clippy::print_stdout)]

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
mod units;

use std::process::ExitCode;

use clap::FromArgMatches;
use clap::error::ErrorKind;

use crate::args::{Cli, command_line};
use crate::console::{coloured, to_stderr};
use crate::failure::Failure;

fn main() -> ExitCode {
    let words: Vec<_> = std::env::args_os().collect();
    // As asked for on the command line alone: an unreadable config file is reported in that form too.
    let json = words.iter().any(|word| word == "--json");
    match run(words, json) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) if json => {
            to_stderr(&failure.json().to_string());
            failure.exit_code()
        }
        Err(failure) => {
            to_stderr(&failure.styled(coloured()));
            failure.exit_code()
        }
    }
}

fn run(words: Vec<std::ffi::OsString>, json: bool) -> Result<(), Failure> {
    // Before anything else takes memory: this process may be the limited reader of one file.
    if words.get(1).is_some_and(|word| word == dicom_child::WORD) {
        return dicom_child::child(&words);
    }
    // What a config file says stands before what the user says, and the last word wins.
    let command = command_line();
    let config_file = config::config_path(&words);
    let words = config::expand(&command, words)?;
    let parsed = command
        .clone()
        .try_get_matches_from(words)
        .and_then(|matches| Ok((Cli::from_arg_matches(&matches)?, matches)));
    let (cli, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(error) if json && is_mistake(&error) => {
            return Err(Failure::from(error).with_config(config_file.as_deref()));
        }
        // The parser's own words show more: the usage, in colours.
        Err(error) if is_mistake(&error) => {
            let _ = error.print();
            if let Some(path) = &config_file {
                to_stderr(&format!("  {}", config::counts_too(path)));
            }
            to_stderr(&format!("  more: accurate explain {}", Failure::USAGE));
            std::process::exit(error.exit_code())
        }
        Err(error) => error.exit(),
    };
    commands::run(&cli, &config::effective(&command, &matches))
        .map_err(|failure| failure.with_config(config_file.as_deref()))
}

/// Whether the command line is wrong, rather than a question for help or the version.
fn is_mistake(error: &clap::Error) -> bool {
    error.use_stderr() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
}
