//! How often the 95 % ellipse across a fitted curve is passed by the true curve.
//!
//! `cargo run --release -p accurate-fit --example coverage -- WIRES_PER_FAMILY [SEED]`
//!
//! Fits to masks start at the truth: right topology is given, as the covariance takes it to be.
#![allow(clippy::print_stdout)]

use accurate_fit::{
    AdaptiveParams, CurveCovariance, Outline, OutlineFitParams, OutlinePair,
    fit_outlines_adaptively,
};
use accurate_geom::nalgebra::Vector2;
use accurate_geom::{Curve3, Point3, View1, View2};
use accurate_synth::{CaseOptions, Family, generate};

/// 95 % quantile of chi² with 2 degrees of freedom.
const CHI2_95: f64 = 5.991;
const PLACES: usize = 60;

/// Places of `PLACES` inside the curve whose ellipse the truth passes.
fn covered(curve: &Curve3, covariance: &CurveCovariance, truth: &[Point3]) -> usize {
    let (start, end) = curve.domain();
    (1..=PLACES)
        .filter(|k| {
            let t = start + (end - start) * *k as f64 / (PLACES + 1) as f64;
            let p = curve.at(t);
            let (axes, spread) = covariance.across(curve, t);
            let nearest = truth.windows(2).map(|w| {
                let e = w[1] - w[0];
                let s = ((p - w[0]).dot(&e) / e.norm_squared()).clamp(0.0, 1.0);
                w[0] + e * s - p
            });
            let off = nearest.min_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
            let e = Vector2::new(axes[0].dot(&off), axes[1].dot(&off));
            spread.try_inverse().is_some_and(|inverse| e.dot(&(inverse * e)) <= CHI2_95)
        })
        .count()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let count: u64 = arguments.next().map_or(Ok(10), |a| a.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1905), |a| a.parse())?;
    let (mut hits, mut places) = (0, 0);
    for family in Family::ALL {
        let mut inside = 0;
        for index in 0..count {
            let case = generate(family, seed, index, &CaseOptions::default())?;
            let one = Outline::<View1>::from_mask(case.masks[0].view())?;
            let two = Outline::<View2>::from_mask(case.masks[1].view())?;
            let points: Vec<Point3> = case.truth.iter().step_by(13).copied().collect();
            let fit = fit_outlines_adaptively(
                &Curve3::interpolate(&points)?,
                &OutlinePair::new(&one, &two),
                &case.rig,
                &OutlineFitParams::DEFAULT,
                &AdaptiveParams::DEFAULT,
            )?;
            if let Some(covariance) = &fit.covariance {
                inside += covered(&fit.curve, covariance, &case.truth);
            }
        }
        println!("{family:10} {:.3}", inside as f64 / (count as usize * PLACES) as f64);
        hits += inside;
        places += count as usize * PLACES;
    }
    println!("{:10} {:.3} over {} wires", "all", hits as f64 / places as f64, places / PLACES);
    Ok(())
}
