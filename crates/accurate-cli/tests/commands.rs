//! The commands as a user runs them: what they write, what they say, how they fail.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn accurate() -> Command {
    Command::cargo_bin("accurate").unwrap()
}

fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/samples")
}

/// A copy of a sample pair that a test may spoil.
fn copy_of(name: &str, dir: &Path) -> PathBuf {
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

fn stdout(command: &mut Command) -> String {
    String::from_utf8(command.assert().success().get_output().stdout.clone()).unwrap()
}

/// Runs a command that must fail; gives its exit code and stderr.
fn failure(command: &mut Command) -> (i32, String) {
    let assert = command.assert().failure();
    let output = assert.get_output();
    (output.status.code().unwrap(), String::from_utf8(output.stderr.clone()).unwrap())
}

#[test]
fn every_method_reconstructs_the_samples_from_points_and_masks() {
    let dir = TempDir::new().unwrap();
    for method in [
        "accurate",
        "paper",
        "paper-refined",
        "baert",
        "baert-table",
        "hoffmann",
        "hoffmann-table",
        "baur",
    ] {
        for input in ["points", "mask"] {
            let out = dir.path().join(method).join(input);
            let text = stdout(
                accurate()
                    .args(["reconstruct", "--input", input, "--method", method, "--json", "--out"])
                    .arg(&out)
                    .arg(samples().join("bend"))
                    .arg(samples().join("wire")),
            );
            let lines: Vec<Value> =
                text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
            assert_eq!(lines.len(), 2, "{method} {input}");
            for (line, case) in lines.iter().zip(["bend", "wire"]) {
                // Loose: a wrong order is tens of units off. Baert as tabled has no order at all, and
                // is off by that much where a line meets the curve twice.
                let overall = line["scores"]["overall"].as_f64().unwrap();
                let limit = if method == "baert-table" { 60.0 } else { 6.0 };
                assert!(overall < limit, "{method} {input} {case}: {overall}");
                let csv = fs::read_to_string(out.join(case).join("curve.csv")).unwrap();
                assert!(csv.starts_with("x,y,z,"), "{}", csv.lines().next().unwrap());
                let result: Value = serde_json::from_str(
                    &fs::read_to_string(out.join(case).join("result.json")).unwrap(),
                )
                .unwrap();
                assert_eq!(result["method"], method);
                assert_eq!(csv.lines().count() as u64, result["points"].as_u64().unwrap() + 1);
            }
        }
    }
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let dir = TempDir::new().unwrap();
    let run = |threads: &str| {
        let out = dir.path().join(threads);
        accurate()
            .args(["reconstruct", "--input", "mask", "--threads", threads, "--picture"])
            .args(["--also", "report,mrk-json,npz,parquet", "--out"])
            .arg(&out)
            .args(["bend", "loop", "wire"].map(|name| samples().join(name)))
            .assert()
            .success();
        ["bend", "loop", "wire"].map(|case| {
            [
                "curve.csv",
                "result.json",
                "picture.svg",
                "report.html",
                "curve.mrk.json",
                "curve.npz",
                "curve.parquet",
            ]
            .map(|file| fs::read(out.join(case).join(file)).unwrap())
        })
    };
    let one = run("1");
    assert_eq!(one, run("2"));
    assert_eq!(one, run("8"));
}

#[test]
fn extra_formats_hold_the_same_curve() {
    let dir = TempDir::new().unwrap();
    accurate()
        .args(["reconstruct", "--input", "points", "--also", "ply,vtp,npy,mrk-json", "--out"])
        .arg(dir.path())
        .arg(samples().join("bend"))
        .assert()
        .success();
    let curve = dir.path().join("curve.csv");
    for extension in ["ply", "vtp", "npy", "mrk.json"] {
        let text = stdout(
            accurate()
                .arg("eval")
                .arg(dir.path().join("curve").with_extension(extension))
                .arg("--truth")
                .arg(&curve),
        );
        let scores: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(scores["max_error"].as_f64().unwrap(), 0.0, "{extension}");
    }
}

#[test]
fn results_go_to_the_files_that_are_named() {
    let dir = TempDir::new().unwrap();
    let file = |name: &str| dir.path().join("new/folder").join(name);
    let mut command = accurate();
    command.args(["reconstruct", "--input", "points", "--method", "paper"]);
    command.arg(samples().join("bend"));
    let names = ["w.vtp", "w.mrk.json", "w.npz", "w.parquet", "w.svg", "w.json"];
    for name in names {
        command.arg("-o").arg(file(name));
    }
    command.arg("--report").arg(file("w.html"));
    stdout(&mut command);
    for name in names.into_iter().chain(["w.html"]) {
        assert!(file(name).metadata().unwrap().len() > 100, "{name}");
    }
    assert!(!file("curve.csv").exists(), "no folder was asked for");
    let html = fs::read_to_string(file("w.html")).unwrap();
    // Points were read; the masks beside them are shown all the same.
    assert!(html.contains("\"kind\":\"mask\""));
    assert!(html.contains("not for clinical use"));
}

#[test]
fn outputs_that_cannot_be_are_refused_before_anything_runs() {
    let dir = TempDir::new().unwrap();
    let out = |name: &str| dir.path().join(name).display().to_string();
    let (bend, wire) = (samples().join("bend"), samples().join("wire"));
    let (bend, wire) = (bend.display().to_string(), wire.display().to_string());
    for (words, expected) in [
        (vec![&*bend, &*wire, "-o", &*out("one.vtp")], "2 pairs"),
        (vec![&*bend, "-o", &*out("a"), "-o", &*out("b")], "both taken for folders"),
        (vec![&*bend, "-o", &*out("a.vtp"), "--also", "ply"], "need a folder"),
        (vec![&*bend, "-o", &*out("a"), "--report", &*out("a.pdf")], "a.pdf"),
    ] {
        let mut command = accurate();
        command.args(["reconstruct", "--input", "points"]).args(&words);
        let (code, message) = failure(&mut command);
        assert_eq!(code, 2, "{words:?}: {message}");
        assert!(message.contains(expected), "{words:?}: {message}");
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn eval_agrees_with_the_scores_of_the_reconstruction() {
    let dir = TempDir::new().unwrap();
    let pair = samples().join("wire");
    let line = stdout(
        accurate()
            .args(["reconstruct", "--input", "points", "--method", "paper", "--json", "--out"])
            .arg(dir.path())
            .arg(&pair),
    );
    let reconstructed: Value = serde_json::from_str(&line).unwrap();
    let text = stdout(
        accurate()
            .arg("eval")
            .arg(dir.path().join("curve.csv"))
            .arg("--truth")
            .arg(pair.join("annotations/guidewire_3D.ply"))
            .arg("--pair")
            .arg(&pair),
    );
    let scores: Value = serde_json::from_str(&text).unwrap();
    for metric in ["accuracy", "completeness", "overall", "max_error"] {
        assert_eq!(scores[metric], reconstructed["scores"][metric], "{metric}");
    }
    for view in 0..2 {
        // Exact points, corner-to-corner ECDP: the curve reprojects well inside a pixel.
        assert!(scores["reprojection_rms_px"][view].as_f64().unwrap() < 1.0);
    }
}

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

#[test]
fn demo_writes_everything_and_scores_it() {
    let dir = TempDir::new().unwrap();
    let text = stdout(accurate().args(["demo", "--out"]).arg(dir.path()));
    assert!(text.contains("against the truth"), "{text}");
    for file in [
        "curve.csv",
        "curve.ply",
        "curve.vtp",
        "curve.mrk.json",
        "result.json",
        "picture.svg",
        "report.html",
    ] {
        assert!(dir.path().join(file).is_file(), "{file}");
    }
}

#[test]
fn trace_orders_a_mask() {
    let text = stdout(accurate().arg("trace").arg(samples().join("bend/masks/mask_L.png")));
    let points: Vec<(f64, f64)> = text
        .lines()
        .skip(1)
        .map(|line| {
            let (x, y) = line.split_once(',').unwrap();
            (x.parse().unwrap(), y.parse().unwrap())
        })
        .collect();
    assert!(points.len() > 100);
    for w in points.windows(2) {
        assert!((w[0].0 - w[1].0).hypot(w[0].1 - w[1].1) <= 3.0, "{w:?}");
    }
}

#[test]
fn tables_come_in_every_format() {
    for (format, sign) in [
        ("md", "| ---"),
        ("csv", "set,cases"),
        ("tex", "\\toprule"),
        ("html", "<table>"),
        ("json", "{"),
    ] {
        let text = stdout(
            accurate().args(["table", "--seeds", "1000", "--cases", "2", "--format", format]),
        );
        assert!(text.contains(sign), "{format}: {text}");
        assert!(text.contains("no weights"), "{format}: a row that cannot run says why");
    }
}

#[test]
fn a_folder_of_pairs_can_be_tabled() {
    let text = stdout(
        accurate()
            .args([
                "table", "--format", "json", "--scores", "polyline", "--method", "paper", "--set",
            ])
            .arg(samples()),
    );
    let table: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(table["cases"], 3);
    for row in table["rows"].as_array().unwrap() {
        assert_eq!(row["scored"], 3, "{row}");
    }
}

#[test]
fn version_and_help_say_what_this_is_not() {
    for flag in ["--version", "--help"] {
        assert!(stdout(accurate().arg(flag)).contains("not for clinical use"), "{flag}");
    }
}

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
    refuses("mask", |p| mask_of(p, "R", (512, 512), &[(9, 9)]), 3, &["view 2", "1 "]);
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

/// A model that takes what is darker than the mean by a standard deviation for the body.
fn dark_model(dir: &Path) -> PathBuf {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../accurate-seg/tests/fixtures");
    let model = dir.join("dark.accmodel");
    accurate()
        .args(["model", "pack"])
        .arg(fixtures.join("dark.onnx"))
        .arg("--manifest")
        .arg(fixtures.join("dark.json"))
        .arg("-o")
        .arg(&model)
        .assert()
        .success();
    model
}

/// A pair whose images show its masks, dark on bright.
fn pair_of_shadows(name: &str, dir: &Path) -> PathBuf {
    let pair = copy_of(name, dir);
    fs::create_dir_all(pair.join("images")).unwrap();
    for view in ["L", "R"] {
        let mask = accurate3d::io::read_mask(&pair.join(format!("masks/mask_{view}.png"))).unwrap();
        let image = mask.mapv(|body| if body { 30_u8 } else { 200 });
        accurate3d::io::write_u8(&pair.join(format!("images/view_{view}.png")), &image).unwrap();
    }
    fs::remove_dir_all(pair.join("masks")).unwrap();
    pair
}

#[cfg(not(feature = "embedded-model"))]
#[test]
fn images_say_that_no_network_is_installed() {
    let dir = TempDir::new().unwrap();
    let pair = pair_of_shadows("bend", dir.path());
    let out = dir.path().join("out");
    let (code, message) =
        failure(accurate().args(["reconstruct", "-i", "image", "-o"]).arg(out).arg(&pair));
    assert_eq!(code, 69);
    assert!(message.contains("no segmentation network is installed"), "{message}");
}

#[cfg(feature = "embedded-model")]
#[test]
fn images_need_no_set_up() {
    let dir = TempDir::new().unwrap();
    let info: Value =
        serde_json::from_str(&stdout(accurate().args(["--json", "model", "info"]))).unwrap();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/wire.accmodel");
    let mut of_file = accurate();
    of_file.args(["--json", "model", "info"]).arg(shipped);
    assert_eq!(info, serde_json::from_str::<Value>(&stdout(&mut of_file)).unwrap());

    let set = dir.path().join("set");
    let mut synth = accurate();
    synth.args(["synth", "easy", "--seed", "1000", "--count", "1", "--xray", "--out"]).arg(&set);
    synth.assert().success();
    let pair = fs::read_dir(&set).unwrap().map(|e| e.unwrap().path()).find(|p| p.is_dir()).unwrap();
    let out = dir.path().join("out");
    let mut run = accurate();
    run.env_remove("ORT_DYLIB_PATH");
    run.args(["--json", "reconstruct", "-i", "image", "-o"]).arg(&out).arg(&pair);
    let result: Value = serde_json::from_str(&stdout(&mut run)).unwrap();
    let by = result["parameters"]["segmentation"].as_str().unwrap();
    assert!(by.contains(&info["blake3"].as_str().unwrap()[..12]) && by.contains("rten"), "{by}");
    assert!(result["scores"]["overall"].is_number() && out.join("curve.csv").is_file());

    let mut segment = accurate();
    segment.env_remove("ORT_DYLIB_PATH");
    segment.args(["segment", "-o"]).arg(&out).arg(pair.join("images/view_L.png"));
    segment.assert().success();
    assert!(out.join("view_L_mask.png").is_file());
}

#[test]
fn images_are_segmented_and_reconstructed() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    let pair = pair_of_shadows("bend", dir.path());
    for method in ["accurate", "paper"] {
        let out = dir.path().join(method);
        let mut command = accurate();
        command.args(["--json", "reconstruct", "-i", "image", "-m", method, "--model"]).arg(&model);
        let text = stdout(command.arg("-o").arg(&out).arg(&pair));
        let result: Value = serde_json::from_str(&text).unwrap();
        // The mask is the sample's own, so that the curve is that of the mask.
        let mut command = accurate();
        command.args(["--json", "reconstruct", "-i", "mask", "-m", method, "-o"]);
        let text = stdout(command.arg(dir.path().join("mask")).arg(samples().join("bend")));
        let of_mask: Value = serde_json::from_str(&text).unwrap();
        assert!(of_mask["scores"]["overall"].is_number());
        assert_eq!(result["scores"], of_mask["scores"], "{method}");
        let by = result["parameters"]["segmentation"].as_str().unwrap();
        assert!(by.contains("dark pixels") && by.contains("rten"), "{by}");
        assert_eq!(result["input"], "image");
    }
}

#[test]
fn segment_writes_mask_probability_and_overlay() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    let pair = pair_of_shadows("bend", dir.path());
    let image = pair.join("images/view_L.png");
    let out = dir.path().join("out");
    let mut command = accurate();
    command.args(["--json", "segment", "--model"]).arg(&model).arg("-o").arg(&out).arg(&image);
    let report: Value = serde_json::from_str(&stdout(&mut command)).unwrap();
    let mask = accurate3d::io::read_mask(&out.join("view_L_mask.png")).unwrap();
    let truth = accurate3d::io::read_mask(&samples().join("bend/masks/mask_L.png")).unwrap();
    assert_eq!(mask, truth);
    assert_eq!(report["body_px"], mask.iter().filter(|b| **b).count());
    let probability = accurate3d::io::read_grey(&out.join("view_L_probability.png")).unwrap();
    assert_eq!(probability.depth, accurate3d::io::BitDepth::Sixteen);
    assert!(mask.iter().zip(&probability.values).all(|(body, p)| !body || *p > 0.3 * 65_535.0));
    assert!(out.join("view_L_overlay.png").is_file());

    let (code, message) = failure(
        accurate().arg("segment").arg("--model").arg(&model).arg("-o").arg(&out).args([&image; 2]),
    );
    assert_eq!(code, 2);
    assert!(message.contains("view_L_mask.png"), "{message}");
    let mut bad = accurate();
    bad.args(["segment", "--threshold", "1.5", "--model"]).arg(&model);
    assert_eq!(failure(bad.arg("-o").arg(&out).arg(&image)).0, 2);
}

#[test]
fn a_library_that_is_no_onnx_runtime_is_said_and_not_a_crash() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    let pair = pair_of_shadows("bend", dir.path());
    let image = pair.join("images/view_L.png");
    let run = |engine: &str| {
        let mut command = accurate();
        command.args(["segment", "--engine", engine, "--model"]).arg(&model);
        command.env("ORT_DYLIB_PATH", dir.path().join("none.so"));
        command.arg("-o").arg(dir.path().join("out")).arg(&image);
        command
    };
    let (code, message) = failure(&mut run("ort"));
    assert_eq!(code, 69);
    assert!(message.contains("none.so"), "{message}");
    let output = run("auto").assert().success();
    let said = String::from_utf8_lossy(&output.get_output().stderr).into_owned();
    assert!(said.contains("going on with rten"), "{said}");
    let (code, message) = failure(run("ort").env_remove("ORT_DYLIB_PATH"));
    assert_eq!(code, 69);
    assert!(message.contains("--onnxruntime"), "{message}");
}

#[test]
fn models_are_described_verified_and_refused() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    let info: Value =
        serde_json::from_str(&stdout(accurate().args(["--json", "model", "info"]).arg(&model)))
            .unwrap();
    assert_eq!((&info["weights"], &info["operations"]), (&Value::from(4), &Value::from(1)));
    let verified =
        stdout(accurate().args(["model", "verify"]).arg(&model).env_remove("ORT_DYLIB_PATH"));
    assert!(verified.contains("sound, runs with rten"), "{verified}");
    let mut bytes = fs::read(&model).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&model, bytes).unwrap();
    let (code, message) = failure(accurate().args(["model", "verify"]).arg(&model));
    assert_eq!(code, 65);
    assert!(message.contains("dark.accmodel: damaged"), "{message}");
}

#[test]
fn nnunet_results_become_a_model_that_runs() {
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("results");
    fs::create_dir(&folder).unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../accurate-seg/tests/fixtures");
    fs::copy(fixtures.join("unet.onnx"), folder.join("network.onnx")).unwrap();
    let plans = |norm: &str| {
        serde_json::json!({
            "dataset_name": "Dataset501_Wires", "plans_name": "nnUNetPlans",
            "foreground_intensity_properties_per_channel": {
                "0": {"mean": 90.0, "std": 20.0, "percentile_00_5": 10.0, "percentile_99_5": 200.0}
            },
            "configurations": {"2d": {
                "patch_size": [128, 64], "spacing": [1.0, 1.0],
                "normalization_schemes": [norm], "use_mask_for_norm": [false],
                "architecture": {"arch_kwargs": {"strides": [[1, 1], [2, 2]]}},
            }},
        })
    };
    let dataset = serde_json::json!({
        "channel_names": {"0": "xray"}, "labels": {"background": 0, "wire": 1},
        "numTraining": 1, "file_ending": ".png",
    });
    fs::write(folder.join("dataset.json"), dataset.to_string()).unwrap();
    fs::write(folder.join("plans.json"), plans("ZScoreNormalization").to_string()).unwrap();
    let model = dir.path().join("imported.accmodel");
    let import = || {
        let mut command = accurate();
        command.args(["--json", "model", "import"]).arg(&folder).arg("-o").arg(&model);
        command
    };
    let report: Value = serde_json::from_str(&stdout(&mut import())).unwrap();
    let manifest = &report["manifest"];
    assert_eq!(manifest["name"], "imported");
    assert_eq!(manifest["network"]["multiple_px"], 2);
    assert_eq!(manifest["network"]["foreground"], serde_json::json!([1]));
    assert_eq!(manifest["tiling"]["window_px"], serde_json::json!([128, 64]));
    assert_eq!(manifest["normalisation"]["scheme"], "z-score");
    let pair = pair_of_shadows("bend", dir.path());
    let mut segment = accurate();
    segment
        .args(["segment", "--mirror", "--model"])
        .arg(&model)
        .arg("-o")
        .arg(dir.path().join("out"));
    segment.arg(pair.join("images/view_R.png")).assert().success();

    fs::write(folder.join("plans.json"), plans("CTNormalization").to_string()).unwrap();
    let report: Value = serde_json::from_str(&stdout(&mut import())).unwrap();
    let fixed = serde_json::json!(
        {"scheme": "fixed", "low": 10.0, "high": 200.0, "mean": 90.0, "std": 20.0}
    );
    assert_eq!(report["manifest"]["normalisation"], fixed);
    let mut resampled = plans("ZScoreNormalization");
    resampled["configurations"]["2d"]["spacing"] = serde_json::json!([0.5, 0.5]);
    let mut other = plans("Foo");
    other["configurations"]["3d_fullres"] = other["configurations"]["2d"].take();
    for (bad, word) in [(plans("Foo"), "Foo"), (resampled, "resampled"), (other, "2d")] {
        fs::write(folder.join("plans.json"), bad.to_string()).unwrap();
        let (code, message) = failure(&mut import());
        assert_eq!(code, 65);
        assert!(message.contains(word), "{message}");
    }
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
fn views_of_different_bodies_are_suspect() {
    let dir = TempDir::new().unwrap();
    let pair = copy_of("bend", dir.path());
    fs::copy(samples().join("loop/masks/mask_R.png"), pair.join("masks/mask_R.png")).unwrap();
    let run = |strict: bool| {
        let mut command = accurate();
        command.args(["reconstruct", "-i", "mask", "-o"]).arg(dir.path().join("out")).arg(&pair);
        if strict {
            command.arg("--strict");
        }
        command
    };
    assert!(stdout(&mut run(false)).contains("suspect"));
    let (code, message) = failure(&mut run(true));
    assert_eq!(code, 4, "{message}");
    assert!(dir.path().join("out/curve.csv").is_file(), "a suspect result is still written");
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
    // The other generator's images are another set too.
    let (code, said) = failure(xray(dir.path(), "4", "1").args(["--generator", "held-out"]));
    assert!(code == 2 && said.contains("another set"), "{said}");
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
