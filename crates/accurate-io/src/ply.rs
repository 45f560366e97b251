use std::io::{BufRead, Cursor};
use std::path::Path;

use accurate_geom::{LengthUnit, Point3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_POINTS_BYTES, read_bytes};
use crate::curve::{Column, CurveTable, check_column_count};
use crate::matrix::{finite, parse_number};
use crate::unit::length_unit;

/// How numbers are stored in a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PlyEncoding {
    /// One line of text per point.
    Ascii,
    /// Little-endian bytes: what most tools write.
    BinaryLittleEndian,
    /// Big-endian bytes.
    BinaryBigEndian,
}

/// Reads the points of a PLY file in order: `x`, `y`, `z` of element `vertex`, ASCII or binary of
/// either byte order, float, double or integer. Other elements and properties are skipped.
///
/// # Errors
/// [`IoError::Malformed`], also for a vertex with more numbers than properties and for bytes behind
/// the declared vertices where no other element follows, and if the header declares more elements than
/// the file has bytes for, before memory is taken; [`IoError::NotFinite`]; [`IoError::Empty`];
/// [`IoError::Missing`].
pub fn read_ply_points(path: &Path) -> Result<Vec<Point3>, IoError> {
    let (points, _) = parse(path)?;
    for (i, p) in points.iter().enumerate() {
        for (name, value) in ["x", "y", "z"].iter().zip(p.coords.iter()) {
            finite(path, *value, || format!("{name} of point {i}"))?;
        }
    }
    if points.is_empty() {
        return Err(IoError::Empty { path: path.to_owned(), what: "points" });
    }
    Ok(points)
}

/// Writes points as doubles; reading them gives the same bits.
///
/// # Errors
/// [`IoError::Empty`], [`IoError::NotFinite`], [`IoError::System`].
pub fn write_ply_points(
    path: &Path,
    points: &[Point3],
    encoding: PlyEncoding,
) -> Result<(), IoError> {
    if points.is_empty() {
        return Err(IoError::Empty { path: path.to_owned(), what: "points" });
    }
    for (i, p) in points.iter().enumerate() {
        for (name, value) in ["x", "y", "z"].iter().zip(p.coords.iter()) {
            finite(path, *value, || format!("{name} of point {i}"))?;
        }
    }
    write(path, &CurveTable::from_points(points.to_vec(), LengthUnit::Unit), encoding)
}

/// Points with the further scalar properties of `vertex` as columns. Units are our own comments
/// `unit mm` and `column NAME UNIT`.
pub(crate) fn read(path: &Path) -> Result<CurveTable, IoError> {
    let (points, (mut columns, comments)) = parse(path)?;
    let mut unit = LengthUnit::Unit;
    for comment in comments {
        let mut words = comment.trim().splitn(3, ' ');
        match (words.next(), words.next(), words.next()) {
            (Some("unit"), Some(label), None) => unit = length_unit(path, "comment unit", label)?,
            (Some("column"), Some(name), Some(label)) => {
                if let Some(column) = columns.iter_mut().find(|c| c.name == name) {
                    column.unit = label.trim().to_owned();
                }
            }
            _ => {}
        }
    }
    Ok(CurveTable { unit, points, columns })
}

pub(crate) fn write(path: &Path, curve: &CurveTable, encoding: PlyEncoding) -> Result<(), IoError> {
    let format = match encoding {
        PlyEncoding::Ascii => "ascii",
        PlyEncoding::BinaryLittleEndian => "binary_little_endian",
        PlyEncoding::BinaryBigEndian => "binary_big_endian",
    };
    write_atomically(path, |w| {
        writeln!(w, "ply\nformat {format} 1.0\ncomment unit {}", curve.unit)?;
        for column in curve.columns.iter().filter(|c| !c.unit.is_empty()) {
            writeln!(w, "comment column {} {}", column.name, column.unit)?;
        }
        writeln!(w, "element vertex {}", curve.points.len())?;
        let names = curve.columns.iter().map(|c| c.name.as_str());
        for name in ["x", "y", "z"].into_iter().chain(names) {
            writeln!(w, "property double {name}")?;
        }
        writeln!(w, "end_header")?;
        for (i, p) in curve.points.iter().enumerate() {
            let further = curve.columns.iter().filter_map(|c| c.values.get(i));
            for (k, value) in p.coords.iter().chain(further).enumerate() {
                match encoding {
                    PlyEncoding::Ascii if k == 0 => write!(w, "{value:?}")?,
                    PlyEncoding::Ascii => write!(w, " {value:?}")?,
                    PlyEncoding::BinaryLittleEndian => w.write_all(&value.to_le_bytes())?,
                    PlyEncoding::BinaryBigEndian => w.write_all(&value.to_be_bytes())?,
                }
            }
            if encoding == PlyEncoding::Ascii {
                writeln!(w)?;
            }
        }
        Ok(())
    })
}

type Rest = (Vec<Column>, Vec<String>);

/// Points, columns and comments, not yet checked for NaN.
fn parse(path: &Path) -> Result<(Vec<Point3>, Rest), IoError> {
    let bytes = read_bytes(path, MAX_POINTS_BYTES)?;
    let malformed =
        |line, reason: &dyn ToString| IoError::malformed(path, "PLY", line, reason.to_string());
    let mut reader = Reader::new(Cursor::new(bytes.as_slice()));
    let header = Parser::<Scalars>::new()
        .read_header(&mut reader)
        .map_err(|e| malformed(e.line(), &e.to_string().replace("\n\t", " ")))?;
    let line_of_data = reader.line();
    let remaining = bytes.len() as u64 - reader.get_ref().position().min(bytes.len() as u64);
    check_counts(path, &header, remaining)?;

    let vertex = header
        .elements
        .iter()
        .find(|(name, _)| name.as_str() == "vertex")
        .map(|(_, element)| element)
        .ok_or_else(|| malformed(None, &"no element `vertex`"))?;
    check_column_count(path, vertex.properties.len().saturating_sub(3))?;
    let scalars: Vec<&str> = vertex
        .properties
        .iter()
        .filter(|(_, p)| matches!(p.data_type, PropertyType::Scalar(_)))
        .map(|(name, _)| name.as_str())
        .collect();
    let place = |name: &str| {
        scalars.iter().position(|s| *s == name).ok_or_else(|| {
            malformed(None, &format!("element `vertex` has no scalar property `{name}`"))
        })
    };
    let xyz = [place("x")?, place("y")?, place("z")?];

    let rows = match header.encoding {
        Encoding::Ascii => ascii_rows(path, reader.into_inner(), line_of_data, &header, vertex)?,
        _ => binary_rows(path, reader, &header, vertex)?,
    };
    let mut points = Vec::with_capacity(rows.len());
    let mut columns: Vec<Column> = scalars
        .iter()
        .enumerate()
        .filter(|(i, _)| !xyz.contains(i))
        .map(|(_, name)| Column {
            name: (*name).to_owned(),
            unit: String::new(),
            values: Vec::new(),
        })
        .collect();
    for (i, row) in rows.iter().enumerate() {
        let [Some(&x), Some(&y), Some(&z)] = xyz.map(|k| row.get(k)) else {
            return Err(malformed(None, &format!("vertex {i} lacks a coordinate")));
        };
        points.push(Point3::new(x, y, z));
        let further = row.iter().enumerate().filter(|(k, _)| !xyz.contains(k));
        for (column, (_, value)) in columns.iter_mut().zip(further) {
            column.values.push(*value);
        }
    }
    Ok((points, (columns, header.comments)))
}

/// Compares what the header declares with the bytes behind it.
fn check_counts(path: &Path, header: &Header, remaining: u64) -> Result<(), IoError> {
    let mut left = remaining;
    for (name, element) in &header.elements {
        let least_bytes: u64 = element
            .properties
            .iter()
            .map(|(_, property)| match (header.encoding, &property.data_type) {
                // A digit and a separator; the very last separator may be missing.
                (Encoding::Ascii, _) => 2,
                (_, PropertyType::Scalar(scalar)) => scalar_bytes(scalar),
                (_, PropertyType::List(length, _)) => scalar_bytes(length),
            })
            .sum();
        let count = element.count as u64;
        // An element without properties costs no bytes: nothing would bound its count.
        let fitting = (left + 1).checked_div(least_bytes).unwrap_or(0);
        if count > fitting {
            let name = crate::error::cut(name, 40);
            let reason = format!(
                "the header declares {count} of `{name}`, what follows has bytes for {fitting} at most: \
                 is the file cut off?"
            );
            return Err(IoError::malformed(path, "PLY", None, reason));
        }
        left = left.saturating_sub(count * least_bytes);
    }
    Ok(())
}

fn scalar_bytes(scalar: &ScalarType) -> u64 {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// The scalars of each vertex. Lines are split here, because the parser's grammar refuses `1.` and
/// cannot say which number is NaN.
fn ascii_rows(
    path: &Path,
    mut data: Cursor<&[u8]>,
    mut line: usize,
    header: &Header,
    vertex: &ElementDef,
) -> Result<Vec<Vec<f64>>, IoError> {
    let malformed = |line, reason: &str| IoError::malformed(path, "PLY", Some(line), reason);
    let mut rows = Vec::new();
    let mut text = Vec::new();
    for (_, element) in &header.elements {
        let wanted = element.name == vertex.name;
        for _ in 0..element.count {
            text.clear();
            let read =
                data.read_until(b'\n', &mut text).map_err(|e| IoError::system(path, "read", e))?;
            if read == 0 {
                return Err(malformed(line, &format!("the file ends within `{}`", element.name)));
            }
            if wanted {
                let text = std::str::from_utf8(&text).map_err(|_| malformed(line, "not text"))?;
                rows.push(ascii_row(path, line, text, vertex)?);
            }
            line += 1;
        }
        if wanted {
            break;
        }
    }
    if is_last(vertex, header) {
        check_end(path, rest_of(&data), vertex)?;
    }
    Ok(rows)
}

/// Whether nothing but vertices may stand behind the first of them.
fn is_last(vertex: &ElementDef, header: &Header) -> bool {
    header.elements.values().next_back().is_some_and(|element| element.name == vertex.name)
}

fn rest_of<'b>(data: &Cursor<&'b [u8]>) -> &'b [u8] {
    let position = usize::try_from(data.position()).unwrap_or(usize::MAX);
    data.get_ref().get(position..).unwrap_or_default()
}

/// Refuses what stands behind the last vertex that the header counts: a count that is too low would
/// cut the curve off.
fn check_end(path: &Path, rest: &[u8], vertex: &ElementDef) -> Result<(), IoError> {
    // Empty lines at the end mean nothing.
    if rest.iter().all(u8::is_ascii_whitespace) {
        return Ok(());
    }
    let reason = format!(
        "{} bytes behind the {} vertices that the header declares",
        rest.len(),
        vertex.count
    );
    Err(IoError::malformed(path, "PLY", None, reason))
}

fn ascii_row(
    path: &Path,
    line: usize,
    text: &str,
    vertex: &ElementDef,
) -> Result<Vec<f64>, IoError> {
    let mut fields = text.split_whitespace().enumerate();
    let mut next = || match fields.next() {
        Some((column, field)) => parse_number(path, line, column + 1, field),
        None => Err(IoError::malformed(path, "PLY", Some(line), "too few numbers")),
    };
    let mut row = Vec::with_capacity(vertex.properties.len());
    for (_, property) in &vertex.properties {
        match property.data_type {
            PropertyType::Scalar(_) => row.push(next()?),
            PropertyType::List(..) => {
                let length = next()?;
                if !(0.0..=text.len() as f64).contains(&length) {
                    return Err(IoError::malformed(path, "PLY", Some(line), "list too long"));
                }
                for _ in 0..length as usize {
                    next()?;
                }
            }
        }
    }
    if let Some((column, _)) = fields.next() {
        let reason = format!("more numbers than the {column} that the header declares");
        return Err(IoError::malformed(path, "PLY", Some(line), reason));
    }
    Ok(row)
}

fn binary_rows(
    path: &Path,
    mut reader: Reader<Cursor<&[u8]>>,
    header: &Header,
    vertex: &ElementDef,
) -> Result<Vec<Vec<f64>>, IoError> {
    let parser = Parser::<Scalars>::new();
    let mut rows = Vec::new();
    for (_, element) in &header.elements {
        let read = parser.read_payload_for_element(&mut reader, element, header).map_err(|e| {
            IoError::malformed(path, "PLY", None, e.to_string().replace("\n\t", " "))
        })?;
        if element.name == vertex.name {
            rows = read.into_iter().map(|row| row.0).collect();
            break;
        }
    }
    if is_last(vertex, header) {
        check_end(path, rest_of(&reader.into_inner()), vertex)?;
    }
    Ok(rows)
}

/// The scalar properties of an element in the order of the header; lists are dropped.
struct Scalars(Vec<f64>);

impl PropertyAccess for Scalars {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, _: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0.push(value);
        PropertyAccessResult::Set
    }
}

#[cfg(test)]
mod tests;
