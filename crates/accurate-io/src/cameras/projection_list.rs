use std::fmt::Write as _;
use std::path::Path;

use accurate_geom::Camera;
use accurate_geom::nalgebra::Matrix3x4;

use super::detect::stem;
use super::named_view::no_size;
use super::{NamedView, ViewDefaults};
use crate::IoError;
use crate::matrix::{finite, parse_number};

const FORMAT: &str = "list of 3 x 4 matrices";

fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let split = |line| {
        let is_gap = |c: char| c.is_whitespace() || c == ',' || c == ';';
        str::split(line, is_gap).filter(|f| !f.is_empty()).collect::<Vec<_>>()
    };
    let kept = |line: &str| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    text.lines()
        .enumerate()
        .filter(move |(_, line)| kept(line))
        .map(move |(i, line)| (i + 1, split(line)))
}

/// Whether the text is rows of four numbers, at least three.
pub(crate) fn looks_like(text: &str) -> bool {
    let first: Vec<_> = rows(text).take(3).collect();
    first.len() == 3 && first.iter().all(|(_, row)| row.len() == 4 && row[0].parse::<f64>().is_ok())
}

/// Reads projection matrices of views one below the other: 3 rows of 4 numbers each, separated by
/// white space, commas or semicolons; `#` begins a comment line.
pub(crate) fn read_text(
    path: &Path,
    text: &str,
    defaults: &ViewDefaults,
) -> Result<Vec<NamedView>, IoError> {
    let mut values = Vec::new();
    for (line, row) in rows(text) {
        if row.len() != 4 {
            let reason = format!("a row of {} numbers; expected 4", row.len());
            return Err(IoError::malformed(path, FORMAT, Some(line), reason));
        }
        for (column, field) in row.iter().enumerate() {
            values.push(parse_number(path, line, column + 1, field)?);
        }
    }
    views(path, &values, defaults)
}

/// Reads projection matrices from NPY: shape (3, 4) or (n, 3, 4), little-endian f8, C order.
pub(crate) fn read_npy(
    path: &Path,
    bytes: &[u8],
    defaults: &ViewDefaults,
) -> Result<Vec<NamedView>, IoError> {
    let (header, length) = crate::npy::header(path, bytes)?;
    let count = match header.shape[..] {
        [3, 4] => Some(1),
        [n, 3, 4] => Some(n),
        _ => None,
    };
    let plain = header.type_descriptor.to_string().trim_matches('\'') == "<f8";
    let fits = count.and_then(|n| n.checked_mul(96)) == Some(length);
    if !plain || header.layout != ndarray_npy::npy::header::Layout::Standard || !fits {
        let reason =
            format!("shape {:?}; expected (3, 4) or (n, 3, 4) of f8, C order", header.shape);
        return Err(IoError::malformed(path, "NPY", None, reason));
    }
    let mut values = Vec::with_capacity(length / 8);
    for (i, chunk) in bytes[bytes.len() - length..].chunks_exact(8).enumerate() {
        let mut raw = [0; 8];
        raw.copy_from_slice(chunk);
        values.push(finite(path, f64::from_le_bytes(raw), || format!("entry {i}"))?);
    }
    views(path, &values, defaults)
}

fn views(path: &Path, values: &[f64], defaults: &ViewDefaults) -> Result<Vec<NamedView>, IoError> {
    if values.is_empty() || !values.len().is_multiple_of(12) {
        let reason = format!("{} rows of 4; expected a multiple of 3", values.len() / 4);
        return Err(IoError::malformed(path, FORMAT, None, reason));
    }
    let count = values.len() / 12;
    values
        .chunks_exact(12)
        .enumerate()
        .map(|(index, chunk)| {
            let name =
                if count == 1 { stem(path) } else { format!("{}_{}", stem(path), index + 1) };
            let size = defaults.image_size.ok_or_else(|| no_size(path, &name))?;
            let p = Matrix3x4::from_row_slice(chunk);
            let camera = Camera::from_projection_matrix(&p, size).map_err(|source| {
                IoError::Geometry { path: path.to_owned(), part: "camera", source }
            })?;
            let mut notes =
                vec!["K, R, t taken out of P with positive focal lengths where possible".into()];
            if defaults.unit.is_none() {
                notes.push("the file states no unit of length".into());
            }
            let unit = defaults.unit.unwrap_or_default();
            Ok(NamedView { name, camera, unit, frame: "as in the file".into(), notes })
        })
        .collect()
}

/// The text that [`read_text`] reads.
pub(crate) fn to_text(path: &Path, views: &[NamedView]) -> Result<String, IoError> {
    let mut text = String::new();
    for view in views {
        if view.camera.distortion().is_some() {
            let what = format!("view `{}`: a 3 x 4 matrix cannot carry lens distortion", view.name);
            return Err(IoError::Unsupported { path: path.to_owned(), what });
        }
        let size = view.camera.size();
        let name = crate::error::cut(&view.name, 80);
        let _ = writeln!(
            text,
            "# {name}: P = K [R | t], {} x {} px, {}",
            size.width, size.height, view.unit
        );
        for row in view.camera.projection_matrix().row_iter() {
            let _ = writeln!(text, "{:?} {:?} {:?} {:?}", row[0], row[1], row[2], row[3]);
        }
    }
    Ok(text)
}
