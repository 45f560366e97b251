use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Repetition, Type as PhysicalType};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::IoError;
use crate::atomic::write_atomically;
use crate::curve::CurveTable;

/// Writes one required double column each for `x`, `y`, `z` and every column; the units stand in
/// the file's key-value metadata as `unit` (of the points) and `unit:<column>`.
pub(crate) fn write(path: &Path, curve: &CurveTable) -> Result<(), IoError> {
    let bytes = encode(curve)
        .map_err(|e| IoError::system(path, "encode", std::io::Error::other(e.to_string())))?;
    write_atomically(path, |w| w.write_all(&bytes))
}

fn encode(curve: &CurveTable) -> Result<Vec<u8>, ParquetError> {
    let coordinate = |axis: usize| curve.points.iter().map(|p| p.coords[axis]).collect();
    let mut columns: Vec<(&str, Vec<f64>)> =
        ["x", "y", "z"].into_iter().enumerate().map(|(k, name)| (name, coordinate(k))).collect();
    columns.extend(curve.columns.iter().map(|c| (c.name.as_str(), c.values.clone())));
    let fields = columns
        .iter()
        .map(|(name, _)| {
            Type::primitive_type_builder(name, PhysicalType::DOUBLE)
                .with_repetition(Repetition::REQUIRED)
                .build()
                .map(Arc::new)
        })
        .collect::<Result<_, _>>()?;
    let schema = Arc::new(Type::group_type_builder("curve").with_fields(fields).build()?);
    let mut units = vec![KeyValue::new("unit".to_owned(), curve.unit.label().to_owned())];
    units.extend(
        curve.columns.iter().map(|c| KeyValue::new(format!("unit:{}", c.name), c.unit.clone())),
    );
    let properties = Arc::new(
        WriterProperties::builder()
            .set_created_by(concat!("accurate-io ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_key_value_metadata(Some(units))
            .build(),
    );
    let mut file = SerializedFileWriter::new(Vec::new(), schema, properties)?;
    let mut group = file.next_row_group()?;
    for (_, values) in &columns {
        if let Some(mut column) = group.next_column()? {
            column.typed::<DoubleType>().write_batch(values, None, None)?;
            column.close()?;
        }
    }
    group.close()?;
    file.into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Column;
    use accurate_geom::{LengthUnit, Point3};
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    #[test]
    fn every_number_and_unit_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.parquet");
        let points: Vec<Point3> =
            (0..5000).map(|i| Point3::new(f64::from(i) / 3.0, -f64::from(i), 5e-324)).collect();
        let sigma: Vec<f64> = (0..5000).map(|i| 1.0 / f64::from(i + 1)).collect();
        let mut curve = CurveTable::from_points(points, LengthUnit::Metre);
        curve.columns.push(Column { name: "sigma".into(), unit: "m".into(), values: sigma });
        write(&path, &curve).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        let meta = reader.metadata().file_metadata();
        let units: Vec<_> = meta
            .key_value_metadata()
            .unwrap()
            .iter()
            .map(|kv| (kv.key.as_str(), kv.value.as_deref().unwrap()))
            .collect();
        assert_eq!(units, [("unit", "m"), ("unit:sigma", "m")]);
        let mut rows = 0;
        for (i, row) in reader.get_row_iter(None).unwrap().enumerate() {
            let row = row.unwrap();
            let p = curve.points[i];
            let expected = [p.x, p.y, p.z, curve.columns[0].values[i]];
            for (k, value) in expected.into_iter().enumerate() {
                assert_eq!(row.get_double(k).unwrap().to_bits(), value.to_bits(), "row {i}");
            }
            rows += 1;
        }
        assert_eq!(rows, 5000);
    }
}
