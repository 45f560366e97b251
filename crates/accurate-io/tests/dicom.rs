//! DICOM: hostile files are refused before memory is taken; a phantom's geometry is the known one.
#![cfg(feature = "dicom")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stderr)]

use std::path::{Path, PathBuf};

use accurate_io::{FrameChoice, IoError, read_dicom_pixels, read_dicom_view, read_grey};

fn element(tag: (u16, u16), vr: &[u8; 2], value: &[u8]) -> Vec<u8> {
    let mut bytes = [tag.0.to_le_bytes(), tag.1.to_le_bytes()].concat();
    bytes.extend(vr);
    bytes.extend((value.len() as u16 + value.len() as u16 % 2).to_le_bytes());
    bytes.extend(value);
    bytes.resize(bytes.len() + value.len() % 2, b' ');
    bytes
}

/// A file of explicit little endian elements.
fn file(elements: &[u8]) -> Vec<u8> {
    let mut meta = element((2, 2), b"UI", b"1.2.840.10008.5.1.4.1.1.12.1\0");
    meta.extend(element((2, 3), b"UI", b"1.2.3\0"));
    meta.extend(element((2, 0x10), b"UI", b"1.2.840.10008.1.2.1\0"));
    let mut bytes = vec![0; 128];
    bytes.extend(b"DICM");
    bytes.extend(element((2, 0), b"UL", &(meta.len() as u32).to_le_bytes()));
    bytes.extend(meta);
    bytes.extend(elements);
    bytes
}

const PATIENT: &[u8] = b"SENTINEL^PATIENT";

/// Tag, value representation and bytes.
type Element = ((u16, u16), [u8; 2], Vec<u8>);

fn view_elements() -> Vec<Element> {
    let text = |t: &str| t.as_bytes().to_vec();
    vec![
        ((0x10, 0x10), *b"PN", PATIENT.to_vec()),
        ((0x18, 0x1110), *b"DS", text("1000")),
        ((0x18, 0x1111), *b"DS", text("750")),
        ((0x18, 0x1164), *b"DS", text("0.5\\0.25")),
        ((0x18, 0x1510), *b"DS", text("30")),
        ((0x18, 0x1511), *b"DS", text("-20")),
        ((0x28, 0x10), *b"US", 4u16.to_le_bytes().to_vec()),
        ((0x28, 0x11), *b"US", 6u16.to_le_bytes().to_vec()),
    ]
}

fn bytes_of(elements: &[Element]) -> Vec<u8> {
    file(&elements.iter().flat_map(|(tag, vr, value)| element(*tag, vr, value)).collect::<Vec<_>>())
}

fn saved(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("view.dcm");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

#[test]
fn row_and_column_spacing_are_not_confused_and_no_patient_leaves() {
    let (_folder, path) = saved(&bytes_of(&view_elements()));
    let view = read_dicom_view(&path).unwrap();
    // Between rows 0.5 mm, between columns 0.25 mm.
    assert_eq!((view.camera.k()[(0, 0)], view.camera.k()[(1, 1)]), (4000.0, -2000.0));
    assert_eq!(view.camera.size().width, 6);
    assert!(!format!("{view:?}").contains("SENTINEL"));
}

#[test]
fn each_missing_or_senseless_tag_is_named_and_never_quoted() {
    let names = [
        "DistanceSourceToDetector",
        "DistanceSourceToPatient",
        "ImagerPixelSpacing",
        "PositionerPrimaryAngle",
        "PositionerSecondaryAngle",
        "Rows",
        "Columns",
    ];
    for (skip, name) in (1..8).zip(names) {
        let mut elements = view_elements();
        elements.remove(skip);
        let (_folder, path) = saved(&bytes_of(&elements));
        let error = read_dicom_view(&path).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("missing"), "{name}: {error}");
        let mut elements = view_elements();
        if elements[skip].1 == *b"DS" {
            elements[skip].2 = PATIENT.to_vec();
            let (_folder, path) = saved(&bytes_of(&elements));
            let error = read_dicom_view(&path).unwrap_err();
            assert!(!format!("{error:?} {error}").contains("SENTINEL"), "{error}");
        }
    }
}

#[test]
fn a_flip_mirrors_and_a_turn_turns() {
    let with = |extra: Vec<Element>| {
        let mut elements = view_elements();
        elements[3].2 = b"0.5\\0.5".to_vec();
        elements.splice(6..6, extra);
        let (_folder, path) = saved(&bytes_of(&elements));
        read_dicom_view(&path).unwrap().camera
    };
    let point = accurate_geom::Point3::new(0.3, -0.2, 0.1);
    let plain = with(vec![]).project(&point).unwrap();
    let flipped = with(vec![((0x18, 0x7034), *b"CS", b"YES".to_vec())]).project(&point).unwrap();
    assert!((plain.x - 3.0 + (flipped.x - 3.0)).abs() < 1e-9 && plain.y == flipped.y);
    let turned = with(vec![((0x18, 0x7032), *b"DS", b"90".to_vec())]).project(&point).unwrap();
    // A quarter clockwise: what was to the right is below, what was below is to the left.
    assert!((turned.y - 2.0 - (plain.x - 3.0)).abs() < 1e-9);
    assert!((turned.x - 3.0 + (plain.y - 2.0)).abs() < 1e-9);
}

#[test]
fn a_field_of_view_that_is_cut_out_of_the_detector_is_noted() {
    let notes = |origin: Option<&[u8]>| {
        let mut elements = view_elements();
        if let Some(origin) = origin {
            elements.insert(6, ((0x18, 0x7030), *b"DS", origin.to_vec()));
        }
        let (_folder, path) = saved(&bytes_of(&elements));
        read_dicom_view(&path).unwrap().notes.join("\n")
    };
    assert!(notes(Some(b"12\\40")).contains("row 12, column 40 of the detector"));
    for origin in [None, Some(&b"0\\0"[..])] {
        let notes = notes(origin);
        assert!(!notes.contains("FieldOfViewOrigin") && notes.contains("middle of the image"));
    }
}

#[test]
fn hostile_files_are_refused_by_the_scan() {
    // A value of a gigabyte in a file of a few hundred bytes.
    let mut bomb = file(&[]);
    bomb.extend([0x10, 0, 0x10, 0]);
    bomb.extend(b"OB\0\0");
    bomb.extend(0x3fff_fff0u32.to_le_bytes());
    let refused = |bytes: &[u8]| {
        let (_folder, path) = saved(bytes);
        match read_dicom_view(&path) {
            Err(IoError::Malformed { reason, .. }) => reason,
            other => panic!("{other:?}"),
        }
    };
    assert!(refused(&bomb).contains("bytes declared"), "{}", refused(&bomb));
    // The same in the group of the transfer syntax, which parsers read first.
    let mut meta_bomb = file(&[]);
    let at = meta_bomb.len();
    meta_bomb.extend([2, 0, 2, 1]);
    meta_bomb.extend(b"OB\0\0");
    meta_bomb.extend(0x3fff_fff0u32.to_le_bytes());
    meta_bomb.resize(at + 100, 0);
    assert!(refused(&meta_bomb).contains("bytes declared"));
    let mut nested = Vec::new();
    for _ in 0..100_000 {
        nested.extend([0x08, 0, 0x40, 0x11]);
        nested.extend(b"SQ\0\0");
        nested.extend(u32::MAX.to_le_bytes());
        nested.extend([0xfe, 0xff, 0, 0xe0]);
        nested.extend(u32::MAX.to_le_bytes());
    }
    assert!(refused(&file(&nested)).contains("nested deeper than 16"));
}

#[test]
fn every_truncation_is_an_error_or_a_view_never_a_panic() {
    let whole = bytes_of(&view_elements());
    for length in 0..whole.len() {
        let (_folder, path) = saved(&whole[..length]);
        assert!(read_dicom_view(&path).is_err(), "{length}");
    }
    // Every byte set to every of a few values.
    for at in 128..whole.len() {
        for value in [0x00, 0x01, 0x7f, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            let (_folder, path) = saved(&bytes);
            if let Ok(view) = read_dicom_view(&path) {
                assert!(view.camera.projection_matrix().iter().all(|v| v.is_finite()));
            }
        }
    }
}

fn phantom() -> Option<PathBuf> {
    let shared = std::env::var_os("ACCURATE_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let phantom = shared.join("xa-phantom");
    if !phantom.is_dir() {
        eprintln!("skipped: no data in {}", phantom.display());
        return None;
    }
    Some(phantom)
}

#[test]
fn the_phantoms_geometry_is_the_registered_one() {
    let Some(phantom) = phantom() else { return };
    let text = std::fs::read_to_string(phantom.join("derived/geometry.json")).unwrap();
    let known: serde_json::Value = serde_json::from_str(&text).unwrap();
    for name in ["IM1", "IM2", "IM3", "IM4"] {
        let view = read_dicom_view(&phantom.join(format!("dicom/{name}.dcm"))).unwrap();
        let p = view.camera.projection_matrix();
        for row in 0..3 {
            for column in 0..4 {
                let expected = known["views"][name]["P"][row][column].as_f64().unwrap();
                let found = p[(row, column)];
                assert!(
                    (found - expected).abs() < 1e-6,
                    "{name} {row} {column}: {found} {expected}"
                );
            }
        }
        assert!(view.notes.iter().any(|note| note.contains("ImagerPixelSpacing is missing")));
    }
}

#[test]
fn the_phantoms_frames_decode_to_the_known_mean() {
    let Some(phantom) = phantom() else { return };
    for name in ["IM1", "IM3"] {
        let path = phantom.join(format!("dicom/{name}.dcm"));
        let pixels = read_dicom_pixels(&path, FrameChoice::Mean).unwrap();
        let known = read_grey(&phantom.join(format!("frames/{name}_mean.png"))).unwrap();
        let worst = (&pixels.values - &known.values).mapv(f32::abs).into_iter().fold(0.0, f32::max);
        // The known image is rounded (or cut) to whole grey values.
        assert!(worst < 1.0, "{name}: {worst}");
        let frames = pixels.frames;
        let error = read_dicom_pixels(&path, FrameChoice::One(frames)).unwrap_err();
        assert!(error.to_string().contains("counted from 0"), "{error}");
    }
}
