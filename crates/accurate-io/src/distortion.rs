use std::path::Path;

use accurate_geom::{Camera, Distortion, Pixel, View};

use crate::IoError;
use crate::bounded::{MAX_SMALL_BYTES, read_text};
use crate::matrix::parse_number;

/// Reads lens distortion (`D_L.txt`): the four or five numbers `k1 k2 p1 p2 [k3]` of OpenCV,
/// separated by white space or line breaks.
///
/// # Errors
/// [`IoError::Shape`] for another count; [`IoError::NotANumber`] or [`IoError::NotFinite`] with line
/// and column; [`IoError::Missing`], [`IoError::TooLarge`] above 1 MiB.
pub fn read_distortion(path: &Path) -> Result<Distortion, IoError> {
    let text = read_text(path, MAX_SMALL_BYTES)?;
    let mut values = Vec::new();
    let mut last_line = 0;
    for (i, line) in text.lines().enumerate() {
        for (column, field) in line.split_whitespace().enumerate() {
            last_line = i + 1;
            values.push(parse_number(path, last_line, column + 1, field)?);
        }
    }
    match values[..] {
        [k1, k2, p1, p2] => Ok(Distortion { k1, k2, p1, p2, k3: 0.0 }),
        [k1, k2, p1, p2, k3] => Ok(Distortion { k1, k2, p1, p2, k3 }),
        _ => Err(IoError::Shape {
            path: path.to_owned(),
            line: last_line,
            expected: (1, 5),
            found: (1, values.len()),
        }),
    }
}

/// Removes the lens distortion of `camera` from points of its view; without distortion they come
/// back unchanged. `path` is the file the points came from.
///
/// # Errors
/// [`IoError::Geometry`] if the distortion cannot be undone at a point (the error names it).
pub fn undistort_points<V: View>(
    path: &Path,
    camera: &Camera,
    points: &[Pixel<V>],
) -> Result<Vec<Pixel<V>>, IoError> {
    let part = if V::NUMBER == 1 { "view 1" } else { "view 2" };
    points
        .iter()
        .map(|p| camera.undistort(&p.point()).map(Pixel::from))
        .collect::<Result<_, _>>()
        .map_err(|source| IoError::Geometry { path: path.to_owned(), part, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_or_five_numbers_in_any_layout_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("D_L.txt");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_distortion(&path)
        };
        let five = Distortion { k1: -0.1, k2: 0.02, p1: 1e-3, p2: 0.0, k3: 5.0 };
        assert_eq!(read("-0.1 0.02 1e-3 0 5\n").unwrap(), five);
        assert_eq!(read("-0.1\n0.02\n1e-3\n0\n5").unwrap(), five);
        assert_eq!(read("-0.1 0.02 1e-3 0").unwrap(), Distortion { k3: 0.0, ..five });
        for (text, expected) in [
            ("", "found 1 x 0"),
            ("1 2 3", "line 1: expected a 1 x 5 matrix, found 1 x 3"),
            ("1 2 3\n4 5 6 7 8", "line 2: expected a 1 x 5 matrix, found 1 x 8"),
            ("1 2 nan 4", "line 1, column 3 is not finite"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }
}
