//! Prints the geometry of a pair folder, or of every case of a set:
//! `cargo run -p accurate-io --example print_pair -- FOLDER`
//!
//! Without an argument it writes a small pair to a temporary folder and prints that one.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::{Path, PathBuf};

use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Point3, Rig};
use accurate_io::{PairContents, PairParts, find_pairs, read_pair, write_pair};

fn main() -> Result<(), Box<dyn Error>> {
    let temporary = tempfile::tempdir()?;
    let path = match std::env::args_os().nth(1) {
        Some(path) => PathBuf::from(path),
        None => {
            write_sample(temporary.path())?;
            temporary.path().to_owned()
        }
    };
    for case in find_pairs(&path)? {
        print(&case)?;
    }
    Ok(())
}

fn print(case: &Path) -> Result<(), Box<dyn Error>> {
    let pair = read_pair(case, PairParts::present_in(case))?;
    let (camera1, camera2, unit) = (pair.rig.camera1(), pair.rig.camera2(), pair.rig.unit());
    let axis = |camera: &Camera| camera.r().row(2).transpose();
    println!("{} ({})", pair.case_id, pair.source.as_deref().unwrap_or("source unknown"));
    for (number, camera) in [(1, camera1), (2, camera2)] {
        let (size, c) = (camera.size(), camera.centre());
        println!(
            "  view {number}: {} x {} px, f = ({:.1}, {:.1}) px, centre ({:.2}, {:.2}, {:.2}) {unit}",
            size.width,
            size.height,
            camera.k()[(0, 0)],
            camera.k()[(1, 1)],
            c.x,
            c.y,
            c.z
        );
    }
    println!(
        "  baseline {:.2} {unit}, optical axes {:.1} degrees apart",
        (camera1.centre() - camera2.centre()).norm(),
        axis(camera1).angle(&axis(camera2)).to_degrees()
    );
    if let Some((points1, points2)) = &pair.points {
        println!("  ordered points: {} and {}", points1.len(), points2.len());
    }
    if let Some(masks) = &pair.masks {
        let [a, b] = masks.each_ref().map(|m| m.iter().filter(|v| **v).count());
        println!("  masks: {a} and {b} foreground pixels");
    }
    if let Some(truth) = &pair.truth {
        let length: f64 = truth.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        println!("  truth: {} points, {length:.2} {unit}", truth.len());
    }
    Ok(())
}

/// A quarter turn of radius 50 mm, seen by two cameras 60 degrees apart.
fn write_sample(folder: &Path) -> Result<(), Box<dyn Error>> {
    let size = ImageSize { width: 512, height: 512 };
    let k = Matrix3::new(1200.0, 0.0, 256.0, 0.0, 1200.0, 256.0, 0.0, 0.0, 1.0);
    let camera = |angle_deg: f64| {
        let r = Rotation3::from_axis_angle(&Vector3::y_axis(), angle_deg.to_radians());
        Camera::new(k, r.into_inner(), Vector3::new(0.0, 0.0, 1200.0), size)
    };
    let rig = Rig::new(camera(0.0)?, camera(60.0)?, LengthUnit::Millimetre)?;
    let truth: Vec<Point3> = (0..=90)
        .map(|deg| f64::from(deg).to_radians())
        .map(|a| Point3::new(50.0 * a.cos(), 50.0 * a.sin(), 10.0 * a))
        .collect();
    let projected: Result<Vec<_>, _> = truth.iter().map(|p| rig.project(p)).collect();
    let contents = PairContents {
        case_id: "quarter-turn".into(),
        points: Some(projected?.into_iter().unzip()),
        masks: None,
        images: None,
        truth: Some(truth),
        source: Some("written by this example".into()),
        rig,
    };
    Ok(write_pair(&folder.join("case_0"), &contents)?)
}
