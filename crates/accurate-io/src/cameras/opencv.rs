use std::path::Path;

use accurate_geom::nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
use accurate_geom::{Distortion, ImageSize};

use super::detect::stem;
use super::filestorage::{Node, Storage, matrix, read_xml, read_yaml};
use super::named_view::{RawView, side_px};
use super::{NamedView, ViewDefaults};
use crate::IoError;
use crate::unit::length_unit;

/// The names that OpenCV's samples and their users give to one quantity; `#` is the view's number.
const K: &[&str] = &["K#", "M#", "cameraMatrix#", "camera_matrix_#", "camera_matrix#", "CM#"];
const D: &[&str] = &["D#", "distCoeffs#", "dist_coeffs_#", "distortion_coefficients_#", "DC#"];
const R: &[&str] = &["R", "rotation", "rotation_matrix", "rvec"];
const T: &[&str] = &["T", "t", "translation", "translation_vector", "tvec"];
const K_ALONE: &[&str] = &["K", "M", "camera_matrix", "cameraMatrix", "mtx", "camera_intrinsics"];
const D_ALONE: &[&str] = &["D", "distortion_coefficients", "distCoeffs", "dist_coeffs", "dist"];

/// A FileStorage file and its text.
pub(crate) struct StorageFile<'f> {
    pub(crate) path: &'f Path,
    pub(crate) text: &'f str,
    pub(crate) syntax: Syntax,
}

/// How a FileStorage is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Syntax {
    Yaml,
    Xml,
}

fn keys(names: &[&str], number: &str) -> Vec<String> {
    names.iter().map(|name| name.replace('#', number)).collect()
}

/// Reads OpenCV FileStorage files: a stereo calibration spread over any of them, or one camera per
/// file.
///
/// Stereo: `K1 D1 K2 D2 R T` under the usual names, `x_cam2 = R x_cam1 + T`, the world being camera
/// 1's frame, unless the files also hold `RT1` and `RT2` (3 x 4, world to camera) as ours do. So for
/// sizes: one for both views, or `image_width1`, `image_height1` and so on where they differ.
pub(crate) fn read(
    files: &[StorageFile<'_>],
    defaults: &ViewDefaults,
) -> Result<Vec<NamedView>, IoError> {
    let storages: Vec<Storage> = files
        .iter()
        .map(|file| match file.syntax {
            Syntax::Yaml => read_yaml(file.path, file.text),
            Syntax::Xml => read_xml(file.path, file.text),
        })
        .collect::<Result<_, _>>()?;
    let path_of = |names: &[String]| {
        let holds = |storage: &Storage| names.iter().any(|name| storage.contains_key(name));
        storages.iter().position(holds).map_or(files[0].path, |i| files[i].path)
    };
    let stereo = storages.iter().any(|s| keys(K, "2").iter().any(|key| s.contains_key(key)));
    if !stereo {
        return files
            .iter()
            .zip(&storages)
            .map(|(file, storage)| single(file.path, storage)?.check(file.path, defaults))
            .collect();
    }
    let mut merged = Storage::new();
    for (StorageFile { path, .. }, storage) in files.iter().zip(&storages) {
        for (key, node) in storage {
            if merged.insert(key.clone(), node.clone()).is_some_and(|old| old != *node) {
                let reason = "two of the files give it different values";
                return Err(IoError::field(path, key.as_str(), "", reason));
            }
        }
    }
    let mut views = Vec::new();
    for number in ["1", "2"] {
        let (k_keys, rt_keys) = (keys(K, number), keys(&["RT#"], number));
        let path = path_of(&k_keys);
        let k = need(path, matrix(path, &merged, &k_keys)?, &k_keys)?;
        let (r, t, frame) = match matrix(path_of(&rt_keys), &merged, &rt_keys)? {
            Some(rt) => {
                let rt = shaped(path, &rt_keys[0], &rt, 3, 4)?;
                (rt.columns(0, 3).into_owned(), rt.column(3).into_owned(), "as in the file")
            }
            None if number == "1" => {
                (DMatrix::identity(3, 3), DMatrix::zeros(3, 1).column(0).into(), CAMERA_1)
            }
            None => {
                let (r_keys, t_keys) = (keys(R, ""), keys(T, ""));
                let path = path_of(&r_keys);
                let r = need(path, matrix(path, &merged, &r_keys)?, &r_keys)?;
                let path = path_of(&t_keys);
                let t = need(path, matrix(path, &merged, &t_keys)?, &t_keys)?;
                (rotation(path, &r)?, vector(path, "T", &t)?, CAMERA_1)
            }
        };
        views.push(
            RawView {
                name: format!("{}_{number}", stem(files[0].path)),
                k: intrinsics(path, &k)?,
                r: Matrix3::from_fn(|i, j| r[(i, j)]),
                t: Vector3::from_fn(|i, _| t[i]),
                size: size(path, &merged, number)?,
                distortion: lens(path, matrix(path, &merged, &keys(D, number))?)?,
                unit: unit(path, &merged)?,
                frame: frame.into(),
                notes: Vec::new(),
            }
            .check(path, defaults)?,
        );
    }
    Ok(views)
}

const CAMERA_1: &str = "camera 1: x right, y down, z forward";

fn single(path: &Path, storage: &Storage) -> Result<RawView, IoError> {
    let k_keys: Vec<String> = keys(K_ALONE, "").into_iter().chain(keys(K, "1")).collect();
    let k = need(path, matrix(path, storage, &k_keys)?, &k_keys)?;
    let d_keys: Vec<String> = keys(D_ALONE, "").into_iter().chain(keys(D, "1")).collect();
    let r = matrix(path, storage, &keys(R, ""))?;
    let t = matrix(path, storage, &keys(T, ""))?;
    let mut notes = Vec::new();
    let (r, t) = match (r, t) {
        (Some(r), Some(t)) => (rotation(path, &r)?, vector(path, "T", &t)?),
        (None, None) => {
            notes.push("the file has no extrinsics: the world is the camera's own frame".into());
            (DMatrix::identity(3, 3), DMatrix::zeros(3, 1).column(0).into())
        }
        (None, _) => return Err(absent(path, &keys(R, ""))),
        (_, None) => return Err(absent(path, &keys(T, ""))),
    };
    Ok(RawView {
        name: stem(path),
        k: intrinsics(path, &k)?,
        r: Matrix3::from_fn(|i, j| r[(i, j)]),
        t: Vector3::from_fn(|i, _| t[i]),
        size: size(path, storage, "")?,
        distortion: lens(path, matrix(path, storage, &d_keys)?)?,
        unit: unit(path, storage)?,
        frame: "as in the file".into(),
        notes,
    })
}

fn need(
    path: &Path,
    found: Option<DMatrix<f64>>,
    names: &[String],
) -> Result<DMatrix<f64>, IoError> {
    found.ok_or_else(|| absent(path, names))
}

fn absent(path: &Path, names: &[String]) -> IoError {
    let reason = format!("not in the file; looked for {}", names.join(", "));
    IoError::field(path, names[0].as_str(), "", reason)
}

fn shaped<'m>(
    path: &Path,
    name: &str,
    m: &'m DMatrix<f64>,
    rows: usize,
    cols: usize,
) -> Result<&'m DMatrix<f64>, IoError> {
    if m.shape() == (rows, cols) {
        Ok(m)
    } else {
        let reason = format!("expected {rows} x {cols}, found {} x {}", m.nrows(), m.ncols());
        Err(IoError::field(path, name, "", reason))
    }
}

fn intrinsics(path: &Path, m: &DMatrix<f64>) -> Result<Matrix3<f64>, IoError> {
    let m = shaped(path, "K", m, 3, 3)?;
    Ok(Matrix3::from_fn(|r, c| m[(r, c)]))
}

/// A rotation matrix, or a rotation vector (Rodrigues) with three entries.
fn rotation(path: &Path, m: &DMatrix<f64>) -> Result<DMatrix<f64>, IoError> {
    if m.len() == 3 {
        let r = Rotation3::new(Vector3::from_fn(|i, _| m[i]));
        return Ok(DMatrix::from_fn(3, 3, |i, j| r.matrix()[(i, j)]));
    }
    shaped(path, "R", m, 3, 3).cloned()
}

fn vector(
    path: &Path,
    name: &str,
    m: &DMatrix<f64>,
) -> Result<accurate_geom::nalgebra::DVector<f64>, IoError> {
    if m.len() == 3 {
        Ok(accurate_geom::nalgebra::DVector::from_fn(3, |i, _| m[i]))
    } else {
        let reason = format!("expected 3 entries, found {}", m.len());
        Err(IoError::field(path, name, "", reason))
    }
}

/// `k1 k2 p1 p2 [k3]`; more only if they are zero.
fn lens(path: &Path, m: Option<DMatrix<f64>>) -> Result<Option<Distortion>, IoError> {
    let Some(m) = m else { return Ok(None) };
    let v: Vec<f64> = m.iter().copied().collect();
    if !(4..=14).contains(&v.len()) {
        let reason = format!("expected 4, 5, 8, 12 or 14 coefficients, found {}", v.len());
        return Err(IoError::field(path, "D", "", reason));
    }
    if v.iter().skip(5).any(|c| *c != 0.0) {
        let what = "the rational, thin prism and tilted lens models are not read; \
                    calibrate with k1 k2 p1 p2 k3, or undistort the points first";
        return Err(IoError::Unsupported { path: path.to_owned(), what: what.into() });
    }
    let k3 = v.get(4).copied().unwrap_or(0.0);
    Ok(Some(Distortion { k1: v[0], k2: v[1], p1: v[2], p2: v[3], k3 }))
}

/// The image size of view `number` if the file gives the views their own, else the size of all.
fn size(path: &Path, storage: &Storage, number: &str) -> Result<Option<ImageSize>, IoError> {
    if !number.is_empty()
        && let Some(own) = stated_size(path, storage, number)?
    {
        return Ok(Some(own));
    }
    stated_size(path, storage, "")
}

fn stated_size(path: &Path, storage: &Storage, number: &str) -> Result<Option<ImageSize>, IoError> {
    let side = |key: String| -> Result<Option<u32>, IoError> {
        match storage.get(&key) {
            None => Ok(None),
            Some(Node::Number(v)) => side_px(path, &key, *v).map(Some),
            Some(_) => Err(IoError::field(path, key, "", "expected a whole number of px")),
        }
    };
    let sides = (side(format!("image_width{number}"))?, side(format!("image_height{number}"))?);
    if let (Some(width), Some(height)) = sides {
        return Ok(Some(ImageSize { width, height }));
    }
    let keys = keys(&["image_size#", "imageSize#"], number);
    let Some((key, node)) = keys.iter().find_map(|key| storage.get(key).map(|node| (key, node)))
    else {
        return Ok(None);
    };
    let sides: Option<Vec<f64>> = match node {
        Node::List(list) => list
            .iter()
            .map(|side| match side {
                Node::Number(v) => Some(*v),
                _ => None,
            })
            .collect(),
        Node::Map(_) => matrix(path, storage, std::slice::from_ref(key))?
            .map(|sides| sides.iter().copied().collect()),
        _ => None,
    };
    let Some(&[width, height]) = sides.as_deref() else {
        return Err(IoError::field(path, key, "", "expected [width, height]"));
    };
    let (width, height) = (side_px(path, key, width)?, side_px(path, key, height)?);
    Ok(Some(ImageSize { width, height }))
}

fn unit(path: &Path, storage: &Storage) -> Result<Option<accurate_geom::LengthUnit>, IoError> {
    match storage.get("unit") {
        Some(Node::Text(text)) => length_unit(path, "unit", text).map(Some),
        _ => Ok(None),
    }
}
