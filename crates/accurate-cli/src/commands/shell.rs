//! What a shell or a packager asks for: completions, the manual, the schema of the config file.

use clap::CommandFactory;
use clap_complete::Shell;

use crate::args::{Cli, ConfigCommand};
use crate::config::schema;
use crate::console::Console;
use crate::failure::Failure;

/// `accurate completions SHELL`: the completion script on stdout.
pub fn completions(shell: Shell, console: &Console) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "accurate", &mut script);
    console.data(String::from_utf8_lossy(&script).trim_end())
}

/// `accurate man`: the manual pages of the command and of every command below it, one behind the
/// other, as roff.
pub fn manual(console: &Console) -> Result<(), Failure> {
    let mut pages = Vec::new();
    let mut command = Cli::command();
    command.build();
    let mut render = |command: clap::Command| {
        clap_mangen::Man::new(command)
            .render(&mut pages)
            .map_err(|error| Failure::new(Failure::IO, error.to_string()))
    };
    render(command.clone())?;
    for below in command.get_subcommands().filter(|below| !below.is_hide_set()) {
        let name = below.get_bin_name().unwrap_or(below.get_name()).replace(' ', "-");
        render(below.clone().name(name))?;
    }
    console.data(String::from_utf8_lossy(&pages).trim_end())
}

/// `accurate config schema`: the JSON schema of the config file.
pub fn config(command: &ConfigCommand, console: &Console) -> Result<(), Failure> {
    match command {
        ConfigCommand::Schema => console.data(&format!("{:#}", schema(&Cli::command()))),
    }
}
