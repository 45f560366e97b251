use std::io::{IsTerminal, Write};
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::time::Duration;

use accurate3d::seg::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::args::Cli;
use crate::failure::Failure;

/// What the user wants to see: data on stdout, prose on stderr.
#[derive(Debug, Clone, Copy)]
pub struct Console {
    pub json: bool,
    quiet: bool,
    verbose: u8,
}

impl Console {
    pub fn of(cli: &Cli) -> Self {
        Self { json: cli.json, quiet: cli.quiet, verbose: cli.verbose }
    }

    /// A line of data.
    pub fn data(&self, line: &str) -> Result<(), Failure> {
        // A reader such as `head` may close the pipe early; that is its right, not an error.
        match writeln!(std::io::stdout().lock(), "{line}") {
            Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
                Err(Failure::new(Failure::IO, format!("stdout: {error}")))
            }
            _ => Ok(()),
        }
    }

    /// A value as JSON on stdout.
    pub fn json(&self, value: &impl Serialize) -> Result<(), Failure> {
        let text = serde_json::to_string(value)
            .map_err(|error| Failure::new(Failure::INTERNAL, error.to_string()))?;
        self.data(&text)
    }

    /// A remark, unless `-q`.
    pub fn remark(&self, line: &str) {
        if !self.quiet {
            to_stderr(line);
        }
    }

    /// A detail, with `-v`.
    pub fn detail(&self, line: &str) {
        if self.verbose > 0 {
            to_stderr(line);
        }
    }

    /// The failure of one of several things, also with `-q`. `kind` says what `name` is one of: the
    /// key of the JSON form.
    pub fn failure_of(&self, kind: &str, name: &str, failure: &Failure) {
        if self.json {
            let mut value = failure.json();
            value[kind] = name.into();
            to_stderr(&value.to_string());
        } else {
            to_stderr(&failure.clone().of(name).styled(coloured()));
        }
    }

    /// A bar with the time left on a terminal; nothing elsewhere.
    pub fn progress(&self, total: usize, what: &'static str) -> ProgressBar {
        if self.quiet || total < 2 {
            return ProgressBar::hidden();
        }
        bar(total, what)
    }

    /// The same for the windows of large images, `count` of which are looked at; where those are several, or
    /// an image is small, nothing.
    pub fn windows(&self, count: usize) -> impl Fn(Progress) -> ControlFlow<()> + Sync + use<> {
        const LEAST: usize = 4;
        let shown = !self.quiet && count == 1;
        let current = OnceLock::new();
        move |Progress { done, total }| {
            if shown && total >= LEAST {
                let bar = current.get_or_init(|| bar(total, "segmenting"));
                if bar.is_finished() {
                    bar.reset();
                }
                bar.set_length(total as u64);
                bar.set_position(done as u64);
                if done == total {
                    bar.finish_and_clear();
                }
            }
            ControlFlow::Continue(())
        }
    }
}

fn bar(total: usize, what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(total as u64).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:30} {pos}/{len}, {eta} left") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// A line of prose. Where nobody reads stderr (`2>&1 | head`) there is nobody to tell either.
pub fn to_stderr(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Whether stderr shows colours.
pub fn coloured() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}
