use accurate_geom::GeomError;

use crate::MatchError;

/// How much of a curve may stay unmatched at each of its ends, px of arc length.
///
/// 0 says that the end is seen in the other view too; infinity that the other view may see any part
/// of the curve.
///
/// The length bounds what an alignment leaves out. [`FreeMatcher`](crate::FreeMatcher) may then leave
/// out more at an end that is not 0, whatever its length: where the path ends with the other view
/// standing still, the points matched with that one point that are worse than the best of them by more
/// than [`FreeMatchParams::end_run_px`](crate::FreeMatchParams::end_run_px).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeEnds {
    /// From the first point on, px.
    pub begin_px: f64,
    /// Up to the last point, px.
    pub end_px: f64,
}

impl FreeEnds {
    /// Both ends are seen in both views.
    pub const NONE: Self = Self { begin_px: 0.0, end_px: 0.0 };

    /// The other view may see any part.
    pub const ANY: Self = Self { begin_px: f64::INFINITY, end_px: f64::INFINITY };

    /// The same freedom for the curve in opposite order.
    pub const fn reversed(self) -> Self {
        Self { begin_px: self.end_px, end_px: self.begin_px }
    }

    /// # Errors
    /// [`GeomError::OutOfRange`] for a negative length or NaN.
    pub(crate) fn validate(self) -> Result<Self, MatchError> {
        not_negative("free length at the begin of a curve (px)", self.begin_px)?;
        not_negative("free length at the end of a curve (px)", self.end_px)?;
        Ok(self)
    }
}

/// Refuses what is no price or length; infinity is one.
pub(crate) fn not_negative(what: &'static str, value: f64) -> Result<(), MatchError> {
    if value >= 0.0 {
        return Ok(());
    }
    Err(GeomError::OutOfRange { what, value, expected: "0 or more" }.into())
}

/// Refuses what is nothing to weigh or to weigh by: infinity times 0 would be no number.
pub(crate) fn finite(what: &'static str, value: f64) -> Result<(), MatchError> {
    not_negative(what, value)?;
    if value.is_finite() {
        return Ok(());
    }
    Err(GeomError::OutOfRange { what, value, expected: "a finite number" }.into())
}

/// Refuses what is no size: positive and finite.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<(), MatchError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(GeomError::OutOfRange { what, value, expected: "a positive number" }.into())
}
