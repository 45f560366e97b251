//! The real C-arm runs of a tube phantom, where someone has them, through the commands: geometry out
//! of DICOM, branches out of two runs, scores in mm, and a third view that took no part.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use accurate3d::geom::nalgebra::Matrix3x4;
use accurate3d::geom::{Camera, ImageSize, Point2, Point3, View1};
use accurate3d::io::read_mask;
use accurate3d::seg::{Mask, Skeleton, zhang_suen};
use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use crate::shared_data::shared_data;

/// A reference point farther than this from the skeleton is not seen by the threshold mask, px.
const SEEN_PX: f64 = 6.0;
/// Fewest ordered points that a branch is reconstructed from.
const LEAST_POINTS: usize = 20;

fn json(command: &mut Command) -> Value {
    let assert = command.assert().success();
    serde_json::from_slice(&assert.get_output().stdout).unwrap()
}

fn run(phantom: &Path, name: &str) -> PathBuf {
    phantom.join("dicom").join(format!("{name}.dcm"))
}

/// P as `accurate camera show` gives it.
fn shown(phantom: &Path, name: &str) -> Matrix3x4<f64> {
    let mut command = Command::cargo_bin("accurate").unwrap();
    let view = json(command.args(["camera", "show", "--json"]).arg(run(phantom, name)));
    Matrix3x4::from_fn(|row, column| view["P"][row][column].as_f64().unwrap())
}

/// The skeleton pixels along a branch, in its order, each once.
fn ordered(camera: &Camera, skeleton: &[Point2], branch: &[Point3]) -> Vec<Point2> {
    let mut points: Vec<Point2> = Vec::new();
    for w in branch.windows(2) {
        for k in 0..32 {
            let x = w[0] + (w[1] - w[0]) * (f64::from(k) / 32.0);
            let p = camera.project(&x).unwrap();
            let nearest = skeleton
                .iter()
                .min_by(|a, b| (*a - p).norm_squared().total_cmp(&(*b - p).norm_squared()))
                .unwrap();
            if (nearest - p).norm() <= SEEN_PX && !points.contains(nearest) {
                points.push(*nearest);
            }
        }
    }
    points
}

fn branches(phantom: &Path) -> Vec<Vec<Point3>> {
    let text = fs::read_to_string(phantom.join("derived/reference_world_mm.csv")).unwrap();
    let mut branches: Vec<Vec<Point3>> = Vec::new();
    for line in text.lines().skip(1) {
        let fields: Vec<f64> = line.split(',').map(|f| f.trim().parse().unwrap()).collect();
        let branch = fields[0] as usize;
        branches.resize(branches.len().max(branch), Vec::new());
        branches[branch - 1].push(Point3::new(fields[1], fields[2], fields[3]));
    }
    branches
}

#[test]
fn branches_of_the_phantom_come_out_of_two_dicom_runs() {
    let Some(phantom) = shared_data("xa-phantom") else { return };
    let dir = TempDir::new().unwrap();
    let known: Value =
        serde_json::from_str(&fs::read_to_string(phantom.join("derived/geometry.json")).unwrap())
            .unwrap();
    let size = ImageSize { width: 512, height: 512 };
    let names = ["IM1", "IM2", "IM3", "IM4"];
    let views = names.map(|name| {
        let p = shown(&phantom, name);
        for row in 0..3 {
            for column in 0..4 {
                let expected = known["views"][name]["P"][row][column].as_f64().unwrap();
                assert!((p[(row, column)] - expected).abs() < 1e-6, "{name} {row} {column}");
            }
        }
        let mask = phantom.join(format!("derived/{name}_thresholdmask.png"));
        let mask = zhang_suen(&Mask::from_array(read_mask(&mask).unwrap()).unwrap());
        let skeleton = Skeleton::of(&mask).unwrap();
        let skeleton: Vec<Point2> =
            skeleton.pixels_as::<View1>().iter().map(|p| p.point()).collect();
        (Camera::from_projection_matrix(&p, size).unwrap(), skeleton)
    });
    let write = |name: &str, head: &str, rows: &[Vec<f64>]| {
        let mut text = format!("{head}\n");
        for row in rows {
            let row: Vec<String> = row.iter().map(f64::to_string).collect();
            let _ = writeln!(text, "{}", row.join(","));
        }
        let path = dir.path().join(name);
        fs::write(&path, text).unwrap();
        path
    };
    let pixels = |points: &[Point2]| points.iter().map(|p| vec![p.x, p.y]).collect::<Vec<_>>();
    let branches = branches(&phantom);
    assert_eq!(branches.len(), 11);
    // The least that the skeletons allow, with their pairs given.
    for (first, second, third, floor_mm) in [(0, 1, 3, 0.55), (2, 3, 0, 0.49)] {
        let mut errors = Vec::new();
        for (index, branch) in branches.iter().enumerate() {
            let [a, b] = [first, second].map(|v| ordered(&views[v].0, &views[v].1, branch));
            if a.len() < LEAST_POINTS || b.len() < LEAST_POINTS {
                continue;
            }
            let truth: Vec<Vec<f64>> = branch.iter().map(|x| vec![x.x, x.y, x.z]).collect();
            let truth = write("truth.csv", "x,y,z", &truth);
            let files = [write("a.csv", "x,y", &pixels(&a)), write("b.csv", "x,y", &pixels(&b))];
            let shown = write("third.csv", "x,y", &pixels(&views[third].1));
            let out = dir.path().join("out");
            let mut command = Command::cargo_bin("accurate").unwrap();
            command.args(["reconstruct", "-i", "points", "--json", "-o"]).arg(&out);
            for view in [first, second] {
                command.arg("--cameras").arg(run(&phantom, names[view]));
            }
            let result = json(command.args(&files).arg("--truth").arg(&truth));
            assert_eq!(result["unit"], "mm");
            let mut eval = Command::cargo_bin("accurate").unwrap();
            eval.arg("eval").arg(out.join("curve.csv")).arg("--truth").arg(&truth);
            eval.arg("--third").arg(run(&phantom, names[third])).arg("--seen").arg(&shown);
            let scores = json(eval.args(["--spacing", "0.2"]));
            let mean = scores["polyline"]["accuracy"].as_f64().unwrap();
            eprintln!(
                "{}+{}, branch {:2}: mean {mean:.2} mm, third view {} {:.2} px",
                names[first],
                names[second],
                index + 1,
                names[third],
                scores["third_view"]["median_px"].as_f64().unwrap(),
            );
            errors.push(mean);
        }
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        eprintln!(
            "{}+{}: {} branches, median {median:.2} mm (floor {floor_mm})",
            names[first],
            names[second],
            errors.len()
        );
        // As in accurate3d's own test of these views: pairs are found here, not given.
        assert!(median < 4.0 * floor_mm, "{median}");
    }
    // The doctor, by reference points snapped to both skeletons: sound as they are; two runs that are
    // no mirror image of each other, exchanged, are found out.
    let doctor = |runs: [usize; 2], data: [usize; 2]| {
        let mut rows = [Vec::new(), Vec::new()];
        for x in branches.iter().flatten() {
            let snapped = data.map(|v| ordered(&views[v].0, &views[v].1, &[*x, *x]));
            if let [Some(p), Some(q)] = snapped.each_ref().map(|points| points.first()) {
                rows[0].push(vec![p.x, p.y]);
                rows[1].push(vec![q.x, q.y]);
            }
        }
        let mut command = Command::cargo_bin("accurate").unwrap();
        command.args(["camera", "doctor", "--json"]);
        command.args(runs.map(|view| run(&phantom, names[view])));
        command.arg("--matched").arg(write("m1.csv", "x,y", &rows[0]));
        json(command.arg(write("m2.csv", "x,y", &rows[1])))
    };
    for data in [[0, 1], [2, 3], [0, 3]] {
        let told = doctor(data, data);
        eprintln!("doctor, {data:?}: {} {} px", told["verdict"], told["residual_px"]);
        assert_eq!(told["verdict"], "sound", "{told}");
    }
    let told = doctor([3, 0], [0, 3]);
    eprintln!("doctor, exchanged: {} {}", told["residual_px"], told["findings"]);
    assert!(told["findings"].to_string().contains("views-swapped"), "{told}");
}
