use std::io::Cursor;
use std::path::Path;

use ndarray::{Array1, Array2};
use ndarray_npy::NpzWriter;

use crate::IoError;
use crate::atomic::write_atomically;
use crate::curve::CurveTable;

/// Name of the array with the points.
const POINTS: &str = "points";
/// Name of the array with the units, as the UTF-8 bytes of a JSON object: NumPy's own text arrays
/// have no counterpart here.
const UNITS: &str = "units_json";

/// Writes `points` (N x 3), one array of N doubles per column, and `units_json`.
pub(crate) fn write(path: &Path, curve: &CurveTable) -> Result<(), IoError> {
    if let Some(taken) = curve.columns.iter().find(|c| [POINTS, UNITS].contains(&c.name.as_str())) {
        return Err(IoError::field(path, "column", &taken.name, "NPZ keeps this name for itself"));
    }
    let failed = |e: &dyn std::fmt::Display| {
        IoError::system(path, "encode", std::io::Error::other(e.to_string()))
    };
    let mut units = serde_json::Map::new();
    units.insert(POINTS.to_owned(), curve.unit.label().into());
    let mut archive = NpzWriter::new(Cursor::new(Vec::new()));
    let values = curve.points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let points = Array2::from_shape_vec((curve.points.len(), 3), values).map_err(|e| failed(&e))?;
    archive.add_array(POINTS, &points).map_err(|e| failed(&e))?;
    for column in &curve.columns {
        units.insert(column.name.clone(), column.unit.as_str().into());
        let values = Array1::from_vec(column.values.clone());
        archive.add_array(column.name.as_str(), &values).map_err(|e| failed(&e))?;
    }
    let units = Array1::from_vec(serde_json::Value::from(units).to_string().into_bytes());
    archive.add_array(UNITS, &units).map_err(|e| failed(&e))?;
    let bytes = archive.finish().map_err(|e| failed(&e))?.into_inner();
    write_atomically(path, |w| w.write_all(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Column;
    use accurate_geom::{LengthUnit, Point3};
    use ndarray_npy::NpzReader;

    #[test]
    fn every_array_comes_back_to_the_bit_and_twice_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let mut curve = CurveTable::from_points(
            vec![Point3::new(0.1, -0.0, 5e-324), Point3::new(1e308, 2.0, 3.0)],
            LengthUnit::Millimetre,
        );
        curve.columns.push(Column {
            name: "sigma".into(),
            unit: "mm".into(),
            values: vec![0.3, 1.0 / 3.0],
        });
        let paths = ["a.npz", "b.npz"].map(|name| folder.path().join(name));
        for path in &paths {
            write(path, &curve).unwrap();
        }
        let bytes = std::fs::read(&paths[0]).unwrap();
        assert_eq!(bytes, std::fs::read(&paths[1]).unwrap());
        let mut archive = NpzReader::new(Cursor::new(bytes)).unwrap();
        let points: Array2<f64> = archive.by_name(POINTS).unwrap();
        for (row, point) in points.rows().into_iter().zip(&curve.points) {
            for (read, written) in row.iter().zip(point.coords.iter()) {
                assert_eq!(read.to_bits(), written.to_bits());
            }
        }
        let sigma: Array1<f64> = archive.by_name("sigma").unwrap();
        assert_eq!(sigma.to_vec(), curve.columns[0].values);
        let units: Array1<u8> = archive.by_name(UNITS).unwrap();
        let units: serde_json::Value = serde_json::from_slice(&units.to_vec()).unwrap();
        assert_eq!(units, serde_json::json!({"points": "mm", "sigma": "mm"}));
    }

    #[test]
    fn a_column_cannot_hide_the_points() {
        let mut curve = CurveTable::from_points(vec![Point3::origin()], LengthUnit::Unit);
        curve.columns.push(Column { name: POINTS.into(), unit: String::new(), values: vec![1.0] });
        let error = write(Path::new("a.npz"), &curve).unwrap_err();
        assert!(error.to_string().contains("keeps this name"), "{error}");
    }
}
