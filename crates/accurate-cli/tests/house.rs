//! The house rules that a compiler does not hold: who may import whom, and which crates may touch
//! the outside world.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// For each crate of ours, the crates of ours it may depend on.
const MAY_IMPORT: &[(&str, &[&str])] = &[
    ("accurate-geom", &[]),
    ("accurate-seg", &["accurate-geom"]),
    ("accurate-traverse", &["accurate-geom"]),
    ("accurate-match", &["accurate-geom"]),
    ("accurate-fit", &["accurate-geom"]),
    ("accurate-baselines", &["accurate-geom", "accurate-match"]),
    ("accurate-eval", &["accurate-geom"]),
    ("accurate-synth", &["accurate-geom"]),
    ("accurate-io", &["accurate-geom"]),
    (
        "accurate3d",
        &[
            "accurate-geom",
            "accurate-seg",
            "accurate-traverse",
            "accurate-match",
            "accurate-fit",
            "accurate-baselines",
            "accurate-eval",
            "accurate-synth",
            "accurate-io",
        ],
    ),
    ("accurate-cli", &["accurate3d"]),
];

/// Third-party crates that `accurate-geom` may take: the vocabulary stays light.
const GEOM_TAKES: &[&str] = &["nalgebra", "pulp", "thiserror", "serde"];

/// Crates that open no file, print nothing and read no clock.
const PURE: &[&str] = &[
    "accurate-geom",
    "accurate-seg",
    "accurate-traverse",
    "accurate-match",
    "accurate-fit",
    "accurate-baselines",
    "accurate-eval",
    "accurate-synth",
];

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn dependencies(manifest: &Path) -> BTreeSet<String> {
    let text = fs::read_to_string(manifest).unwrap();
    let table: toml::Table = text.parse().unwrap();
    let names = |key: &str| {
        table.get(key).and_then(|d| d.as_table()).map(|d| d.keys().cloned().collect::<Vec<_>>())
    };
    ["dependencies", "build-dependencies"].iter().filter_map(|key| names(key)).flatten().collect()
}

fn crates() -> BTreeMap<String, PathBuf> {
    fs::read_dir(workspace().join("crates"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.join("Cargo.toml").is_file())
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), path))
        .collect()
}

#[test]
fn no_crate_imports_upwards_or_sideways() {
    let allowed: BTreeMap<_, _> = MAY_IMPORT.iter().copied().collect();
    let ours = crates();
    assert!(!ours.is_empty());
    for (name, path) in &ours {
        let may = allowed
            .get(name.as_str())
            .unwrap_or_else(|| panic!("{name} has no row in MAY_IMPORT: say whom it may import"));
        for dependency in dependencies(&path.join("Cargo.toml")) {
            assert!(
                !ours.contains_key(&dependency) || may.contains(&dependency.as_str()),
                "{name} must not import {dependency}"
            );
        }
    }
}

#[test]
fn the_vocabulary_stays_light() {
    for dependency in dependencies(&workspace().join("crates/accurate-geom/Cargo.toml")) {
        assert!(GEOM_TAKES.contains(&dependency.as_str()), "accurate-geom takes {dependency}");
    }
}

/// Everything that `accurate-geom`, `-traverse` and `-match` build with, whatever the features, has
/// to be free of engines. Manifests of ours list what they take outside of tests, `Cargo.lock` what
/// any feature of others could bring, so that this holds for every build.
#[test]
fn the_geometry_builds_without_engines() {
    let lock: toml::Table =
        fs::read_to_string(workspace().join("Cargo.lock")).unwrap().parse().unwrap();
    let packages = lock["package"].as_array().unwrap();
    let ours = crates();
    let needs = |name: &str| -> Vec<String> {
        if let Some(path) = ours.get(name) {
            return dependencies(&path.join("Cargo.toml")).into_iter().collect();
        }
        packages
            .iter()
            .filter(|package| package["name"].as_str() == Some(name))
            .filter_map(|package| package.get("dependencies")?.as_array())
            .flatten()
            // A name alone, or followed by version and source where there are several.
            .filter_map(|needed| Some(needed.as_str()?.split(' ').next()?.to_owned()))
            .collect()
    };
    let closure = |name: &str| {
        let mut known = BTreeSet::from([name.to_owned()]);
        let mut open = vec![name.to_owned()];
        while let Some(next) = open.pop() {
            open.extend(needs(&next).into_iter().filter(|needed| known.insert(needed.clone())));
        }
        known
    };
    const ENGINES: [&str; 5] = ["rten", "rten-tensor", "ort", "ort-sys", "prost"];
    for name in ["accurate-geom", "accurate-traverse", "accurate-match"] {
        let built = closure(name);
        assert!(built.contains("nalgebra"), "{name} is not in Cargo.lock as this test reads it");
        for engine in ENGINES {
            assert!(!built.contains(engine), "{name} builds with {engine}");
        }
    }
    let all = closure("accurate-cli");
    assert!(ENGINES.iter().all(|engine| all.contains(*engine)), "an engine has another name now");
}

#[test]
fn engines_stay_behind_the_features_of_one_crate() {
    const ENGINES: [&str; 4] = ["rten", "rten-tensor", "ort", "prost"];
    for (name, path) in crates() {
        let text = fs::read_to_string(path.join("Cargo.toml")).unwrap();
        let table: toml::Table = text.parse().unwrap();
        let Some(dependencies) = table["dependencies"].as_table() else { continue };
        for engine in ENGINES {
            let optional = dependencies.get(engine).map(|d| {
                d.as_table().and_then(|d| d.get("optional")).and_then(toml::Value::as_bool)
            });
            match optional {
                None => {}
                Some(optional) => {
                    assert_eq!((name.as_str(), optional), ("accurate-seg", Some(true)), "{engine}")
                }
            }
        }
        let default = table.get("features").and_then(|f| f.get("default"));
        assert!(name != "accurate-seg" || default.is_none(), "accurate-seg is light by default");
    }
}

#[test]
fn folder_and_crate_names_agree() {
    for (name, path) in crates() {
        let text = fs::read_to_string(path.join("Cargo.toml")).unwrap();
        assert!(text.contains(&format!("name = \"{name}\"")), "{name}");
    }
}

#[test]
fn pure_crates_open_no_file_and_read_no_clock() {
    let forbidden =
        ["std::fs", "std::net", "std::env", "std::process", "Instant::", "SystemTime", "println!"];
    let ours = crates();
    for name in PURE {
        let Some(path) = ours.get(*name) else { panic!("no crate {name}") };
        for file in rust_files(&path.join("src")) {
            let text = fs::read_to_string(&file).unwrap();
            // Documentation may speak of them; code may not.
            let code: String = text
                .lines()
                .filter(|l| !l.trim_start().starts_with("//"))
                .collect::<Vec<_>>()
                .join("\n");
            for word in forbidden {
                assert!(!code.contains(word), "{} uses {word}", file.display());
            }
        }
    }
}

#[test]
fn no_source_file_is_a_drawer_for_everything() {
    for (_, path) in crates() {
        for file in rust_files(&path.join("src")) {
            let stem = file.file_stem().unwrap().to_str().unwrap();
            assert!(
                !["utils", "util", "common", "helpers", "misc"].contains(&stem),
                "{}: name the idea",
                file.display()
            );
        }
    }
}

#[test]
fn every_law_that_the_paper_map_names_is_a_test() {
    let map = fs::read_to_string(workspace().join("docs/paper-map.md")).unwrap();
    let sources: String = crates()
        .values()
        .flat_map(|path| rust_files(path))
        .map(|file| fs::read_to_string(file).unwrap())
        .collect();
    let mut laws = 0;
    // Laws stand in the third column of every table, each between back quotes.
    for line in map.lines().filter(|l| l.starts_with("| ")) {
        let column = line.split(" | ").nth(2).unwrap_or("");
        for name in column.split('`').skip(1).step_by(2).filter(|n| n.contains('_')) {
            assert!(sources.contains(&format!("fn {name}")), "no test called {name}");
            laws += 1;
        }
    }
    assert!(laws > 30, "the table was not read: {laws} laws");
}

#[test]
fn every_link_of_the_documents_leads_somewhere() {
    let root = workspace();
    let mut documents = vec![root.join("README.md"), root.join("ARCHITECTURE.md")];
    documents.extend(markdown_files(&root.join("docs")));
    let mut links = 0;
    for document in documents {
        let text = fs::read_to_string(&document).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = target.split('#').next().unwrap();
            if file.is_empty() || file.contains("://") {
                continue;
            }
            let path = document.parent().unwrap().join(file);
            assert!(path.exists(), "{}: {target}", document.display());
            links += 1;
        }
    }
    assert!(links > 10, "no links were read: {links}");
}

fn markdown_files(dir: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(markdown_files(&path));
        } else if path.extension().is_some_and(|e| e == "md") {
            files.push(path);
        }
    }
    files
}

fn rust_files(dir: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    files
}

/// A version `a.b` or `a.b.c`, to be compared.
fn version(text: &str) -> Vec<u32> {
    text.split('.').map(|part| part.parse().unwrap()).collect()
}

#[test]
fn the_stated_rust_is_new_enough_for_every_library() {
    let manifest: toml::Table =
        fs::read_to_string(workspace().join("Cargo.toml")).unwrap().parse().unwrap();
    let stated = manifest["workspace"]["package"]["rust-version"].as_str().unwrap();
    let readme = fs::read_to_string(workspace().join("README.md")).unwrap();
    assert!(readme.contains(&format!("Rust toolchain ({stated} or newer)")), "README: {stated}");

    // For this machine only: what other systems need was not downloaded to build here.
    let compiler = Command::new("rustc").arg("-vV").output().unwrap();
    let compiler = String::from_utf8(compiler.stdout).unwrap();
    let host = compiler.lines().find_map(|line| line.strip_prefix("host: ")).unwrap();
    let metadata = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--filter-platform", host])
        .current_dir(workspace())
        .output()
        .unwrap();
    assert!(metadata.status.success(), "{}", String::from_utf8_lossy(&metadata.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&metadata.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let newer: Vec<_> = packages
        .iter()
        .filter_map(|package| Some((package, package["rust_version"].as_str()?)))
        .filter(|(_, needed)| version(needed) > [version(stated), vec![0]].concat())
        .map(|(package, needed)| format!("{} needs Rust {needed}", package["name"]))
        .collect();
    assert!(packages.len() > 100, "{} packages", packages.len());
    assert!(newer.is_empty(), "the workspace states {stated}: {newer:?}");
}
