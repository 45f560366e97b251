use std::fmt::Debug;
use std::ops::RangeInclusive;

use crate::SynthError;

/// What is done to a case besides drawing it. The default is nothing.
///
/// Options draw from streams of their own: the curve and the true cameras of a case are the same
/// with any options.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseOptions {
    /// Thickness of the mask, px, 1 to 64; `None` is the family's own: `sim-paper` a tube of 0.1
    /// units (1 to 2 px), `carm` the wire's diameter (1 to 1.9 px), both at the mean depth and at
    /// least 1 px so that the mask hangs together; the other families 3 px.
    pub mask_thickness_px: Option<f64>,
    /// Number of discs per view, drawn uniformly, that hide the wire in the mask (and cover it in
    /// the picture). At most 64. Ordered points are not affected.
    pub occlusion_discs: RangeInclusive<u32>,
    /// Radius of an occlusion disc, px.
    pub occlusion_radius_px: f64,
    /// Number of stretches per view, drawn uniformly, that are missing: from the mask, the picture
    /// and the ordered points. At most 64. The two views lose different stretches.
    pub gaps: RangeInclusive<u32>,
    /// Length of a missing stretch along the projected curve, px, drawn uniformly. Between round
    /// caps the hole in the mask is shorter by the mask's thickness.
    pub gap_length_px: RangeInclusive<f64>,
    /// What the nominal camera 2 gets wrong; `None`: the nominal rig is the true one.
    pub calibration_error: Option<CalibrationError>,
}

/// The error of the nominal camera 2: [`SynthCase::rig`](crate::SynthCase::rig) has it,
/// [`SynthCase::true_rig`](crate::SynthCase::true_rig) does not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationError {
    /// Rotation about the camera's own centre, about a random axis, degrees, 0 to 45.
    pub rotation_deg: f64,
    /// Shift of the principal point in a random direction, px, 0 to 1000.
    pub shift_px: f64,
}

impl Default for CaseOptions {
    fn default() -> Self {
        Self {
            mask_thickness_px: None,
            occlusion_discs: 0..=0,
            occlusion_radius_px: 8.0,
            gaps: 0..=0,
            gap_length_px: 10.0..=30.0,
            calibration_error: None,
        }
    }
}

impl CaseOptions {
    /// Refuses what no case can be made with.
    pub(crate) fn check(&self) -> Result<(), SynthError> {
        if let Some(thickness) = self.mask_thickness_px {
            within("mask_thickness_px", thickness, 1.0..=64.0, "1 to 64 px")?;
        }
        for (name, counts) in [("occlusion_discs", &self.occlusion_discs), ("gaps", &self.gaps)] {
            if counts.is_empty() || *counts.end() > 64 {
                return Err(bad(name, counts, "low..=high with low <= high <= 64"));
            }
        }
        within("occlusion_radius_px", self.occlusion_radius_px, 0.0..=1e4, "0 to 10000 px")?;
        let lengths = &self.gap_length_px;
        if lengths.is_empty() || *lengths.start() <= 0.0 || *lengths.end() > 1e4 {
            return Err(bad("gap_length_px", lengths, "low..=high with 0 < low <= high <= 10000"));
        }
        if let Some(error) = self.calibration_error {
            within("rotation_deg", error.rotation_deg, 0.0..=45.0, "0 to 45 degrees")?;
            within("shift_px", error.shift_px, 0.0..=1000.0, "0 to 1000 px")?;
        }
        Ok(())
    }
}

pub(crate) fn within(
    name: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), SynthError> {
    if range.contains(&value) { Ok(()) } else { Err(bad(name, &value, expected)) }
}

fn bad(name: &'static str, value: &impl Debug, expected: &'static str) -> SynthError {
    SynthError::BadOption { name, value: format!("{value:?}"), expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bad_option_is_named() {
        let d = CaseOptions::default();
        assert_eq!(d.check(), Ok(()));
        let calibration = |rotation_deg, shift_px| CaseOptions {
            calibration_error: Some(CalibrationError { rotation_deg, shift_px }),
            ..CaseOptions::default()
        };
        #[expect(clippy::reversed_empty_ranges)]
        let bad = [
            ("mask_thickness_px", CaseOptions { mask_thickness_px: Some(0.5), ..d.clone() }),
            ("mask_thickness_px", CaseOptions { mask_thickness_px: Some(f64::NAN), ..d.clone() }),
            ("occlusion_discs", CaseOptions { occlusion_discs: 2..=1, ..d.clone() }),
            ("occlusion_discs", CaseOptions { occlusion_discs: 0..=65, ..d.clone() }),
            ("occlusion_radius_px", CaseOptions { occlusion_radius_px: -1.0, ..d.clone() }),
            ("gaps", CaseOptions { gaps: 0..=u32::MAX, ..d.clone() }),
            ("gap_length_px", CaseOptions { gap_length_px: 0.0..=5.0, ..d.clone() }),
            ("gap_length_px", CaseOptions { gap_length_px: 1.0..=f64::INFINITY, ..d.clone() }),
            ("rotation_deg", calibration(-0.1, 0.0)),
            ("shift_px", calibration(0.1, f64::NAN)),
        ];
        for (expected, options) in bad {
            match options.check() {
                Err(SynthError::BadOption { name, .. }) => assert_eq!(name, expected),
                other => panic!("{expected}: {other:?}"),
            }
        }
    }
}
