use accurate_geom::GeomError;
use thiserror::Error;

/// Why no curve could be fitted.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FitError {
    /// A view has nothing to fit to.
    #[error("view {view}: the outline is empty ({foreground} foreground pixels)")]
    EmptyOutline {
        /// 1 or 2.
        view: u8,
        /// Foreground pixels found.
        foreground: usize,
    },
    /// Too few points for a curve.
    #[error("{what}: {found} points, at least {needed} are needed")]
    TooFewPoints {
        /// Which list.
        what: &'static str,
        /// Points found.
        found: usize,
        /// Points needed.
        needed: usize,
    },
    /// An input number is NaN or infinite.
    #[error("{what} {index} is not finite")]
    NotFinite {
        /// Which list.
        what: &'static str,
        /// Index in it, from 0.
        index: usize,
    },
    /// Two images of one view have different sizes.
    #[error("view {view}: the mask is {} x {} pixels (rows, columns), its map {} x {}", expected.0, expected.1, found.0, found.1)]
    ShapeMismatch {
        /// 1 or 2.
        view: u8,
        /// Rows and columns of the mask.
        expected: (usize, usize),
        /// Rows and columns of the map.
        found: (usize, usize),
    },
    /// A map holds something else than probabilities, 0 to 1: logits, or grey values up to 255.
    #[error("view {view}: pixel {index} of the probability map is {value}, not in 0 to 1")]
    NotAProbability {
        /// 1 or 2.
        view: u8,
        /// Index of the pixel, row by row, from 0.
        index: usize,
        /// Its value.
        value: f32,
    },
    /// A picture shows nothing along the curve.
    #[error("view {view}: the image shows nothing dark along the curve")]
    NotSeenInImage {
        /// 1 or 2.
        view: u8,
    },
    /// The curve has no length, or one that no image can hold.
    #[error("a curve of length {length_px} px cannot be fitted")]
    BadLength {
        /// Length in px.
        length_px: f64,
    },
    /// A parameter is out of its range.
    #[error("parameter {name} = {value} is out of range")]
    BadParameter {
        /// The field.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The curve is not in front of a camera.
    #[error("view {view}: the curve is not in front of the camera (depth {depth})")]
    NotInFront {
        /// 1 or 2.
        view: u8,
        /// z in the camera frame, in the rig's unit.
        depth: f64,
    },
    /// The normal equations could not be solved, even damped.
    #[error("the normal equations of {unknowns} unknowns are not positive definite")]
    Singular {
        /// Number of unknowns.
        unknowns: usize,
    },
    /// A matched pair has an index beyond its curve, or falls behind the pair before.
    #[error("pair {index} = {pair:?} is not in order, or beyond curves of {lengths:?} points")]
    BadPair {
        /// Index of the pair, from 0.
        index: usize,
        /// Indices into curve 1 and curve 2.
        pair: (usize, usize),
        /// Points of curve 1 and curve 2.
        lengths: (usize, usize),
    },
    /// The correspondences are not good enough to be refined: a fit would lock the mistake in.
    #[error(
        "the match is not good enough to refine: mean epipolar distance {mean_distance_px:.2} px \
         (limit {max_distance_px}), coverage {coverage:.3} (limit {min_coverage})"
    )]
    BadMatch {
        /// Mean distance of the matched pairs, px.
        mean_distance_px: f64,
        /// The largest that is accepted, px.
        max_distance_px: f64,
        /// The smaller of both views' matched fractions.
        coverage: f64,
        /// The smallest that is accepted.
        min_coverage: f64,
    },
    /// Geometry refused a value.
    #[error(transparent)]
    Geometry(#[from] GeomError),
}
