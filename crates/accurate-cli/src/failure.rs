use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use accurate3d::Error;
use accurate3d::eval::EvalError;
use accurate3d::io::IoError;
use accurate3d::matching::MatchError;
use accurate3d::seg::SegError;
use accurate3d::synth::SynthError;
use accurate3d::traverse::TraverseError;

use crate::code::Code;
use crate::config::counts_too;
use crate::segmentation::code_of;

/// What went wrong, what to do about it, and the exit code that says so to a script.
#[derive(Debug, Clone)]
pub struct Failure {
    code: Code,
    message: String,
    hint: Option<String>,
}

impl Failure {
    pub const INTERNAL: Code = Code::Internal;
    pub const USAGE: Code = Code::Usage;
    pub const SUSPECT: Code = Code::Suspect;
    pub const BAD_INPUT: Code = Code::BadInput;
    pub const NO_INPUT: Code = Code::NoInput;
    pub const UNAVAILABLE: Code = Code::Unavailable;
    pub const IO: Code = Code::Io;

    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), hint: None }
    }

    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// A wrong option may stand in the config file.
    pub fn with_config(self, config: Option<&Path>) -> Self {
        let Some(path) = config.filter(|_| self.code == Self::USAGE) else { return self };
        let hints: Vec<String> = self.hint.clone().into_iter().chain([counts_too(path)]).collect();
        self.with_hint(hints.join("; "))
    }

    /// The same exit code and hint behind another message.
    pub fn about(self, message: String) -> Self {
        Self { message, ..self }
    }

    /// The same with the file it is about in front.
    pub fn of_file(self, path: &Path) -> Self {
        self.of(&path.display().to_string())
    }

    /// The same with what it is about in front, if it does not begin with that already.
    pub fn of(self, name: &str) -> Self {
        if self.message.starts_with(&format!("{name}: ")) {
            return self;
        }
        let message = format!("{name}: {}", self.message);
        self.about(message)
    }

    /// A failure to write `path`. A missing folder is an output error here, not a missing input.
    pub fn of_output(error: IoError) -> Self {
        match error {
            IoError::Missing { path, .. } => {
                Self::new(Self::IO, format!("cannot write {}: its folder is gone", path.display()))
            }
            error => error.into(),
        }
    }

    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code.exit())
    }
}

impl Failure {
    /// For a person. `error` in the colour of errors where the terminal shows colours.
    pub fn styled(&self, colour: bool) -> String {
        let (red, plain) = if colour { ("\x1b[1;31m", "\x1b[0m") } else { ("", "") };
        let code = self.code;
        let mut text = format!("{red}error[{code}]{plain}: {}", self.message);
        if let Some(hint) = &self.hint {
            text.push_str(&format!("\n  hint: {hint}"));
        }
        text.push_str(&format!("\n  more: accurate explain {code}"));
        text
    }

    /// For a program: the same as one line of JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "error": self.message,
            "code": self.code.name(),
            "exit": self.code.exit(),
            "hint": self.hint,
        })
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.styled(false))
    }
}

const LOOK_AT_THE_MASK: &str =
    "look at the mask: the body should be non-zero and at least 2 px long";
const LOOK_AT_THE_IMAGE: &str =
    "look at the image: it shows nothing. Is it the right file, and was it exposed?";

/// Whether a file is one that a pair folder holds.
fn is_of_a_pair(path: &Path) -> bool {
    const FOLDERS: [&str; 5] = ["calibration", "points", "masks", "images", "annotations"];
    let above = path.parent().and_then(Path::file_name);
    path.ends_with("meta.json") || FOLDERS.iter().any(|name| above.is_some_and(|f| f == *name))
}

/// For views that do not go together.
const ASK_THE_DOCTOR: &str = "`accurate camera doctor` tries the usual mistakes (swapped views, inverse extrinsics, mirrored \
     images, units, lenses) and names the one";

impl From<IoError> for Failure {
    fn from(error: IoError) -> Self {
        let (code, hint) = match &error {
            IoError::Missing { path, .. } if is_of_a_pair(path) => {
                (Self::NO_INPUT, Some("a pair folder's layout is in docs/conventions.md"))
            }
            IoError::Missing { .. } => (Self::NO_INPUT, None),
            IoError::Empty { what: "foreground pixel", .. } => {
                (Code::BadMask, Some(LOOK_AT_THE_MASK))
            }
            IoError::NoPair { .. } => {
                (Code::NoPair, Some("give a pair folder, or a folder of case_* pair folders"))
            }
            IoError::System { .. } => (Self::IO, None),
            IoError::Geometry { .. } => (
                Code::Calibration,
                Some(
                    "K is 3x3 upper triangular; [R | t] is world to camera; docs/cameras.md says what \
                     each tool's file is taken for",
                ),
            ),
            IoError::SizeMismatch { .. } => (
                Code::SizeMismatch,
                Some("masks and images must have the size the cameras are for"),
            ),
            IoError::PointOutside { .. } => (
                Code::SizeMismatch,
                Some(
                    "points are pixels (x, y) of the picture that K is for: were they scaled, cropped or swapped?",
                ),
            ),
            IoError::TooLarge { .. } => (Code::TooLarge, None),
            IoError::NotText { .. }
            | IoError::Shape { .. }
            | IoError::NotANumber { .. }
            | IoError::Malformed { .. } => (Code::Malformed, None),
            IoError::NotFinite { .. } => (Code::NotFinite, None),
            IoError::Unsupported { what, .. } if what.contains("image size") => (
                Code::Unsupported,
                Some("state it: --image-size WIDTHxHEIGHT, e.g. --image-size 512x512"),
            ),
            IoError::Unsupported { .. } | IoError::UnknownExtension { .. } => {
                (Code::Unsupported, None)
            }
            _ => (Self::BAD_INPUT, None),
        };
        let failure = Self::new(code, error.to_string());
        match hint {
            Some(hint) => failure.with_hint(hint),
            None => failure,
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let message = error.to_string();
        match error {
            Error::NotSegmented { .. } => Self::new(Self::INTERNAL, message),
            Error::MissingInput { .. } => Self::new(Self::NO_INPUT, message),
            Error::Segmentation { source, .. } => Self::from(source).about(message),
            Error::Traversal { source, .. } => Self::from(source).about(message),
            Error::Matching {
                source: MatchError::TooLarge { .. } | MatchError::OutOfMemory { .. },
                ..
            } => {
                Self::new(Code::TooLarge, message).with_hint("points some 0.5 px apart are enough")
            }
            Error::Matching { .. } => Self::new(Code::NoMatch, message).with_hint(ASK_THE_DOCTOR),
            Error::NotClosed { .. } => Self::new(Code::NoOrder, message)
                .with_hint("leave --closed out for a body with two ends"),
            Error::NoCandidate { .. } => {
                Self::new(Code::NoMatch, message).with_hint(ASK_THE_DOCTOR)
            }
            Error::Fitting { .. } => Self::new(Code::NoFit, message),
            Error::Name(_) => Self::new(Self::BAD_INPUT, message),
            Error::MixedUnits { .. } => Self::new(Self::BAD_INPUT, message)
                .with_hint("measure pairs in one unit at a time: `unit` in meta.json says which"),
            Error::OtherSize { .. } => Self::new(Code::SizeMismatch, message),
            Error::Synthesis(_) => Self::new(Self::USAGE, message),
            _ => Self::new(Self::INTERNAL, message),
        }
    }
}

impl From<clap::Error> for Failure {
    /// The parser's paragraphs: the error, a tip where it has one, the usage.
    fn from(error: clap::Error) -> Self {
        let text = error.to_string();
        let in_one_line = |part: &str| part.split_whitespace().collect::<Vec<_>>().join(" ");
        let mut parts = text.split("\n\n").map(in_one_line);
        let first = parts.next().unwrap_or_default();
        let message = first.strip_prefix("error: ").unwrap_or(&first);
        let tip = parts.find_map(|part| part.strip_prefix("tip: ").map(str::to_owned));
        Self::new(Self::USAGE, message)
            .with_hint(tip.unwrap_or_else(|| "`accurate help COMMAND` shows every option".into()))
    }
}

impl From<SynthError> for Failure {
    fn from(error: SynthError) -> Self {
        Self::new(Self::USAGE, error.to_string())
    }
}

impl From<EvalError> for Failure {
    fn from(error: EvalError) -> Self {
        Self::new(Self::BAD_INPUT, error.to_string())
    }
}

impl From<SegError> for Failure {
    fn from(error: SegError) -> Self {
        let code = code_of(&error);
        let failure = Self::new(code, error.to_string());
        match error {
            SegError::Constant { .. } => failure.with_hint(LOOK_AT_THE_IMAGE),
            _ if code == Code::BadMask => failure.with_hint(LOOK_AT_THE_MASK),
            _ => failure,
        }
    }
}

impl From<TraverseError> for Failure {
    fn from(error: TraverseError) -> Self {
        let message = error.to_string();
        match error {
            TraverseError::Empty { .. } | TraverseError::TooSmall { .. } => {
                Self::new(Code::BadMask, message).with_hint(LOOK_AT_THE_MASK)
            }
            _ => Self::new(Code::NoOrder, message)
                .with_hint("order the points yourself and use --input points"),
        }
    }
}
