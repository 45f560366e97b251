use accurate_geom::GeomError;
use thiserror::Error;

/// Why two curves could not be turned into a 3D curve.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MatchError {
    /// A curve has no point.
    #[error("view {view}: the curve has no point")]
    Empty {
        /// 1 or 2.
        view: u8,
    },
    /// A curve point is NaN or infinite.
    #[error("view {view}: point {index} is not finite: ({x}, {y})")]
    NotFinite {
        /// 1 or 2.
        view: u8,
        /// Index along the curve, from 0.
        index: usize,
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
    },
    /// No correspondence was found: a curve of no point is not a result.
    #[error("{method}: no point of view 1 found a partner in view 2 ({candidates} candidates)")]
    NoCorrespondence {
        /// Name of the method.
        method: &'static str,
        /// Candidate pairs that were looked at.
        candidates: usize,
    },
    /// Pairs were found, but the rays of none of them meet.
    #[error(
        "{method}: none of the {pairs} matched pairs could be triangulated; the first: {first}"
    )]
    NothingTriangulated {
        /// Name of the method.
        method: &'static str,
        /// Matched pairs.
        pairs: usize,
        /// What the first pair failed with.
        first: GeomError,
    },
    /// A cell of the cost matrix is NaN or minus infinity. (Plus infinity forbids a cell.)
    #[error("the cost of matching point {i} of view 1 with point {j} of view 2 is {value}")]
    InvalidCost {
        /// Index in view 1, from 0.
        i: usize,
        /// Index in view 2, from 0.
        j: usize,
        /// The value.
        value: f64,
    },
    /// Every path from corner to corner costs more than a number can hold.
    #[error("no path of finite cost through the {n1} x {n2} costs")]
    NoFinitePath {
        /// Points of view 1.
        n1: usize,
        /// Points of view 2.
        n2: usize,
    },
    /// The alignment would need more memory than is allowed.
    #[error(
        "aligning {n1} with {n2} points needs {bytes} bytes (limit {limit_bytes}); resample the curves"
    )]
    TooLarge {
        /// Points of view 1.
        n1: usize,
        /// Points of view 2.
        n2: usize,
        /// Bytes needed, saturating.
        bytes: u64,
        /// Bytes allowed.
        limit_bytes: u64,
    },
    /// The system refused the memory of an alignment.
    #[error("no memory for aligning {n1} with {n2} points ({bytes} bytes); resample the curves")]
    OutOfMemory {
        /// Points of view 1.
        n1: usize,
        /// Points of view 2.
        n2: usize,
        /// Bytes needed.
        bytes: u64,
    },
    /// Geometry refused a value.
    #[error(transparent)]
    Geometry(#[from] GeomError),
}
