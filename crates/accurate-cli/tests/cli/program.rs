//! Running the command, and pairs to run it on.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

pub fn accurate() -> Command {
    Command::cargo_bin("accurate").unwrap()
}

pub fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/samples")
}

/// A copy of a sample pair that a test may spoil.
pub fn copy_of(name: &str, dir: &Path) -> PathBuf {
    let target = dir.join(name);
    for part in ["masks", "calibration", "annotations", "points"] {
        fs::create_dir_all(target.join(part)).unwrap();
        for entry in fs::read_dir(samples().join(name).join(part)).unwrap() {
            let entry = entry.unwrap();
            fs::copy(entry.path(), target.join(part).join(entry.file_name())).unwrap();
        }
    }
    fs::copy(samples().join(name).join("meta.json"), target.join("meta.json")).unwrap();
    target
}

pub fn stdout(command: &mut Command) -> String {
    String::from_utf8(command.assert().success().get_output().stdout.clone()).unwrap()
}

/// Runs a command that must fail; gives its exit code and stderr.
pub fn failure(command: &mut Command) -> (i32, String) {
    let assert = command.assert().failure();
    let output = assert.get_output();
    (output.status.code().unwrap(), String::from_utf8(output.stderr.clone()).unwrap())
}
