//! Cameras of every kind behind one front: [`read_cameras`] and [`write_cameras`].

mod colmap;
mod detect;
mod filestorage;
mod json_cameras;
mod named_view;
mod opencv;
mod projection_list;
mod write;

#[cfg(feature = "dicom")]
pub(crate) use detect::stem;
pub use detect::{CameraSource, is_dicom, read_cameras};
#[cfg(feature = "dicom")]
pub(crate) use named_view::RawView;
pub use named_view::{NamedView, ViewDefaults};
pub use write::{CameraFormat, write_cameras};
