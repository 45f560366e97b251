use std::fmt;
use std::process::ExitCode;

use accurate3d::Error;
use accurate3d::eval::EvalError;
use accurate3d::io::IoError;
use accurate3d::seg::SegError;
use accurate3d::synth::SynthError;
use accurate3d::traverse::TraverseError;

/// What went wrong, what to do about it, and the exit code that says so to a script.
#[derive(Debug)]
pub struct Failure {
    code: u8,
    message: String,
    hint: Option<String>,
}

impl Failure {
    pub const INTERNAL: u8 = 1;
    pub const USAGE: u8 = 2;
    pub const NO_RECONSTRUCTION: u8 = 3;
    pub const SUSPECT: u8 = 4;
    pub const BAD_INPUT: u8 = 65;
    pub const NO_INPUT: u8 = 66;
    pub const UNAVAILABLE: u8 = 69;
    pub const IO: u8 = 74;

    pub fn new(code: u8, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), hint: None }
    }

    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// The same exit code and hint behind another message.
    pub fn about(self, message: String) -> Self {
        Self { message, ..self }
    }

    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.code)
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.message)?;
        match &self.hint {
            Some(hint) => write!(f, "\n  hint: {hint}"),
            None => Ok(()),
        }
    }
}

impl From<IoError> for Failure {
    fn from(error: IoError) -> Self {
        let (code, hint) = match &error {
            IoError::Missing { .. } => {
                (Self::NO_INPUT, Some("a pair folder's layout is in docs/conventions.md"))
            }
            IoError::NoPair { .. } => {
                (Self::NO_INPUT, Some("give a pair folder, or a folder of case_* pair folders"))
            }
            IoError::System { .. } => (Self::IO, None),
            IoError::Geometry { .. } => (
                Self::BAD_INPUT,
                Some("K is 3x3 upper triangular; RT is 3x4 [R | t], world to camera"),
            ),
            IoError::SizeMismatch { .. } => {
                (Self::BAD_INPUT, Some("masks and images must have the size the cameras are for"))
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
            Error::NoNetwork { .. } => Self::new(Self::UNAVAILABLE, message)
                .with_hint("segment the images elsewhere and use --input mask"),
            Error::MissingInput { .. } => Self::new(Self::NO_INPUT, message),
            Error::Segmentation { .. } => Self::new(Self::BAD_INPUT, message)
                .with_hint("look at the mask: the body should be non-zero and at least 2 px long"),
            Error::Traversal { .. } => Self::new(Self::NO_RECONSTRUCTION, message)
                .with_hint("order the points yourself and use --input points"),
            Error::Matching { .. } => Self::new(Self::NO_RECONSTRUCTION, message)
                .with_hint("check that the calibration belongs to these views, in this order"),
            Error::Name(_) => Self::new(Self::BAD_INPUT, message),
            Error::Synthesis(_) => Self::new(Self::USAGE, message),
            _ => Self::new(Self::INTERNAL, message),
        }
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
        Self::new(Self::BAD_INPUT, error.to_string())
    }
}

impl From<TraverseError> for Failure {
    fn from(error: TraverseError) -> Self {
        Self::new(Self::NO_RECONSTRUCTION, error.to_string())
    }
}
