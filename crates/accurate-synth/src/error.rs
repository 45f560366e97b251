use accurate_geom::GeomError;
use thiserror::Error;

/// Why a case could not be made.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SynthError {
    /// An option has a value that no case can be made with.
    #[error("option {name} is {value}: expected {expected}")]
    BadOption {
        /// The field.
        name: &'static str,
        /// Its value.
        value: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// No draw met the family's conditions (in the image, enough tangencies).
    #[error(
        "{family} seed {seed} index {index}: none of {attempts} draws met the family's conditions"
    )]
    NoDraw {
        /// Name of the family.
        family: &'static str,
        /// Seed.
        seed: u64,
        /// Index of the case.
        index: u64,
        /// Draws made.
        attempts: u32,
    },
    /// An occlusion disc or a gap does not fit between the tips of the projected curve.
    #[error(
        "view {view}: no room for {what} of {size_px} px on a curve of {length_px:.1} px whose tips stay visible"
    )]
    NoRoom {
        /// 1 or 2.
        view: u8,
        /// `an occlusion disc` or `a gap`.
        what: &'static str,
        /// Radius of the disc or length of the gap, px.
        size_px: f64,
        /// Length of the projected curve, px.
        length_px: f64,
    },
    /// An image could not be encoded or decoded.
    #[error("{what}: {reason}")]
    Encoding {
        /// The format.
        what: &'static str,
        /// What the codec said.
        reason: String,
    },
    /// A camera or a projection was refused.
    #[error(transparent)]
    Geometry(#[from] GeomError),
}
