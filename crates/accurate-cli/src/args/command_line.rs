use clap::{Arg, ArgAction, Command, CommandFactory, value_parser};

use super::Cli;

/// The definition of the command line: what [`Cli`] derives, its switches also as `--switch=false`,
/// by which a user turns off what a config file turns on. Of an option that is given twice the last
/// one counts.
pub fn command_line() -> Command {
    with_settable_switches(Cli::command()).args_override_self(true)
}

/// Whether an option is on or off.
pub fn is_switch(arg: &Arg) -> bool {
    arg.get_value_parser().type_id() == value_parser!(bool).type_id()
}

fn with_settable_switches(command: Command) -> Command {
    command.mut_args(settable).mut_subcommands(with_settable_switches)
}

fn settable(arg: Arg) -> Arg {
    // `--json` stands in no file.
    if !matches!(arg.get_action(), ArgAction::SetTrue) || arg.get_long() == Some("json") {
        return arg;
    }
    arg.action(ArgAction::Set)
        .value_parser(value_parser!(bool))
        .value_name("true|false")
        .num_args(0..=1)
        // What follows a switch after a space is the next argument.
        .require_equals(true)
        .default_value("false")
        .default_missing_value("true")
        .hide_default_value(true)
        .hide_possible_values(true)
}
