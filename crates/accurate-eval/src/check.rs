use accurate_geom::Point3;

use crate::EvalError;

/// Largest absolute coordinate accepted: its square, and sums of squares, stay finite.
const LARGEST_COORDINATE: f64 = 1e150;

/// Refuses an empty list of points and coordinates that are not finite or overflow when squared.
pub(crate) fn points(which: &'static str, points: &[Point3]) -> Result<(), EvalError> {
    if points.is_empty() {
        return Err(EvalError::Empty { which });
    }
    // NaN is not within either.
    if points.iter().all(|point| point.iter().all(|v| v.abs() <= LARGEST_COORDINATE)) {
        return Ok(());
    }
    for (index, point) in points.iter().enumerate() {
        let value = point.coords.amax();
        if !point.iter().all(|v| v.is_finite()) {
            return Err(EvalError::NotFinite { which, index });
        }
        if value > LARGEST_COORDINATE {
            return Err(EvalError::TooLarge { which, index, value, limit: LARGEST_COORDINATE });
        }
    }
    Ok(())
}

/// Refuses a result that has overflowed, or is what an overflow left behind.
pub(crate) fn result(what: &'static str, value: f64) -> Result<f64, EvalError> {
    if value.is_finite() { Ok(value) } else { Err(EvalError::Overflow { what, value }) }
}

/// Refuses an empty list of numbers and numbers that are not finite.
pub(crate) fn values(which: &'static str, values: &[f64]) -> Result<(), EvalError> {
    if values.is_empty() {
        return Err(EvalError::Empty { which });
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(EvalError::NotFinite { which, index }),
        None => Ok(()),
    }
}
