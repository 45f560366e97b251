use std::fmt::Write as _;
use std::path::Path;

use accurate_geom::nalgebra::{Matrix3, Matrix3x4};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_SMALL_BYTES, read_text};
use crate::error::cut;

/// Reads a 3 x 3 matrix (`K_L.txt`, px): numbers separated by white space, one row per line. Blank
/// lines and lines that begin with `#` are skipped.
///
/// # Errors
/// [`IoError::Shape`], [`IoError::NotANumber`] or [`IoError::NotFinite`] with line and column;
/// [`IoError::Missing`], [`IoError::TooLarge`] above 1 MiB, [`IoError::NotText`].
pub fn read_matrix3(path: &Path) -> Result<Matrix3<f64>, IoError> {
    Ok(Matrix3::from_row_slice(&read_rows::<3>(path)?))
}

/// Reads a 3 x 4 matrix (`RT_L.txt`: `[R | t]`, world to camera), in the format of
/// [`read_matrix3`].
///
/// # Errors
/// As [`read_matrix3`].
pub fn read_matrix3x4(path: &Path) -> Result<Matrix3x4<f64>, IoError> {
    Ok(Matrix3x4::from_row_slice(&read_rows::<4>(path)?))
}

/// Writes a 3 x 3 matrix; reading it gives the same bits.
///
/// # Errors
/// [`IoError::NotFinite`], [`IoError::System`].
pub fn write_matrix3(path: &Path, matrix: &Matrix3<f64>) -> Result<(), IoError> {
    write_rows(path, matrix.row_iter().map(|r| r.iter().copied().collect()))
}

/// Writes a 3 x 4 matrix; reading it gives the same bits.
///
/// # Errors
/// [`IoError::NotFinite`], [`IoError::System`].
pub fn write_matrix3x4(path: &Path, matrix: &Matrix3x4<f64>) -> Result<(), IoError> {
    write_rows(path, matrix.row_iter().map(|r| r.iter().copied().collect()))
}

/// Three rows of `COLUMNS` finite numbers, row by row.
fn read_rows<const COLUMNS: usize>(path: &Path) -> Result<Vec<f64>, IoError> {
    let text = read_text(path, MAX_SMALL_BYTES)?;
    let shape =
        |line, found| IoError::Shape { path: path.to_owned(), line, expected: (3, COLUMNS), found };
    let rows: Vec<(usize, &str)> = text
        .lines()
        .enumerate()
        .map(|(i, l)| (i + 1, l.trim()))
        .filter(|(_, l)| !l.is_empty() && !l.starts_with('#'))
        .collect();
    let mut values = Vec::with_capacity(3 * COLUMNS);
    for &(line, row) in &rows {
        let columns = row.split_whitespace().count();
        if columns != COLUMNS {
            return Err(shape(line, (rows.len(), columns)));
        }
        if values.len() == 3 * COLUMNS {
            return Err(shape(line, (rows.len(), columns)));
        }
        for (column, field) in row.split_whitespace().enumerate() {
            values.push(parse_number(path, line, column + 1, field)?);
        }
    }
    if values.len() != 3 * COLUMNS {
        let last = rows.last().map_or(0, |r| r.0);
        return Err(shape(last, (rows.len(), if rows.is_empty() { 0 } else { COLUMNS })));
    }
    Ok(values)
}

fn write_rows(path: &Path, rows: impl Iterator<Item = Vec<f64>>) -> Result<(), IoError> {
    let mut text = String::new();
    for (r, row) in rows.enumerate() {
        for (c, value) in row.iter().enumerate() {
            finite(path, *value, || format!("row {}, column {}", r + 1, c + 1))?;
            // `{:?}` is the shortest text that reads back to the same bits.
            let _ = write!(text, "{}{value:?}", if c == 0 { "" } else { " " });
        }
        text.push('\n');
    }
    write_atomically(path, |w| w.write_all(text.as_bytes()))
}

/// One finite number of a text file; `line` and `column` from 1.
pub(crate) fn parse_number(
    path: &Path,
    line: usize,
    column: usize,
    field: &str,
) -> Result<f64, IoError> {
    let value: f64 = field.trim().parse().map_err(|_| IoError::NotANumber {
        path: path.to_owned(),
        line,
        column,
        text: cut(field, 40),
    })?;
    finite(path, value, || format!("line {line}, column {column}"))
}

/// Refuses NaN and infinities, naming the place.
pub(crate) fn finite(path: &Path, value: f64, at: impl FnOnce() -> String) -> Result<f64, IoError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(IoError::NotFinite { path: path.to_owned(), at: at(), value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_a_file::in_a_file;

    fn read(text: &str) -> Result<Matrix3<f64>, IoError> {
        in_a_file("K_L.txt", text, read_matrix3)
    }

    #[test]
    fn white_space_comments_and_a_missing_last_newline_do_not_matter() {
        let k =
            read("\u{feff}# K of the left camera\r\n\r\n 1e3\t0 256\r\n0 -1e3 1\n0 0 1").unwrap();
        assert_eq!(k, Matrix3::new(1000.0, 0.0, 256.0, 0.0, -1000.0, 1.0, 0.0, 0.0, 1.0));
    }

    #[test]
    fn each_defect_names_its_line_and_value() {
        let cases: [(&str, &str); 8] = [
            ("", "line 0: expected a 3 x 3 matrix, found 0 x 0"),
            ("1 0 0\n0 1 0\n", "line 2: expected a 3 x 3 matrix, found 2 x 3"),
            ("1 0 0\n0 1\n0 0 1\n", "line 2: expected a 3 x 3 matrix, found 3 x 2"),
            ("1 0 0 0\n0 1 0 0\n0 0 1 0\n", "line 1: expected a 3 x 3 matrix, found 3 x 4"),
            ("1 0 0\n0 1 0\n0 0 1\n0 0 0\n", "line 4: expected a 3 x 3 matrix, found 4 x 3"),
            ("1 0 0\n0 x 0\n0 0 1\n", "line 2, column 2: `x` is not a number"),
            ("1 0 NaN\n0 1 0\n0 0 1\n", "line 1, column 3 is not finite: NaN"),
            ("1 0 0\n0 1e999 0\n0 0 1\n", "line 2, column 2 is not finite: inf"),
        ];
        for (text, expected) in cases {
            let error = read(text).unwrap_err();
            assert!(error.to_string().ends_with(expected), "{text:?}: {error}");
            assert!(error.path().ends_with("K_L.txt"));
        }
    }

    #[test]
    fn a_nan_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("K_L.txt");
        let mut k = Matrix3::identity();
        k[(1, 2)] = f64::NAN;
        let error = write_matrix3(&path, &k).unwrap_err();
        assert!(error.to_string().contains("row 2, column 3"), "{error}");
        assert!(!path.exists());
    }
}
