//! What a folder of results holds: the files of one run, whole, and the config that repeats it.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{accurate, copy_of, failure, samples, stdout};

fn names(folder: &Path) -> BTreeSet<String> {
    fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

fn expected(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

#[test]
fn a_saved_config_repeats_a_run_with_several_outputs() {
    let dir = TempDir::new().unwrap();
    let mut command = accurate();
    command.current_dir(dir.path()).args(["reconstruct", "-i", "points", "-m", "paper"]);
    command.args(["-o", "a", "-o", "b.vtp", "-o", "c,d.csv", "--also", "ply,npy"]);
    stdout(command.arg(samples().join("bend")));
    let files = ["a/curve.csv", "a/curve.ply", "a/curve.npy", "a/result.json", "a/config.toml"];
    let read =
        || files.iter().chain(&["b.vtp", "c,d.csv"]).map(|f| fs::read(dir.path().join(f)).unwrap());
    let first: Vec<Vec<u8>> = read().collect();
    fs::rename(dir.path().join("a/config.toml"), dir.path().join("saved.toml")).unwrap();
    for gone in ["a/curve.csv", "a/curve.ply", "a/curve.npy", "a/result.json", "b.vtp", "c,d.csv"] {
        fs::remove_file(dir.path().join(gone)).unwrap();
    }
    let mut again = accurate();
    again.current_dir(dir.path()).args(["--config", "saved.toml", "reconstruct"]);
    stdout(again.arg(samples().join("bend")));
    assert_eq!(first, read().collect::<Vec<_>>());
    assert_eq!(names(dir.path()), expected(&["a", "b.vtp", "c,d.csv", "saved.toml"]));
}

#[test]
fn a_folder_of_results_is_of_one_run() {
    let dir = TempDir::new().unwrap();
    let out = dir.path().join("out");
    let run = |pair: &str, more: &[&str]| {
        let mut command = accurate();
        command.args(["reconstruct", "-i", "points", "-m", "paper", "-o"]).arg(&out).args(more);
        command.arg(samples().join(pair));
        command
    };
    stdout(&mut run("bend", &["--also", "ply,mrk-json,report", "--picture"]));
    fs::write(out.join("notes.txt"), "the user's").unwrap();
    // A run that fails leaves what was there, config and all.
    let before = ["config.toml", "result.json"].map(|f| fs::read(out.join(f)).unwrap());
    let (code, message) = failure(&mut run("no-such-pair", &[]));
    assert_eq!(code, 66, "{message}");
    assert_eq!(before, ["config.toml", "result.json"].map(|f| fs::read(out.join(f)).unwrap()));
    // One that does not, leaves nothing of it.
    stdout(&mut run("wire", &["--also", "npy"]));
    let left = ["config.toml", "curve.csv", "curve.npy", "notes.txt", "result.json"];
    assert_eq!(names(&out), expected(&left));
    // One that cannot write a file of its own leaves the folder as it was.
    if cfg!(target_os = "linux") {
        let before = fs::read(out.join("result.json")).unwrap();
        let (code, message) = failure(&mut run("bend", &["-o", "/proc/none/w.csv"]));
        assert!(code == 74 && message.contains("/proc/none"), "{code} {message}");
        assert_eq!(names(&out), expected(&left));
        assert_eq!(fs::read(out.join("result.json")).unwrap(), before);
    }
}

#[test]
fn a_file_of_the_users_own_is_no_earlier_result() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("curve.ply"), "the user's").unwrap();
    let mut command = accurate();
    command.args(["reconstruct", "-i", "points", "-m", "paper", "-o"]).arg(dir.path());
    stdout(command.arg(samples().join("bend")));
    assert_eq!(fs::read_to_string(dir.path().join("curve.ply")).unwrap(), "the user's");
}

#[test]
fn every_case_of_a_batch_has_its_own_config() {
    let dir = TempDir::new().unwrap();
    let bad = copy_of("bend", dir.path());
    fs::remove_file(bad.join("points/points_L.csv")).unwrap();
    let out = dir.path().join("out");
    let mut command = accurate();
    command.args(["reconstruct", "-i", "points", "-m", "paper", "-o"]).arg(&out);
    failure(command.arg(&bad).arg(samples().join("wire")));
    assert_eq!(names(&out), expected(&["wire"]));
    let left = ["config.toml", "curve.csv", "result.json"];
    assert_eq!(names(&out.join("wire")), expected(&left));
}

#[test]
fn a_report_leaves_out_what_cannot_be_read_and_says_so() {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    fs::remove_file(pair.join("masks/mask_R.png")).unwrap();
    let (out, report) = (dir.path().join("out"), dir.path().join("report.html"));
    let mut command = accurate();
    command.args(["reconstruct", "-i", "points", "--report"]).arg(&report).arg("-o").arg(&out);
    let done = command.arg(&pair).assert().success();
    let said = String::from_utf8_lossy(&done.get_output().stderr).into_owned();
    assert!(said.contains("the report shows less") && said.contains("mask_R.png"), "{said}");
    assert!(report.is_file() && out.join("curve.csv").is_file());
}

#[test]
fn a_folder_that_is_no_pair_does_not_stop_the_others() {
    let dir = TempDir::new().unwrap();
    let (empty, out) = (dir.path().join("empty"), dir.path().join("out"));
    fs::create_dir(&empty).unwrap();
    let mut command = accurate();
    command.args(["reconstruct", "-i", "points"]).arg(samples().join("bend")).arg(&empty);
    let (code, message) = failure(command.arg(dir.path().join("nowhere")).arg("-o").arg(&out));
    assert!(code != 0 && message.contains("2 of 3 pairs failed"), "{code} {message}");
    assert!(message.contains("empty") && message.contains("nowhere"), "{message}");
    assert!(out.join("bend/curve.csv").is_file());
}

#[test]
fn what_is_read_is_not_replaced() {
    let dir = TempDir::new().unwrap();
    let pair = samples().join("bend");
    let rig = dir.path().join("rig.json");
    let mut convert = accurate();
    convert.args(["camera", "convert", "--to", "rig-json", "-o"]).arg(&rig).arg(&pair);
    stdout(&mut convert);
    let before = fs::read(&rig).unwrap();
    let mut command = accurate();
    command.args(["reconstruct", "-i", "points", "-m", "paper", "--cameras"]).arg(&rig);
    command.args(["L", "R"].map(|v| pair.join(format!("points/points_{v}.csv"))));
    let (code, message) = failure(command.arg("-o").arg(&rig));
    assert!(code == 2 && message.contains("rig.json is read"), "{code} {message}");
    assert_eq!(before, fs::read(&rig).unwrap());
}

#[test]
fn a_place_that_cannot_be_is_refused_before_the_work() {
    let dir = TempDir::new().unwrap();
    fs::write(dir.path().join("file"), "").unwrap();
    fs::create_dir(dir.path().join("folder.png")).unwrap();
    let bend = samples().join("bend").display().to_string();
    let mask = samples().join("bend/masks/mask_L.png").display().to_string();
    // The work of each would fail in another way: there is no such input.
    for words in [
        "table --cases 9999999 -o file/t.md",
        "trace nowhere.png -o file/t.csv",
        "figure overview nowhere -o file/t.svg",
        "figure overview nowhere -o folder.png",
        "plan-views --shape nowhere.csv --first nowhere.dcm -o file/t.csv",
        "camera convert nowhere --to rig-toml -o file/t.toml",
        "camera convert nowhere --to colmap -o file",
        "camera doctor nowhere -o file/t.toml",
        "synth xray --onto nowhere.png --sheet file/t.png",
        "synth easy -n 100000 -o file/set",
        "reproduce table1 --cases 9999999 -o file/t",
        "model pack nowhere.onnx --manifest nowhere.json -o file/m.accmodel",
        "reconstruct BEND -i mask -o file/t.csv",
        "reconstruct BEND -i mask -o file",
    ] {
        let mut command = accurate();
        command.current_dir(dir.path());
        command.args(words.split(' ').map(|word| if word == "BEND" { &bend } else { word }));
        let (code, message) = failure(&mut command);
        assert!(code == 74 && message.contains("A050"), "{words}: {code} {message}");
    }
    let mut trace = accurate();
    trace.current_dir(dir.path()).args(["trace", &mask, "-o", "new/folder/t.csv"]);
    stdout(&mut trace);
    assert!(dir.path().join("new/folder/t.csv").is_file());
}

#[test]
fn an_extension_that_says_nothing_is_no_folder() {
    let dir = TempDir::new().unwrap();
    let run = |out: &str| {
        let mut command = accurate();
        command.current_dir(dir.path()).args(["reconstruct", "-i", "points", "-m", "paper", "-o"]);
        command.arg(out).arg(samples().join("bend"));
        command
    };
    for out in ["wire.stl", "wire.vtpp"] {
        let (code, message) = failure(&mut run(out));
        assert!(code == 2 && message.contains(".mrk.json"), "{code} {message}");
    }
    assert!(names(dir.path()).is_empty());
    for out in ["run_0.5/", "run_0.5", "plain"] {
        stdout(&mut run(out));
    }
    assert_eq!(names(dir.path()), expected(&["plain", "run_0.5"]));
    for (words, expected) in [
        (&["synth", "xray", "-n", "1", "--sheet", "s.jpg"][..], "s.jpg"),
        (&["camera", "doctor", "nowhere.toml", "-o", "rig.yml"], "rig.yml"),
    ] {
        let (code, message) = failure(accurate().current_dir(dir.path()).args(words));
        assert!(code == 2 && message.contains(expected), "{code} {message}");
    }
}

#[test]
fn a_generated_case_is_of_one_run() {
    let dir = TempDir::new().unwrap();
    let set = dir.path().join("set");
    let synth = |seed: &str, more: &[&str]| {
        let mut command = accurate();
        command.args(["synth", "easy", "-n", "1", "--seed", seed]).args(more);
        command.arg("--out").arg(&set);
        command
    };
    let case = set.join("case_000");
    stdout(&mut synth("1500", &["--xray"]));
    assert!(case.join("images/view_L.png").is_file());
    stdout(&mut synth("1501", &[]));
    assert!(!case.join("images").exists(), "images of another curve");
    let meta: Value =
        serde_json::from_str(&fs::read_to_string(case.join("meta.json")).unwrap()).unwrap();
    assert!(meta["source"].as_str().unwrap().contains("seed 1501"), "{meta}");
    // A run that was stopped begins anew; a folder of something else is left alone.
    fs::remove_file(case.join("meta.json")).unwrap();
    let mask = fs::read(case.join("masks/mask_L.png")).unwrap();
    fs::write(case.join("masks/mask_L.png"), "someone's own").unwrap();
    let (code, message) = failure(&mut synth("1501", &["--xray"]));
    assert!(code == 2 && message.contains("case_000"), "{code} {message}");
    assert_eq!(fs::read(case.join("masks/mask_L.png")).unwrap(), b"someone's own");
    fs::write(case.join(".accurate-synth-unfinished"), "").unwrap();
    stdout(&mut synth("1501", &[]));
    assert_eq!(fs::read(case.join("masks/mask_L.png")).unwrap(), mask);
    assert!(!case.join(".accurate-synth-unfinished").exists());
    let foreign = meta.to_string().replace("accurate synth", "the clinic's");
    fs::write(case.join("meta.json"), &foreign).unwrap();
    let (code, message) = failure(&mut synth("1501", &[]));
    assert!(code == 2 && message.contains("case_000"), "{code} {message}");
    assert_eq!(fs::read_to_string(case.join("meta.json")).unwrap(), foreign);
}
