//! Nothing that identifies a patient, a person or a place leaves a DICOM file: not on stdout or
//! stderr, not in a file, not when it fails.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

use crate::dicom::{Element, text, view};

/// Identifying attributes, DICOM PS3.15 table E.1-1 (basic application confidentiality profile).
const IDENTIFYING: [((u16, u16), &[u8; 2]); 62] = [
    ((0x08, 0x14), b"UI"),   // Instance Creator UID
    ((0x08, 0x18), b"UI"),   // SOP Instance UID
    ((0x08, 0x20), b"DA"),   // Study Date
    ((0x08, 0x21), b"DA"),   // Series Date
    ((0x08, 0x22), b"DA"),   // Acquisition Date
    ((0x08, 0x23), b"DA"),   // Content Date
    ((0x08, 0x30), b"TM"),   // Study Time
    ((0x08, 0x50), b"SH"),   // Accession Number
    ((0x08, 0x80), b"LO"),   // Institution Name
    ((0x08, 0x81), b"ST"),   // Institution Address
    ((0x08, 0x90), b"PN"),   // Referring Physician's Name
    ((0x08, 0x92), b"ST"),   // Referring Physician's Address
    ((0x08, 0x94), b"SH"),   // Referring Physician's Telephone Numbers
    ((0x08, 0x1010), b"SH"), // Station Name
    ((0x08, 0x1030), b"LO"), // Study Description
    ((0x08, 0x103e), b"LO"), // Series Description
    ((0x08, 0x1040), b"LO"), // Institutional Department Name
    ((0x08, 0x1048), b"PN"), // Physician(s) of Record
    ((0x08, 0x1050), b"PN"), // Performing Physician's Name
    ((0x08, 0x1060), b"PN"), // Name of Physician(s) Reading Study
    ((0x08, 0x1070), b"PN"), // Operators' Name
    ((0x08, 0x1080), b"LO"), // Admitting Diagnoses Description
    ((0x08, 0x2111), b"ST"), // Derivation Description
    ((0x10, 0x10), b"PN"),   // Patient's Name
    ((0x10, 0x20), b"LO"),   // Patient ID
    ((0x10, 0x21), b"LO"),   // Issuer of Patient ID
    ((0x10, 0x30), b"DA"),   // Patient's Birth Date
    ((0x10, 0x32), b"TM"),   // Patient's Birth Time
    ((0x10, 0x1000), b"LO"), // Other Patient IDs
    ((0x10, 0x1001), b"PN"), // Other Patient Names
    ((0x10, 0x1005), b"PN"), // Patient's Birth Name
    ((0x10, 0x1040), b"LO"), // Patient's Address
    ((0x10, 0x1060), b"PN"), // Patient's Mother's Birth Name
    ((0x10, 0x1080), b"LO"), // Military Rank
    ((0x10, 0x1081), b"LO"), // Branch of Service
    ((0x10, 0x1090), b"LO"), // Medical Record Locator
    ((0x10, 0x2000), b"LO"), // Medical Alerts
    ((0x10, 0x2110), b"LO"), // Allergies
    ((0x10, 0x2150), b"LO"), // Country of Residence
    ((0x10, 0x2152), b"LO"), // Region of Residence
    ((0x10, 0x2154), b"SH"), // Patient's Telephone Numbers
    ((0x10, 0x2160), b"SH"), // Ethnic Group
    ((0x10, 0x2180), b"SH"), // Occupation
    ((0x10, 0x21b0), b"LT"), // Additional Patient History
    ((0x10, 0x21f0), b"LO"), // Patient's Religious Preference
    ((0x10, 0x4000), b"LT"), // Patient Comments
    ((0x18, 0x1000), b"LO"), // Device Serial Number
    ((0x18, 0x1030), b"LO"), // Protocol Name
    ((0x20, 0x0d), b"UI"),   // Study Instance UID
    ((0x20, 0x0e), b"UI"),   // Series Instance UID
    ((0x20, 0x10), b"SH"),   // Study ID
    ((0x20, 0x4000), b"LT"), // Image Comments
    ((0x32, 0x1032), b"PN"), // Requesting Physician
    ((0x32, 0x1060), b"LO"), // Requested Procedure Description
    ((0x38, 0x10), b"LO"),   // Admission ID
    ((0x38, 0x300), b"LO"),  // Current Patient Location
    ((0x38, 0x400), b"LO"),  // Patient's Institution Residence
    ((0x40, 0x06), b"PN"),   // Scheduled Performing Physician's Name
    ((0x40, 0x242), b"SH"),  // Performed Station Name
    ((0x40, 0x253), b"SH"),  // Performed Procedure Step ID
    ((0x40, 0x1001), b"SH"), // Requested Procedure ID
    ((0x40, 0xa123), b"PN"), // Person Name
];

/// A value that stands nowhere else: no output may hold it.
fn sentinel(tag: (u16, u16), vr: &[u8; 2]) -> String {
    let number = u32::from(tag.0) * 65_536 + u32::from(tag.1);
    match vr {
        b"DA" => format!("18{:02}0{}{:02}", tag.1 % 90 + 10, tag.1 % 9 + 1, tag.1 % 17 + 11),
        b"TM" => format!("2359{:02}.{:06}", tag.1 % 50 + 10, number % 999_999),
        b"UI" => format!("2.25.770077.{number}"),
        _ => format!("SENTINEL_{number}"),
    }
}

fn identifying() -> Vec<Element> {
    IDENTIFYING.iter().map(|(tag, vr)| text(*tag, vr, &sentinel(*tag, vr))).collect()
}

fn files_below(dir: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(files_below(&path)) } else { files.push(path) }
    }
    files
}

/// A mask of a bow, and the image that shows it dark.
fn bow(side: usize, bend: f64) -> (Vec<u8>, ndarray::Array2<bool>) {
    let mask = ndarray::Array2::from_shape_fn((side, side), |(y, x)| {
        let (x, y) = (x as f64 / side as f64 - 0.5, y as f64 / side as f64 - 0.5);
        y.abs() < 0.35 && (x - bend * (0.12 - y * y)).abs() < 0.013
    });
    (mask.iter().map(|body| if *body { 40 } else { 200 }).collect(), mask)
}

#[test]
fn no_identifying_tag_reaches_any_output() {
    const { assert!(IDENTIFYING.len() >= 30) };
    let inputs = TempDir::new().unwrap();
    let outputs = TempDir::new().unwrap();
    let side = 128;
    let mut paths = Vec::new();
    for (name, angle, bend) in [("a", -35.0, 0.5), ("b", 40.0, -0.3)] {
        let (pixels, mask) = bow(side, bend);
        let path = inputs.path().join(format!("{name}.dcm"));
        let twice: Vec<u8> = pixels.iter().chain(&pixels).copied().collect();
        fs::write(&path, view([angle, 0.0], side as u16, &twice, &identifying())).unwrap();
        accurate3d::io::write_mask(&inputs.path().join(format!("{name}.png")), &mask).unwrap();
        paths.push(path);
    }
    // The sentinels are in the file: the test would find them if they came out.
    let raw = fs::read(&paths[0]).unwrap();
    for (tag, vr) in IDENTIFYING {
        let value = sentinel(tag, vr);
        assert!(raw.windows(value.len()).any(|w| w == value.as_bytes()), "{value}");
    }
    // The same with a number that is none, and cut off: errors must not quote either.
    let broken = inputs.path().join("broken.dcm");
    let mut elements = identifying();
    elements.push(text((0x18, 0x7032), b"DS", "SENTINEL^NAME"));
    fs::write(&broken, view([0.0, 0.0], 4, &[0; 16], &elements)).unwrap();
    let cut = inputs.path().join("cut.dcm");
    fs::write(&cut, &raw[..raw.len() / 2]).unwrap();
    let out = |name: &str| outputs.path().join(name).display().to_string();
    let [a, b] = ["a", "b"].map(|n| inputs.path().join(n).display().to_string());
    let (a_dcm, b_dcm) = (format!("{a}.dcm"), format!("{b}.dcm"));
    let (a_png, b_png) = (format!("{a}.png"), format!("{b}.png"));
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/wire.accmodel");
    let model = model.display().to_string();
    let (broken, cut) = (broken.display().to_string(), cut.display().to_string());
    let dicom_cameras = ["--cameras", &a_dcm, "--cameras", &b_dcm];
    let mut runs: Vec<Vec<&str>> = vec![
        vec!["camera", "show", &a_dcm, &b_dcm],
        vec!["camera", "show", "--json", "-v", &a_dcm],
        vec!["camera", "show", &broken],
        vec!["camera", "show", &cut],
        vec!["reconstruct", &broken, &cut, "-i", "image", "-o", "never"],
        vec!["camera", "doctor", &a_dcm, &b_dcm, "--masks", &a_png, &b_png],
    ];
    let kinds = ["opencv-yaml", "opencv-xml", "colmap", "rig-toml", "p-txt", "views-json"];
    let written: Vec<String> =
        kinds.iter().map(|kind| out(if *kind == "rig-toml" { "rig.toml" } else { kind })).collect();
    for (kind, path) in kinds.iter().zip(&written) {
        runs.push(vec!["camera", "convert", &a_dcm, &b_dcm, "--to", kind, "-o", path]);
    }
    let (masks, report, images) = (out("masks"), out("report.html"), out("images"));
    let mut reconstruct = vec!["reconstruct", &a_png, &b_png, "-i", "mask", "-o", &masks];
    reconstruct.extend(dicom_cameras);
    reconstruct.extend(["--report", &report, "--also", "ply,vtp,mrk-json,npy,npz,parquet,picture"]);
    runs.push(reconstruct);
    runs.push(vec![
        "reconstruct",
        &a_dcm,
        &b_dcm,
        "-i",
        "image",
        "--model",
        &model,
        "-o",
        &images,
        "--also",
        "report",
    ]);
    let (curve, heat) = (format!("{masks}/curve.csv"), out("plan.svg"));
    runs.push(vec!["plan-views", "--shape", &curve, "--first", &a_dcm, "-o", &heat]);
    let mut said = Vec::new();
    for run in &runs {
        let output = Command::cargo_bin("accurate")
            .unwrap()
            .current_dir(outputs.path())
            .env_remove("ORT_DYLIB_PATH")
            .args(run)
            .output()
            .unwrap();
        said.push((format!("{run:?}, stdout"), output.stdout));
        said.push((format!("{run:?}, stderr"), output.stderr));
    }
    // What has to be there is there, so that something was looked through.
    for file in [&report, &curve, &heat, &written[0], &written[3]] {
        assert!(Path::new(file).is_file(), "{file}: {}", String::from_utf8_lossy(&said[13].1));
    }
    let files = files_below(outputs.path());
    said.extend(files.iter().map(|f| (f.display().to_string(), fs::read(f).unwrap())));
    for (place, bytes) in &said {
        let has = |word: &str| bytes.windows(word.len()).any(|w| w == word.as_bytes());
        assert!(!has("SENTINEL"), "{place}");
        for (tag, vr) in IDENTIFYING {
            assert!(!has(&sentinel(tag, vr)), "{place}: {tag:x?}");
        }
    }
}
