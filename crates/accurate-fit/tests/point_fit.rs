//! Bundle adjustment of ordered points.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use accurate_fit::{FitError, PointFit, PointFitParams, fit_points};
use accurate_geom::{Pixel, View1, View2};
use accurate_synth::{CaseOptions, Family, SynthCase, generate};
use support::{deviation, distances_across, integers, match_points, px_per_unit};

const SEED: u64 = 1903;

fn case(family: Family, index: u64) -> SynthCase {
    generate(family, SEED, index, &CaseOptions::default()).unwrap()
}

fn fitted(case: &SynthCase, one: &[Pixel<View1>], two: &[Pixel<View2>]) -> PointFit {
    let pairs = match_points(one, two, &case.rig);
    fit_points(one, two, &pairs, &case.rig, &PointFitParams::DEFAULT).unwrap()
}

#[test]
fn exact_points_give_the_curve_to_a_hundredth_of_a_pixel() {
    for family in [Family::Medium, Family::Helix, Family::Tangency] {
        for index in 0..4 {
            let case = case(family, index);
            let (one, two) = &case.exact_points;
            let fit = fitted(&case, one, two);
            let scale = px_per_unit(&case);
            let (mean, max) = deviation(&fit.curve, &case.truth);
            assert!(mean * scale < 0.01 && max * scale < 0.1, "{} {mean} {max}", case.id);
            assert!(fit.noise_px < 0.01, "{} {}", case.id, fit.noise_px);
        }
    }
}

#[test]
fn integer_points_give_the_curve_to_a_fraction_of_their_rounding() {
    let (mut mean, mut max) = (0.0, 0.0);
    for index in 0..8 {
        let case = case(Family::Medium, index);
        let fit = fitted(&case, &integers(&case.exact_points.0), &integers(&case.exact_points.1));
        // 1/sqrt(12), known from the coordinates being integers.
        assert!((fit.noise_px - 0.288_675).abs() < 1e-5);
        let scale = px_per_unit(&case);
        let (a, b) = deviation(&fit.curve, &case.truth);
        mean += a * scale / 8.0;
        max += b * scale / 8.0;
    }
    assert!(mean < 0.15 && max < 1.0, "{mean} {max}");
}

#[test]
fn the_noise_of_points_is_found_from_their_residuals() {
    let mut worst = 1.0f64;
    for index in 0..4 {
        let case = case(Family::Medium, index);
        // Uniform noise of standard deviation 0.2 px, from a fixed sequence (Weyl).
        let noisy = |k: usize, c: f64| {
            let u = ((k as f64 + 1.0) * c).fract() - 0.5;
            u * 0.2 * 12f64.sqrt()
        };
        let (phi, root) = (0.618_033_988_749_895, 0.754_877_666_246_693);
        let one: Vec<Pixel<View1>> = (case.exact_points.0.iter().enumerate())
            .map(|(k, p)| Pixel::new(p.x + noisy(k, phi), p.y + noisy(k, root)))
            .collect();
        let two: Vec<Pixel<View2>> = (case.exact_points.1.iter().enumerate())
            .map(|(k, p)| Pixel::new(p.x + noisy(k, root), p.y + noisy(k + 5, phi)))
            .collect();
        let noise = fitted(&case, &one, &two).noise_px;
        worst = worst.max((noise / 0.2).max(0.2 / noise));
    }
    // Some 600 residuals: 3 %; a low-discrepancy sequence is not white, which the spline may follow.
    assert!(worst < 1.25, "{worst}");
}

#[test]
fn parameters_are_in_order_and_points_lie_near_them() {
    let case = case(Family::Hard, 1);
    let (one, two) = &case.exact_points;
    let fit = fitted(&case, one, two);
    for parameters in &fit.parameters {
        assert!(parameters.windows(2).all(|w| w[0] <= w[1]));
    }
    for (p, u) in one.iter().zip(&fit.parameters[0]) {
        let q = case.rig.project(&fit.curve.at(*u)).unwrap().0;
        // 1 px apart in the data; along the curve the foot is half of that off at most.
        assert!(p.distance(q) < 0.5, "{p:?} {q:?}");
    }
    assert!(fit.rms_px[1] <= fit.rms_px[0]);
}

#[test]
fn exchanging_the_views_gives_the_same_curve() {
    let case = case(Family::Medium, 2);
    let (one, two) = (integers(&case.exact_points.0), integers(&case.exact_points.1));
    let pairs = match_points(&one, &two, &case.rig);
    let params = PointFitParams::DEFAULT;
    let here = fit_points(&one, &two, &pairs, &case.rig, &params).unwrap();
    let swapped1: Vec<Pixel<View1>> = two.iter().map(|p| Pixel::new(p.x, p.y)).collect();
    let swapped2: Vec<Pixel<View2>> = one.iter().map(|p| Pixel::new(p.x, p.y)).collect();
    let turned: Vec<(usize, usize)> = pairs.iter().map(|&(i, j)| (j, i)).collect();
    let there = fit_points(&swapped1, &swapped2, &turned, &case.rig.swapped(), &params).unwrap();
    for (a, b) in here.curve.sample(100).iter().zip(there.curve.sample(100)) {
        assert!((a - b).norm() < 1e-3, "{a} {b}");
    }
}

/// The law by which one of several fits to the same points is chosen.
#[test]
fn a_curve_that_cannot_follow_the_points_is_more_surprising_whichever_view_is_first() {
    let case = case(Family::Helix, 1);
    let (one, two) = (integers(&case.exact_points.0), integers(&case.exact_points.1));
    let pairs = match_points(&one, &two, &case.rig);
    let surprise = |knot_spacing_px: f64| {
        let params = PointFitParams { knot_spacing_px, ..PointFitParams::DEFAULT };
        fit_points(&one, &two, &pairs, &case.rig, &params).unwrap().surprise
    };
    // A turn of a helix has radius 15 px or more: 10 px knots follow it, 60 px knots cut through it
    // and leave residuals of pixels, each (1 px)² of which costs 12 / 3.
    let (close, far) = (surprise(10.0), surprise(60.0));
    assert!(close < far, "{close} {far}");

    let swapped1: Vec<Pixel<View1>> = two.iter().map(|p| Pixel::new(p.x, p.y)).collect();
    let swapped2: Vec<Pixel<View2>> = one.iter().map(|p| Pixel::new(p.x, p.y)).collect();
    let turned: Vec<(usize, usize)> = pairs.iter().map(|&(i, j)| (j, i)).collect();
    let rig = case.rig.swapped();
    let there = fit_points(&swapped1, &swapped2, &turned, &rig, &PointFitParams::DEFAULT).unwrap();
    // Both stop at a change of 3 % in a logarithm of the smoothness, to which a minimum is flat.
    assert!((there.surprise - close).abs() < 1.0, "{} {close}", there.surprise);
}

#[test]
fn what_only_one_view_sees_is_left_out() {
    let case = case(Family::Easy, 0);
    let (one, two) = &case.exact_points;
    // View 2 does not see the first 60 px and the last 40.
    let cut = &two[60..two.len() - 40];
    let arcs2 = &case.exact_arc_lengths.1[60..two.len() - 40];
    let arcs1 = &case.exact_arc_lengths.0;
    let at = |s: f64| arcs1.partition_point(|a| *a < s).min(one.len() - 1);
    let (first, last) = (at(arcs2[0]), at(arcs2[arcs2.len() - 1]));
    let pairs: Vec<(usize, usize)> = match_points(&one[first..=last], cut, &case.rig)
        .iter()
        .map(|&(i, j)| (i + first, j))
        .collect();
    let params =
        PointFitParams { free_ends: [[true, true], [false, false]], ..PointFitParams::DEFAULT };
    let fit = fit_points(one, cut, &pairs, &case.rig, &params).unwrap();
    let expected = one.len() - 1 - (last - first);
    assert!(fit.beyond[0].abs_diff(expected) <= 4, "{:?} {expected}", fit.beyond);
    assert_eq!(fit.beyond[1], 0);
    let part: Vec<_> = (case.truth.iter())
        .enumerate()
        .filter(|(k, _)| {
            let s = *k as f64 / 1999.0 * case.length();
            s >= arcs2[0] && s <= arcs2[arcs2.len() - 1]
        })
        .map(|(_, p)| *p)
        .collect();
    let (mean, max) = deviation(&fit.curve, &part);
    // The truth's part is cut at its vertices, 0.3 px apart.
    assert!(mean < 0.02 && max < 0.5, "{mean} {max}");
    // Without free ends the match is too poor.
    let refused = fit_points(one, cut, &pairs, &case.rig, &PointFitParams::DEFAULT);
    assert!(matches!(refused, Err(FitError::BadMatch { .. })), "{refused:?}");
}

#[test]
fn a_wrong_match_is_refused_with_its_numbers() {
    let case = case(Family::Medium, 3);
    let (one, two) = &case.exact_points;
    let n = one.len().min(two.len());
    let crossed: Vec<(usize, usize)> = (0..n).map(|k| (k, k)).collect();
    let params = PointFitParams::DEFAULT;
    match fit_points(one, two, &crossed, &case.rig, &params) {
        Err(FitError::BadMatch { mean_distance_px, max_distance_px, .. }) => {
            assert!(mean_distance_px > 1.0);
            assert_eq!(max_distance_px, 1.0);
        }
        other => panic!("{other:?}"),
    }
    let mut pairs = match_points(one, two, &case.rig);
    pairs.swap(10, 300);
    assert!(matches!(
        fit_points(one, two, &pairs, &case.rig, &params),
        Err(FitError::BadPair { .. })
    ));
    assert!(matches!(
        fit_points(
            one,
            two,
            &[(0, 0), (one.len(), 1), (one.len(), 2), (one.len(), 3)],
            &case.rig,
            &params
        ),
        Err(FitError::BadPair { index: 1, .. })
    ));
    assert!(matches!(
        fit_points(&one[..3], two, &crossed, &case.rig, &params),
        Err(FitError::TooFewPoints { found: 3, .. })
    ));
    assert!(matches!(
        fit_points(one, two, &[], &case.rig, &params),
        Err(FitError::TooFewPoints { found: 0, .. })
    ));
    let mut broken = one.clone();
    broken[7].x = f64::NAN;
    assert!(matches!(
        fit_points(&broken, two, &crossed, &case.rig, &params),
        Err(FitError::NotFinite { index: 7, .. })
    ));
    for bad in [
        PointFitParams { huber_sigmas: 0.0, ..params },
        PointFitParams { max_mean_distance_px: f64::NAN, ..params },
        PointFitParams { min_coverage: f64::NAN, ..params },
    ] {
        assert!(matches!(
            fit_points(one, two, &crossed, &case.rig, &bad),
            Err(FitError::BadParameter { .. })
        ));
    }
}

#[test]
fn a_few_outliers_do_not_bend_the_curve() {
    let case = case(Family::Easy, 1);
    let (mut one, two) = case.exact_points.clone();
    let pairs = match_points(&one, &two, &case.rig);
    let scale = px_per_unit(&case);
    for k in (40..one.len() - 40).step_by(50) {
        one[k].y += 3.0;
    }
    let params = PointFitParams { noise_px: Some(0.05), ..PointFitParams::DEFAULT };
    let fit = fit_points(&one, &two, &pairs, &case.rig, &params).unwrap();
    let (mean, _) = deviation(&fit.curve, &case.truth);
    // Huber at 0.15 px: 1 point in 50 pulls by that, beside 50 good ones.
    assert!(mean * scale < 0.03, "{mean}");
}

#[test]
fn most_ellipses_hold_the_truth() {
    let (mut inside, mut half, mut total) = (0, 0, 0);
    for family in [Family::Easy, Family::Medium, Family::Hard, Family::Helix] {
        for index in 0..4 {
            let case = case(family, index);
            let fit =
                fitted(&case, &integers(&case.exact_points.0), &integers(&case.exact_points.1));
            let d = distances_across(&fit.curve, &fit.covariance, &case.truth, 40);
            assert!(d.iter().all(|v| v.is_finite()));
            inside += d.iter().filter(|v| **v <= 5.991).count();
            half += d.iter().filter(|v| **v <= 1.386).count();
            total += d.len();
        }
    }
    // 95 %; 16 curves of some 10 independent stretches each: 1.7 %, three times; and the noise of
    // rounding is less than normal in its tails.
    let share = inside as f64 / total as f64;
    assert!((0.90..=1.0).contains(&share), "{share}");
    // The ellipses of 50 % hold 1 - 2^-4 of the truth where variances are four times too large (what few
    // stretches need at 95 % is about three times what most do), 1 - 2^-0.5 where they are twice too small.
    let half = half as f64 / total as f64;
    assert!((0.29..=0.94).contains(&half), "{half}");
}
