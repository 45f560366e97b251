use std::fmt::Write as _;
use std::path::Path;

use accurate_geom::{LengthUnit, Point3};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::curve::{Column, CurveTable, check_column_count};
use crate::matrix::parse_number;
use crate::points::CsvTable;
use crate::unit::length_unit;

/// The column whose unit is the unit of the points.
const ARC_LENGTH: &str = "arc_length";

pub(crate) fn read(path: &Path) -> Result<CurveTable, IoError> {
    let table = CsvTable::read(path)?;
    check_column_count(path, table.header.len().saturating_sub(3))?;
    let xyz = [table.column("x")?, table.column("y")?, table.column("z")?];
    let mut columns: Vec<(usize, Column)> = Vec::new();
    for (index, title) in table.header.iter().enumerate().filter(|(i, _)| !xyz.contains(i)) {
        let (name, unit) = match title.strip_suffix(']').and_then(|t| t.split_once('[')) {
            Some((name, unit)) => (name, unit),
            None => (title.as_str(), ""),
        };
        columns.push((index, Column { name: name.into(), unit: unit.into(), values: Vec::new() }));
    }
    let mut points = Vec::new();
    table.for_each_row(|line, row| {
        let number = |c: usize| parse_number(path, line, c + 1, row.get(c).unwrap_or_default());
        points.push(Point3::new(number(xyz[0])?, number(xyz[1])?, number(xyz[2])?));
        for (index, column) in &mut columns {
            column.values.push(number(*index)?);
        }
        Ok(())
    })?;
    let columns: Vec<Column> = columns.into_iter().map(|(_, column)| column).collect();
    let unit = match columns.iter().find(|c| c.name == ARC_LENGTH) {
        Some(column) if !column.unit.is_empty() => length_unit(path, ARC_LENGTH, &column.unit)?,
        _ => LengthUnit::Unit,
    };
    Ok(CurveTable { unit, points, columns })
}

pub(crate) fn write(path: &Path, curve: &CurveTable) -> Result<(), IoError> {
    let failed = |e: csv::Error| IoError::system(path, "encode", std::io::Error::other(e));
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut row: Vec<String> = ["x", "y", "z"].map(str::to_owned).to_vec();
    row.extend(curve.columns.iter().map(|c| {
        if c.unit.is_empty() { c.name.clone() } else { format!("{}[{}]", c.name, c.unit) }
    }));
    writer.write_record(&row).map_err(failed)?;
    let mut text = String::new();
    for (i, p) in curve.points.iter().enumerate() {
        for value in p.iter().chain(curve.columns.iter().filter_map(|c| c.values.get(i))) {
            text.clear();
            // `{:?}` is the shortest text that reads back to the same bits.
            write!(text, "{value:?}")
                .map_err(|e| IoError::system(path, "encode", std::io::Error::other(e)))?;
            writer.write_field(&text).map_err(failed)?;
        }
        // The end of the row.
        writer.write_record(None::<&[u8]>).map_err(failed)?;
    }
    let bytes = writer
        .into_inner()
        .map_err(|e| IoError::system(path, "encode", std::io::Error::other(e.to_string())))?;
    write_atomically(path, |w| w.write_all(&bytes))
}
