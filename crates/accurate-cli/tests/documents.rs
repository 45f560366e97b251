//! Every command that the README and the guide show is run as written, in a folder that holds the
//! shipped samples; a command that is not run here stands in a list with its reason.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "cli/dicom.rs"]
mod dicom;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

/// Commands by their beginning, and where else they are run.
const RUN_ELSEWHERE: [(&str, &str); 7] = [
    ("cargo test", "the gate runs it"),
    ("cargo doc", "the gate runs it"),
    (
        "accurate reconstruct a.dcm b.dcm",
        "needs runs that show something; tests/cli/two_views.rs makes them",
    ),
    ("accurate table --check", "the gate runs it"),
    ("accurate table", "130 cases a set; tests/cli/commands.rs runs it on a few"),
    ("accurate reproduce", "130 cases a set; tests/manners.rs runs it on a few"),
    ("accurate verify", "130 cases a set; tests/manners.rs runs it on a few"),
];

/// Names that the documents use for the reader's own data, and the sample that stands in for them.
const STAND_INS: [(&str, &str); 2] = [("case_017", "bend"), ("a_mask.png", "")];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The commands behind `$` in the console blocks of a document, comments cut off.
fn commands_of(document: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(document)).unwrap();
    let mut inside = false;
    let mut commands = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside && line.trim() == "```console";
        } else if let Some(command) = line.strip_prefix("$ ").filter(|_| inside) {
            let command = command.split("  #").next().unwrap().trim();
            let command = command.replace("cargo run --release --", "accurate");
            commands.push(command);
        }
    }
    commands
}

/// A work folder with what the documents expect to find.
fn work_folder() -> TempDir {
    let dir = TempDir::new().unwrap();
    let samples = root().join("datasets/samples");
    for (name, sample) in STAND_INS.iter().filter(|(_, sample)| !sample.is_empty()) {
        copy(&samples.join(sample), &dir.path().join(name));
    }
    copy(&samples, &dir.path().join("datasets/samples"));
    copy(&samples.join("bend/masks/mask_L.png"), &dir.path().join("a_mask.png"));
    copy(&samples.join("bend/masks/mask_R.png"), &dir.path().join("b_mask.png"));
    copy(&samples.join("bend/points/points_L.csv"), &dir.path().join("a.csv"));
    copy(&samples.join("bend/points/points_R.csv"), &dir.path().join("b.csv"));
    camera_files(dir.path());
    dir
}

/// Cameras of every tool that docs/cameras.md speaks of.
fn camera_files(dir: &Path) {
    let convert = |format: &str, out: &str| {
        let mut command = Command::cargo_bin("accurate").unwrap();
        command.current_dir(dir).args(["camera", "convert", "case_017", "--to", format]);
        command.args(["-o", out]).assert().success();
    };
    fs::create_dir(dir.join("sparse")).unwrap();
    for (format, out) in [("rig-toml", "rig.toml"), ("colmap", "sparse/0"), ("p-txt", "p.txt")] {
        convert(format, out);
    }
    for (name, angle) in [("a.dcm", -30.0), ("b.dcm", 45.0)] {
        fs::write(dir.join(name), dicom::view([angle, 5.0], 512, &[0; 512 * 512], &[])).unwrap();
    }
    let fixtures = root().join("crates/accurate-io/tests/fixtures/opencv");
    for name in ["intrinsics.yml", "extrinsics.yml"] {
        copy(&fixtures.join(name), &dir.join(name));
    }
    let camera = r#"{"IntrinsicMatrix": [[800,0,0],[0,810,0],[321,241,1]],
        "RadialDistortion": [0.1,0.2], "TangentialDistortion": [0,0], "ImageSize": [480,640],
        "WorldUnits": "mm"}"#;
    let stereo = format!(
        r#"{{"CameraParameters1": {camera}, "CameraParameters2": {camera},
            "RotationOfCamera2": [[0,1,0],[-1,0,0],[0,0,1]], "TranslationOfCamera2": [5,6,7]}}"#
    );
    fs::write(dir.join("stereo.json"), stereo).unwrap();
    // The two objects that the page shows.
    let page = fs::read_to_string(root().join("docs/cameras.md")).unwrap();
    let block = page.split("```json\n").nth(1).unwrap().split("```").next().unwrap();
    let second = block.find("{\"intrinsic\"").unwrap();
    fs::write(dir.join("diffdrr.json"), &block[..second]).unwrap();
    fs::write(dir.join("deepdrr.json"), &block[second..]).unwrap();
    // Twenty beads, seen by the cameras of rig.toml.
    let rig = accurate3d::io::read_rig(&dir.join("rig.toml")).unwrap();
    let mut beads = [String::from("x,y\n"), String::from("x,y\n")];
    for i in 0..20 {
        let turn = |k: f64| 100.0 * (k * f64::from(i)).sin();
        let bead = accurate3d::geom::Point3::new(turn(1.0), turn(2.3), turn(3.1));
        for (rows, camera) in beads.iter_mut().zip([rig.camera1(), rig.camera2()]) {
            let p = camera.project(&bead).unwrap();
            rows.push_str(&format!("{},{}\n", p.x, p.y));
        }
    }
    for (number, rows) in (1..).zip(beads) {
        fs::write(dir.join(format!("beads_{number}.csv")), rows).unwrap();
    }
    let mut rough = String::from("x,y,z,arc_length[mm]\n");
    for i in 0..40 {
        let s = f64::from(i) / 39.0;
        let x = 20.0 * (4.0 * s).sin();
        rough.push_str(&format!("{x},{},{},{s}\n", 15.0 * s, 60.0 * s - 30.0));
    }
    fs::write(dir.join("rough.csv"), rough).unwrap();
}

fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            copy(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        fs::copy(from, to).unwrap();
    }
}

#[test]
fn every_command_shown_to_a_reader_works() {
    let dir = work_folder();
    let mut unused: BTreeSet<&str> = RUN_ELSEWHERE.iter().map(|(start, _)| *start).collect();
    let mut ran = 0;
    for document in ["README.md", "docs/guide.md", "docs/cameras.md"] {
        for command in commands_of(document) {
            let elsewhere = RUN_ELSEWHERE.iter().find(|(start, _)| command.starts_with(start));
            if let Some((start, _)) = elsewhere {
                unused.remove(start);
                continue;
            }
            let Some(words) = command.strip_prefix("accurate ") else {
                panic!("{document}: `{command}` is neither run here nor named as run elsewhere");
            };
            // A pipe or a redirection is the shell's business.
            let words = words.split(['|', '>']).next().unwrap();
            let samples = ["bend", "loop", "wire"].map(|s| format!("datasets/samples/{s}"));
            let words: Vec<String> = words
                .split_whitespace()
                .flat_map(|word| match word {
                    "datasets/samples/*" => samples.to_vec(),
                    word => vec![word.to_owned()],
                })
                .collect();
            let mut process = Command::cargo_bin("accurate").unwrap();
            let output = process.current_dir(dir.path()).args(&words).output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{document}: `{command}` failed:\n{said}");
            ran += 1;
        }
    }
    assert!(ran >= 5, "only {ran} commands were found in the documents");
    unused.remove("cargo doc");
    assert!(unused.is_empty(), "in no document any more: {unused:?}");
}
