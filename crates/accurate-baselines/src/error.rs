use thiserror::Error;

/// Why a baseline could not be set up, or one of its building blocks refused its input.
///
/// Reconstruction itself reports [`accurate_match::MatchError`], as every matcher does.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum BaselineError {
    /// A parameter is outside its range.
    #[error("parameter {name} = {value}: must be {expected}")]
    Parameter {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range in words.
        expected: &'static str,
    },
    /// Interpolation knots are missing, not finite, or do not increase.
    #[error("knot {index} of {count}: abscissae must be finite and strictly increasing")]
    Knots {
        /// The offending knot, from 0.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A grid without a cell has no path.
    #[error("a {n1} x {n2} grid has no path")]
    EmptyGrid {
        /// Rows.
        n1: usize,
        /// Columns.
        n2: usize,
    },
    /// Every path costs more than a number can hold.
    #[error("no path of finite cost through the {n1} x {n2} grid")]
    NoPath {
        /// Rows.
        n1: usize,
        /// Columns.
        n2: usize,
    },
    /// Dijkstra's algorithm needs costs that are not negative.
    #[error("cost of cell ({i}, {j}) is {value}: must not be negative or NaN")]
    Cost {
        /// Row.
        i: usize,
        /// Column.
        j: usize,
        /// The cost.
        value: f64,
    },
}

/// Refuses a parameter that is not finite or not above `floor`.
pub(crate) fn above(
    name: &'static str,
    value: f64,
    floor: f64,
    expected: &'static str,
) -> Result<(), BaselineError> {
    if value.is_finite() && value > floor {
        Ok(())
    } else {
        Err(BaselineError::Parameter { name, value, expected })
    }
}

/// Refuses a parameter that is negative or not finite.
pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<(), BaselineError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(BaselineError::Parameter { name, value, expected: "finite and not negative" })
    }
}
