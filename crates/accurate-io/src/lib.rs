//! The files of `accurate`: pair folders, cameras, images and curves, read with care and written
//! whole or not at all.
//!
//! - [`read_pair`], [`write_pair`], [`find_pairs`]: the pair folder, the native input;
//!   [`pair_of_views`]: the same from two cameras and two files.
//! - [`read_rig`], [`write_rig`]: two cameras in one TOML or JSON file.
//! - [`read_curve`], [`write_curve`]: 3D curves as CSV, PLY, VTK PolyData, Slicer Markups,
//!   NPY, NPZ or (feature `parquet`) Parquet.
//! - [`write_mask_nifti`]: a mask as a NIfTI label map.
//! - [`read_cameras`], [`write_cameras`]: cameras of other tools, and of DICOM XA with the feature
//!   `dicom`.
//! - [`read_grey`], [`read_mask`] and their writers: images as arrays `[[y, x]]`.
//! - [`read_manifest`]: what a data set is, where it comes from and under which licence.
//!
//! # What is promised
//! - A file is untrusted: a size it declares is compared with the bytes that are there before
//!   memory is taken, and whatever is wrong becomes an [`IoError`] with file, place and value.
//! - No NaN or infinity is read or written.
//! - Every file is written to a temporary name, synced and renamed ([`write_atomically`]).
//! - What is written reads back to the same bits, where the format can hold them. Three cannot, and
//!   are off in the last digits: COLMAP (rotations as quaternions, pixels counted half a pixel off),
//!   3 x 4 matrices (`K`, `R` and `t` are taken out of the product) and Slicer's millimetres for a
//!   curve in cm or m.

mod atomic;
mod bounded;
mod calibration;
mod cameras;
mod curve;
mod curve_csv;
#[cfg(feature = "dicom")]
mod dicom;
mod distortion;
mod error;
mod find;
mod fingerprint;
mod finite_check;
mod image_file;
#[cfg(test)]
mod in_a_file;
mod json;
mod manifest;
mod markups;
mod matrix;
mod meta;
mod nifti_label;
mod npy;
mod npz;
mod pair;
mod pair_of_views;
mod pair_write;
#[cfg(feature = "parquet")]
mod parquet_file;
mod ply;
mod points;
mod rig_file;
mod unit;
mod vtp;

pub use atomic::{remove_unfinished, require_writable, write_atomically};
pub use bounded::read_file;
pub use cameras::{
    CameraFormat, CameraSource, NamedView, ViewDefaults, is_dicom, read_cameras, write_cameras,
};
pub use curve::{Column, CurveTable, is_curve_file, read_curve, write_curve};
#[cfg(feature = "dicom")]
pub use dicom::{DicomPixels, FrameChoice, read_dicom_pixels, read_dicom_view};
pub use distortion::{read_distortion, undistort_points};
pub use error::IoError;
pub use find::find_pairs;
pub use fingerprint::{hash_bytes, hash_file, hash_pair, pair_files};
pub use image_file::{
    BitDepth, GreyImage, MAX_IMAGE_SIDE_PX, png_bytes, read_grey, read_image_size, read_mask,
    write_grey, write_mask, write_rgb, write_u8, write_u16,
};
pub use json::write_json;
pub use manifest::{Generator, Manifest, ManifestFile, Split, read_manifest, read_manifests};
pub use matrix::{read_matrix3, read_matrix3x4, write_matrix3, write_matrix3x4};
pub use nifti_label::write_mask_nifti;
pub use npy::write_npy_u8;
pub use pair::{OrderedPoints, Pair, PairParts, Truth, read_pair};
pub use pair_of_views::{ViewFiles, pair_of_views};
pub use pair_write::{PairContents, write_pair};
pub use ply::{PlyEncoding, read_ply_points, write_ply_points};
pub use points::{read_points, write_points};
pub use rig_file::{read_rig, write_rig};
