use std::path::{Path, PathBuf};

use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Camera, Distortion, GeomError, ImageSize, LengthUnit, Rig};

use crate::IoError;
use crate::distortion::read_distortion;
use crate::matrix::{read_matrix3, read_matrix3x4};

/// The two views of a pair folder: the letter in file names and the name in errors.
pub(crate) const VIEWS: [(char, &str); 2] = [('L', "view 1"), ('R', "view 2")];

/// `calibration/RT_L.txt` of a case.
pub(crate) fn rt_path(case: &Path, letter: char) -> PathBuf {
    case.join("calibration").join(format!("RT_{letter}.txt"))
}

/// Where `K` of a view may lie, in the order of trying: with the case, or shared by its set.
fn k_candidates(case: &Path, letter: char) -> Vec<PathBuf> {
    let own = format!("K_{letter}.txt");
    let folders = [case.join("calibration"), case.join("..").join("calibration"), case.join("..")];
    let names = [own.as_str(), "K.txt"];
    names.iter().flat_map(|name| folders.iter().map(move |f| f.join(name))).collect()
}

/// The first place where `K` of a view lies.
pub(crate) fn k_path(case: &Path, letter: char) -> Option<PathBuf> {
    k_candidates(case, letter).into_iter().find(|path| path.is_file())
}

/// `calibration/D_L.txt` of a case, which may be absent.
pub(crate) fn lens_path(case: &Path, letter: char) -> PathBuf {
    case.join("calibration").join(format!("D_{letter}.txt"))
}

/// The rig of a case folder; `size_source` is the file that gave the image sizes.
///
/// Each error names the file that holds the offending value.
pub(crate) fn read_rig_of_case(
    case: &Path,
    sizes: [ImageSize; 2],
    size_source: &Path,
    unit: LengthUnit,
) -> Result<Rig, IoError> {
    let view = |index: usize| -> Result<Camera, IoError> {
        let ((letter, part), size) = (VIEWS[index], sizes[index]);
        let Some(k_path) = k_path(case, letter) else {
            let mut also_tried = k_candidates(case, letter);
            let path = also_tried.remove(0);
            return Err(IoError::Missing { path, also_tried });
        };
        let rt_path = rt_path(case, letter);
        let k = read_matrix3(&k_path)?;
        let rt = read_matrix3x4(&rt_path)?;
        let r: Matrix3<f64> = rt.fixed_columns::<3>(0).into_owned();
        Camera::new(k, r, rt.column(3).into_owned(), size).map_err(|source| {
            let path = match source {
                GeomError::NotUpperTriangular { .. } | GeomError::ZeroFocalLength { .. } => &k_path,
                GeomError::EmptyImage { .. } => size_source,
                _ => rt_path.as_path(),
            };
            IoError::Geometry { path: path.to_owned(), part, source }
        })
    };
    let (camera1, camera2) = (view(0)?, view(1)?);
    Rig::new(camera1, camera2, unit).map_err(|source| IoError::Geometry {
        path: case.join("calibration"),
        part: "rig",
        source,
    })
}

/// The camera of a view with the lens of `calibration/D_L.txt`, if there is one.
///
/// `with_pictures`: masks or images are wanted, which only an ideal lens allows.
pub(crate) fn read_lens(
    case: &Path,
    index: usize,
    camera: &Camera,
    with_pictures: bool,
) -> Result<Camera, IoError> {
    let (letter, part) = VIEWS[index];
    let path = lens_path(case, letter);
    if !path.is_file() {
        return Ok(camera.clone());
    }
    let lens = read_distortion(&path)?;
    if with_pictures && lens != Distortion::default() {
        let what = "masks and images with lens distortion must be undistorted first; \
                    then remove this file";
        return Err(IoError::Unsupported { path, what: what.into() });
    }
    let geometry = |source| IoError::Geometry { path, part, source };
    camera.clone().with_distortion(lens).map_err(geometry)
}
