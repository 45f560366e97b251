//! Input that cannot be used is refused: exit code, words, and no output.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{accurate, copy_of, failure, samples};

/// Spoils a pair and expects an exit code, words in the message, and no output.
fn refuses(input: &str, spoil: impl FnOnce(&Path), code: i32, words: &[&str]) {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    spoil(&pair);
    let out = dir.path().join("out");
    let (found, message) = failure(
        accurate()
            .args(["reconstruct", "--input", input, "--method", "paper", "--out"])
            .arg(&out)
            .arg(&pair),
    );
    assert_eq!(found, code, "{message}");
    for word in words {
        assert!(message.contains(word), "no `{word}` in: {message}");
    }
    let left: Vec<_> =
        fs::read_dir(&out).map(|d| d.map(|e| e.unwrap().path()).collect()).unwrap_or_default();
    assert!(left.is_empty(), "left behind: {left:?}");
}

fn write(path: PathBuf, text: &str) {
    fs::write(path, text).unwrap();
}

#[test]
fn a_missing_file_is_named() {
    refuses(
        "mask",
        |p| fs::remove_file(p.join("masks/mask_R.png")).unwrap(),
        66,
        &["mask_R.png", "hint"],
    );
    refuses(
        "points",
        |p| fs::remove_file(p.join("points/points_L.csv")).unwrap(),
        66,
        &["points_L.csv"],
    );
    refuses(
        "mask",
        |p| fs::remove_file(p.join("calibration/RT_L.txt")).unwrap(),
        66,
        &["RT_L.txt"],
    );
}

#[test]
fn a_matrix_of_the_wrong_shape_is_named() {
    refuses("mask", |p| write(p.join("calibration/K_L.txt"), "1 0\n0 1\n"), 65, &["K_L.txt", "3"]);
}

#[test]
fn nan_is_refused_with_its_place() {
    refuses(
        "mask",
        |p| write(p.join("calibration/RT_R.txt"), "1 0 0 0\n0 NaN 0 0\n0 0 1 5\n"),
        65,
        &["RT_R.txt", "not finite"],
    );
    refuses(
        "points",
        |p| write(p.join("points/points_R.csv"), "x,y\n1,2\n3,inf\n"),
        65,
        &["points_R.csv"],
    );
}

#[test]
fn a_zero_baseline_is_refused() {
    refuses(
        "mask",
        |p| {
            for file in ["K", "RT"] {
                let from = p.join(format!("calibration/{file}_L.txt"));
                fs::copy(from, p.join(format!("calibration/{file}_R.txt"))).unwrap();
            }
        },
        65,
        &["zero baseline"],
    );
}

#[test]
fn a_matrix_that_is_no_rotation_is_refused() {
    refuses(
        "mask",
        |p| write(p.join("calibration/RT_R.txt"), "1 0 0 0\n0 1.1 0 0\n0 0 1 5\n"),
        65,
        &["RT_R.txt", "not a rotation"],
    );
}

fn mask_of(pair: &Path, view: &str, size: (usize, usize), on: &[(usize, usize)]) {
    let mask = ndarray::Array2::from_shape_fn(size, |at| on.contains(&at));
    accurate3d::io::write_mask(&pair.join(format!("masks/mask_{view}.png")), &mask).unwrap();
}

#[test]
fn empty_and_one_pixel_masks_are_refused() {
    refuses("mask", |p| mask_of(p, "L", (512, 512), &[]), 65, &["mask_L.png", "foreground"]);
    refuses("mask", |p| mask_of(p, "R", (512, 512), &[(9, 9)]), 65, &["A027", "view 2", "1 "]);
}

#[test]
fn a_closed_loop_is_refused() {
    let ring: Vec<(usize, usize)> = (0..400)
        .map(|k| {
            let (s, c) = (f64::from(k) * 0.02).sin_cos();
            ((256.0 + 40.0 * s).round() as usize, (256.0 + 40.0 * c).round() as usize)
        })
        .collect();
    refuses("mask", |p| mask_of(p, "L", (512, 512), &ring), 3, &["view 1", "endpoint"]);
}

#[test]
fn an_image_of_another_size_is_refused() {
    refuses(
        "mask",
        |p| mask_of(p, "L", (100, 90), &[(5, 5), (5, 6)]),
        65,
        &["mask_L.png", "90", "512"],
    );
}

#[test]
fn one_bad_pair_does_not_stop_the_others() {
    let dir = TempDir::new().unwrap();
    let bad = copy_of("bend", dir.path());
    fs::remove_file(bad.join("masks/mask_L.png")).unwrap();
    let out = dir.path().join("out");
    let assert = accurate()
        .args(["reconstruct", "-i", "mask", "-m", "paper", "-o"])
        .arg(&out)
        .arg(&bad)
        .arg(samples().join("wire"))
        .assert()
        .failure();
    let output = assert.get_output();
    assert_eq!(output.status.code(), Some(66));
    assert!(String::from_utf8_lossy(&output.stderr).contains("1 of 2 pairs failed"));
    assert!(out.join("wire/curve.csv").is_file());
    assert!(!out.join("bend").exists());
}

#[test]
fn wrong_usage_has_its_own_exit_code() {
    for args in [
        &["reconstruct", "x", "--input", "smell", "--out", "y"][..],
        &["table", "--set", "no-such-set"],
        &["table", "--cases", "0"],
        &["demo", "--threads", "100000"],
        &["synth", "spaghetti", "--out", "y"],
    ] {
        assert_eq!(failure(accurate().args(args)).0, 2, "{args:?}");
    }
}

#[test]
fn every_failed_pair_is_named_also_quietly_and_to_a_program() {
    let dir = TempDir::new().unwrap();
    let bad = copy_of("bend", dir.path());
    fs::remove_file(bad.join("masks/mask_L.png")).unwrap();
    let worse = copy_of("loop", dir.path());
    fs::remove_file(worse.join("calibration/RT_R.txt")).unwrap();
    let run = |flag: &str| {
        let mut command = accurate();
        command.args(["reconstruct", "-i", "mask", "-m", "paper", flag, "-o"]);
        command.arg(dir.path().join("out")).args([&bad, &worse]).arg(samples().join("wire"));
        failure(&mut command)
    };
    let (code, said) = run("-q");
    assert_eq!(code, 66, "{said}");
    for pair in [&bad, &worse] {
        let line = format!("error[A030]: {}: missing file", pair.display());
        assert!(said.contains(&line), "no `{line}` in: {said}");
    }
    assert!(said.contains("2 of 3 pairs failed"), "{said}");
    let (_, said) = run("--json");
    let lines: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 3, "{said}");
    for (line, pair) in lines.iter().zip([&bad, &worse]) {
        assert_eq!((&line["pair"], &line["code"]), (&pair.to_str().into(), &"A030".into()));
    }
    assert_eq!(lines[2]["error"], "2 of 3 pairs failed");
}

#[test]
fn options_that_the_method_does_not_know_are_refused() {
    for option in [&["--closed", "yes"][..], &["--refine-calibration"]] {
        let mut command = accurate();
        command.args(["reconstruct", "-i", "points", "-m", "paper", "-o", "never"]).args(option);
        let (code, said) = failure(command.arg(samples().join("bend")));
        assert!(code == 2 && said.contains(option[0]), "{option:?}: {code} {said}");
    }
}

#[test]
fn one_point_is_no_curve() {
    for view in ["L", "R"] {
        refuses(
            "points",
            |p| write(p.join(format!("points/points_{view}.csv")), "x,y\n250,250\n"),
            65,
            &["1 point in view", "hint"],
        );
    }
}

#[test]
fn what_is_read_is_never_replaced() {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    for part in
        ["points/points_L.csv", "masks/mask_L.png", "annotations/guidewire_3D.ply", "meta.json"]
    {
        let file = pair.join(part);
        let before = fs::read(&file).unwrap();
        let mut command = accurate();
        command.args(["reconstruct", "-i", "mask", "-o"]).arg(&file).arg(&pair);
        let (code, message) = failure(&mut command);
        assert!(code == 2 && message.contains("would be replaced"), "{code} {message}");
        assert_eq!(fs::read(&file).unwrap(), before, "{part}");
    }
    let mask = pair.join("masks/mask_L.png");
    let before = fs::read(&mask).unwrap();
    let (code, message) = failure(accurate().arg("trace").arg(&mask).arg("-o").arg(&mask));
    assert!(code == 2 && message.contains("would be replaced"), "{code} {message}");
    assert_eq!(fs::read(&mask).unwrap(), before);
}

/// Of every command that writes a file.
#[test]
fn no_command_replaces_what_it_reads() {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    let at = |file: &str| pair.join(file).display().to_string();
    let (rig, network) = (dir.path().join("rig.toml"), dir.path().join("net.onnx"));
    accurate()
        .args(["camera", "convert", "--to", "rig-toml", "-o"])
        .arg(&rig)
        .arg(&pair)
        .assert()
        .success();
    fs::write(&network, "no network").unwrap();
    fs::copy(at("masks/mask_L.png"), at("masks/a.png")).unwrap();
    fs::copy(at("masks/mask_R.png"), at("masks/a_mask.png")).unwrap();
    let [rig, network] = [&rig, &network].map(|path| path.display().to_string());
    let (folder, set) = (at(""), dir.path().display().to_string());
    let [left, right, k] = ["masks/mask_L.png", "masks/mask_R.png", "calibration/K_L.txt"].map(at);
    let shape = dir.path().join("shape.csv").display().to_string();
    write(PathBuf::from(&shape), "x,y,z\n0,0,0\n1,1,1\n");
    let (a, a_mask, masks, meta) =
        (at("masks/a.png"), at("masks/a_mask.png"), at("masks"), at("meta.json"));
    for (words, file) in [
        (vec!["segment", &a, &a_mask, "-o", &masks], &a_mask),
        (vec!["figure", "gctt", &folder, "-o", &left], &left),
        (vec!["table", "--set", &set, "-o", &meta], &meta),
        (vec!["table", "--set", &set, "--per-case", &meta], &meta),
        (vec!["camera", "convert", &folder, "--to", "p-txt", "-o", &k], &k),
        (vec!["camera", "doctor", &rig, "--masks", &left, &right, "-o", &rig], &rig),
        (vec!["plan-views", "--shape", &shape, "--first", &rig, "-o", &shape], &shape),
        (vec!["model", "pack", &network, "--manifest", &rig, "-o", &network], &network),
        (vec!["synth", "xray", "--onto", &left, "--sheet", &left], &left),
    ] {
        let before = fs::read(file).unwrap();
        let (code, message) = failure(accurate().args(&words));
        assert!(code == 2, "{words:?}: {code} {message}");
        assert!(message.contains("would be replaced"), "{words:?}: {message}");
        assert_eq!(&fs::read(file).unwrap(), &before, "{words:?}");
    }
}

#[test]
fn two_config_files_are_refused() {
    let dir = TempDir::new().unwrap();
    let config = dir.path().join("lab.toml");
    write(config.clone(), "quiet = true\n");
    let mut command = accurate();
    command.arg("--config").arg(&config).args(["reconstruct", "-o"]).arg(dir.path().join("out"));
    command.arg(samples().join("bend")).args(["--config", "nowhere.toml"]);
    let (code, message) = failure(&mut command);
    assert!(code == 2 && message.contains("--config is given twice"), "{code} {message}");
}

#[test]
fn one_view_in_the_place_of_both_is_refused() {
    let same = |file: [&'static str; 2]| {
        move |pair: &Path| {
            fs::copy(pair.join(file[0]), pair.join(file[1])).unwrap();
        }
    };
    let masks = same(["masks/mask_L.png", "masks/mask_R.png"]);
    refuses("mask", masks, 65, &["masks of both views are the same", "named twice"]);
    let points = same(["points/points_L.csv", "points/points_R.csv"]);
    refuses("points", points, 65, &["points of both views are the same"]);
}

#[test]
fn what_comes_out_as_a_single_point_is_no_curve() {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    write(pair.join("points/points_L.csv"), "x,y\n1,2\n100,200\n");
    let out = dir.path().join("out");
    let mut command = accurate();
    command.args(["reconstruct", "-i", "points", "-o"]).arg(&out).arg(&pair);
    let (code, message) = failure(&mut command);
    assert!(code == 3 && message.contains("A013") && message.contains("hint"), "{code} {message}");
    assert!(!out.exists());
    let in_space = |pair: &Path| write(pair.join("points/points_L.csv"), "x,y,z\n1,2,3\n4,5,6\n");
    refuses("points", in_space, 65, &["points_L.csv", "curve in space"]);
}

#[test]
fn points_of_a_scaled_picture_are_refused_with_what_may_have_happened() {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    let path = pair.join("points/points_R.csv");
    let doubled: String = fs::read_to_string(&path)
        .unwrap()
        .lines()
        .map(|line| match line.split_once(',').map(|(x, y)| (x.parse(), y.parse())) {
            Some((Ok::<f64, _>(x), Ok::<f64, _>(y))) => format!("{},{}\n", 2.0 * x, 2.0 * y),
            _ => format!("{line}\n"),
        })
        .collect();
    fs::write(&path, doubled).unwrap();
    let out = dir.path().join("out");
    let mut run = accurate();
    let (code, said) =
        failure(run.args(["reconstruct", "-i", "points", "-o"]).arg(&out).arg(&pair));
    assert_eq!(code, 65, "{said}");
    assert!(said.contains("error[A022]") && said.contains("points_R.csv: point"), "{said}");
    assert!(said.contains("scaled") && !out.exists(), "{said}");
}

#[test]
fn what_a_pair_folder_says_itself_is_not_said_again_to_the_doctor() {
    for (option, value) in [("--views", "l,r"), ("--image-size", "64x64"), ("--unit", "mm")] {
        let mut doctor = accurate();
        doctor.args(["camera", "doctor", option, value]).arg(samples().join("bend"));
        let (code, said) = failure(&mut doctor);
        assert_eq!(code, 2, "{said}");
        assert!(said.contains(option) && said.contains("pair folder"), "{said}");
    }
}

#[test]
fn what_a_config_file_says_wrongly_is_not_blamed_on_the_command_line_alone() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("lab.toml");
    for (text, json) in [
        ("[reconstruct]\nunit = \"cm\"\n", false),
        ("[reconstruct]\ninput = \"bla\"\n", false),
        ("[reconstruct]\ninput = \"bla\"\n", true),
    ] {
        write(file.clone(), text);
        let mut command = accurate();
        command.arg("--config").arg(&file).args(["reconstruct", "-o", "never"]);
        if json {
            command.arg("--json");
        }
        if !text.contains("input") {
            command.args(["-i", "points"]);
        }
        let (code, said) = failure(command.arg(samples().join("bend")));
        assert!(code == 2 && said.contains("lab.toml says counts"), "{text}: {code} {said}");
    }
}

#[test]
fn quiet_or_verbose_on_the_command_line_wins_over_either_in_the_config_file() {
    let dir = TempDir::new().unwrap();
    let config = dir.path().join("accurate.toml");
    let mask = samples().join("bend/masks/mask_L.png");
    let remarks = |setting: &str, before: &[&str], after: &[&str]| {
        fs::write(&config, setting).unwrap();
        let mut trace = accurate();
        trace.arg("--config").arg(&config).args(before).arg("trace").arg(&mask).args(after);
        String::from_utf8(trace.assert().success().get_output().stderr.clone()).unwrap()
    };
    assert_eq!(remarks("quiet = true\n", &[], &[]), "");
    assert!(remarks("quiet = true\n", &["-v"], &[]).contains("coverage"));
    assert!(remarks("quiet = true\n", &[], &["-v"]).contains("coverage"));
    assert_eq!(remarks("verbose = 2\n", &[], &["--quiet"]), "");
}

#[test]
fn the_doctor_refuses_masks_of_rings() {
    let dir = TempDir::new().unwrap();
    let pair = samples().join("bend");
    let size = accurate3d::io::read_mask(&pair.join("masks/mask_L.png")).unwrap().dim();
    let ring = ndarray::Array2::from_shape_fn(size, |(y, x)| {
        let radius = (x as f64 - 60.0).hypot(y as f64 - 60.0);
        (radius - 40.0).abs() <= 1.5
    });
    let mask = dir.path().join("ring.png");
    accurate3d::io::write_mask(&mask, &ring).unwrap();
    let mut doctor = accurate();
    doctor.args(["camera", "doctor"]).arg(&pair).arg("--masks").args([&mask, &mask]);
    let (code, said) = failure(&mut doctor);
    assert_eq!(code, 65, "{said}");
    assert!(said.contains("ring.png") && said.contains("closed"), "{said}");
}

#[test]
fn one_pixel_is_no_body_to_trace() {
    let dir = TempDir::new().unwrap();
    let mut mask = ndarray::Array2::from_elem((20, 20), false);
    mask[[10, 10]] = true;
    let path = dir.path().join("dot.png");
    accurate3d::io::write_mask(&path, &mask).unwrap();
    for method in ["accurate", "paper"] {
        let (code, said) = failure(accurate().args(["trace", "--method", method]).arg(&path));
        assert_eq!(code, 65, "{said}");
        assert!(said.contains("error[A027]") && said.contains("dot.png"), "{said}");
    }
}

#[test]
fn points_by_the_hundred_thousand_are_too_many_and_no_wrong_calibration() {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    for (view, from) in [("L", 60.0), ("R", 61.0)] {
        let along = |k: u32| from + 400.0 * f64::from(k) / 120_000.0;
        let rows: String =
            (0..120_000).map(|k| format!("{:.4},{:.4}\n", along(k), along(k))).collect();
        write(pair.join(format!("points/points_{view}.csv")), &format!("x,y\n{rows}"));
    }
    let mut run = accurate();
    run.args(["reconstruct", "-i", "points", "-o"]).arg(dir.path().join("out")).arg(&pair);
    let (code, message) = failure(&mut run);
    assert_eq!(code, 65, "{message}");
    for words in ["120000 points", "limit", "0.5 px apart"] {
        assert!(message.contains(words), "{message}");
    }
}
