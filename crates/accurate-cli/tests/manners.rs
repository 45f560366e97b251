//! How the command behaves around its work: config files, codes, completions, recorded runs.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn accurate(words: &[&str]) -> Command {
    let mut command = Command::cargo_bin("accurate").unwrap();
    command.args(words);
    command
}

fn stdout(command: &mut Command) -> String {
    String::from_utf8(command.assert().success().get_output().stdout.clone()).unwrap()
}

fn stderr_of_failure(command: &mut Command) -> (i32, String) {
    let assert = command.assert().failure();
    let output = assert.get_output();
    (output.status.code().unwrap(), String::from_utf8(output.stderr.clone()).unwrap())
}

fn bend() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/samples/bend")
}

#[test]
fn figures_are_drawn_the_same_twice_and_only_as_svg_or_png() {
    let dir = TempDir::new().unwrap();
    let draw = |name: &str| {
        let file = dir.path().join(name);
        stdout(accurate(&["figure", "ecdp"]).arg(bend()).arg("-o").arg(&file));
        fs::read(file).unwrap()
    };
    assert_eq!(draw("a.svg"), draw("b.svg"));
    assert_eq!(draw("a.png"), draw("b.png"));
    let (code, message) =
        stderr_of_failure(accurate(&["figure", "ecdp", "-o"]).arg(dir.path().join("a.gif")));
    assert_eq!(code, 2);
    assert!(message.contains("a.gif"), "{message}");
    let (code, message) = stderr_of_failure(&mut accurate(&["figure", "gcct", "-o", "x.svg"]));
    assert_eq!(code, 2);
    assert!(message.contains("gctt"), "{message}");
}

#[test]
fn a_config_file_stands_in_for_options_and_the_command_line_wins() {
    let dir = TempDir::new().unwrap();
    let config = dir.path().join("lab.toml");
    fs::write(&config, "[reconstruct]\ninput = \"points\"\nmethod = \"paper\"\nalso = [\"ply\"]\n")
        .unwrap();
    let run = |out: &str, more: &[&str]| {
        let out = dir.path().join(out);
        let mut command = accurate(&["--json", "--config"]);
        command.arg(&config).arg("reconstruct").arg(bend()).args(more).arg("--out").arg(&out);
        let result: Value = serde_json::from_str(&stdout(&mut command)).unwrap();
        (result, out)
    };
    let (result, out) = run("a", &[]);
    assert_eq!((&result["method"], &result["input"]), (&"paper".into(), &"points".into()));
    assert!(out.join("curve.ply").is_file());
    let (result, _) = run("b", &["--method", "baur"]);
    assert_eq!(result["method"], "baur");

    // The config that a run leaves behind gives the same run again.
    let (saved, again) = (out.join("config.toml"), dir.path().join("c"));
    let mut command = accurate(&["--config"]);
    command.arg(&saved).arg("reconstruct").arg(bend()).arg("--out").arg(&again);
    stdout(&mut command);
    assert_eq!(
        fs::read(out.join("curve.csv")).unwrap(),
        fs::read(again.join("curve.csv")).unwrap()
    );
}

#[test]
fn a_config_file_with_an_unknown_key_is_refused_by_name() {
    let dir = TempDir::new().unwrap();
    let config = dir.path().join("lab.toml");
    fs::write(&config, "[reconstruct]\npicturee = true\n").unwrap();
    let mut command = accurate(&["--config"]);
    let (code, error) = stderr_of_failure(command.arg(&config).arg("demo"));
    assert_eq!(code, 65);
    assert!(error.contains("reconstruct.picturee") && error.contains("`picture`"), "{error}");
    let (code, _) = stderr_of_failure(&mut accurate(&["--config", "/nowhere.toml", "demo"]));
    assert_eq!(code, 66);
}

#[test]
fn every_error_names_a_code_that_can_be_explained() {
    let words = ["reconstruct", "/nowhere", "--input", "mask", "--out", "/tmp/never"];
    let (code, error) = stderr_of_failure(&mut accurate(&words));
    assert_eq!(code, 66);
    let name = error.split(['[', ']']).nth(1).unwrap();
    let text = stdout(&mut accurate(&["explain", name]));
    assert!(text.starts_with(name) && text.contains("exit 66"), "{text}");
    // The same for a program.
    let (_, error) = stderr_of_failure(accurate(&words).arg("--json"));
    let error: Value = serde_json::from_str(&error).unwrap();
    assert_eq!((&error["code"], &error["exit"]), (&name.into(), &66.into()));
    // No escape codes where stderr is no terminal.
    assert!(!error["error"].as_str().unwrap().contains('\x1b'));
}

#[test]
fn a_typing_error_is_told_what_was_meant() {
    let (code, error) = stderr_of_failure(&mut accurate(&["reconstrct"]));
    assert_eq!(code, 2);
    assert!(error.contains("reconstruct") && error.contains("explain A002"), "{error}");
    let words = ["reconstruct", "x", "--input", "mask", "--out", "y", "--method", "hofmann"];
    let (_, error) = stderr_of_failure(&mut accurate(&words));
    assert!(error.contains("did you mean `hoffmann`"), "{error}");
}

#[test]
fn completions_manual_and_schema_cover_every_command() {
    let help = stdout(&mut accurate(&["--help"]));
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter_map(|line| line.strip_prefix("  ").filter(|l| !l.starts_with(' ')))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(commands.len() >= 8, "{help}");
    let manual = stdout(&mut accurate(&["man"]));
    let schema: Value =
        serde_json::from_str(&stdout(&mut accurate(&["config", "schema"]))).unwrap();
    let scripts = ["bash", "zsh", "fish"].map(|s| stdout(&mut accurate(&["completions", s])));
    for name in commands {
        // A hyphen is escaped in roff.
        let page = format!("accurate\\-{}", name.replace('-', "\\-"));
        assert!(manual.contains(&page), "{name} has no manual page");
        assert!(schema["properties"][name].is_object(), "{name} is not in the schema");
        for script in &scripts {
            assert!(script.contains(name), "{name} is not completed");
        }
    }
    // A switch takes a value behind `=` only: none is offered as the next word.
    let strict: Vec<&str> = scripts[2].lines().filter(|line| line.contains("-l strict")).collect();
    assert!(!strict.is_empty() && strict.iter().all(|line| !line.contains("true")), "{strict:?}");
}

/// The manifest of table 1 of one seeded case, written to `out`.
fn recorded_table(out: &Path, image_cases: &str) -> Value {
    let words = ["reproduce", "table1", "--seeds", "1000", "--cases", "1", "--image-cases"];
    stdout(accurate(&words).arg(image_cases).arg("--out").arg(out));
    serde_json::from_str(&fs::read_to_string(out.join("manifest.json")).unwrap()).unwrap()
}

#[test]
fn a_recorded_table_has_every_set_in_every_format() {
    let out = TempDir::new().unwrap();
    let manifest = recorded_table(out.path(), "1");
    for set in ["simulation", "phantom", "simulation-images", "phantom-images"] {
        for format in ["md", "csv", "tex", "html", "json"] {
            assert!(out.path().join(format!("table1-{set}.{format}")).is_file());
        }
    }
    assert_eq!(manifest["files_blake3"].as_object().unwrap().len(), 20);
    assert!(manifest["segmentation"].as_str().unwrap().contains("rten"));
}

#[test]
fn a_recorded_table_is_verified_and_a_changed_one_is_not() {
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("table1");
    // No images: a verification makes the table again, and theirs take longest.
    let manifest = recorded_table(&out, "0");
    assert!(!manifest["files_blake3"].as_object().unwrap().is_empty());
    assert!(stdout(accurate(&["verify"]).arg(&out)).starts_with("verified"));

    let table = out.join("table1-phantom.md");
    let forged = fs::read_to_string(&table).unwrap().replace('1', "2");
    fs::write(&table, forged).unwrap();
    let (code, error) = stderr_of_failure(accurate(&["verify"]).arg(&out));
    assert_eq!(code, 1);
    assert!(error.contains("A004") && error.contains("table1-phantom.md was changed"), "{error}");
}

#[test]
fn a_command_line_that_is_wrong_is_json_with_json() {
    for (words, message, hint) in [
        (&["reconstruct", "x", "--out", "y"][..], "--input <INPUT>", "every option"),
        (&["table", "--case", "3"], "unexpected argument '--case'", "'--cases'"),
        (&["reconstrct"], "reconstrct", "'reconstruct'"),
        (&["demo", "--threads", "9999"], "9999 is not in 0..=1024", "every option"),
    ] {
        let (code, error) = stderr_of_failure(accurate(words).arg("--json"));
        assert_eq!(code, 2, "{words:?}");
        let error: Value = serde_json::from_str(&error).unwrap();
        assert_eq!((&error["code"], &error["exit"]), (&"A002".into(), &2.into()));
        assert!(error["error"].as_str().unwrap().contains(message), "{error}");
        assert!(!error["error"].as_str().unwrap().contains('\n'), "{error}");
        assert!(error["hint"].as_str().unwrap().contains(hint), "{error}");
    }
    // A question is none.
    assert!(stdout(&mut accurate(&["--json", "--version"])).starts_with("accurate "));
}

#[test]
#[cfg(unix)]
fn nobody_has_to_read_stderr() {
    use std::process::{Command, Stdio};
    let dir = TempDir::new().unwrap();
    let run = |words: &[&str]| {
        let (reader, writer) = std::io::pipe().unwrap();
        // As `2>&1 | head -0`: the pipe has no other end.
        drop(reader);
        let mut command = Command::new(env!("CARGO_BIN_EXE_accurate"));
        command.current_dir(dir.path()).args(words).stdin(Stdio::null());
        command.stdout(writer.try_clone().unwrap()).stderr(writer);
        command.status().unwrap().code()
    };
    assert_eq!(run(&["synth", "easy", "-n", "1", "--out", "set"]), Some(0));
    assert_eq!(run(&["explain", "A999"]), Some(2));
    assert_eq!(run(&["reconstruct", "-i", "mask", "-o", "out", "nowhere", "set"]), Some(66));
}

#[test]
fn every_command_below_another_has_a_page_with_a_heading_of_one_line() {
    let manual = stdout(&mut accurate(&["man"]));
    for name in ["accurate-camera-doctor", "accurate-synth-xray", "accurate-model-pack"] {
        assert!(manual.contains(&format!(".TH {name} 1")), "no page of {name}");
    }
    let mut lines = manual.lines().peekable();
    while let Some(line) = lines.next() {
        if line.starts_with(".TH") {
            assert!(line.matches('"').count() % 2 == 0, "{line}");
            assert!(line.contains(concat!(" ", env!("CARGO_PKG_VERSION"), "\"")), "{line}");
            assert_eq!(lines.peek(), Some(&".SH NAME"), "{line}");
        }
    }
    assert!(stdout(&mut accurate(&["eval", "--help"])).contains("mrk.json"));
}
