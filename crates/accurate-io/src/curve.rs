use std::collections::BTreeSet;
use std::path::Path;

use accurate_geom::{LengthUnit, Point3};

use crate::IoError;
use crate::matrix::finite;
use crate::{curve_csv, markups, npy, npz, ply, vtp};

/// The extensions [`write_curve`] knows.
#[cfg(feature = "parquet")]
const WRITTEN: &str = ".csv, .ply, .vtp, .mrk.json, .npy, .npz, .parquet";
#[cfg(not(feature = "parquet"))]
const WRITTEN: &str = ".csv, .ply, .vtp, .mrk.json, .npy, .npz";

/// The extensions [`read_curve`] knows.
const READ: &str = ".csv, .ply, .vtp, .mrk.json, .npy, .npz";

/// Most columns a curve may have. Names are compared with one another, so that a file of a million
/// columns would take hours.
pub(crate) const MAX_COLUMNS: usize = 1024;

/// A 3D curve with values per point, as it goes to and comes from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveTable {
    /// Unit of the points.
    pub unit: LengthUnit,
    /// Points in order along the curve; at least one.
    pub points: Vec<Point3>,
    /// Values per point: arc length, sigma, residual, flags, ...; at most 1024.
    pub columns: Vec<Column>,
}

/// One value per point of a [`CurveTable`].
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// An identifier, unique in its table: a letter or `_`, then letters, digits, `_`, `-`. Not
    /// `x`, `y`, `z`.
    pub name: String,
    /// Unit label (`mm`, `px`, ...); empty for a number without unit.
    pub unit: String,
    /// One finite value per point.
    pub values: Vec<f64>,
}

impl CurveTable {
    /// A curve without columns.
    pub fn from_points(points: Vec<Point3>, unit: LengthUnit) -> Self {
        Self { unit, points, columns: Vec::new() }
    }

    /// The column called `name`.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|c| c.name == name)
    }

    /// Refuses a table that some format could not hold; `path` is named in the error.
    fn check(&self, path: &Path) -> Result<(), IoError> {
        if self.points.is_empty() {
            return Err(IoError::Empty { path: path.to_owned(), what: "points" });
        }
        for (i, p) in self.points.iter().enumerate() {
            for (name, value) in ["x", "y", "z"].iter().zip(p.coords.iter()) {
                finite(path, *value, || format!("{name} of point {i}"))?;
            }
        }
        check_column_count(path, self.columns.len())?;
        let mut names = BTreeSet::from(["x", "y", "z"]);
        for Column { name, unit, values } in &self.columns {
            let bad = |value: &str, reason: &str| IoError::field(path, "column", value, reason);
            let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
            let inner = |c: char| letter(c) || c.is_ascii_digit() || c == '-';
            if !name.starts_with(letter) || !name.chars().all(inner) {
                return Err(bad(name, "expected a letter or _, then letters, digits, _ or -"));
            }
            if !names.insert(name) {
                return Err(bad(name, "the name is taken"));
            }
            if unit.trim() != unit || unit.chars().any(char::is_control) {
                return Err(bad(unit, "a unit must be one trimmed line"));
            }
            if values.len() != self.points.len() {
                let reason = format!("{} values for {} points", values.len(), self.points.len());
                return Err(bad(name, &reason));
            }
            for (i, &value) in values.iter().enumerate() {
                finite(path, value, || format!("{name} of point {i}"))?;
            }
        }
        Ok(())
    }
}

/// Writes a curve in the format of the name's extension, atomically:
///
/// - `.csv`: header `x,y,z`, then one column per [`Column`] headed `name[unit]`;
/// - `.ply`: binary little-endian doubles, columns as further properties, units as comments;
/// - `.vtp`: VTK PolyData (ASCII XML), one polyline, columns as point arrays, units as field data;
/// - `.mrk.json`: a 3D Slicer Markups curve, LPS, columns as measurements per control point; Slicer's
///   points are millimetres, so cm and m are scaled, and `unit` is shown as if it were mm;
/// - `.npy`: N x 3 doubles; **columns and unit are not stored**;
/// - `.npz`: `points` (N x 3), one array per column, `units_json` (UTF-8 bytes of a JSON object);
/// - `.parquet` (feature `parquet`): one double column each, units as key-value metadata.
///
/// Numbers keep every bit (scaled ones aside).
///
/// # Errors
/// [`IoError::Empty`], [`IoError::NotFinite`] naming point and column, [`IoError::Field`] for a
/// column name or length that no format could hold, [`IoError::UnknownExtension`],
/// [`IoError::System`]. Nothing is written then.
pub fn write_curve(path: &Path, curve: &CurveTable) -> Result<(), IoError> {
    curve.check(path)?;
    match extension(path).as_str() {
        "csv" => curve_csv::write(path, curve),
        "ply" => ply::write(path, curve, ply::PlyEncoding::BinaryLittleEndian),
        "vtp" => vtp::write(path, curve),
        "mrk.json" => markups::write(path, curve),
        "npy" => npy::write(path, curve),
        "npz" => npz::write(path, curve),
        #[cfg(feature = "parquet")]
        "parquet" => crate::parquet_file::write(path, curve),
        _ => Err(unknown_extension(path, WRITTEN)),
    }
}

/// Reads a curve in the format of the name's extension: what [`write_curve`] writes, and
///
/// - `.csv` with columns `x`, `y`, `z` anywhere in its header and numbers in all others;
/// - `.ply` ASCII or binary, float or double, with as many vertices as its header says;
/// - `.npy` N x 3 of `f8` or `f4`;
/// - `.vtp` with ASCII arrays and one polyline through all points in order;
/// - `.mrk.json` with one markup, LPS or RAS, in mm. Control points that Slicer counts as not placed
///   (`positionStatus` undefined, preview or missing) are left out, with their values, as Slicer
///   leaves them out of its curve.
///
/// - `.npz` with an array `points`, N x 3; other arrays of N numbers are columns.
///
/// `.parquet` is written, not read.
///
/// A file that names no unit gives [`LengthUnit::Unit`], one that names another than mm, cm, m and
/// `unit` is refused; a CSV file names it in the column `arc_length[..]`.
///
/// # Errors
/// [`IoError`] naming the file and the line, point or value; a declared size beyond the bytes of
/// the file is refused before memory is taken.
pub fn read_curve(path: &Path) -> Result<CurveTable, IoError> {
    let curve = match extension(path).as_str() {
        "csv" => curve_csv::read(path)?,
        "ply" => ply::read(path)?,
        "vtp" => vtp::read(path)?,
        "mrk.json" => markups::read(path)?,
        "npy" => npy::read(path)?,
        "npz" => npz::read(path)?,
        _ => return Err(unknown_extension(path, READ)),
    };
    curve.check(path)?;
    Ok(curve)
}

/// Refuses more columns than [`MAX_COLUMNS`]; readers ask before they compare names.
pub(crate) fn check_column_count(path: &Path, found: usize) -> Result<(), IoError> {
    if found <= MAX_COLUMNS {
        return Ok(());
    }
    Err(IoError::TooLarge {
        path: path.to_owned(),
        what: "number of columns".into(),
        found: found as u64,
        limit: MAX_COLUMNS as u64,
    })
}

fn extension(path: &Path) -> String {
    let lower = |part: &std::ffi::OsStr| part.to_string_lossy().to_ascii_lowercase();
    let last = path.extension().map(lower).unwrap_or_default();
    let before = path.file_stem().map(Path::new).and_then(Path::extension).map(lower);
    if last == "json" && before.as_deref() == Some("mrk") { "mrk.json".to_owned() } else { last }
}

fn unknown_extension(path: &Path, expected: &'static str) -> IoError {
    IoError::UnknownExtension { path: path.to_owned(), expected }
}

/// Whether [`write_curve`] knows the extension of this name.
pub fn is_curve_file(path: &Path) -> bool {
    WRITTEN.split(", ").any(|known| known.strip_prefix('.') == Some(extension(path).as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> CurveTable {
        let points = vec![Point3::new(0.0, 1.0, 2.0), Point3::new(3.0, 4.0, 5.0)];
        let mut table = CurveTable::from_points(points, LengthUnit::Millimetre);
        table.columns.push(Column {
            name: "arc_length".into(),
            unit: "mm".into(),
            values: vec![0.0, 5.2],
        });
        table
    }

    #[test]
    fn no_format_takes_a_table_another_could_not_hold() {
        let folder = tempfile::tempdir().unwrap();
        let mut bad: Vec<(CurveTable, &str)> = Vec::new();
        let mut with = |change: fn(&mut CurveTable), expected| {
            let mut t = table();
            change(&mut t);
            bad.push((t, expected));
        };
        with(|t| t.points.clear(), "no points");
        with(|t| t.points[1].y = f64::NAN, "y of point 1 is not finite: NaN");
        with(
            |t| t.columns[0].values[0] = f64::INFINITY,
            "arc_length of point 0 is not finite: inf",
        );
        with(|t| t.columns[0].values.truncate(1), "1 values for 2 points");
        with(|t| t.columns[0].name = "x".into(), "the name is taken");
        with(|t| t.columns[0].name = "arc length".into(), "expected a letter");
        with(|t| t.columns[0].name = String::new(), "expected a letter");
        with(|t| t.columns[0].unit = "m\nm".into(), "one trimmed line");
        with(|t| t.columns.push(t.columns[0].clone()), "the name is taken");
        with(|t| t.columns = vec![t.columns[0].clone(); 1025], "number of columns is 1025");
        for extension in ["csv", "ply", "vtp", "npy", "npz", "mrk.json"] {
            let path = folder.path().join(format!("curve.{extension}"));
            for (table, expected) in &bad {
                let error = write_curve(&path, table).unwrap_err().to_string();
                assert!(error.contains(expected), "{extension}: {error}");
                assert!(!path.exists());
            }
        }
    }

    #[test]
    fn a_csv_curve_in_a_unit_that_is_not_known_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.csv");
        let unit_of = |header: &str| {
            std::fs::write(&path, format!("{header}\n1,2,3,0\n")).unwrap();
            read_curve(&path).map(|curve| curve.unit)
        };
        assert_eq!(unit_of("x,y,z,arc_length[cm]").unwrap(), LengthUnit::Centimetre);
        assert_eq!(unit_of("x,y,z,arc_length").unwrap(), LengthUnit::Unit);
        let error = unit_of("x,y,z,arc_length[inch]").unwrap_err().to_string();
        assert!(error.ends_with("arc_length = `inch`: expected mm, cm, m or unit"), "{error}");
    }

    #[test]
    fn an_unknown_extension_lists_the_known_ones() {
        for name in ["curve.obj", "curve", ".csv", "curve.json"] {
            let error = write_curve(Path::new(name), &table()).unwrap_err();
            assert!(error.to_string().contains(".vtp"), "{error}");
            assert!(matches!(read_curve(Path::new(name)), Err(IoError::UnknownExtension { .. })));
        }
    }
}
