//! Images and models as a user gives them.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{accurate, copy_of, failure, samples, stdout};

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
        // The mask is the sample's own, so that the curve is that of the mask; in `accurate` mode it is
        // fitted to the map, which shows the mask. Curves half a pixel apart (of one unit here) have
        // scores that differ by no more.
        let mut command = accurate();
        command.args(["--json", "reconstruct", "-i", "mask", "-m", method, "-o"]);
        let text = stdout(command.arg(dir.path().join("mask")).arg(samples().join("bend")));
        let of_mask: Value = serde_json::from_str(&text).unwrap();
        assert!(of_mask["scores"]["overall"].is_number());
        if method == "paper" {
            assert_eq!(result["scores"], of_mask["scores"]);
        }
        for score in ["accuracy", "completeness", "overall", "max_error"] {
            let of = |result: &Value| result["scores"][score].as_f64().unwrap();
            let apart = (of(&result) - of(&of_mask)).abs();
            assert!(apart < 0.5, "{method}, {score}: {apart}");
        }
        let by = result["parameters"]["segmentation"].as_str().unwrap();
        assert!(by.contains("dark pixels") && by.contains("rten"), "{by}");
        assert_eq!(result["input"], "image");
    }
}

#[test]
fn bright_bodies_give_the_curve_of_dark_ones() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    let pair = pair_of_shadows("bend", dir.path());
    let run = |pair: &Path, out: &Path, more: &[&str]| {
        let mut command = accurate();
        command.args(["reconstruct", "-i", "image"]).args(more).arg("--model").arg(&model);
        command.arg("-o").arg(out).arg(pair).assert().success();
        fs::read(out.join("curve.csv")).unwrap()
    };
    let dark = run(&pair, &dir.path().join("dark"), &[]);
    for view in ["L", "R"] {
        let file = pair.join(format!("images/view_{view}.png"));
        let image = accurate3d::io::read_grey(&file).unwrap().values;
        // The sum of the two grey values of a shadow.
        accurate3d::io::write_u8(&file, &image.mapv(|grey| (230.0 - grey) as u8)).unwrap();
    }
    let out = dir.path().join("bright");
    assert_eq!(run(&pair, &out, &["--photometric", "monochrome1"]), dark);
    let result: Value =
        serde_json::from_slice(&fs::read(out.join("result.json")).unwrap()).unwrap();
    assert_eq!(result["parameters"]["photometric"], "monochrome1");
}

#[test]
fn options_of_images_are_refused_where_none_are_read() {
    let dir = TempDir::new().unwrap();
    for option in [
        ["--photometric", "monochrome1"],
        ["--model", "no.accmodel"],
        ["--engine", "rten"],
        ["--mirror", "all"],
    ] {
        let out = dir.path().join("out");
        let mut command = accurate();
        command.args(["reconstruct", "-i", "mask"]).args(option).arg("-o").arg(&out);
        let (code, message) = failure(command.arg(samples().join("bend")));
        assert_eq!(code, 2, "{message}");
        assert!(message.contains(option[0]) && message.contains("--input image"), "{message}");
        assert!(!out.exists());
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
    // Whoever names a library wants that one.
    let mut named = run("auto");
    named.env_remove("ORT_DYLIB_PATH").arg("--onnxruntime").arg(dir.path().join("none.so"));
    let (code, message) = failure(&mut named);
    assert_eq!(code, 69);
    assert!(message.contains("none.so"), "{message}");
    let (code, message) = failure(run("rten").arg("--onnxruntime").arg(dir.path().join("none.so")));
    assert_eq!(code, 2);
    assert!(message.contains("takes no --onnxruntime"), "{message}");
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
    let told = stdout(accurate().args(["model", "info"]).arg(&model));
    assert!(told.lines().any(|line| line.starts_with("normalisation")), "{told}");
    // In words: nothing is printed as it stands in a program or in JSON.
    assert!(!told.contains(['{', '"']), "{told}");
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
        .args(["segment", "--mirror", "all", "--model"])
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
fn an_image_that_fails_is_named_also_quietly_and_to_a_program() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    let image = pair_of_shadows("bend", dir.path()).join("images/view_L.png");
    let run = |flag: &str| {
        let mut command = accurate();
        command.env_remove("ORT_DYLIB_PATH").args(["segment", "nowhere.png", flag, "--model"]);
        command.arg(&model).arg(&image).arg("-o").arg(dir.path().join("out"));
        failure(&mut command)
    };
    let (code, said) = run("-q");
    assert_eq!(code, 66, "{said}");
    assert!(said.contains("error[A030]: nowhere.png: missing file"), "{said}");
    let (_, said) = run("--json");
    let first: Value = serde_json::from_str(said.lines().next().unwrap()).unwrap();
    assert_eq!((&first["image"], &first["code"]), (&"nowhere.png".into(), &"A030".into()));
}

#[test]
fn a_dicom_run_is_segmented_by_its_mean_or_by_one_frame() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    // A dark bar across each frame: the mean shows both, half as dark.
    let side = 128_u16;
    let frame = |bar: std::ops::Range<u16>| {
        (0..side).flat_map(move |row| {
            let value = if bar.contains(&row) { 20_u8 } else { 200 };
            std::iter::repeat_n(value, usize::from(side))
        })
    };
    let pixels: Vec<u8> = frame(60..64).chain(frame(100..102)).collect();
    let run = dir.path().join("run.dcm");
    fs::write(&run, crate::dicom::view([10.0, 0.0], side, &pixels, &[])).unwrap();
    let segment = |more: &[&str], input: &Path| {
        let mut command = accurate();
        command.env_remove("ORT_DYLIB_PATH").args(["--json", "segment", "--model"]).arg(&model);
        command.args(["--mirror", "never", "-o"]).arg(dir.path().join("out")).args(more).arg(input);
        command
    };
    let body = |more: &[&str]| -> u64 {
        let report: Value = serde_json::from_str(&stdout(&mut segment(more, &run))).unwrap();
        assert_eq!(report["size"], serde_json::json!([side, side]));
        report["body_px"].as_u64().unwrap()
    };
    assert_eq!(body(&["--frame", "0"]), 4 * u64::from(side));
    assert_eq!(body(&["--frame", "1"]), 2 * u64::from(side));
    assert_eq!(body(&[]), 6 * u64::from(side));
    // Nothing was written over: every frame has names of its own.
    for name in ["run", "run_frame0", "run_frame1"] {
        assert!(dir.path().join(format!("out/{name}_mask.png")).is_file(), "{name}");
    }
    let (code, said) = failure(&mut segment(&["--frame", "2"], &run));
    assert_eq!(code, 65, "{said}");
    assert_eq!(said.matches("run.dcm").count(), 1, "{said}");
    let image = dir.path().join("out/run_probability.png");
    let (code, said) = failure(&mut segment(&["--frame", "0"], &image));
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("no DICOM run"), "{said}");
}

#[test]
fn an_image_of_one_grey_value_is_to_be_looked_at_and_a_threshold_is_a_probability() {
    let dir = TempDir::new().unwrap();
    let model = dark_model(dir.path());
    let black = dir.path().join("black.png");
    accurate3d::io::write_u8(&black, &ndarray::Array2::zeros((64, 64))).unwrap();
    let segment = |more: &[&str]| {
        let mut command = accurate();
        command.arg("segment").arg(&black).arg("-o").arg(dir.path().join("out"));
        command.arg("--model").arg(&model).args(more);
        failure(&mut command)
    };
    let (code, message) = segment(&[]);
    assert_eq!(code, 65);
    assert!(message.contains("look at the image") && !message.contains("mask"), "{message}");
    for wrong in ["2", "-0.1", "NaN", "much"] {
        let (code, message) = segment(&[&format!("--threshold={wrong}")]);
        assert_eq!(code, 2);
        let named = message.contains("--threshold") && message.contains("from 0 to 1");
        assert!(named && !message.contains("low"), "{message}");
    }
}
