//! Views given as files: cameras of any kind, points, masks, images and DICOM runs.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use crate::program::{accurate, failure, stdout};

fn sample(name: &str, file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/samples").join(name).join(file)
}

/// The cameras of a sample in a format.
fn converted(name: &str, format: &str, path: &Path) {
    let folder = sample(name, "");
    let mut command = accurate();
    command.args(["camera", "convert"]).arg(folder).args(["--to", format, "-o"]).arg(path);
    command.assert().success();
}

#[test]
fn cameras_of_every_kind_and_two_files_give_the_curve_of_the_pair_folder() {
    let dir = TempDir::new().unwrap();
    let curve = |out: &str| fs::read_to_string(dir.path().join(out).join("curve.csv")).unwrap();
    for (input, parts) in [
        ("points", ["points/points_L.csv", "points/points_R.csv"]),
        ("mask", ["masks/mask_L.png", "masks/mask_R.png"]),
    ] {
        let folder_out = dir.path().join(format!("{input}-folder"));
        let mut whole = accurate();
        whole.args(["reconstruct", "-i", input, "-m", "paper", "-o"]).arg(&folder_out);
        stdout(whole.arg(sample("bend", "")));
        for (format, name) in
            [("rig-toml", "rig.toml"), ("opencv-yaml", "stereo.yml"), ("views-json", "views.json")]
        {
            let cameras = dir.path().join(name);
            converted("bend", format, &cameras);
            let out = dir.path().join(format!("{input}-{format}"));
            let mut command = accurate();
            command.args(["reconstruct", "-i", input, "-m", "paper", "--json", "-o"]).arg(&out);
            command.arg("--cameras").arg(&cameras);
            command.arg("--truth").arg(sample("bend", "annotations/guidewire_3D.ply"));
            for part in parts {
                command.arg(sample("bend", part));
            }
            let result: Value = serde_json::from_str(&stdout(&mut command)).unwrap();
            // These formats hold every bit of the cameras.
            assert_eq!(curve(&format!("{input}-{format}")), curve(&format!("{input}-folder")));
            let names = result["case"].as_str().unwrap();
            assert!(names.contains("_L_") && names.ends_with("_R"), "{names}");
            assert!(result["scores"]["overall"].as_f64().unwrap() < 6.0);
            let inputs = result["inputs"].as_array().unwrap();
            assert_eq!(inputs.len(), 4, "cameras, both files and truth have their hashes");
        }
    }
}

#[test]
fn what_is_missing_or_too_much_is_said_with_the_way_out() {
    let dir = TempDir::new().unwrap();
    let rig = dir.path().join("rig.toml");
    converted("bend", "rig-toml", &rig);
    let folder = sample("bend", "").display().to_string();
    let rig = rig.display().to_string();
    let [a, b] = ["L", "R"].map(|v| sample("bend", &format!("masks/mask_{v}.png")));
    let (a, b) = (a.display().to_string(), b.display().to_string());
    let other = sample("wire", "masks/mask_R.png").display().to_string();
    let run = dir.path().join("a.dcm");
    fs::write(&run, crate::dicom::view([10.0, 0.0], 8, &[9; 64], &[])).unwrap();
    let run = run.display().to_string();
    let cases: [(&[&str], i32, &str); 10] = [
        (&[&a, &b], 2, "no cameras"),
        (&["--cameras", &rig, &a], 2, "1 files; expected two"),
        (&["--cameras", &rig, &folder, &b], 2, "is a folder"),
        (&["--cameras", &rig, &a, &other], 65, "px but camera"),
        (&["--cameras", &a, &a, &b], 65, "a.png"),
        (&["--cameras", &rig, "--views", "x,y", &a, &b], 2, "no view `x`"),
        (&["--cameras", &rig, "--cameras", &rig, &a, &b], 2, "there are 4"),
        (&[&run, &run], 2, "DICOM runs are images"),
        (&["--truth", &a, &folder], 2, "--truth is for two views"),
        (&["--cameras", &rig, "--cameras", "nowhere.yml", &a, &b], 66, "nowhere.yml"),
    ];
    for (words, exit, expected) in cases {
        let out = dir.path().join("never");
        let mut command = accurate();
        command.args(["reconstruct", "-i", "mask", "-o"]).arg(&out).args(words);
        let (code, message) = failure(&mut command);
        let expected = if expected == "a.png" { "mask_L.png" } else { expected };
        assert!(code == exit && message.contains(expected), "{words:?}: {code} {message}");
        assert!(!out.exists(), "{words:?}");
    }
}

#[test]
fn two_dicom_runs_are_segmented_and_their_frames_are_chosen() {
    let dir = TempDir::new().unwrap();
    let side = 128usize;
    // A dark bow on a bright ground; in the first frame of two there is nothing.
    let picture = |bend: f64| -> Vec<u8> {
        (0..side * side)
            .map(|i| {
                let (x, y) = ((i % side) as f64 / 128.0 - 0.5, (i / side) as f64 / 128.0 - 0.5);
                let body = y.abs() < 0.35 && (x - bend * (0.12 - y * y)).abs() < 0.013;
                if body { 30 } else { 200 }
            })
            .collect()
    };
    let mut runs = Vec::new();
    for (name, angle, bend) in [("a", -35.0, 0.5), ("b", 40.0, -0.3)] {
        let mut pixels = vec![200; side * side];
        pixels.extend(picture(bend));
        let path = dir.path().join(format!("{name}.dcm"));
        fs::write(&path, crate::dicom::view([angle, 0.0], side as u16, &pixels, &[])).unwrap();
        runs.push(path);
    }
    let model =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../accurate-seg/tests/fixtures/dark.onnx");
    let bundle = dir.path().join("dark.accmodel");
    let mut pack = accurate();
    pack.args(["model", "pack"]).arg(&model).arg("--manifest").arg(model.with_extension("json"));
    stdout(pack.arg("-o").arg(&bundle));
    let run = |frame: &str| {
        let mut command = accurate();
        command.env_remove("ORT_DYLIB_PATH").args(["reconstruct", "-i", "image", "--json"]);
        command.arg("--model").arg(&bundle).args(["--frame", frame, "-o"]);
        command.arg(dir.path().join("out")).args(&runs);
        command
    };
    let result: Value = serde_json::from_str(&stdout(&mut run("1"))).unwrap();
    assert_eq!(result["case"], "a_b");
    assert_eq!(result["unit"], "mm");
    // A field of 102 px of 0.8 / 1.5 mm, of which the bow takes 70 %.
    let length = result["length"].as_f64().unwrap();
    assert!((40.0..70.0).contains(&length), "{length}");
    let (code, message) = failure(&mut run("0"));
    assert!(code == 65 || code == 3, "{message}");
    let (code, message) = failure(&mut run("2"));
    assert!(code == 65 && message.contains("the file has 2 frames"), "{message}");
}

#[test]
fn the_doctor_finds_swapped_cameras_and_writes_the_mended_rig() {
    let dir = TempDir::new().unwrap();
    let rig = dir.path().join("rig.toml");
    converted("loop", "rig-toml", &rig);
    let doctor = |cameras: &Path, order: [&str; 2]| {
        let mut command = accurate();
        command.args(["camera", "doctor", "--json"]).arg(cameras).arg("--points");
        for letter in order {
            command.arg(sample("loop", &format!("points/points_{letter}.csv")));
        }
        command
    };
    let say = |command: &mut Command| -> Value { serde_json::from_str(&stdout(command)).unwrap() };
    let sound = say(&mut doctor(&rig, ["L", "R"]));
    assert_eq!(sound["verdict"], "sound", "{sound}");
    let mended = dir.path().join("mended.toml");
    let ill = say(doctor(&rig, ["R", "L"]).arg("-o").arg(&mended));
    assert_eq!(ill["verdict"], "mistaken", "{ill}");
    let names = |f: &Value| f["mistake"].as_str().unwrap().to_owned();
    let finding = &ill["findings"][0];
    let all: Vec<String> = std::iter::once(names(finding))
        .chain(finding["or"].as_array().unwrap().iter().map(names))
        .collect();
    assert!(all.contains(&"views-swapped".to_owned()), "{all:?}");
    assert_eq!(say(&mut doctor(&mended, ["R", "L"]))["verdict"], "sound");
    let (code, _) = failure(doctor(&rig, ["R", "L"]).arg("--strict"));
    assert_eq!(code, 4);
    // A pair folder is examined by its own points.
    let text = stdout(accurate().args(["camera", "doctor"]).arg(sample("loop", "")));
    assert!(text.contains("ok: none of the usual mistakes"), "{text}");
    let mut uneven = accurate();
    uneven.args(["camera", "doctor"]).arg(&rig).arg("--matched");
    for letter in ["L", "R"] {
        uneven.arg(sample("loop", &format!("points/points_{letter}.csv")));
    }
    let (code, message) = failure(&mut uneven);
    assert!(code == 65 && message.contains("points, "), "{message}");
}

#[test]
fn a_plan_ranks_second_views_and_draws_them() {
    let dir = TempDir::new().unwrap();
    let first = dir.path().join("first.dcm");
    fs::write(&first, crate::dicom::view([-30.0, 10.0], 512, &vec![0; 512 * 512], &[])).unwrap();
    let shape = dir.path().join("rough.csv");
    let mut csv = String::from("x,y,z,arc_length[mm]\n");
    for i in 0..40 {
        let s = f64::from(i) / 39.0;
        csv.push_str(&format!(
            "{},{},{},{}\n",
            20.0 * (4.0 * s).sin(),
            15.0 * s,
            60.0 * s - 30.0,
            s
        ));
    }
    fs::write(&shape, csv).unwrap();
    let plan = |out: &str| {
        let mut command = accurate();
        command.args(["plan-views", "--json", "--step", "15", "--first"]).arg(&first);
        command.arg("--shape").arg(&shape);
        for extension in ["svg", "png", "csv"] {
            command.arg("-o").arg(dir.path().join(format!("{out}.{extension}")));
        }
        command
    };
    let report: Value = serde_json::from_str(&stdout(&mut plan("one"))).unwrap();
    assert_eq!(report["c_arm"], true);
    assert_eq!(report["unit"], "mm");
    let [best, worst] =
        [&report["best"][0], &report["worst"]].map(|v| v["expected_mean"].as_f64().unwrap());
    assert!(0.0 < best && 2.0 * best < worst, "{best} {worst}");
    stdout(&mut plan("two"));
    for extension in ["svg", "png", "csv"] {
        let read = |name: &str| fs::read(dir.path().join(format!("{name}.{extension}"))).unwrap();
        assert_eq!(read("one"), read("two"), "{extension}");
    }
    let table = fs::read_to_string(dir.path().join("one.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 13 * 7);
    let (code, message) = failure(plan("three").args(["-o", "plan.pdf"]));
    assert!(code == 2 && message.contains("plan.pdf"), "{message}");
    assert_eq!(failure(plan("four").args(["--primary", "40..10"])).0, 2);
}

#[test]
fn figures_are_drawn_as_png_too() {
    let dir = TempDir::new().unwrap();
    let draw = |name: &str| {
        let path = dir.path().join(name);
        stdout(accurate().args(["figure", "overview", "-o"]).arg(&path));
        fs::read(path).unwrap()
    };
    let one = draw("one.png");
    assert!(one.starts_with(b"\x89PNG") && one.len() > 20_000, "{}", one.len());
    assert_eq!(one, draw("two.png"));
    let (code, message) = failure(accurate().args(["figure", "overview", "-o", "x.pdf"]));
    assert!(code == 2 && message.contains("x.pdf"), "{message}");
}

/// `accurate reconstruct` of a sample's points with these cameras.
fn of_points(cameras: &Path, out: &Path) -> Command {
    let mut command = accurate();
    command.args(["reconstruct", "-i", "points", "-m", "paper", "--json", "-o"]).arg(out);
    command.arg("--cameras").arg(cameras);
    command.args(["L", "R"].map(|v| sample("bend", &format!("points/points_{v}.csv"))));
    command
}

#[test]
fn every_file_behind_a_result_is_named_with_its_hash() {
    let dir = TempDir::new().unwrap();
    let colmap = dir.path().join("colmap");
    converted("bend", "colmap", &colmap);
    let truth = sample("bend", "annotations/guidewire_3D.ply");
    let both = ["colmap/cameras.txt", "colmap/images.txt"];
    let own = ["K_L.txt", "K_R.txt", "RT_L.txt", "RT_R.txt", "meta.json"];
    for (cameras, files) in [
        (colmap.clone(), &both[..]),
        (colmap.join("images.txt"), &both),
        (sample("bend", ""), &own),
    ] {
        let mut command = of_points(&cameras, &dir.path().join("out"));
        let result: Value =
            serde_json::from_str(&stdout(command.arg("--truth").arg(&truth))).unwrap();
        let inputs = result["inputs"].as_array().unwrap();
        let names: Vec<&str> = inputs.iter().map(|i| i["file"].as_str().unwrap()).collect();
        let others = ["points_L.csv", "points_R.csv", "guidewire_3D.ply"];
        for file in files.iter().chain(&others) {
            assert!(names.iter().any(|name| name.ends_with(file)), "no {file} in {names:?}");
        }
        assert_eq!(inputs.len(), files.len() + others.len(), "{names:?}");
    }
}

/// A straight curve, its unit stated or not.
fn line_in(unit: Option<&str>, scale: f64, path: &Path) {
    let mut csv = String::from("x,y,z");
    csv += &unit.map(|unit| format!(",arc_length[{unit}]")).unwrap_or_default();
    for k in 0..50 {
        let s = scale * f64::from(k);
        csv +=
            &format!("\n{s},0,0{}", if unit.is_some() { format!(",{s}") } else { String::new() });
    }
    fs::write(path, csv + "\n").unwrap();
}

#[test]
fn lengths_in_two_units_are_not_compared() {
    let dir = TempDir::new().unwrap();
    let file = |name: &str| dir.path().join(name);
    line_in(Some("mm"), 1.0, &file("mm.csv"));
    line_in(Some("m"), 1e-3, &file("m.csv"));
    line_in(None, 1.0, &file("none.csv"));
    let eval = |curve: &str, truth: &str| {
        let mut command = accurate();
        command.arg("eval").arg(file(curve)).arg("--truth").arg(file(truth));
        command
    };
    let (code, said) = failure(&mut eval("m.csv", "mm.csv"));
    assert!(code == 65 && said.contains("the curve is in m, the truth in mm"), "{code} {said}");
    assert!(said.contains("hint"), "{said}");
    // What states no unit has the other's.
    for (curve, truth) in [("mm.csv", "none.csv"), ("none.csv", "mm.csv")] {
        let scores: Value = serde_json::from_str(&stdout(&mut eval(curve, truth))).unwrap();
        assert_eq!((&scores["unit"], &scores["overall"]), (&"mm".into(), &0.0.into()));
    }
    // The same for the truth of a reconstruction, and for cameras beside a curve.
    let pair = file("pair");
    for part in ["calibration", "points"] {
        fs::create_dir_all(pair.join(part)).unwrap();
        for entry in fs::read_dir(sample("bend", part)).unwrap() {
            let entry = entry.unwrap();
            fs::copy(entry.path(), pair.join(part).join(entry.file_name())).unwrap();
        }
    }
    let meta = fs::read_to_string(sample("bend", "meta.json")).unwrap();
    fs::write(pair.join("meta.json"), meta.replace("\"unit\": \"unit\"", "\"unit\": \"mm\""))
        .unwrap();
    let out = file("out");
    let (code, said) = failure(of_points(&pair, &out).arg("--truth").arg(file("m.csv")));
    assert!(code == 65 && said.contains("is in mm") && said.contains("m.csv in m"), "{said}");
    assert!(!out.exists());
    stdout(of_points(&pair, &out).arg("--truth").arg(file("mm.csv")));
    let scores = stdout(eval("none.csv", "none.csv").arg("--pair").arg(&pair));
    assert!(scores.contains("\"unit\":\"mm\""), "{scores}");
    let (code, said) = failure(eval("m.csv", "none.csv").arg("--pair").arg(&pair));
    assert!(code == 65 && said.contains("the pair in mm"), "{code} {said}");
}

#[test]
fn a_name_that_two_views_have_is_refused() {
    let dir = TempDir::new().unwrap();
    let mut runs = Vec::new();
    for (folder, angle) in [("one", -30.0), ("two", 40.0)] {
        fs::create_dir(dir.path().join(folder)).unwrap();
        let path = dir.path().join(folder).join("XA.dcm");
        fs::write(&path, crate::dicom::view([angle, 0.0], 8, &[9; 64], &[])).unwrap();
        runs.push(path);
    }
    let mut command = accurate();
    command.args(["camera", "doctor", "--views", "XA,XA"]).args(&runs);
    let (code, said) = failure(&mut command);
    assert!(code == 2 && said.contains("2 views are called `XA`"), "{code} {said}");
    // One file with two views of one name.
    let views = dir.path().join("views.json");
    converted("bend", "views-json", &views);
    let mut text: Value = serde_json::from_str(&fs::read_to_string(&views).unwrap()).unwrap();
    text[0]["name"] = "XA".into();
    text[1]["name"] = "XA".into();
    fs::write(&views, text.to_string()).unwrap();
    let shape = dir.path().join("shape.csv");
    line_in(None, 1.0, &shape);
    let mut command = accurate();
    command.args(["plan-views", "--view", "XA", "--first"]).arg(&views);
    let (code, said) = failure(command.arg("--shape").arg(&shape));
    assert!(code == 2 && said.contains("2 views are called `XA`"), "{code} {said}");
}

#[test]
fn files_without_frames_take_none() {
    let dir = TempDir::new().unwrap();
    let rig = dir.path().join("rig.toml");
    converted("bend", "rig-toml", &rig);
    for input in ["image", "mask"] {
        let mut command = accurate();
        command.args(["reconstruct", "-i", input, "--frame", "3", "-o", "never", "--cameras"]);
        command.arg(&rig).args(["L", "R"].map(|v| sample("bend", &format!("masks/mask_{v}.png"))));
        let (code, said) = failure(&mut command);
        assert!(code == 2 && said.contains("--frame"), "{code} {said}");
    }
}

#[test]
fn a_unit_can_be_stated_for_a_pair_folder_that_states_none() {
    let dir = TempDir::new().unwrap();
    let pair = crate::program::copy_of("wire", dir.path());
    fs::remove_file(pair.join("meta.json")).unwrap();
    let rig = dir.path().join("rig.toml");
    let mut command = accurate();
    command.args(["camera", "convert", "--unit", "cm", "--to", "rig-toml", "-o"]).arg(&rig);
    stdout(command.arg(&pair));
    assert!(fs::read_to_string(&rig).unwrap().contains("\"cm\""));
    // What is stated stays.
    converted("wire", "rig-toml", &rig);
    let again = dir.path().join("again.toml");
    let mut command = accurate();
    command.args(["camera", "convert", "--unit", "cm", "--to", "rig-toml", "-o"]).arg(&again);
    stdout(command.arg(&rig));
    assert!(fs::read_to_string(&again).unwrap().contains("\"mm\""));
}

#[test]
fn a_truth_is_in_the_unit_of_its_cameras() {
    let dir = TempDir::new().unwrap();
    let mut command = accurate();
    command.args(["synth", "carm", "-n", "1", "--out"]).arg(dir.path());
    stdout(&mut command);
    for folder in [dir.path().join("case_000"), sample("wire", "")] {
        let bytes = fs::read(folder.join("annotations/guidewire_3D.ply")).unwrap();
        let head = String::from_utf8_lossy(&bytes[..300]).into_owned();
        assert!(head.contains("comment unit mm"), "{head}");
    }
}

#[test]
fn the_doctor_looks_at_sizes_and_at_who_is_who_before_it_looks_for_mistakes() {
    let dir = TempDir::new().unwrap();
    let rig = dir.path().join("rig.toml");
    converted("bend", "rig-toml", &rig);
    let masks = ["wire", "bend"].map(|name| sample(name, "masks/mask_L.png"));
    let mut command = accurate();
    command.args(["camera", "doctor"]).arg(&rig).arg("--masks").args(&masks);
    let (code, message) = failure(&mut command);
    assert!(code == 65 && message.contains("A022"), "{code} {message}");
    let run = dir.path().join("XA.dcm");
    fs::write(&run, crate::dicom::view([10.0, 0.0], 8, &[9; 64], &[])).unwrap();
    let (code, message) = failure(accurate().args(["camera", "doctor"]).arg(&run).arg(&run));
    assert!(code == 2 && message.contains("same camera"), "{code} {message}");
}
