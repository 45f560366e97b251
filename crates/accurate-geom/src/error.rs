use thiserror::Error;

/// What makes a geometric value unusable.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum GeomError {
    /// A number that must be finite is NaN or infinite.
    #[error("{what} is not finite: {value}")]
    NotFinite {
        /// The offending quantity, e.g. `K[0][2]`.
        what: String,
        /// Its value.
        value: f64,
    },
    /// `K` has an entry below the diagonal, or its last row is not `0 0 1`.
    #[error("K is not upper triangular with last row 0 0 1: K[{row}][{column}] = {value}")]
    NotUpperTriangular {
        /// Row of the offending entry, from 0.
        row: usize,
        /// Column of the offending entry, from 0.
        column: usize,
        /// Its value.
        value: f64,
    },
    /// A focal length of `K` is zero.
    #[error("K[{index}][{index}] is zero: the focal length must not vanish")]
    ZeroFocalLength {
        /// 0 for f_x, 1 for f_y.
        index: usize,
    },
    /// `R` is not a rotation matrix.
    #[error(
        "R is not a rotation: |RᵀR - I| = {orthogonality:.3e}, det R = {determinant:.6} (tolerance {tolerance:.0e})"
    )]
    NotARotation {
        /// Largest absolute entry of `RᵀR - I`.
        orthogonality: f64,
        /// Determinant of `R`; a rotation has +1.
        determinant: f64,
        /// Tolerance on both.
        tolerance: f64,
    },
    /// The image has no pixels.
    #[error("image size {width} x {height} has no pixels")]
    EmptyImage {
        /// Width in px.
        width: u32,
        /// Height in px.
        height: u32,
    },
    /// Both cameras share one centre: no depth can be seen.
    #[error("zero baseline: the camera centres are {distance:.3e} apart (scene scale {scale:.3e})")]
    ZeroBaseline {
        /// Distance of the centres, in the rig's unit.
        distance: f64,
        /// The scale it was compared with, in the rig's unit.
        scale: f64,
    },
    /// The epipolar line of a pixel at the epipole does not exist.
    #[error("pixel ({x}, {y}) of view {view} is the epipole: it has no epipolar line")]
    AtEpipole {
        /// View of the pixel, 1 or 2.
        view: u8,
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
    },
    /// The point does not lie in front of the camera.
    #[error("the point is not in front of the camera: depth {depth}")]
    NotInFront {
        /// z in the camera frame, in the rig's unit.
        depth: f64,
    },
}

/// Refuses NaN and infinities, naming the quantity.
pub(crate) fn finite(value: f64, what: impl FnOnce() -> String) -> Result<f64, GeomError> {
    if value.is_finite() { Ok(value) } else { Err(GeomError::NotFinite { what: what(), value }) }
}
