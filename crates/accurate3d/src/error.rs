use std::fmt;

use accurate_eval::EvalError;
use accurate_fit::FitError;
use accurate_geom::LengthUnit;
use accurate_io::IoError;
use accurate_match::MatchError;
use accurate_seg::SegError;
use accurate_synth::SynthError;
use accurate_traverse::TraverseError;
use thiserror::Error;

use crate::{InputKind, UnknownName};

/// The stage of the pipeline that refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Image to mask to skeleton.
    Segmentation,
    /// Skeleton to ordered curve.
    Traversal,
    /// Ordered curves to 3D.
    Matching,
    /// One 3D curve to both views.
    Fitting,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Segmentation => "segmentation",
            Self::Traversal => "traversal",
            Self::Matching => "matching",
            Self::Fitting => "fitting",
        })
    }
}

/// Why a pair could not be reconstructed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The pair lacks what the chosen input needs.
    #[error("case {case}: no {input} in this pair")]
    MissingInput {
        /// Case id.
        case: String,
        /// What was asked for.
        input: InputKind,
    },
    /// Images have to be segmented first.
    #[error("case {case}: the images are not segmented yet")]
    NotSegmented {
        /// Case id.
        case: String,
    },
    /// What belongs to a view has not the size of its camera's image.
    #[error(
        "case {case}, view {view}: the {what} has {} x {} px, its camera sees {} x {}",
        found.1, found.0, expected.1, expected.0
    )]
    OtherSize {
        /// Case id.
        case: String,
        /// 1 or 2.
        view: u8,
        /// Mask, image or probability map.
        what: &'static str,
        /// (height, width), px.
        found: (usize, usize),
        /// (height, width) of the camera, px.
        expected: (usize, usize),
    },
    /// The mask of a view could not be skeletonised.
    #[error("case {case}, view {view}: {source}")]
    Segmentation {
        /// Case id.
        case: String,
        /// 1 or 2.
        view: u8,
        /// What segmentation says.
        source: SegError,
    },
    /// The skeletons could not be ordered.
    #[error("case {case}: {source}")]
    Traversal {
        /// Case id.
        case: String,
        /// What traversal says.
        source: TraverseError,
    },
    /// The curves could not be matched.
    #[error("case {case}: {source}")]
    Matching {
        /// Case id.
        case: String,
        /// What matching says.
        source: MatchError,
    },
    /// No curve could be fitted to the outlines.
    #[error("case {case}: {source}")]
    Fitting {
        /// Case id.
        case: String,
        /// What the fit says.
        source: FitError,
    },
    /// No pair of walks through the two masks gives a curve.
    #[error(
        "case {case}: no walk, or no pair of them, gives a curve ({} and {} walks, {pairs} pairs compared)",
        walks[0], walks[1]
    )]
    NoCandidate {
        /// Case id.
        case: String,
        /// Walks proposed in each view.
        walks: [usize; 2],
        /// Pairs whose ends agree.
        pairs: usize,
    },
    /// A ring was asked for, but a view shows a body with ends.
    #[error("case {case}, view {view}: the mask is not closed ({tips} tips)")]
    NotClosed {
        /// Case id.
        case: String,
        /// 1 or 2.
        view: u8,
        /// Tips of its skeleton.
        tips: usize,
    },
    /// A name stands for nothing.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// A mean or interval could not be formed.
    #[error(transparent)]
    Scoring(#[from] EvalError),
    /// A case could not be generated.
    #[error(transparent)]
    Synthesis(#[from] SynthError),
    /// Distances in different units have no mean.
    #[error("set {set}: pairs in {} and in {}", units[0], units[1])]
    MixedUnits {
        /// Name of the case set.
        set: String,
        /// That of the first pair, and another.
        units: [LengthUnit; 2],
    },
    /// A figure needs something to show.
    #[error("the figure has no case to show")]
    NoCase,
    /// An image of a report could not be encoded.
    #[error("the report's images: {source}")]
    Report {
        /// What the encoder says.
        source: IoError,
    },
}

impl Error {
    /// The stage that refused, where it was a stage.
    pub fn stage(&self) -> Option<Stage> {
        match self {
            Self::Segmentation { .. } | Self::NotSegmented { .. } => Some(Stage::Segmentation),
            Self::Traversal { .. } | Self::NotClosed { .. } => Some(Stage::Traversal),
            Self::Matching { .. } => Some(Stage::Matching),
            Self::Fitting { .. } => Some(Stage::Fitting),
            Self::NoCandidate { .. } => Some(Stage::Matching),
            Self::MissingInput { .. }
            | Self::OtherSize { .. }
            | Self::Name(_)
            | Self::Scoring(_)
            | Self::Synthesis(_)
            | Self::NoCase
            | Self::MixedUnits { .. }
            | Self::Report { .. } => None,
        }
    }
}
