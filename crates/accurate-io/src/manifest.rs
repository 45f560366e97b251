use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::IoError;
use crate::bounded::{MAX_SMALL_BYTES, read_text};
use crate::rig_file::line_at;

/// What a data set is, where it comes from, and what one may do with it: one TOML file per set in
/// `datasets/`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Name of the set; the file is called `NAME.toml`.
    pub name: String,
    /// What it shows, in a sentence or two.
    pub what: String,
    /// Unit of its 3D coordinates: `mm`, `cm`, `m` or `unit`.
    pub unit: String,
    /// What is known of the true 3D curves.
    pub truth: String,
    /// Who made it and where it is published.
    pub origin: String,
    /// The published state the project was measured on.
    pub commit: Option<String>,
    /// The licence in the words of its owner, and what follows from it.
    pub licence: String,
    /// How to get it.
    pub obtain: String,
    /// Whether the project's repository holds it.
    pub shipped: bool,
    /// How its cases are split; at least one.
    pub split: Vec<Split>,
    /// The program that makes it; only for sets that are generated.
    pub generator: Option<Generator>,
    /// Files a user should have after following `obtain`; may be empty.
    #[serde(default)]
    pub files: Vec<ManifestFile>,
}

/// A named part of a data set.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Split {
    /// `test`, `train`, ...
    pub name: String,
    /// Number of cases (per seed, for a generated set).
    pub cases: u64,
    /// Seeds of a generated set; empty otherwise.
    #[serde(default)]
    pub seeds: Vec<u64>,
    /// Remarks: which cases, what they are used for.
    pub note: Option<String>,
}

/// The program that makes a generated set.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generator {
    /// Family of curves, as `accurate synth FAMILY` knows it.
    pub family: String,
    /// The command for one seed, with `SEED` and `OUT` in place of the seed and the folder.
    pub command: String,
}

/// A file of a data set.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestFile {
    /// Path within the set.
    pub path: String,
    /// `sha256:` and 64 hexadecimal digits, where the file must not differ.
    pub hash: Option<String>,
}

/// Reads one manifest and checks that it says what it must.
///
/// # Errors
/// [`IoError::Malformed`] with the line for broken TOML, a missing or an unknown field;
/// [`IoError::Field`] for an empty text, a name that is not the file's, an unknown unit, a set
/// without cases, a generated set without seeds, a hash of another form or a path outside the set.
pub fn read_manifest(path: &Path) -> Result<Manifest, IoError> {
    let text = read_text(path, MAX_SMALL_BYTES)?;
    let manifest: Manifest = toml::from_str(&text).map_err(|e| {
        let line = e.span().map(|span| line_at(&text, span.start));
        IoError::malformed(path, "manifest", line, e.message())
    })?;
    manifest.check(path)?;
    Ok(manifest)
}

/// Reads every `*.toml` of a folder, sorted by file name.
///
/// # Errors
/// As [`read_manifest`], for the first file that fails.
pub fn read_manifests(folder: &Path) -> Result<Vec<Manifest>, IoError> {
    let system = |e| IoError::system(folder, "list", e);
    let mut paths: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder).map_err(system)? {
        let path = entry.map_err(system)?.path();
        if path.extension().is_some_and(|e| e == "toml") {
            paths.push(path);
        }
    }
    paths.sort();
    paths.iter().map(|p| read_manifest(p)).collect()
}

impl Manifest {
    fn check(&self, path: &Path) -> Result<(), IoError> {
        let refuse = |field: &str, value: &str, reason: &str| {
            Err(IoError::field(path, field, value, reason))
        };
        let texts = [
            ("name", &self.name),
            ("what", &self.what),
            ("truth", &self.truth),
            ("origin", &self.origin),
            ("licence", &self.licence),
            ("obtain", &self.obtain),
        ];
        if let Some((field, text)) = texts.iter().find(|(_, text)| text.trim().is_empty()) {
            return refuse(field, text, "must not be empty");
        }
        if path.file_stem().is_none_or(|stem| stem.to_string_lossy() != self.name) {
            return refuse("name", &self.name, "must be the name of the file");
        }
        if self.unit.parse::<accurate_geom::LengthUnit>().is_err() {
            return refuse("unit", &self.unit, "expected mm, cm, m or unit");
        }
        if self.split.is_empty() {
            return refuse("split", "", "at least one [[split]] is needed");
        }
        for split in &self.split {
            if split.name.trim().is_empty() || split.cases == 0 {
                return refuse("split", &split.name, "needs a name and at least one case");
            }
            if self.generator.is_some() == split.seeds.is_empty() {
                return refuse("seeds", &split.name, "needed for a generated set, and only there");
            }
        }
        if let Some(generator) = &self.generator
            && !(generator.command.contains("SEED") && generator.command.contains("OUT"))
        {
            return refuse("command", &generator.command, "must contain SEED and OUT");
        }
        for file in &self.files {
            let inside = Path::new(&file.path)
                .components()
                .all(|c| matches!(c, std::path::Component::Normal(_)));
            if file.path.is_empty() || !inside {
                return refuse("path", &file.path, "must lie within the set");
            }
            if let Some(hash) = &file.hash {
                let digits = hash.strip_prefix("sha256:").unwrap_or_default();
                if digits.len() != 64 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
                    return refuse("hash", hash, "expected sha256: and 64 hexadecimal digits");
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_a_file::in_a_file;

    const GOOD: &str = r#"name = "helix"
what = "Helices"
unit = "unit"
truth = "exact"
origin = "made by this project"
licence = "MIT OR Apache-2.0"
obtain = "run the command"
shipped = false
split = [{ name = "test", cases = 26, seeds = [1, 2] }]
files = [{ path = "case_000/meta.json", hash = "sha256:0000000000000000000000000000000000000000000000000000000000000000" }]
[generator]
family = "helix"
command = "accurate synth helix --count 26 --seed SEED --out OUT"
"#;

    fn read(text: &str) -> Result<Manifest, IoError> {
        in_a_file("helix.toml", text, read_manifest)
    }

    #[test]
    fn every_required_field_is_missed_by_name() {
        assert_eq!(read(GOOD).unwrap().split[0].seeds, [1, 2]);
        for field in
            ["name", "what", "unit", "truth", "origin", "licence", "obtain", "shipped", "split"]
        {
            let start = format!("{field} = ");
            let text: Vec<&str> = GOOD.lines().filter(|l| !l.starts_with(&start)).collect();
            let error = read(&text.join("\n")).unwrap_err().to_string();
            assert!(error.contains(&format!("missing field `{field}`")), "{error}");
        }
    }

    #[test]
    fn values_without_sense_are_refused() {
        for (from, to, field) in [
            ("\"helix\"\nwhat", "\"coil\"\nwhat", "name = `coil`"),
            ("\"MIT OR Apache-2.0\"", "\" \"", "licence"),
            ("\"unit\"", "\"inch\"", "unit = `inch`"),
            ("[1, 2]", "[]", "seeds"),
            ("cases = 26", "cases = 0", "split"),
            ("--seed SEED", "--seed 1", "command"),
            ("case_000/meta.json", "../secret", "path"),
            ("sha256:00", "md5:00", "hash"),
            ("shipped", "licensed", "unknown field `licensed`"),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let error = read(&GOOD.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(field), "{from} -> {to}: {error}");
        }
    }
}
