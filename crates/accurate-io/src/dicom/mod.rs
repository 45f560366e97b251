//! DICOM XA: the geometry of a C-arm view, and its frames.
//!
//! A file is scanned before a parser sees it ([`scan::scan`]), and no text of a file ever reaches an
//! output or an error: what identifies a patient cannot leak through here.

mod geometry;
mod open;
mod pixels;
mod scan;

pub use geometry::read_dicom_view;
pub use pixels::{DicomPixels, FrameChoice, read_dicom_pixels};
