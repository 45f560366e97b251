//! Two masks of a bent wire and a rough guess become a curve, a judgement and an uncertainty.
//!
//! `cargo run -p accurate-fit --example outlines`
#![allow(clippy::print_stdout)]

use accurate_fit::{
    AdaptiveParams, Outline, OutlineFitParams, OutlinePair, fit_outlines_adaptively,
};
use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{Camera, Curve3, ImageSize, LengthUnit, Point3, Rig, View1, View2};
use ndarray::Array2;

/// A wire of three quarters of a turn.
fn wire(s: f64) -> Point3 {
    let angle = 4.7 * s;
    Point3::new(60.0 * angle.cos(), 60.0 * angle.sin(), 80.0 * (s - 0.5))
}

/// Pixels within 1.5 px of the projected wire.
fn mask(camera: &Camera) -> Result<Array2<bool>, Box<dyn std::error::Error>> {
    let mut mask = Array2::from_elem((256, 256), false);
    for k in 0..=4000 {
        let p = camera.project(&wire(f64::from(k) / 4000.0))?;
        for dy in -2i32..=2 {
            for dx in -2i32..=2 {
                let (x, y) = (p.x.round() + f64::from(dx), p.y.round() + f64::from(dy));
                if (x - p.x).hypot(y - p.y) <= 1.5 {
                    mask[[y as usize, x as usize]] = true;
                }
            }
        }
    }
    Ok(mask)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let size = ImageSize { width: 256, height: 256 };
    let k = Matrix3::new(600.0, 0.0, 128.0, 0.0, 600.0, 128.0, 0.0, 0.0, 1.0);
    let away = Vector3::new(0.0, 0.0, 500.0);
    let tilt = *Rotation3::from_axis_angle(&Vector3::x_axis(), 0.4).matrix();
    let turn = *Rotation3::from_axis_angle(&Vector3::y_axis(), 1.3).matrix();
    let rig = Rig::new(
        Camera::new(k, tilt, away, size)?,
        Camera::new(k, turn * tilt, away, size)?,
        LengthUnit::Millimetre,
    )?;
    let outline1 = Outline::<View1>::from_mask(mask(rig.camera1())?.view())?;
    let outline2 = Outline::<View2>::from_mask(mask(rig.camera2())?.view())?;

    // Three millimetres off, as a tracer and a matcher might leave it.
    let guess: Vec<Point3> = (0..=40)
        .map(|i| {
            let s = f64::from(i) / 40.0;
            wire(s) + Vector3::new((9.0 * s).sin(), (7.0 * s).cos(), (8.0 * s).sin()) * 1.7
        })
        .collect();
    let fit = fit_outlines_adaptively(
        &Curve3::interpolate(&guess)?,
        &OutlinePair::new(&outline1, &outline2),
        &rig,
        &OutlineFitParams::DEFAULT,
        &AdaptiveParams::DEFAULT,
    )?;

    let j = fit.judgement;
    println!(
        "half thickness  {:.2} and {:.2} px",
        fit.half_thickness_px[0], fit.half_thickness_px[1]
    );
    println!("unexplained     {:.2}, outside {:.2}", j.unexplained, j.outside);
    println!("misfit          {:.4} px² per point (1/18 = 0.0556 at the truth)", j.chi_per_point());
    let (start, end) = fit.curve.domain();
    for i in 0..=4 {
        let t = start + (end - start) * f64::from(i) / 4.0;
        let p = fit.curve.at(t);
        let off = (0..=4000).map(|k| (wire(f64::from(k) / 4000.0) - p).norm());
        let off = off.fold(f64::INFINITY, f64::min);
        let sigma =
            fit.covariance.as_ref().map_or(f64::NAN, |c| c.across(&fit.curve, t).1.trace().sqrt());
        println!("at {:7.2} {:7.2} {:7.2} mm: off {off:.3}, sigma {sigma:.3}", p.x, p.y, p.z);
    }
    Ok(())
}
