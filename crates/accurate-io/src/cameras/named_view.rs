use std::path::{Path, PathBuf};

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, Distortion, ImageSize, LengthUnit};
use serde::{Deserialize, Serialize};

use crate::IoError;
use crate::pair::check_size;
use crate::unit::length_unit;

/// One camera read from a file, with what its numbers mean.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedView {
    /// Name of the view: from the file, or the file's own.
    pub name: String,
    /// The camera: pixel centres at integers, world to camera.
    pub camera: Camera,
    /// Unit of the world.
    pub unit: LengthUnit,
    /// The world frame in words.
    pub frame: String,
    /// What was assumed, or converted, to get here. Nothing is assumed without a line in it.
    pub notes: Vec<String>,
}

impl NamedView {
    /// Refuses a picture, rows and columns of it, that has not the size of the camera's image.
    ///
    /// # Errors
    /// [`IoError::SizeMismatch`] with the picture's `path`.
    pub fn check_size(&self, path: &Path, dim: (usize, usize)) -> Result<(), IoError> {
        let camera = PathBuf::from(format!("camera `{}`", self.name));
        check_size(path, dim, &camera, self.camera.size())
    }
}

/// What some formats leave out and the caller may know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ViewDefaults {
    /// Image size for files that state none; without it they are refused.
    pub image_size: Option<ImageSize>,
    /// Unit of the world for files that state none; without it [`LengthUnit::Unit`], with a note.
    pub unit: Option<LengthUnit>,
}

/// The numbers of a view before they are checked.
pub(crate) struct RawView {
    pub(crate) name: String,
    pub(crate) k: Matrix3<f64>,
    pub(crate) r: Matrix3<f64>,
    pub(crate) t: Vector3<f64>,
    pub(crate) size: Option<ImageSize>,
    pub(crate) distortion: Option<Distortion>,
    pub(crate) unit: Option<LengthUnit>,
    pub(crate) frame: String,
    pub(crate) notes: Vec<String>,
}

impl RawView {
    pub(crate) fn check(self, path: &Path, defaults: &ViewDefaults) -> Result<NamedView, IoError> {
        let geometry = |source| IoError::Geometry { path: path.to_owned(), part: "camera", source };
        let mut notes = self.notes;
        let size = self.size.or(defaults.image_size).ok_or_else(|| no_size(path, &self.name))?;
        let unit = self.unit.or(defaults.unit).unwrap_or_else(|| {
            notes.push("the file states no unit of length".into());
            LengthUnit::Unit
        });
        let mut camera = Camera::new(self.k, self.r, self.t, size).map_err(geometry)?;
        if let Some(lens) = self.distortion.filter(|lens| *lens != Distortion::default()) {
            camera = camera.with_distortion(lens).map_err(geometry)?;
        }
        Ok(NamedView { name: self.name, camera, unit, frame: self.frame, notes })
    }
}

/// Largest accepted side of an image that a camera file states, px.
const MAX_SIDE_PX: u32 = 1_000_000;

/// A side of an image that a file gives as a number, px.
pub(crate) fn side_px(path: &Path, field: &str, value: f64) -> Result<u32, IoError> {
    if (1.0..=f64::from(MAX_SIDE_PX)).contains(&value) && value.fract() == 0.0 {
        // Exact by the check above.
        Ok(value as u32)
    } else {
        let reason = format!("expected a whole number of px from 1 to {MAX_SIDE_PX}");
        Err(IoError::field(path, field, value.to_string(), reason))
    }
}

pub(crate) fn no_size(path: &Path, view: &str) -> IoError {
    IoError::Unsupported {
        path: path.to_owned(),
        what: format!("view `{view}`: the file states no image size; it must be given beside it"),
    }
}

/// A view as `accurate camera show --json` prints it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ViewJson {
    pub(crate) name: String,
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(rename = "R")]
    r: [[f64; 3]; 3],
    t: [f64; 3],
    #[serde(rename = "P", default)]
    p: Option<[[f64; 4]; 3]>,
    image_size: [u32; 2],
    unit: String,
    frame: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distortion: Option<[f64; 5]>,
    #[serde(default)]
    notes: Vec<String>,
}

impl NamedView {
    /// `{"name", "K", "R", "t", "P", "image_size", "unit", "frame", "distortion"?, "notes"}`, with
    /// `P = K [R | t]`; reading it back gives the same bits.
    ///
    /// # Errors
    /// [`serde_json::Error`] never for a view that was read; kept for the caller to pass on.
    pub fn to_json(&self) -> Result<serde_json::Value, serde_json::Error> {
        serde_json::to_value(self.described())
    }

    /// Reads what [`Self::to_json`] wrote. `P` is not read: it follows from `K`, `R`, `t`.
    ///
    /// # Errors
    /// [`IoError::Malformed`], [`IoError::Field`], [`IoError::Geometry`], all about `path`.
    pub fn from_json(path: &Path, text: &str) -> Result<Self, IoError> {
        let view: ViewJson = serde_json::from_str(text)
            .map_err(|e| IoError::malformed(path, "view JSON", Some(e.line()), e))?;
        view.view(path)
    }

    pub(crate) fn described(&self) -> ViewJson {
        let rows = |m: &Matrix3<f64>| [0, 1, 2].map(|r| [0, 1, 2].map(|c| m[(r, c)]));
        let p = self.camera.projection_matrix();
        let size = self.camera.size();
        ViewJson {
            name: self.name.clone(),
            k: rows(self.camera.k()),
            r: rows(self.camera.r()),
            t: (*self.camera.t()).into(),
            p: Some([0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| p[(r, c)]))),
            image_size: [size.width, size.height],
            unit: self.unit.label().to_owned(),
            frame: self.frame.clone(),
            distortion: self.camera.distortion().map(|d| [d.k1, d.k2, d.p1, d.p2, d.k3]),
            notes: self.notes.clone(),
        }
    }
}

impl ViewJson {
    pub(crate) fn view(self, path: &Path) -> Result<NamedView, IoError> {
        let matrix = |rows: &[[f64; 3]; 3]| Matrix3::from_fn(|r, c| rows[r][c]);
        let unit = length_unit(path, "unit", &self.unit)?;
        let [width, height] = self.image_size;
        RawView {
            name: self.name,
            k: matrix(&self.k),
            r: matrix(&self.r),
            t: Vector3::from(self.t),
            size: Some(ImageSize { width, height }),
            distortion: self.distortion.map(|[k1, k2, p1, p2, k3]| Distortion {
                k1,
                k2,
                p1,
                p2,
                k3,
            }),
            unit: Some(unit),
            frame: self.frame,
            notes: self.notes,
        }
        .check(path, &ViewDefaults::default())
    }
}
