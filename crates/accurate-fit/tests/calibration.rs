//! The boundary fit under a wrong calibration of view 2.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use accurate_fit::{
    AdaptiveParams, CalibratedFit, CalibrationPriors, Outline, OutlineFitParams, OutlinePair,
    fit_outlines_adaptively, fit_outlines_and_calibration,
};
use accurate_geom::nalgebra::{Matrix3, Vector2};
use accurate_geom::{Camera, Distortion, Rig, View1, View2};
use accurate_synth::{CalibrationError, CaseOptions, Family, SynthCase, generate};
use support::{curve_through, deviation, px_per_unit};

const SEED: u64 = 1902;

fn fitted(case: &SynthCase, rig: &Rig) -> CalibratedFit {
    let one = Outline::<View1>::from_mask(case.masks[0].view()).unwrap();
    let two = Outline::<View2>::from_mask(case.masks[1].view()).unwrap();
    fit_outlines_and_calibration(
        &curve_through(&case.truth),
        &OutlinePair::new(&one, &two),
        rig,
        &OutlineFitParams::DEFAULT,
        &AdaptiveParams::DEFAULT,
        &CalibrationPriors::DEFAULT,
    )
    .unwrap()
}

/// Unit direction in image 2 along the epipolar line of the middle of the truth.
fn epipolar_direction(case: &SynthCase, rig: &Rig) -> Vector2<f64> {
    let middle = &case.truth[case.truth.len() / 2];
    let (p1, _) = rig.project(middle).unwrap();
    let line = rig.fundamental().transpose().line(p1).unwrap();
    Vector2::new(-line.coefficients().y, line.coefficients().x)
}

#[test]
fn an_exact_calibration_is_left_alone() {
    for index in 0..4 {
        let case = generate(Family::Medium, SEED, index, &CaseOptions::default()).unwrap();
        let found = fitted(&case, &case.rig).calibration;
        let across = Vector2::from(found.observed).dot(&Vector2::from(found.shift_px));
        // Five standard deviations of the estimate.
        assert!(across.abs() < 5.0 * found.observed_sigma_px, "{found:?}");
        // A roll can stand in for a part of the shift where the body is off the image's middle.
        assert!(found.observed_sigma_px < 0.25, "{found:?}");
    }
}

#[test]
fn the_shift_along_epipolar_lines_is_reported_as_unobserved() {
    for (family, index) in [(Family::Easy, 0), (Family::Medium, 1), (Family::Carm, 0)] {
        let case = generate(family, SEED, index, &CaseOptions::default()).unwrap();
        let found = fitted(&case, &case.rig).calibration;
        let along = epipolar_direction(&case, &case.rig);
        // Epipolar lines of a finite rig fan out by up to some 10 degrees over the body.
        let cosine = Vector2::from(found.unobserved).dot(&along).abs();
        assert!(cosine > 0.95, "{} {cosine} {found:?}", case.id);
        // Nothing is learnt there: the prior stays.
        assert!((0.6..=0.71).contains(&found.unobserved_sigma_px), "{found:?}");
    }
}

#[test]
fn a_shift_across_epipolar_lines_is_found_and_removed() {
    for index in 0..4 {
        let case = generate(Family::Medium, SEED, index, &CaseOptions::default()).unwrap();
        let along = epipolar_direction(&case, &case.rig);
        let across = Vector2::new(-along.y, along.x);
        let mut k: Matrix3<f64> = *case.rig.camera2().k();
        // The nominal principal point is 0.8 px off: the image is shifted by -0.8 px against it.
        k[(0, 2)] += 0.8 * across.x;
        k[(1, 2)] += 0.8 * across.y;
        let c = case.rig.camera2();
        // Pixels are undistorted, but their camera knows its lens.
        let lens = Distortion { k1: 0.01, ..Distortion::default() };
        let camera2 = Camera::new(k, *c.r(), *c.t(), c.size()).unwrap();
        let camera2 = camera2.with_distortion(lens).unwrap();
        let nominal = Rig::new(case.rig.camera1().clone(), camera2, case.rig.unit()).unwrap();
        let found = fitted(&case, &nominal);
        let estimate = Vector2::from(found.calibration.shift_px).dot(&across);
        let sigma = found.calibration.observed_sigma_px;
        assert!(sigma < 0.25, "{:?}", found.calibration);
        assert!((estimate + 0.8).abs() < 4.0 * sigma, "{} {estimate} {sigma}", case.id);
        // Up to that the corrected rig is the true one again, and the curve explains the outlines.
        let corrected = found.calibration.correct(&nominal).unwrap();
        assert_eq!(corrected.camera2().distortion(), Some(&lens));
        let dk = corrected.camera2().k() - c.k();
        assert!(across.dot(&Vector2::new(dk[(0, 2)], dk[(1, 2)])).abs() < 4.0 * sigma);
        assert!(found.fit.judgement.unexplained < 0.1, "{:?}", found.fit.judgement);
    }
}

#[test]
fn a_turned_camera_costs_less_with_the_nuisance_than_without() {
    let options = CaseOptions {
        calibration_error: Some(CalibrationError { rotation_deg: 0.05, shift_px: 0.0 }),
        ..CaseOptions::default()
    };
    let (mut with, mut without) = (0.0, 0.0);
    for index in 0..6 {
        let case = generate(Family::Medium, SEED, index, &options).unwrap();
        let one = Outline::<View1>::from_mask(case.masks[0].view()).unwrap();
        let two = Outline::<View2>::from_mask(case.masks[1].view()).unwrap();
        let pair = OutlinePair::new(&one, &two);
        let params = OutlineFitParams::DEFAULT;
        let truth = curve_through(&case.truth);
        let plain =
            fit_outlines_adaptively(&truth, &pair, &case.rig, &params, &AdaptiveParams::DEFAULT);
        let found = fitted(&case, &case.rig);
        let scale = px_per_unit(&case);
        without += deviation(&plain.unwrap().curve, &case.truth).0 * scale;
        with += deviation(&found.fit.curve, &case.truth).0 * scale;
    }
    assert!(with < without, "{with} {without}");
    // 0.05 degrees are 1 px; what is left is the part along the epipolar lines, about 0.6 px of
    // depth on average over random axes, seen at 60 to 100 degrees.
    assert!(with / 6.0 < 0.8, "{}", with / 6.0);
}
