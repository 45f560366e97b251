use super::*;
use crate::in_a_file::in_a_file;
use std::fs;

fn read_raw(bytes: &[u8]) -> Result<Vec<Point3>, IoError> {
    in_a_file("truth.ply", bytes, read_ply_points)
}

#[test]
fn foreign_elements_lists_and_the_order_of_properties_do_not_matter() {
    let text = "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement camera 1\r\n\
        property list uchar int ids\r\nelement vertex 2\r\nproperty uchar red\r\n\
        property float z\r\nproperty list uchar float w\r\nproperty float x\r\n\
        property float y\r\nend_header\r\n2 7 8\r\n255 3. 1 9 1e0 -.5\r\n0 6 0 4 5";
    let points = read_raw(text.as_bytes()).unwrap();
    assert_eq!(points, [Point3::new(1.0, -0.5, 3.0), Point3::new(4.0, 5.0, 6.0)]);
}

#[test]
fn binary_floats_with_colours_are_read_in_both_byte_orders() {
    for (name, big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        let mut bytes = format!(
            "ply\nformat {name} 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
             property float z\nproperty uchar red\nend_header\n"
        )
        .into_bytes();
        for row in [[1.5_f32, -2.0, 3.0], [4.0, 5.0, 6.25]] {
            for v in row {
                bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
            }
            bytes.push(200);
        }
        let points = read_raw(&bytes).unwrap();
        assert_eq!(points, [Point3::new(1.5, -2.0, 3.0), Point3::new(4.0, 5.0, 6.25)]);
        // One byte short of what the header declares.
        let error = read_raw(&bytes[..bytes.len() - 1]).unwrap_err();
        assert!(matches!(error, IoError::Malformed { .. } | IoError::TooLarge { .. }), "{error}");
    }
}

#[test]
fn a_count_below_the_vertices_of_a_file_is_refused() {
    let head = |format: &str, further: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
             property float z\n{further}end_header\n"
        )
    };
    let binary = |vertices: u8| {
        let mut bytes = head("binary_little_endian", "").into_bytes();
        bytes.extend((0..3 * vertices).flat_map(|v| f32::from(v).to_le_bytes()));
        bytes
    };
    assert_eq!(read_raw(&binary(1)).unwrap().len(), 1);
    let error = read_raw(&binary(2)).unwrap_err().to_string();
    assert!(error.contains("12 bytes behind the 1 vertices"), "{error}");
    let text = head("ascii", "") + "1 2 3\n\n \r\n";
    assert_eq!(read_raw(text.as_bytes()).unwrap().len(), 1, "empty lines at the end");
    let face = "element face 1\nproperty list uchar int vertex_indices\n";
    let text = head("ascii", face) + "1 2 3\n3 0 0 0\n";
    assert_eq!(read_raw(text.as_bytes()).unwrap().len(), 1, "another element follows");
}

#[test]
fn a_unit_that_is_not_known_is_refused_and_prose_is_not_taken_for_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("curve.ply");
    let read_with = |comment: &str| {
        let text = format!(
            "ply\nformat ascii 1.0\ncomment {comment}\nelement vertex 1\nproperty float x\n\
             property float y\nproperty float z\nend_header\n1 2 3\n"
        );
        fs::write(&path, text).unwrap();
        read(&path).map(|curve| curve.unit)
    };
    assert_eq!(read_with("unit cm").unwrap(), LengthUnit::Centimetre);
    assert_eq!(read_with("unit square of a board").unwrap(), LengthUnit::Unit);
    let error = read_with("unit inch").unwrap_err().to_string();
    assert!(error.ends_with("comment unit = `inch`: expected mm, cm, m or unit"), "{error}");
}

#[test]
fn a_count_beyond_the_file_is_refused_before_memory_is_taken() {
    for (format, property) in [
        ("ascii", "property float x"),
        ("binary_little_endian", "property double x"),
        ("binary_little_endian", "property list uchar double x"),
        ("ascii", "comment an element without properties costs no bytes"),
    ] {
        let text = format!(
            "ply\nformat {format} 1.0\nelement vertex 1000000000000\n{property}\nend_header\n1 2 3\n"
        );
        let error = read_raw(text.as_bytes()).unwrap_err();
        assert!(
            matches!(&error, IoError::Malformed { reason, .. } if reason.contains("cut off")),
            "{property}: {error}"
        );
    }
}

#[test]
fn each_defect_names_its_line() {
    let head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nend_header\n";
    let cases = [
        ("1 nan 3\n", "line 8, column 2 is not finite: NaN"),
        ("1 2 x\n", "line 8, column 3: `x` is not a number"),
        ("1 22222\n", "line 8: not valid PLY: too few numbers"),
        ("1 2 3 4\n", "line 8: not valid PLY: more numbers than the 3 that the header declares"),
        ("1 2 3\n4 5 6\n", "6 bytes behind the 1 vertices that the header declares"),
    ];
    for (data, expected) in cases {
        let error = read_raw(format!("{head}{data}").as_bytes()).unwrap_err().to_string();
        assert!(error.ends_with(expected), "{error}");
    }
    for (text, expected) in [
        (head.replace("float y", "list uchar int y") + "1 2 3 4\n", "no scalar property `y`"),
        (head.replace("vertex 1", "vertex 0"), "no points"),
        (head.replace("vertex", "point") + "1 2 3\n", "no element `vertex`"),
        ("plx\n".to_owned(), "not valid PLY"),
    ] {
        let error = read_raw(text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
