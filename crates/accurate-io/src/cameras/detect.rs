use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use accurate_geom::{Camera, LengthUnit, Rig};

use super::colmap::{self, Part};
use super::opencv::{self, StorageFile, Syntax};
use super::{NamedView, ViewDefaults, json_cameras, projection_list};
use crate::bounded::{MAX_SMALL_BYTES, as_text, read_bytes, read_text};
use crate::pair::{PairParts, read_pair};
use crate::rig_file::{looks_like_rig, parse_rig};
use crate::{IoError, error};

/// What kind of camera file a path is, by its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CameraSource {
    /// A pair folder of ours.
    PairFolder,
    /// COLMAP text: the folder, or what is in its `cameras.txt` or `images.txt`.
    Colmap,
    /// A DICOM file.
    Dicom,
    /// OpenCV FileStorage, YAML.
    OpencvYaml,
    /// OpenCV FileStorage, XML.
    OpencvXml,
    /// Our rig file, TOML or JSON.
    Rig,
    /// Any other JSON: views as printed by `camera show`, MATLAB, DiffDRR, DeepDRR.
    Json,
    /// 3 x 4 matrices as text.
    MatrixText,
    /// 3 x 4 matrices as NPY.
    MatrixNpy,
}

/// Whether the file is DICOM: `DICM` after the preamble of 128 bytes.
///
/// A pipe is never taken for one and not looked into: what is taken out of it is gone for the reader
/// that follows.
///
/// # Errors
/// [`IoError::Missing`], [`IoError::System`].
pub fn is_dicom(path: &Path) -> Result<bool, IoError> {
    let system = |e| IoError::system(path, "read", e);
    if !path.metadata().map_err(system)?.is_file() {
        return Ok(false);
    }
    let mut head = Vec::new();
    File::open(path).map_err(system)?.take(132).read_to_end(&mut head).map_err(system)?;
    Ok(begins_as_dicom(&head))
}

fn begins_as_dicom(bytes: &[u8]) -> bool {
    bytes.get(128..132) == Some(b"DICM")
}

/// The cameras of files of any known kind, in the order of the paths and within a file in its own.
/// The kind is told by content, not by name. Every file is read once, so that pipes will do, but for
/// DICOM.
///
/// OpenCV files are read together: one may hold the intrinsics and another the extrinsics, as
/// `stereo_calib` writes them. So are the two files of COLMAP in one folder; what is not given of
/// them is looked for beside the other, as `cameras.txt` or `images.txt`.
///
/// # Errors
/// [`IoError`] that names the file; [`IoError::Unsupported`] for a kind that is not known, a lens
/// model that is not ours, or an image size that is stated nowhere.
pub fn read_cameras(paths: &[PathBuf], defaults: &ViewDefaults) -> Result<Vec<NamedView>, IoError> {
    let files: Vec<CameraFile<'_>> =
        paths.iter().map(|path| CameraFile::open(path)).collect::<Result<_, _>>()?;
    let mut views = Vec::new();
    let (mut opencv_done, mut colmap_done) = (false, Vec::<&Path>::new());
    for file in &files {
        let path = file.path;
        match file.kind {
            CameraSource::PairFolder => {
                let pair = read_pair(path, PairParts::default())?;
                views.extend(views_of_rig(&pair.rig, &pair.case_id, defaults));
            }
            CameraSource::Rig => {
                let rig = parse_rig(path, file.text()?)?;
                views.extend(views_of_rig(&rig, &stem(path), defaults));
            }
            CameraSource::Colmap => {
                let folder = file.folder();
                if !colmap_done.contains(&folder) {
                    colmap_done.push(folder);
                    views.extend(colmap_views(folder, &files, defaults)?);
                }
            }
            CameraSource::OpencvYaml | CameraSource::OpencvXml => {
                if !opencv_done {
                    opencv_done = true;
                    views.extend(opencv_views(&files, defaults)?);
                }
            }
            CameraSource::Json => views.extend(json_cameras::read(path, file.text()?, defaults)?),
            CameraSource::MatrixText => {
                views.extend(projection_list::read_text(path, file.text()?, defaults)?);
            }
            CameraSource::MatrixNpy => {
                views.extend(projection_list::read_npy(path, &file.bytes, defaults)?);
            }
            CameraSource::Dicom => views.push(dicom_view(path)?),
        }
    }
    Ok(views)
}

fn opencv_views(
    files: &[CameraFile<'_>],
    defaults: &ViewDefaults,
) -> Result<Vec<NamedView>, IoError> {
    let mut storages = Vec::new();
    for file in files {
        let syntax = match file.kind {
            CameraSource::OpencvYaml => Syntax::Yaml,
            CameraSource::OpencvXml => Syntax::Xml,
            _ => continue,
        };
        storages.push(StorageFile { path: file.path, text: file.text()?, syntax });
    }
    opencv::read(&storages, defaults)
}

/// The COLMAP model of a folder: the parts given, and what is missing of it from the folder.
fn colmap_views(
    folder: &Path,
    files: &[CameraFile<'_>],
    defaults: &ViewDefaults,
) -> Result<Vec<NamedView>, IoError> {
    let find = |part: Part| -> Result<(PathBuf, String), IoError> {
        let mut given =
            files.iter().filter(|file| file.folder() == folder && file.colmap_part() == Some(part));
        let Some(file) = given.next() else {
            let path = folder.join(part.file_name());
            let text = read_text(&path, part.max_bytes())?;
            return Ok((path, text));
        };
        if let Some(second) = given.find(|second| second.path != file.path) {
            let what = format!(
                "{} holds the same part of a COLMAP model in the same folder; give one model at a time",
                file.path.display()
            );
            return Err(IoError::Unsupported { path: second.path.to_owned(), what });
        }
        Ok((file.path.to_owned(), file.text()?.to_owned()))
    };
    let (cameras, images) = (find(Part::Cameras)?, find(Part::Images)?);
    colmap::read((&cameras.0, &cameras.1), (&images.0, &images.1), defaults)
}

#[cfg(feature = "dicom")]
fn dicom_view(path: &Path) -> Result<NamedView, IoError> {
    crate::dicom::read_dicom_view(path)
}

#[cfg(not(feature = "dicom"))]
fn dicom_view(path: &Path) -> Result<NamedView, IoError> {
    let what = "a DICOM file; this build does not read DICOM (feature `dicom`)".into();
    Err(IoError::Unsupported { path: path.to_owned(), what })
}

fn views_of_rig(rig: &Rig, name: &str, defaults: &ViewDefaults) -> [NamedView; 2] {
    // A plain unit is what is left where none is stated.
    let stated = Some(rig.unit()).filter(|unit| *unit != LengthUnit::Unit);
    let view = |camera: &Camera, number: u8| NamedView {
        name: format!("{name}_{number}"),
        camera: camera.clone(),
        unit: stated.or(defaults.unit).unwrap_or_default(),
        frame: "as in the file".into(),
        notes: Vec::new(),
    };
    [view(rig.camera1(), 1), view(rig.camera2(), 2)]
}

/// The file's name without its extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A path, what it is, and what is in it: a pipe can be read but once.
struct CameraFile<'p> {
    path: &'p Path,
    kind: CameraSource,
    /// Empty for a folder and for DICOM, which have readers of their own.
    bytes: Vec<u8>,
}

impl<'p> CameraFile<'p> {
    fn open(path: &'p Path) -> Result<Self, IoError> {
        let without_bytes = |kind| Ok(Self { path, kind, bytes: Vec::new() });
        if path.is_dir() {
            return without_bytes(if path.join(Part::Cameras.file_name()).is_file() {
                CameraSource::Colmap
            } else {
                CameraSource::PairFolder
            });
        }
        if is_dicom(path)? {
            return without_bytes(CameraSource::Dicom);
        }
        let bytes = read_bytes(path, MAX_SMALL_BYTES)?;
        let kind = kind_of(path, &bytes)?;
        Ok(Self { path, kind, bytes })
    }

    fn text(&self) -> Result<&str, IoError> {
        as_text(self.path, &self.bytes)
    }

    /// The folder of a COLMAP model: the path itself, or where the file lies.
    fn folder(&self) -> &'p Path {
        if self.path.is_dir() { self.path } else { self.path.parent().unwrap_or(self.path) }
    }

    /// Which file of a COLMAP model it is. The name decides only where the content leaves it open: in
    /// a file without a single camera or image.
    fn colmap_part(&self) -> Option<Part> {
        if self.kind != CameraSource::Colmap || self.path.is_dir() {
            return None;
        }
        Part::of(self.text().ok()?).or_else(|| part_by_name(self.path))
    }
}

fn part_by_name(path: &Path) -> Option<Part> {
    let name = path.file_name()?;
    [Part::Cameras, Part::Images].into_iter().find(|part| name == part.file_name())
}

/// The kind of a file that is no DICOM file.
fn kind_of(path: &Path, bytes: &[u8]) -> Result<CameraSource, IoError> {
    let unsupported = |what: String| IoError::Unsupported { path: path.to_owned(), what };
    if begins_as_dicom(bytes) {
        return Err(unsupported("DICOM is read from files, not from a pipe".into()));
    }
    if bytes.starts_with(b"\x93NUMPY") {
        return Ok(CameraSource::MatrixNpy);
    }
    let text = as_text(path, bytes)?;
    let head = text.trim_start();
    if head.starts_with('<') {
        Ok(CameraSource::OpencvXml)
    } else if head.starts_with("%YAML") || text.contains("!!opencv-matrix") {
        Ok(CameraSource::OpencvYaml)
    } else if looks_like_rig(text) {
        Ok(CameraSource::Rig)
    } else if head.starts_with(['{', '[']) {
        Ok(CameraSource::Json)
    } else if Part::of(text).is_some() {
        Ok(CameraSource::Colmap)
    } else if projection_list::looks_like(text) {
        Ok(CameraSource::MatrixText)
    } else if part_by_name(path).is_some() {
        // Of no kind by its content; its own reader says best what is wrong with it.
        Ok(CameraSource::Colmap)
    } else {
        let first = error::cut(head.lines().next().unwrap_or_default(), 40);
        Err(unsupported(format!(
            "no known camera file (it begins with `{first}`); expected DICOM XA, OpenCV YAML or XML, \
             COLMAP text, 3 x 4 matrices, camera JSON, or a rig file"
        )))
    }
}
