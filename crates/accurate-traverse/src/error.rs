use accurate_geom::GeomError;
use thiserror::Error;

/// Why a skeleton could not be turned into an ordered curve.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum TraverseError {
    /// The skeleton has no pixel.
    #[error("view {view}: the skeleton has no pixel")]
    Empty {
        /// 1 or 2.
        view: u8,
    },
    /// The skeleton has too few pixels to have a direction.
    #[error("view {view}: the skeleton has {pixels} pixel, a curve needs at least 2")]
    TooSmall {
        /// 1 or 2.
        view: u8,
        /// Pixels found.
        pixels: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("view {view}: skeleton pixel {index} is not finite: ({x}, {y})")]
    NotFinite {
        /// 1 or 2.
        view: u8,
        /// Index in the input, from 0.
        index: usize,
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
    },
    /// A coordinate is not a whole number: the input is not a skeleton.
    #[error("view {view}: skeleton pixel {index} is not at whole coordinates: ({x}, {y})")]
    NotInteger {
        /// 1 or 2.
        view: u8,
        /// Index in the input, from 0.
        index: usize,
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
    },
    /// A coordinate is larger than any image.
    #[error("view {view}: skeleton pixel {index} at ({x}, {y}) is beyond {limit} px")]
    SizeTooLarge {
        /// 1 or 2.
        view: u8,
        /// Index in the input, from 0.
        index: usize,
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
        /// Largest absolute coordinate accepted, px.
        limit: u32,
    },
    /// A pixel is given twice.
    #[error("view {view}: skeleton pixel ({x}, {y}) is given more than once")]
    Duplicate {
        /// 1 or 2.
        view: u8,
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
    },
    /// No pixel has exactly one 8-neighbour.
    #[error(
        "view {view}: {found} pixels but no endpoint; a closed curve (or one whose ends are hidden) \
         has no start for this traversal and needs the mode for closed curves"
    )]
    NoEndpoint {
        /// 1 or 2.
        view: u8,
        /// Pixels of the skeleton.
        found: usize,
    },
    /// Every endpoint of a view is the epipole: none has an epipolar line to be compared by.
    #[error("view {view}: all {found} endpoints lie at the epipole")]
    EndpointsAtEpipole {
        /// 1 or 2.
        view: u8,
        /// Endpoints of the view.
        found: usize,
    },
    /// The given start is not a pixel of the skeleton.
    #[error("view {view}: the start ({x}, {y}) is not a pixel of the skeleton")]
    StartNotOnSkeleton {
        /// 1 or 2.
        view: u8,
        /// Column, px.
        x: f64,
        /// Row, px.
        y: f64,
    },
    /// A parameter is outside its range.
    #[error("parameter {name} = {value}: {expected}")]
    InvalidParameter {
        /// Name of the field of the parameters.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is accepted.
        expected: &'static str,
    },
    /// Skeleton and radii are images of different shapes.
    #[error("view {view}: the skeleton has shape {skeleton:?}, the radii have {radii:?}")]
    ShapeMismatch {
        /// 1 or 2.
        view: u8,
        /// (height, width) of the skeleton.
        skeleton: (usize, usize),
        /// (height, width) of the radii.
        radii: (usize, usize),
    },
    /// A radius at a pixel of the skeleton is not a positive finite number.
    #[error("view {view}: radius {value} at column {x}, row {y} of the skeleton")]
    BadRadius {
        /// 1 or 2.
        view: u8,
        /// Column, px.
        x: usize,
        /// Row, px.
        y: usize,
        /// The radius, px.
        value: f64,
    },
    /// The skeleton has no strand: no two pixels touch, or all that do are blobs.
    #[error(
        "view {view}: {pixels} skeleton pixels, but no strand among them (specks, or a mask that was not \
         thinned)"
    )]
    NoEdge {
        /// 1 or 2.
        view: u8,
        /// Pixels of the skeleton.
        pixels: usize,
    },
    /// Far more strands than one body has.
    #[error(
        "view {view}: {strands} strands between tips and junctions, {limit} at most: no mask of one body \
         (specks of a threshold? texture?)"
    )]
    Tangled {
        /// 1 or 2.
        view: u8,
        /// Edges of the skeleton's graph.
        strands: usize,
        /// The most that are looked at.
        limit: usize,
    },
    /// Points that make no curve.
    #[error(transparent)]
    Geometry(#[from] GeomError),
}
