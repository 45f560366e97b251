//! Generated pairs and X-ray images.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use tempfile::TempDir;

use crate::program::{accurate, failure, stdout};

#[test]
fn synth_writes_pairs_that_reconstruct() {
    let dir = TempDir::new().unwrap();
    let set = dir.path().join("set");
    accurate()
        .args(["synth", "easy", "--count", "3", "--seed", "1500", "--xray", "--out"])
        .arg(&set)
        .assert()
        .success();
    assert!(set.join("case_002/images/view_R.png").is_file());
    let text = stdout(
        accurate()
            .args(["reconstruct", "--input", "points", "--out"])
            .arg(dir.path().join("out"))
            .arg(&set),
    );
    assert_eq!(text.lines().count(), 3);
}

/// A shorter run of another family or seed would leave the longer one's last cases among its own.
#[test]
fn cases_of_another_set_are_not_left_beside_new_ones() {
    let dir = TempDir::new().unwrap();
    let synth = |seed: &str, first: &str, count: &str| {
        let mut command = accurate();
        command.args(["synth", "easy", "-q", "--seed", seed, "--first", first, "--count", count]);
        command.arg("--out").arg(dir.path());
        command
    };
    stdout(&mut synth("1500", "0", "2"));
    stdout(&mut synth("1500", "2", "1"));
    let meta = |case: &str| fs::read(dir.path().join(case).join("meta.json")).unwrap();
    let before = meta("case_000");
    let (code, said) = failure(&mut synth("1501", "0", "1"));
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("cases of another set (2, the first case_001)"), "{said}");
    assert_eq!(meta("case_000"), before);
    // All of them are written again, and what others have put there stays.
    fs::create_dir(dir.path().join("case_007")).unwrap();
    stdout(&mut synth("1501", "0", "3"));
    assert_ne!(meta("case_000"), before);
    assert!(dir.path().join("case_007").is_dir());
}

/// `accurate synth xray` on small images.
fn xray(shards: &Path, count: &str, threads: &str) -> Command {
    let mut command = accurate();
    command.args(["synth", "xray", "--seed", "1500", "--size", "64", "--per-shard", "4", "-q"]);
    command.args(["--count", count, "--threads", threads, "--shards"]).arg(shards);
    command
}

#[test]
fn shards_are_the_same_for_any_number_of_threads_and_resume_where_they_stopped() {
    let dir = TempDir::new().unwrap();
    let (one, two) = (dir.path().join("one"), dir.path().join("two"));
    stdout(&mut xray(&one, "10", "1"));
    stdout(&mut xray(&two, "4", "2"));
    let first = fs::metadata(two.join("shard-000000.npy")).unwrap().modified().unwrap();
    // A shard without its entry in the list is of a run that was killed: it is drawn again.
    fs::write(two.join("shard-000001.npy"), b"half").unwrap();
    stdout(&mut xray(&two, "10", "2"));
    let kept = fs::metadata(two.join("shard-000000.npy")).unwrap().modified().unwrap();
    assert_eq!(first, kept, "a shard that was there was written again");
    let names = ["shard-000000.npy", "shard-000001.npy", "shard-000002.npy", "shards.json"];
    for name in names {
        assert_eq!(fs::read(one.join(name)).unwrap(), fs::read(two.join(name)).unwrap(), "{name}");
    }
    assert_eq!(fs::read_dir(&two).unwrap().count(), names.len());
    let last = fs::read(one.join("shard-000002.npy")).unwrap();
    assert!(String::from_utf8_lossy(&last[..128]).contains("(2, 3, 64, 64)"));
    assert!(last[last.len() - 64 * 64..].iter().all(|label| *label <= 1));
}

#[test]
fn a_folder_of_another_set_and_a_size_that_cannot_be_are_refused() {
    let dir = TempDir::new().unwrap();
    stdout(&mut xray(dir.path(), "4", "1"));
    let (code, said) = failure(xray(dir.path(), "4", "1").args(["--first", "3"]));
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("another set") && said.contains("first 0"), "{said}");
    // The other generators' images are other sets too.
    for generator in ["held-out", "phantom"] {
        let (code, said) = failure(xray(dir.path(), "4", "1").args(["--generator", generator]));
        assert!(code == 2 && said.contains("another set"), "{said}");
    }
    let other = dir.path().join("other");
    let mut command = accurate();
    command.args(["synth", "xray", "--size", "8", "--shards"]).arg(&other);
    let (code, said) = failure(&mut command);
    assert!(code == 2 && said.contains("side_px is 8"), "{said}");
    assert!(!other.exists());
    assert_eq!(failure(accurate().args(["synth", "xray"])).0, 2);
}

#[test]
fn wires_are_drawn_onto_given_images_and_small_ones_are_refused() {
    let dir = TempDir::new().unwrap();
    // The sheet of one image is a picture of 512 x 256 px: a background like any other.
    let sheet = dir.path().join("sheet.png");
    stdout(accurate().args(["synth", "xray", "-q", "--count", "1", "--sheet"]).arg(&sheet));
    let onto = dir.path().join("onto");
    stdout(xray(&onto, "2", "1").arg("--onto").arg(&sheet));
    assert!(onto.join("shard-000000.npy").is_file());
    let list = fs::read_to_string(onto.join("shards.json")).unwrap();
    assert!(list.contains("xray-onto "), "{list}");
    let mut command = accurate();
    command.args(["synth", "xray", "--size", "300", "--shards"]).arg(dir.path().join("no"));
    let (code, said) = failure(command.arg("--onto").arg(&sheet));
    assert_eq!(code, 65, "{said}");
    assert!(said.contains("512 x 256 px"), "{said}");
}
