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
    /// Two rays run side by side: they meet nowhere, or at infinity.
    #[error(
        "the rays are parallel: the sine of their angle is {sine:.3e} (at least {least:.0e} needed)"
    )]
    ParallelRays {
        /// Sine of the angle between the rays.
        sine: f64,
        /// The least sine accepted.
        least: f64,
    },
    /// The solution lies at infinity.
    #[error("the point lies at infinity: homogeneous weight {weight:.3e}")]
    PointAtInfinity {
        /// Fourth homogeneous coordinate, of a unit 4-vector in baselines.
        weight: f64,
    },
    /// An iteration did not settle.
    #[error("{what} did not converge in {iterations} iterations")]
    NoConvergence {
        /// Which iteration.
        what: &'static str,
        /// Steps made.
        iterations: usize,
    },
    /// A curve needs more points than were given.
    #[error("{found} points are too few: at least {needed} needed")]
    TooFewPoints {
        /// Points given.
        found: usize,
        /// Points needed.
        needed: usize,
    },
    /// Two consecutive points of a curve coincide.
    #[error("point {index} repeats the point before it")]
    DuplicatePoint {
        /// Index of the second of the two.
        index: usize,
    },
    /// The numbers of two lists that belong together differ.
    #[error("{what}: expected {expected}, found {found}")]
    LengthMismatch {
        /// What was counted.
        what: &'static str,
        /// The number it must have.
        expected: usize,
        /// The number it has.
        found: usize,
    },
    /// A knot vector is not a clamped cubic one: non-decreasing, four equal knots at each end, at
    /// most three equal ones between.
    #[error(
        "knot {index} = {value} breaks the order or the multiplicity of a clamped cubic spline"
    )]
    BadKnot {
        /// Index of the knot.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A number lies outside its range.
    #[error("{what} = {value}: expected {expected}")]
    OutOfRange {
        /// The offending quantity.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range in words.
        expected: &'static str,
    },
    /// The data do not determine every control point.
    #[error("control point {index} is not determined by the data: fewer control points are needed")]
    Underdetermined {
        /// First control point without enough data.
        index: usize,
    },
    /// A 3 x 4 matrix is no camera: its left 3 x 3 block is singular.
    #[error("the projection matrix has a singular left block: row {row} depends on the others")]
    SingularProjection {
        /// Row, from 0, found dependent (rows are taken from the last to the first).
        row: usize,
    },
    /// The lens model is not one to one at this point.
    #[error("the distortion model cannot be inverted at pixel ({x}, {y})")]
    DistortionFolds {
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
    },
}

/// Refuses NaN and infinities, naming the quantity.
pub(crate) fn finite(value: f64, what: impl FnOnce() -> String) -> Result<f64, GeomError> {
    if value.is_finite() { Ok(value) } else { Err(GeomError::NotFinite { what: what(), value }) }
}
