use std::io::{Cursor, Read};
use std::path::Path;

use ndarray::{Array1, Array2, Ix1};
use ndarray_npy::NpzWriter;
use zip::ZipArchive;

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_POINTS_BYTES, read_bytes};
use crate::curve::{Column, CurveTable, MAX_COLUMNS};
use crate::npy::{parse, parse_bytes, parse_points};
use crate::unit::length_unit;

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

/// Reads what [`write`] writes: `points` (N x 3), units, and every other array of N numbers as a column. Of
/// an archive that something else wrote, arrays of other shapes and kinds are none of the curve.
pub(crate) fn read(path: &Path) -> Result<CurveTable, IoError> {
    let malformed = |reason: String| IoError::malformed(path, "NPZ", None, reason);
    let bytes = read_bytes(path, MAX_POINTS_BYTES)?;
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| malformed(e.to_string()))?;
    let mut names: Vec<String> =
        archive.file_names().filter_map(|n| n.strip_suffix(".npy").map(str::to_owned)).collect();
    // In the order of the archive, which is that of the columns.
    names.sort_by_key(|name| archive.index_for_name(&format!("{name}.npy")));
    if !names.iter().any(|name| name == POINTS) {
        return Err(malformed(format!("no array `{POINTS}` in it")));
    }
    if names.len() > MAX_COLUMNS + 2 {
        return Err(malformed(format!("{} arrays", names.len())));
    }
    // What is packed may unpack to anything: all arrays together are no larger than a file may be.
    let mut left = MAX_POINTS_BYTES;
    let mut array = |name: &str| -> Result<Vec<u8>, IoError> {
        let entry =
            archive.by_name(&format!("{name}.npy")).map_err(|e| malformed(e.to_string()))?;
        let mut bytes = Vec::new();
        entry.take(left + 1).read_to_end(&mut bytes).map_err(|e| malformed(e.to_string()))?;
        left = left.checked_sub(bytes.len() as u64).ok_or_else(|| IoError::TooLarge {
            path: path.to_owned(),
            what: "unpacked size in bytes".into(),
            found: MAX_POINTS_BYTES + 1,
            limit: MAX_POINTS_BYTES,
        })?;
        Ok(bytes)
    };
    let mut curve = parse_points(path, &array(POINTS)?)?;
    let units = if names.iter().any(|name| name == UNITS) {
        let bytes = array(UNITS)?;
        let object: Result<serde_json::Map<_, _>, _> =
            serde_json::from_slice(parse_bytes(path, &bytes)?);
        object.map_err(|e| malformed(format!("`{UNITS}`: {e}")))?
    } else {
        serde_json::Map::new()
    };
    let label = |name: &str| units.get(name).and_then(serde_json::Value::as_str);
    if let Some(unit) = label(POINTS) {
        curve.unit = length_unit(path, UNITS, unit)?;
    }
    for name in names.iter().filter(|name| ![POINTS, UNITS].contains(&name.as_str())) {
        let Ok(values) = parse(path, &array(name)?) else { continue };
        let Ok(values) = values.into_dimensionality::<Ix1>() else { continue };
        if values.len() == curve.points.len() {
            curve.columns.push(Column {
                name: name.clone(),
                unit: label(name).unwrap_or_default().to_owned(),
                values: values.to_vec(),
            });
        }
    }
    Ok(curve)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Column;
    use crate::in_a_file::in_a_file;
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
        assert_eq!(read(&paths[0]).unwrap(), curve);
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

    /// An archive of such arrays, each under its name.
    fn archive(arrays: &[(&str, Vec<u8>)], packed: bool) -> Vec<u8> {
        use zip::write::SimpleFileOptions;
        let method =
            if packed { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
        let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in arrays {
            let options = SimpleFileOptions::default().compression_method(method);
            writer.start_file(*name, options).unwrap();
            std::io::Write::write_all(&mut writer, bytes).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    fn npy<D: ndarray::Dimension>(array: &ndarray::Array<f64, D>) -> Vec<u8> {
        use ndarray_npy::WriteNpyExt;
        let mut bytes = Vec::new();
        array.write_npy(&mut bytes).unwrap();
        bytes
    }

    fn read_bytes_of(bytes: &[u8]) -> Result<CurveTable, IoError> {
        in_a_file("a.npz", bytes, read)
    }

    #[test]
    fn archives_of_others_are_read_packed_or_not() {
        let points = npy(&Array2::from_shape_fn((4, 3), |(k, axis)| (3 * k + axis) as f64));
        let times = npy(&Array1::from_vec(vec![0.0, 0.5, 1.0, 1.5]));
        let camera = npy(&Array2::<f64>::eye(3));
        for packed in [false, true] {
            let arrays = [
                ("times.npy", times.clone()),
                ("points.npy", points.clone()),
                ("K.npy", camera.clone()),
                ("note.txt", b"no array".to_vec()),
            ];
            let curve = read_bytes_of(&archive(&arrays, packed)).unwrap();
            assert_eq!((curve.points.len(), curve.unit), (4, LengthUnit::Unit));
            assert_eq!(curve.points[3], Point3::new(9.0, 10.0, 11.0));
            let names: Vec<_> = curve.columns.iter().map(|c| c.name.as_str()).collect();
            assert_eq!(names, ["times"]);
        }
    }

    #[test]
    fn what_holds_no_curve_or_unpacks_to_too_much_is_refused() {
        let points = npy(&Array2::from_elem((4, 3), 1.0));
        let refused = |arrays: &[(&str, Vec<u8>)], packed| {
            read_bytes_of(&archive(arrays, packed)).unwrap_err().to_string()
        };
        let none = refused(&[("curve.npy", points.clone())], false);
        assert!(none.contains("no array `points`"), "{none}");
        let flat = refused(&[("points.npy", npy(&Array1::from_elem(12, 1.0)))], true);
        assert!(flat.contains("expected (N, 3)"), "{flat}");
        // A claim of a terabyte of units takes no memory.
        let mut claim = npy(&Array1::from_elem(16, 1.0));
        let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (1000000000000,), }";
        claim[10..10 + header.len()].copy_from_slice(header.as_bytes());
        claim[10 + header.len()..127].fill(b' ');
        for units in [b"no array".to_vec(), claim] {
            let error = refused(&[("points.npy", points.clone()), ("units_json.npy", units)], true);
            assert!(error.contains("NPY"), "{error}");
        }
        // A megabyte that unpacks to more than any file may hold.
        let bomb = archive(&[("points.npy", vec![0; MAX_POINTS_BYTES as usize + 2])], true);
        assert!(bomb.len() < 2_000_000);
        let error = read_bytes_of(&bomb).unwrap_err();
        assert!(matches!(error, IoError::TooLarge { .. }), "{error}");
        let whole = archive(&[("points.npy", points)], false);
        assert!(read_bytes_of(&whole).is_ok());
        assert!(read_bytes_of(&whole[..whole.len() / 2]).is_err());
        assert!(read_bytes_of(b"").is_err());
    }
}
