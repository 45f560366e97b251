//! What a shell or a packager asks for: completions, the manual, the schema of the config file.

use clap::{Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;

use crate::args::{Cli, ConfigCommand, command_line};
use crate::config::{schema, subcommands};
use crate::console::Console;
use crate::failure::Failure;

/// `accurate completions SHELL`: the completion script on stdout.
pub fn completions(shell: Shell, console: &Console) -> Result<(), Failure> {
    let mut script = Vec::new();
    // Switches as switches: of one with a value shells would complete the value as a word of its own.
    clap_complete::generate(shell, &mut Cli::command(), "accurate", &mut script);
    console.data(String::from_utf8_lossy(&script).trim_end())
}

/// `accurate man`: the manual pages of the command and of every command below it, one behind the
/// other, as roff.
pub fn manual(console: &Console) -> Result<(), Failure> {
    let mut command = without_help(command_line());
    command.build();
    let mut pages = Vec::new();
    render(&command, &mut pages).map_err(|error| Failure::new(Failure::IO, error.to_string()))?;
    console.data(String::from_utf8_lossy(&pages).trim_end())
}

/// A command without the commands called `help` in it, which have no page.
fn without_help(command: Command) -> Command {
    command.disable_help_subcommand(true).mut_subcommands(without_help)
}

/// A command's page, and those of the commands below it.
fn render(command: &Command, pages: &mut Vec<u8>) -> std::io::Result<()> {
    let name = command.get_bin_name().unwrap_or(command.get_name()).replace(' ', "-");
    // The heading of a page is one line; `--version` has two.
    Man::new(command.clone().name(name).version(env!("CARGO_PKG_VERSION"))).render(pages)?;
    subcommands(command).try_for_each(|below| render(below, pages))
}

/// `accurate config schema`: the JSON schema of the config file.
pub fn config(command: &ConfigCommand, console: &Console) -> Result<(), Failure> {
    match command {
        ConfigCommand::Schema => console.data(&format!("{:#}", schema(&command_line()))),
    }
}
