//! Lengths that are compared must be in one unit.

use accurate3d::geom::LengthUnit;

use crate::failure::Failure;

/// The unit of both; what states none takes the other's.
///
/// # Errors
/// [`Failure::BAD_INPUT`] if both state one and it is not the same. Nothing is converted: a unit
/// that was stated wrongly would hide behind it.
pub fn common_unit(
    one: (&str, LengthUnit),
    two: (&str, LengthUnit),
) -> Result<LengthUnit, Failure> {
    match (one.1, two.1) {
        (a, b) if a == b => Ok(a),
        (LengthUnit::Unit, stated) | (stated, LengthUnit::Unit) => Ok(stated),
        (a, b) => {
            let message = format!("{} is in {a}, {} in {b}", one.0, two.0);
            Err(Failure::new(Failure::BAD_INPUT, message)
                .with_hint("convert one of them, or correct the unit that its file states"))
        }
    }
}
