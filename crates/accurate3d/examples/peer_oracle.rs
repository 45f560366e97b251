//! Writes inputs and our answers to a folder, for `benchmarks/peers/check.py` to compare with other
//! people's tools: `cargo run --release -p accurate3d --example peer_oracle -- OUT`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

use std::path::PathBuf;

use accurate3d::eval::table_scores;
use accurate3d::geom::{Fundamental, Triangulation, Triangulator, View1, View2};
use accurate3d::io::{
    CurveTable, write_curve, write_json, write_mask, write_matrix3, write_points,
};
use accurate3d::matching::{CurveMatcher, Ecdp, EcdpParams};
use accurate3d::seg::{Mask, zhang_suen};
use accurate3d::synth::{CaseOptions, Family, generate};
use serde_json::json;

const CASES: u64 = 5;

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("give the output folder"));
    for family in [Family::SimPaper, Family::Hard, Family::Carm] {
        for index in 0..CASES {
            let case = generate(family, 1000, index, &CaseOptions::default()).unwrap();
            let dir = out.join(&case.id);
            std::fs::create_dir_all(&dir).unwrap();
            let rig = &case.rig;
            for (mask, name) in case.masks.iter().zip(["L", "R"]) {
                let mask = Mask::from_array(mask.clone()).unwrap();
                write_mask(&dir.join(format!("mask_{name}.png")), mask.as_array()).unwrap();
                let thin = zhang_suen(&mask);
                write_mask(&dir.join(format!("thin_{name}.png")), thin.as_array()).unwrap();
            }
            let (p1, p2) = &case.rounded_points;
            write_points::<View1>(&dir.join("points_L.csv"), p1).unwrap();
            write_points::<View2>(&dir.join("points_R.csv"), p2).unwrap();
            let f: &Fundamental<View1, View2> = rig.fundamental();
            write_matrix3(&dir.join("F.txt"), f.matrix()).unwrap();
            let lines: Vec<[f64; 3]> =
                p2.iter().map(|&p| (*f.line(p).unwrap().coefficients()).into()).collect();
            let ecdp = Ecdp { params: EcdpParams::PAPER };
            let matched = ecdp.reconstruct(p1, p2, rig).unwrap();
            let curve: Vec<_> = matched.points.iter().map(|p| p.position).collect();
            let cost: f64 =
                matched.pairs.iter().map(|&(i, j)| f.line(p2[j]).unwrap().distance(p1[i])).sum();
            let dlt = Triangulator::new(rig, Triangulation::Dlt);
            let triangulated: Vec<_> = matched
                .pairs
                .iter()
                .map(|&(i, j)| dlt.triangulate(p1[i], p2[j]).unwrap())
                .collect();
            let table = |points| CurveTable { unit: rig.unit(), points, columns: vec![] };
            write_curve(&dir.join("dlt.csv"), &table(triangulated)).unwrap();
            write_curve(&dir.join("curve.csv"), &table(curve.clone())).unwrap();
            write_curve(&dir.join("truth.csv"), &table(case.truth.clone())).unwrap();
            let scores = table_scores(&curve, &case.truth).unwrap();
            let projection = |camera: &accurate3d::geom::Camera| -> Vec<Vec<f64>> {
                let p = camera.projection_matrix();
                (0..3).map(|r| (0..4).map(|c| p[(r, c)]).collect()).collect()
            };
            let answers = json!({
                "P1": projection(rig.camera1()),
                "P2": projection(rig.camera2()),
                "lines_in_view_1": lines,
                "pairs": matched.pairs,
                "path_cost": cost,
                "accuracy": scores.accuracy,
                "completeness": scores.completeness,
                "max_error": scores.max_error,
            });
            write_json(&dir.join("answers.json"), &answers).unwrap();
        }
    }
    println!("{} cases in {}", 3 * CASES, out.display());
}
