//! What the X-ray-like pictures keep.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_geom::{Point2, Point3};
use accurate_synth::{
    CaseOptions, Family, SynthCase, XrayOptions, XrayResponse, generate, render_xray,
};

fn case(family: Family, index: u64) -> SynthCase {
    generate(family, 11, index, &CaseOptions::default()).unwrap()
}

/// No anatomy, no blur, hardly any noise: 1e6 photons are known to 0.1 %.
const CLEAN: XrayOptions = XrayOptions {
    dose_photons_per_px: 1e6,
    contrast: 0.5,
    blur_sigma_px: 0.0,
    background: 0.0,
    readout_noise_photons: 0.0,
    response: XrayResponse::Linear,
};

#[test]
fn the_same_case_gives_the_same_picture() {
    let case = case(Family::Carm, 0);
    let pictures = render_xray(&case, &XrayOptions::default());
    assert_eq!(pictures, render_xray(&case.clone(), &XrayOptions::default()));
    assert_ne!(pictures[0], pictures[1]);
    assert_eq!(pictures[0].dim(), (500, 500));
}

#[test]
fn every_family_shows_its_wire_darker_than_its_surroundings() {
    for family in Family::ALL {
        let case = case(family, 1);
        let options = XrayOptions { contrast: 0.45, ..XrayOptions::default() };
        let with = render_xray(&case, &options);
        let without = render_xray(&case, &XrayOptions { contrast: 0.0, ..options });
        for view in 0..2 {
            let camera = [case.true_rig.camera1(), case.true_rig.camera2()][view];
            let (mut sum, mut count) = (0.0, 0.0);
            for x in case.truth.iter().step_by(10) {
                let p = camera.project(x).unwrap();
                let at = [p.y.round() as usize, p.x.round() as usize];
                sum += f64::from(without[view][at]) - f64::from(with[view][at]);
                count += 1.0;
            }
            // Even the 0.35 mm wire of a C-arm, 0.74 px wide and blurred, takes 10 % off: 0.1 of
            // 3.5 natural logarithms on a scale of 50,000.
            assert!(sum / count > 0.1 / 3.5 * 50_000.0, "{family} {view}: {}", sum / count);
        }
    }
}

#[test]
fn strands_that_cross_add_up() {
    // A planar loop across the view direction of camera 1: the two straight arms cross at the
    // centre at a right angle.
    let mut case = case(Family::Easy, 0);
    case.wire_radius = 6.0;
    let corner = |y: f64, z: f64| Point3::new(0.0, y, z);
    let corners =
        [corner(-100.0, -100.0), corner(60.0, 60.0), corner(60.0, -60.0), corner(-100.0, 100.0)];
    case.truth = corners
        .windows(2)
        .flat_map(|w| (0..400).map(move |k| w[0] + (w[1] - w[0]) * (f64::from(k) / 400.0)))
        .collect();
    let [picture, _] = render_xray(&case, &CLEAN);
    let relative = |y: f64, z: f64| {
        let p: Point2 = case.true_rig.camera1().project(&corner(y, z)).unwrap();
        f64::from(picture[[p.y.round() as usize, p.x.round() as usize]]) / 50_000.0
    };
    // Through the middle of one strand half the photons pass, through both a quarter. The pixel
    // centre may be 0.71 px off the axis: the chord is shorter by 1 - sqrt(1 - (1.21 / 6)²) = 2 %
    // at most, which is 1.5 % of the photons per strand; the oblique view adds 0.3 %.
    assert!((relative(-50.0, -50.0) - 0.5).abs() < 0.012, "{}", relative(-50.0, -50.0));
    assert!((relative(0.0, 0.0) - 0.25).abs() < 0.012, "{}", relative(0.0, 0.0));
    assert!((relative(-50.0, 0.0) - 1.0).abs() < 0.006, "{}", relative(-50.0, 0.0));
}

#[test]
fn a_gap_is_not_in_the_picture_and_a_disc_is() {
    let options = CaseOptions { gaps: 1..=1, gap_length_px: 30.0..=30.0, ..CaseOptions::default() };
    let gapped = generate(Family::Easy, 11, 2, &options).unwrap();
    let [picture, _] = render_xray(&gapped, &CLEAN);
    let curve: Vec<Point2> =
        gapped.truth.iter().map(|x| gapped.true_rig.camera1().project(x).unwrap()).collect();
    let (mut arc, middle) = (0.0, (gapped.gaps[0][0].0 + gapped.gaps[0][0].1) / 2.0);
    for w in curve.windows(2) {
        arc += (w[1] - w[0]).norm();
        if arc > middle {
            let at = [w[0].y.round() as usize, w[0].x.round() as usize];
            assert!(picture[at] > 49_000);
            break;
        }
    }

    let options = CaseOptions { occlusion_discs: 1..=1, ..CaseOptions::default() };
    let covered = generate(Family::Easy, 11, 2, &options).unwrap();
    let [picture, _] = render_xray(&covered, &CLEAN);
    let disc = covered.occlusions[0][0];
    assert!(picture[[disc.y.round() as usize, disc.x.round() as usize]] < 5_000);
}

#[test]
fn senseless_options_are_moved_into_range() {
    let case = case(Family::Easy, 0);
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let options = XrayOptions {
            dose_photons_per_px: bad,
            contrast: bad,
            blur_sigma_px: bad,
            background: bad,
            readout_noise_photons: bad,
            response: XrayResponse::Log,
        };
        assert!(options.check().is_err());
        assert_eq!(render_xray(&case, &options)[0].dim(), (512, 512));
    }
}

#[test]
fn the_noise_is_that_of_the_photons() {
    let case = case(Family::Easy, 0);
    let options = XrayOptions { dose_photons_per_px: 100.0, contrast: 0.0, ..CLEAN };
    let [picture, _] = render_xray(&case, &options);
    let photons = picture.mapv(|value| f64::from(value) / 500.0);
    let n = photons.len() as f64;
    let mean = photons.sum() / n;
    let variance = photons.mapv(|p| (p - mean).powi(2)).sum() / (n - 1.0);
    // Poisson of 100 cut at 131 photons by the 16-bit range (3 sigma): mean and variance lose
    // little. Standard errors at 262,144 pixels: 0.02 and 0.28.
    assert!((mean - 100.0).abs() < 0.1, "{mean}");
    assert!((variance - 100.0).abs() < 2.0, "{variance}");
}
