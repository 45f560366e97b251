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
    /// Geometry refused a value.
    #[error(transparent)]
    Geometry(#[from] GeomError),
}
