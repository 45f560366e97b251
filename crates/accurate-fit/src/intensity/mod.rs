//! One 3D B-spline fitted to the grey levels of both images: the curve is drawn as a thin absorber and
//! moved until the drawing explains the pictures.

mod band;
mod dense_normal;
mod drawing;
mod fit;
mod moved;
mod params;
mod shown;
mod smooth;

pub use fit::{IntensityFit, IntensityPair, fit_intensities};
pub use params::IntensityFitParams;
pub use shown::{CurveEnd, CurveEnds, ShownPiece};
