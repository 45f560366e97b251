//! The real C-arm phantom, where someone has it: two-view reconstructions of its tubes against the
//! published 3D centreline, and against a view that took no part.
//!
//! Ordered points come from the skeleton of each view's threshold mask: the reference says which
//! skeleton pixels belong to a branch and in which order, not which pixel of one view belongs to
//! which of the other. With those pairs given too, the least error that the skeletons allow is
//! 0.55 mm (IM1 and IM2) and 0.49 mm (IM3 and IM4).
#![allow(clippy::unwrap_used, clippy::print_stderr)]

#[path = "support/shared_data.rs"]
mod shared_data;

use std::path::Path;

use accurate3d::eval::curve_scores;
use accurate3d::fit::CalibrationPriors;
use accurate3d::geom::nalgebra::Matrix3x4;
use accurate3d::geom::{Camera, ImageSize, LengthUnit, Pixel, Point2, Point3, Rig, View};
use accurate3d::io::read_mask;
use accurate3d::seg::{Mask, Skeleton};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};
use serde_json::Value;
use shared_data::shared_data;

/// A reference point farther than this from the skeleton is not seen by the threshold mask, px.
const SEEN_PX: f64 = 6.0;

struct XaView {
    camera: Camera,
    skeleton: Vec<Point2>,
}

impl XaView {
    fn read(dir: &Path, geometry: &Value, name: &str) -> Self {
        let p = &geometry["views"][name]["P"];
        let p = Matrix3x4::from_fn(|row, column| p[row][column].as_f64().unwrap());
        let size = ImageSize { width: 512, height: 512 };
        let mask = read_mask(&dir.join(format!("{name}_thresholdmask.png"))).unwrap();
        let skeleton = Skeleton::of(&Mask::from_array(mask).unwrap()).unwrap();
        let points = skeleton.pixels().iter().map(|&(y, x)| Point2::new(x as f64, y as f64));
        Self {
            camera: Camera::from_projection_matrix(&p, size).unwrap(),
            skeleton: points.collect(),
        }
    }

    fn distance_to_skeleton(&self, p: &Point2) -> (f64, Point2) {
        let nearest = self
            .skeleton
            .iter()
            .min_by(|a, b| (*a - p).norm_squared().total_cmp(&(*b - p).norm_squared()));
        let nearest = *nearest.unwrap();
        ((nearest - p).norm(), nearest)
    }

    /// The skeleton pixels along a branch, in its order, each once.
    fn ordered<V: View>(&self, branch: &[Point3]) -> Vec<Pixel<V>> {
        let mut points: Vec<Point2> = Vec::new();
        for w in branch.windows(2) {
            for k in 0..32 {
                let x = w[0] + (w[1] - w[0]) * (f64::from(k) / 32.0);
                let (distance, pixel) =
                    self.distance_to_skeleton(&self.camera.project(&x).unwrap());
                if distance <= SEEN_PX && !points.contains(&pixel) {
                    points.push(pixel);
                }
            }
        }
        points.into_iter().map(Pixel::from).collect()
    }
}

fn branches(dir: &Path) -> Vec<Vec<Point3>> {
    let mut reader = csv::Reader::from_path(dir.join("reference_world_mm.csv")).unwrap();
    let mut branches: Vec<Vec<Point3>> = Vec::new();
    for row in reader.deserialize() {
        let (branch, x, y, z): (usize, f64, f64, f64) = row.unwrap();
        if branches.len() < branch {
            branches.push(Vec::new());
        }
        branches[branch - 1].push(Point3::new(x, y, z));
    }
    branches
}

#[test]
fn branches_of_the_phantom_come_back_near_the_floor_of_their_skeletons() {
    let Some(dir) = shared_data("xa-phantom/derived") else { return };
    let text = std::fs::read_to_string(dir.join("geometry.json")).unwrap();
    let geometry: Value = serde_json::from_str(&text).unwrap();
    let branches = branches(&dir);
    assert_eq!(branches.len(), 11);
    for (first, second, third, floor_mm) in
        [("IM1", "IM2", "IM4", 0.55), ("IM3", "IM4", "IM1", 0.49)]
    {
        let [a, b, c] = [first, second, third].map(|name| XaView::read(&dir, &geometry, name));
        let rig = Rig::new(a.camera.clone(), b.camera.clone(), LengthUnit::Millimetre).unwrap();
        let estimated = Some(CalibrationPriors::DEFAULT);
        for (method, calibration, name) in [
            (Method::Paper, None, "paper"),
            (Method::Accurate, None, "accurate"),
            // The published cameras and the skeletons together are 0 to 4 px off across the epipolar
            // lines, by branch.
            (Method::Accurate, estimated, "accurate, calibration estimated"),
        ] {
            let mut errors = Vec::new();
            for (index, branch) in branches.iter().enumerate() {
                let points = (a.ordered(branch), b.ordered(branch));
                if points.0.len() < 20 || points.1.len() < 20 {
                    eprintln!("{first}+{second}, branch {}: not seen by the masks", index + 1);
                    continue;
                }
                let id = format!("branch-{}", index + 1);
                let pair = ViewPair { points: Some(points), ..ViewPair::new(id, rig.clone()) };
                let mut params = Params::new(InputKind::Points, method);
                params.robust.calibration = calibration;
                let curve = reconstruct(&pair, &params).unwrap();
                let positions = curve.positions();
                let scores = curve_scores(&positions, branch, 0.2).unwrap();
                let third_view: Vec<f64> = positions
                    .iter()
                    .map(|x| c.distance_to_skeleton(&c.camera.project(x).unwrap()).0)
                    .collect();
                let third_px = third_view.iter().sum::<f64>() / third_view.len() as f64;
                eprintln!(
                    "{first}+{second}, {name}, branch {:2}: mean {:.2} mm, max {:.2} mm, third \
                     view {third} {third_px:.2} px",
                    index + 1,
                    scores.accuracy,
                    scores.max_reconstruction_to_truth,
                );
                errors.push(scores.accuracy);
            }
            errors.sort_by(f64::total_cmp);
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            let median = errors[errors.len() / 2];
            eprintln!(
                "{first}+{second}, {name}: {} branches, mean {mean:.2} mm, median {median:.2} mm \
                 (floor {floor_mm})",
                errors.len()
            );
            // The pairs are found here, not given; tangent stretches of thick tubes leave their
            // depth open, and where tubes cross the reference snaps to the wrong one's skeleton.
            assert!(median < 4.0 * floor_mm, "{first}+{second}, {name}: {median}");
        }
    }
}
