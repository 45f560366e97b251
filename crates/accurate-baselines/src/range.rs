use accurate_geom::GeomError;

/// Refuses a parameter that is not finite or not above 0.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<(), GeomError> {
    let expected = "a finite number above 0";
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(GeomError::OutOfRange { what, value, expected })
    }
}

/// Refuses a parameter that is not finite or negative.
pub(crate) fn not_negative(what: &'static str, value: f64) -> Result<(), GeomError> {
    let expected = "a finite number, 0 or above";
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(GeomError::OutOfRange { what, value, expected })
    }
}
