use accurate_geom::GeomError;
use thiserror::Error;

/// Why a score could not be computed. A score that cannot be computed is an error, never a zero.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum EvalError {
    /// There is nothing to score.
    #[error("{which}: no element")]
    Empty {
        /// What is empty, e.g. `reconstruction` or `truth`.
        which: &'static str,
    },
    /// A number is NaN or infinite.
    #[error("{which}: element {index} is not finite")]
    NotFinite {
        /// The list, e.g. `truth`.
        which: &'static str,
        /// Index in the list, from 0.
        index: usize,
    },
    /// The numbers given are finite, but what follows from them is not.
    #[error("{what} is not finite: {value}")]
    Overflow {
        /// What was to be computed, e.g. `relative length error`.
        what: &'static str,
        /// What came out.
        value: f64,
    },
    /// A coordinate is so large that its square overflows.
    #[error("{which}: element {index} has a coordinate of {value:e}, beyond {limit:e}")]
    TooLarge {
        /// The list, e.g. `truth`.
        which: &'static str,
        /// Index in the list, from 0.
        index: usize,
        /// The coordinate.
        value: f64,
        /// The largest absolute value accepted.
        limit: f64,
    },
    /// A curve needs two different points to have a length.
    #[error("{which}: {points} points but no length")]
    NoLength {
        /// The curve, e.g. `truth`.
        which: &'static str,
        /// Points given.
        points: usize,
    },
    /// Resampling would need too many points.
    #[error(
        "{which}: a spacing of {spacing} on a length of {length} needs more than {limit} samples"
    )]
    TooManySamples {
        /// The curve, e.g. `truth`.
        which: &'static str,
        /// Spacing asked for, world unit.
        spacing: f64,
        /// Length of the curve, world unit.
        length: f64,
        /// The most samples accepted.
        limit: usize,
    },
    /// An argument is outside its range.
    #[error("{name} = {value}: {expected}")]
    InvalidArgument {
        /// Name of the argument.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is accepted.
        expected: &'static str,
    },
    /// Two lists that belong together have different lengths.
    #[error("{which}: {found} elements, expected {expected}")]
    LengthMismatch {
        /// The list.
        which: &'static str,
        /// Its length.
        found: usize,
        /// The length of the other list.
        expected: usize,
    },
    /// Two images that belong together have different shapes.
    #[error("{which}: shape {found:?}, expected {expected:?} (rows, columns)")]
    ShapeMismatch {
        /// The image.
        which: &'static str,
        /// Its shape.
        found: (usize, usize),
        /// The shape of the other image.
        expected: (usize, usize),
    },
    /// The points lie on one line (or in one point): a rotation about it cannot be seen.
    #[error(
        "the points do not fix a rotation: relative spread off a line {spread_ratio:.1e}, needed {needed:.0e}"
    )]
    Collinear {
        /// Spread off the best line relative to that along it.
        spread_ratio: f64,
        /// The least accepted.
        needed: f64,
    },
    /// A point of a curve cannot be projected.
    #[error("{which}: point {index}: {source}")]
    Projection {
        /// The curve, `reconstruction` or `truth`.
        which: &'static str,
        /// Index along the (resampled) curve, from 0.
        index: usize,
        /// Why.
        source: GeomError,
    },
}
