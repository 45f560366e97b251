//! Real X-ray data, where someone has them: `ACCURATE_DATA`, or `../shared/data` beside the
//! checkout. Not shipped; without them these tests say that they were skipped.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

#[path = "support/shared_data.rs"]
mod shared_data;

use std::path::Path;

use accurate3d::geom::{
    Camera, ImageSize, LengthUnit, Pixel, Point3, Rig, Triangulation, Triangulator,
};
use accurate3d::io::{PairParts, find_pairs, read_matrix3, read_matrix3x4, read_pair};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};
use shared_data::shared_data;

fn camera(dir: &Path, view: &str) -> Camera {
    let k = read_matrix3(&dir.join(format!("K_{view}.txt"))).unwrap();
    let rt = read_matrix3x4(&dir.join(format!("RT_{view}.txt"))).unwrap();
    let r = rt.fixed_view::<3, 3>(0, 0).into_owned();
    let size = ImageSize { width: 1024, height: 1024 };
    Camera::new(k, r, rt.column(3).into_owned(), size).unwrap()
}

#[test]
fn calibration_beads_triangulate_to_a_seventh_of_a_millimetre() {
    let Some(dir) = shared_data("guide3d/beads") else { return };
    let unit = LengthUnit::Centimetre;
    let rig = Rig::new(camera(&dir, "L"), camera(&dir, "R"), unit).unwrap();
    let mut reader = csv::Reader::from_path(dir.join("beads.csv")).unwrap();
    let rows: Vec<[f64; 7]> = reader.deserialize().map(|row| row.unwrap()).collect();
    assert_eq!(rows.len(), 20);
    for method in [Triangulation::Dlt, Triangulation::LindstromNiter2] {
        let triangulator = Triangulator::new(&rig, method);
        let errors_mm: Vec<f64> = rows
            .iter()
            .map(|[x, y, z, u1, v1, u2, v2]| {
                let found =
                    triangulator.triangulate(Pixel::new(*u1, *v1), Pixel::new(*u2, *v2)).unwrap();
                10.0 * (found - Point3::new(*x, *y, *z)).norm()
            })
            .collect();
        let mean = errors_mm.iter().sum::<f64>() / errors_mm.len() as f64;
        eprintln!("beads, {method}: mean error {mean:.4} mm");
        assert!((mean - 0.146).abs() < 0.01, "{method}: {mean}");
    }
}

/// Length between the ends that both views are matched to, and mean epipolar distance: figures of
/// the corner-to-corner method, which forces the tail that only one view sees.
#[test]
fn paper_mode_reconstructs_every_guide3d_pair_corner_to_corner() {
    let Some(dir) = shared_data("guide3d/pairs") else { return };
    let pairs = find_pairs(&dir).unwrap();
    assert_eq!(pairs.len(), 12);
    for dir in pairs {
        let parts = PairParts { points: true, ..PairParts::default() };
        let pair = ViewPair::from(read_pair(&dir, parts).unwrap());
        let curve = reconstruct(&pair, &Params::new(InputKind::Points, Method::Paper)).unwrap();
        let (length_cm, distance) = (curve.length(), curve.diagnostics.mean_epipolar_distance_px);
        eprintln!("{}: {length_cm:.1} cm, mean epipolar distance {distance:.2} px", curve.id);
        assert!((20.0..=26.1).contains(&length_cm), "{}: {length_cm}", curve.id);
        assert!((4.0..=6.1).contains(&distance), "{}: {distance}", curve.id);
    }
}

/// Our own mode finds the direction, leaves the tail that one view alone sees, and agrees.
#[test]
fn accurate_mode_agrees_on_the_part_that_both_views_see() {
    let Some(dir) = shared_data("guide3d/pairs") else { return };
    let mut close = 0;
    for dir in find_pairs(&dir).unwrap() {
        let parts = PairParts { points: true, ..PairParts::default() };
        let pair = ViewPair::from(read_pair(&dir, parts).unwrap());
        let params = |method| Params::new(InputKind::Points, method);
        let ours = reconstruct(&pair, &params(Method::Accurate)).unwrap();
        let paper = reconstruct(&pair, &params(Method::Paper)).unwrap();
        let d = &ours.diagnostics;
        eprintln!(
            "{}: mean epipolar distance {:.2} px, matched {:.1} % / {:.1} %, adjusted: {}",
            ours.id,
            d.mean_epipolar_distance_px,
            100.0 * d.matched_fraction[0],
            100.0 * d.matched_fraction[1],
            d.not_adjusted.as_deref().unwrap_or("yes"),
        );
        close += usize::from(d.mean_epipolar_distance_px <= 0.5);
        assert_eq!(d.view2_reversed, paper.diagnostics.view2_reversed, "{}", ours.id);
        // One view sees more of the wire in every pair; it must not be forced onto the other.
        assert!(d.matched_fraction[0].min(d.matched_fraction[1]) < 0.99, "{}", ours.id);
    }
    assert!(close >= 11, "{close} of 12");
}
