//! Real biplane X-ray pairs (Guide3D), where a copy is at hand.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

use std::path::{Path, PathBuf};

use accurate_geom::{ImageSize, LengthUnit};
use accurate_io::{PairParts, Truth, find_pairs, read_curve, read_pair};

/// `ACCURATE_DATA`, else `shared/data` beside the workspace.
fn data() -> PathBuf {
    std::env::var_os("ACCURATE_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    )
}

#[test]
fn all_guide3d_pairs_are_read() {
    let set = data().join("guide3d/pairs");
    if !set.is_dir() {
        println!("skipped: no guide3d data");
        return;
    }
    let cases = find_pairs(&set).unwrap();
    assert_eq!(cases.len(), 12);
    for (i, case) in cases.iter().enumerate() {
        let needs = PairParts { points: true, truth: Truth::IfPresent, ..PairParts::default() };
        let pair = read_pair(case, needs).unwrap();
        assert_eq!(pair.case_id, format!("case_{i:03}"));
        assert_eq!(pair.rig.unit(), LengthUnit::Centimetre);
        assert_eq!(pair.size, [ImageSize { width: 1024, height: 1024 }; 2]);
        assert_eq!(pair.truth, None);
        // The data's description gives 93.8 degrees between the optical axes.
        let axis = |c: &accurate_geom::Camera| c.r().row(2).transpose();
        let angle = axis(pair.rig.camera1()).dot(&axis(pair.rig.camera2())).acos().to_degrees();
        assert!((angle - 93.8).abs() < 0.05, "{angle}");
        let (points1, points2) = pair.points.unwrap();
        assert!(points1.len() > 100 && points2.len() > 100, "{}", case.display());
        // Resampled at 1 px: no step is far from it.
        assert!(points1.windows(2).all(|w| w[0].distance(w[1]) < 1.5));
        assert!(points2.windows(2).all(|w| w[0].distance(w[1]) < 1.5));
    }
    println!("read {} guide3d pairs", cases.len());
}

#[test]
fn a_reference_curve_with_further_columns_is_read() {
    let path = data().join("xa-phantom/derived/reference_world_mm.csv");
    if !path.is_file() {
        println!("skipped: no xa-phantom data");
        return;
    }
    let curve = read_curve(&path).unwrap();
    assert_eq!(curve.points.len(), 464);
    assert!(curve.column("branch").is_some());
}
