//! Every command that the README and the guide show is run as written, in a folder that holds the
//! shipped samples; a command that is not run here stands in a list with its reason.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

/// Commands by their beginning, and where else they are run.
const RUN_ELSEWHERE: [(&str, &str); 6] = [
    ("cargo test", "the gate runs it"),
    ("cargo doc", "the gate runs it"),
    ("accurate table --check", "the gate runs it"),
    ("accurate table", "130 cases a set; tests/commands.rs runs it on a few"),
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
    dir
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
    for document in ["README.md", "docs/guide.md"] {
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
