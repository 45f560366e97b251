use std::io;
use std::path::{Path, PathBuf};

use accurate_geom::{GeomError, ImageSize};
use thiserror::Error;

/// What makes a file unusable. Every variant names the file and the value or position.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IoError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    System {
        /// The file or folder.
        path: PathBuf,
        /// What was tried: `read`, `write`, ...
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// A file that is needed does not exist.
    #[error("missing file {}{}", path.display(), list_alternatives(also_tried))]
    Missing {
        /// Where it is expected.
        path: PathBuf,
        /// Other places that were looked at, in order.
        also_tried: Vec<PathBuf>,
    },
    /// A file, or a size declared in it, exceeds what is accepted. Found before memory was taken.
    #[error("{}: {what} is {found}, more than the accepted {limit}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The quantity, with its unit.
        what: String,
        /// Its value.
        found: u64,
        /// The largest accepted value.
        limit: u64,
    },
    /// The file is not UTF-8 text.
    #[error("{}: not a text file: byte {offset} is not UTF-8", path.display())]
    NotText {
        /// The file.
        path: PathBuf,
        /// Offset of the first byte that is not UTF-8.
        offset: usize,
    },
    /// A matrix file has the wrong shape.
    #[error(
        "{}: line {line}: expected a {} x {} matrix, found {} x {}",
        path.display(), expected.0, expected.1, found.0, found.1
    )]
    Shape {
        /// The file.
        path: PathBuf,
        /// The line, from 1, where the shape first departs (0 for a file without numbers).
        line: usize,
        /// Rows and columns expected.
        expected: (usize, usize),
        /// Rows of the file and columns of that line.
        found: (usize, usize),
    },
    /// A text is no number.
    #[error("{}: line {line}, column {column}: `{text}` is not a number", path.display())]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1, counted in fields.
        column: usize,
        /// The text, cut to 40 characters.
        text: String,
    },
    /// A number that must be finite is NaN or infinite.
    #[error("{}: {at} is not finite: {value}", path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Where: a line and column, or a point and coordinate.
        at: String,
        /// The value.
        value: f64,
    },
    /// The file breaks its format.
    #[error("{}: {}not valid {format}: {reason}", path.display(), line_prefix(*line))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The format expected: `JSON`, `TOML`, `PLY`, ...
        format: &'static str,
        /// Line, from 1, where known.
        line: Option<usize>,
        /// What is wrong.
        reason: String,
    },
    /// The file is valid but uses something that is not read here.
    #[error("{}: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is not read, and what to do instead.
        what: String,
    },
    /// A field has a value that makes no sense.
    #[error("{}: {field} = `{value}`: {reason}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field.
        field: String,
        /// Its value.
        value: String,
        /// What is expected.
        reason: String,
    },
    /// The file holds no points, or no number, at all.
    #[error("{}: no {what}", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
        /// What it should hold.
        what: &'static str,
    },
    /// Two files of one pair disagree on the image size.
    #[error(
        "{} is {} x {} px but {} says {} x {} px",
        path.display(), found.width, found.height,
        other.display(), expected.width, expected.height
    )]
    SizeMismatch {
        /// The file that disagrees.
        path: PathBuf,
        /// Its size.
        found: ImageSize,
        /// The file it is compared with.
        other: PathBuf,
        /// The size there.
        expected: ImageSize,
    },
    /// A point lies outside of the picture that its camera recorded.
    #[error(
        "{}: point {index} at ({:.1}, {:.1}) px lies outside of its picture of {} x {} px",
        path.display(), point[0], point[1], size.width, size.height
    )]
    PointOutside {
        /// The file.
        path: PathBuf,
        /// Its index, from 0.
        index: usize,
        /// (x, y) as in the file, px.
        point: [f64; 2],
        /// The picture's.
        size: ImageSize,
    },
    /// The calibration is no usable camera or rig.
    #[error("{}: {part}: {source}", path.display())]
    Geometry {
        /// The file with the offending value, or the folder if two files do not go together.
        path: PathBuf,
        /// `view 1`, `view 2` or `rig`.
        part: &'static str,
        /// What is wrong.
        source: GeomError,
    },
    /// The name's extension is none of the formats.
    #[error("{}: unknown extension; expected one of {expected}", path.display())]
    UnknownExtension {
        /// The file.
        path: PathBuf,
        /// The extensions known for this kind of file.
        expected: &'static str,
    },
    /// A folder is neither a pair nor a set of pairs.
    #[error(
        "{}: neither a pair folder (meta.json, points/, masks/, images/ or calibration/RT_L.txt) \
         nor a folder of case_*",
        path.display()
    )]
    NoPair {
        /// The folder.
        path: PathBuf,
    },
}

impl IoError {
    /// The file or folder the error is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::System { path, .. }
            | Self::Missing { path, .. }
            | Self::TooLarge { path, .. }
            | Self::NotText { path, .. }
            | Self::Shape { path, .. }
            | Self::NotANumber { path, .. }
            | Self::NotFinite { path, .. }
            | Self::Malformed { path, .. }
            | Self::Unsupported { path, .. }
            | Self::Field { path, .. }
            | Self::Empty { path, .. }
            | Self::SizeMismatch { path, .. }
            | Self::PointOutside { path, .. }
            | Self::Geometry { path, .. }
            | Self::UnknownExtension { path, .. }
            | Self::NoPair { path } => path,
        }
    }

    /// Turns the system's error on `path` into ours; "not found" becomes [`IoError::Missing`].
    pub(crate) fn system(path: &Path, action: &'static str, source: io::Error) -> Self {
        if source.kind() == io::ErrorKind::NotFound {
            Self::Missing { path: path.to_owned(), also_tried: Vec::new() }
        } else {
            Self::System { path: path.to_owned(), action, source }
        }
    }

    /// A malformed file; only the first line of `reason` is kept, cut to 200 characters, so that a
    /// parser which quotes its input cannot flood a terminal.
    pub(crate) fn malformed(
        path: &Path,
        format: &'static str,
        line: Option<usize>,
        reason: impl ToString,
    ) -> Self {
        let reason = cut(reason.to_string().lines().next().unwrap_or_default(), 200);
        Self::Malformed { path: path.to_owned(), format, line, reason }
    }

    pub(crate) fn field(
        path: &Path,
        field: impl Into<String>,
        value: impl AsRef<str>,
        reason: impl Into<String>,
    ) -> Self {
        Self::Field {
            path: path.to_owned(),
            field: field.into(),
            value: cut(value.as_ref(), 80),
            reason: reason.into(),
        }
    }
}

/// At most `limit` characters of `text`, without control characters.
pub(crate) fn cut(text: &str, limit: usize) -> String {
    text.chars().filter(|c| !c.is_control()).take(limit).collect()
}

fn line_prefix(line: Option<usize>) -> String {
    line.map(|l| format!("line {l}: ")).unwrap_or_default()
}

fn list_alternatives(also_tried: &[PathBuf]) -> String {
    if also_tried.is_empty() {
        return String::new();
    }
    let names: Vec<String> = also_tried.iter().map(|p| p.display().to_string()).collect();
    format!(" (also looked for {})", names.join(", "))
}
