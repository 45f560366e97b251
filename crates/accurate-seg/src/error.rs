use thiserror::Error;

/// What makes an image, a mask or a threshold unusable.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SegError {
    /// The array has no pixels at all.
    #[error("image of {height} rows and {width} columns has no pixels")]
    EmptyImage {
        /// Rows, px.
        height: usize,
        /// Columns, px.
        width: usize,
    },
    /// The image is larger than a routine can index, or than a network is given.
    #[error("image of {height} rows and {width} columns is too large: at most {most} pixels")]
    TooLarge {
        /// Rows, px.
        height: usize,
        /// Columns, px.
        width: usize,
        /// Most pixels.
        most: u64,
    },
    /// The mask has no foreground pixel.
    #[error("mask of {height} rows and {width} columns has no foreground pixel")]
    EmptyMask {
        /// Rows, px.
        height: usize,
        /// Columns, px.
        width: usize,
    },
    /// The mask has foreground, but not enough of it to be a curve.
    #[error("{pixels} skeleton pixel(s) are not a curve: at least 2 are needed")]
    TooSmall {
        /// Skeleton pixels found.
        pixels: usize,
    },
    /// Every pixel is foreground: there is no background to measure a distance to.
    #[error("mask of {height} rows and {width} columns has no background pixel")]
    NoBackground {
        /// Rows, px.
        height: usize,
        /// Columns, px.
        width: usize,
    },
    /// Most pixels are foreground: no picture of a thin body.
    #[error(
        "{foreground} of {pixels} pixels of the mask are foreground: a thin body covers a few; is the \
         mask inverted?"
    )]
    MostlyForeground {
        /// Foreground pixels.
        foreground: usize,
        /// All pixels.
        pixels: usize,
    },
    /// A pixel is NaN or infinite.
    #[error("pixel at row {row}, column {column} is not finite: {value}")]
    NotFinite {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// Its value.
        value: f32,
    },
    /// A value of a probability map is no probability.
    #[error("probability at row {row}, column {column} is {value}; expected 0 to 1")]
    NotAProbability {
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// Its value.
        value: f32,
    },
    /// A length that something is looked for with is not positive, or beyond any image.
    #[error("{name} is {value}; expected more than 0 and less than 100000")]
    BadLength {
        /// The field.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// By how much a piece may be fainter is negative or no number.
    #[error("a piece may be fainter than the surest by {value} logits; expected 0 or more")]
    BadFaintness {
        /// The value.
        value: f32,
    },
    /// A threshold is NaN.
    #[error("threshold `{name}` is not a number")]
    LevelIsNan {
        /// Which one: `level`, `low` or `high`.
        name: &'static str,
    },
    /// A threshold of a probability lies outside of 0 to 1.
    #[error("threshold `{name}` is {value}; expected 0 to 1")]
    LevelOutOfRange {
        /// Which one: `low` or `high`.
        name: &'static str,
        /// Its value.
        value: f32,
    },
    /// The engine that runs a network failed.
    #[error("{engine}: {message}")]
    Engine {
        /// Which engine.
        engine: String,
        /// What it says.
        message: String,
    },
    /// The lower threshold of a hysteresis lies above the upper one.
    #[error("hysteresis thresholds out of order: low {low} > high {high}")]
    LevelsOutOfOrder {
        /// Lower threshold, in grey values.
        low: f32,
        /// Upper threshold, in grey values.
        high: f32,
    },
    /// The caller ended the work before it was done.
    #[error("ended by the caller after {done} of {total} parts")]
    Cancelled {
        /// Parts that were done.
        done: usize,
        /// Parts there were.
        total: usize,
    },
    /// A segmenter answered with an array of another size than the image.
    #[error("segmentation of {found:?} rows and columns for an image of {expected:?}")]
    WrongShape {
        /// Rows and columns of the image, px.
        expected: (usize, usize),
        /// Rows and columns of the answer, px.
        found: (usize, usize),
    },
    /// All pixels are equal, so that no threshold separates two classes.
    #[error("every pixel has the value {value}: no threshold separates two classes")]
    Constant {
        /// The one value.
        value: f32,
    },
}
