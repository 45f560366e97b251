use std::path::Path;

use accurate_geom::{LengthUnit, Point3};
use ndarray::{Array2, Array4, ArrayD};
use ndarray_npy::npy::header::Header;
use ndarray_npy::{ReadNpyExt, WriteNpyExt};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_POINTS_BYTES, read_bytes};
use crate::curve::CurveTable;

/// Largest accepted header, bytes; NumPy itself writes 118 for such an array.
const MAX_HEADER_BYTES: usize = 4096;
/// Deepest accepted bracket in the header; `{'shape': (N, 3)}` has two. The header is a Python
/// literal, and its parser recurses.
const MAX_NESTING: usize = 4;

pub(crate) fn read(path: &Path) -> Result<CurveTable, IoError> {
    parse_points(path, &read_bytes(path, MAX_POINTS_BYTES)?)
}

/// The points of an array's bytes, without columns and unit.
pub(crate) fn parse_points(path: &Path, bytes: &[u8]) -> Result<CurveTable, IoError> {
    let values = parse(path, bytes)?;
    let &[rows, 3] = values.shape() else {
        let reason = format!("shape {:?}; expected (N, 3)", values.shape());
        return Err(IoError::malformed(path, "NPY", None, reason));
    };
    if rows == 0 {
        return Err(IoError::Empty { path: path.to_owned(), what: "points" });
    }
    let row = |k: usize| Point3::new(values[[k, 0]], values[[k, 1]], values[[k, 2]]);
    Ok(CurveTable::from_points((0..rows).map(row).collect(), LengthUnit::Unit))
}

/// An array's bytes as doubles, of any shape.
pub(crate) fn parse(path: &Path, bytes: &[u8]) -> Result<ArrayD<f64>, IoError> {
    let malformed = |reason: String| IoError::malformed(path, "NPY", None, reason);
    let (header, data_length) = header(path, bytes)?;
    let descriptor = header.type_descriptor.to_string();
    let item_bytes = match descriptor.trim_matches('\'') {
        "<f8" | ">f8" => 8,
        "<f4" | ">f4" => 4,
        _ => {
            return Err(IoError::Unsupported {
                path: path.to_owned(),
                what: format!(
                    "element type {}; expected f8 or f4",
                    crate::error::cut(&descriptor, 40)
                ),
            });
        }
    };
    // The shape is a claim of the file: compare it with the bytes before memory is taken for it.
    let claimed = header.shape.iter().try_fold(item_bytes, |size: usize, n| size.checked_mul(*n));
    if claimed != Some(data_length) {
        return Err(malformed(format!("shape {:?} but {data_length} bytes of data", header.shape)));
    }
    if item_bytes == 8 {
        ArrayD::<f64>::read_npy(bytes)
    } else {
        ArrayD::<f32>::read_npy(bytes).map(|a| a.mapv(f64::from))
    }
    .map_err(|e| malformed(e.to_string()))
}

/// The bytes of an array of bytes.
pub(crate) fn parse_bytes<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a [u8], IoError> {
    let malformed = |reason: String| IoError::malformed(path, "NPY", None, reason);
    let (header, data_length) = header(path, bytes)?;
    let descriptor = header.type_descriptor.to_string();
    if descriptor.trim_matches('\'') != "|u1" || header.shape != [data_length] {
        return Err(malformed(format!(
            "{} of shape {:?} in {data_length} bytes; expected one row of bytes",
            crate::error::cut(&descriptor, 40),
            header.shape
        )));
    }
    Ok(&bytes[bytes.len() - data_length..])
}

pub(crate) fn write(path: &Path, curve: &CurveTable) -> Result<(), IoError> {
    let values = curve.points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    let failed = |e: String| IoError::system(path, "encode", std::io::Error::other(e));
    let array = Array2::from_shape_vec((curve.points.len(), 3), values)
        .map_err(|e| failed(e.to_string()))?;
    let mut bytes = Vec::new();
    array.write_npy(&mut bytes).map_err(|e| failed(e.to_string()))?;
    write_atomically(path, |w| w.write_all(&bytes))
}

/// Writes bytes of shape (images, channels, height, width) as NPY `|u1`, C order.
///
/// # Errors
/// [`IoError::System`].
pub fn write_npy_u8(path: &Path, array: &Array4<u8>) -> Result<(), IoError> {
    write_atomically(path, |w| array.write_npy(w).map_err(std::io::Error::other))
}

/// An array's header, and the number of bytes behind it.
pub(crate) fn header(path: &Path, bytes: &[u8]) -> Result<(Header, usize), IoError> {
    let malformed = |reason: String| IoError::malformed(path, "NPY", None, reason);
    let data_length = check_header(bytes).map_err(malformed)?;
    let header = Header::from_reader(&mut &*bytes).map_err(|e| malformed(e.to_string()))?;
    Ok((header, data_length))
}

/// Refuses a header the parser should not see, and returns the number of bytes behind it.
fn check_header(bytes: &[u8]) -> Result<usize, String> {
    let short = || "the file ends within the header".to_owned();
    let major = *bytes.get(6).ok_or_else(short)?;
    let (length, start) = if major == 1 {
        let field: [u8; 2] = bytes.get(8..10).and_then(|b| b.try_into().ok()).ok_or_else(short)?;
        (u32::from(u16::from_le_bytes(field)), 10)
    } else {
        let field: [u8; 4] = bytes.get(8..12).and_then(|b| b.try_into().ok()).ok_or_else(short)?;
        (u32::from_le_bytes(field), 12)
    };
    let length = length as usize;
    if length > MAX_HEADER_BYTES {
        return Err(format!("the header declares {length} bytes; at most {MAX_HEADER_BYTES}"));
    }
    let header = bytes.get(start..start + length).ok_or_else(short)?;
    let mut depth = 0_usize;
    for byte in header {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > MAX_NESTING {
            return Err(format!("brackets in the header nest deeper than {MAX_NESTING}"));
        }
    }
    Ok(bytes.len() - start - length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_a_file::in_a_file;
    use std::fs;

    fn read_raw(header: &str, data: &[u8]) -> Result<CurveTable, IoError> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16 + 1).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.push(b'\n');
        bytes.extend(data);
        in_a_file("curve.npy", bytes, read)
    }

    #[test]
    fn fortran_order_and_single_precision_are_read() {
        let data: Vec<u8> =
            [1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let header = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }";
        let curve = read_raw(header, &data).unwrap();
        assert_eq!(curve.points, [Point3::new(1.0, 3.0, 5.0), Point3::new(2.0, 4.0, 6.0)]);
    }

    #[test]
    fn a_shape_beyond_the_file_is_refused_before_memory_is_taken() {
        for shape in ["(1000000000000, 3)", "(18446744073709551615, 3)", "(1, 3)", "(3, 1)", "()"] {
            let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}");
            let error = read_raw(&header, &[0; 48]).unwrap_err();
            assert!(matches!(error, IoError::Malformed { .. }), "{shape}: {error}");
        }
    }

    #[test]
    fn a_nest_of_brackets_does_not_reach_the_recursive_parser() {
        let error = read_raw(&"(".repeat(4000), &[]).unwrap_err();
        assert!(error.to_string().contains("nest deeper"), "{error}");
        let error = read_raw(&"(".repeat(60_000), &[]).unwrap_err();
        assert!(error.to_string().contains("at most 4096"), "{error}");
    }

    #[test]
    fn bytes_are_written_as_numpy_reads_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("images.npy");
        let array =
            Array4::from_shape_fn((2, 3, 4, 5), |(n, c, y, x)| (60 * n + 20 * c + 5 * y + x) as u8);
        write_npy_u8(&path, &array).unwrap();
        let bytes = fs::read(&path).unwrap();
        let header = String::from_utf8_lossy(&bytes[..bytes.len() - 120]).into_owned();
        assert!(header.contains("'|u1'") && header.contains("(2, 3, 4, 5)"), "{header}");
        assert!(header.contains("'fortran_order': False"), "{header}");
        assert!(bytes[bytes.len() - 120..].iter().copied().eq(0..120));
    }

    #[test]
    fn integers_are_refused_by_name() {
        let header = "{'descr': '<i8', 'fortran_order': False, 'shape': (1, 3)}";
        let error = read_raw(header, &[0; 24]).unwrap_err();
        assert!(error.to_string().contains("'<i8'"), "{error}");
    }
}
