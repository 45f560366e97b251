//! The boundary fit on rendered masks of known curves.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use accurate_fit::{
    AdaptiveParams, FitError, Outline, OutlineFit, OutlineFitParams, OutlinePair, fit_outlines,
    fit_outlines_adaptively, judge_curve,
};
use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{Camera, Curve3, Point3, Rig, View1, View2};
use accurate_synth::{CaseOptions, Family, SynthCase, generate};
use ndarray::Array2;
use support::{curve_through, deviation, distances_across, perturbed, px_per_unit};

const SEED: u64 = 1901;

struct Scene {
    case: SynthCase,
    one: Outline<View1>,
    two: Outline<View2>,
}

fn scene(family: Family, index: u64, thickness_px: Option<f64>) -> Scene {
    let options = CaseOptions { mask_thickness_px: thickness_px, ..CaseOptions::default() };
    let case = generate(family, SEED, index, &options).unwrap();
    let one = Outline::from_mask(case.masks[0].view()).unwrap();
    let two = Outline::from_mask(case.masks[1].view()).unwrap();
    Scene { case, one, two }
}

impl Scene {
    fn fit(&self, start: &Curve3, params: &OutlineFitParams) -> OutlineFit {
        let pair = OutlinePair::new(&self.one, &self.two);
        fit_outlines(start, &pair, &self.case.rig, params).unwrap()
    }

    fn adaptive(&self, start: &Curve3) -> OutlineFit {
        let pair = OutlinePair::new(&self.one, &self.two);
        fit_outlines_adaptively(
            start,
            &pair,
            &self.case.rig,
            &OutlineFitParams::DEFAULT,
            &AdaptiveParams::DEFAULT,
        )
        .unwrap()
    }

    fn truth(&self) -> Curve3 {
        curve_through(&self.case.truth)
    }
}

#[test]
fn at_the_truth_a_squared_residual_is_an_eighteenth_of_a_pixel_on_average() {
    for thickness in [3.0, 5.0] {
        let (mut chi, mut used) = (0.0, 0);
        for index in 0..12 {
            let s = scene(Family::Medium, index, Some(thickness));
            let pair = OutlinePair::new(&s.one, &s.two);
            let params = OutlineFitParams::DEFAULT;
            let j = judge_curve(&s.truth(), &pair, &s.case.rig, &params).unwrap();
            assert!(j.unexplained < 1e-9, "{j:?}");
            chi += j.chi;
            used += j.used[0] + j.used[1];
        }
        // r = |n| U(-1/2, 1/2): variance of r² is E[n⁴]/80 - (1/18)², with E over |n|-weighted
        // directions of n⁴ = 8/15: 0.0036, so 0.06 per point. Some 25,000 points, of which about 20
        // in a row repeat each other: 0.06 / sqrt(25000 / 20) = 0.0017; three of that.
        let mean = chi / used as f64;
        assert!((mean - 1.0 / 18.0).abs() < 0.0051, "t = {thickness}: {mean}");
    }
}

#[test]
fn from_the_truth_every_outline_is_explained() {
    for family in [Family::Easy, Family::Medium, Family::Hard, Family::Carm, Family::SimPaper] {
        for index in 0..4 {
            let s = scene(family, index, None);
            let fit = s.adaptive(&s.truth());
            let j = fit.judgement;
            // One boundary point 1 px off counts 0.02; one px of a 1 px body seen 1.5 px off 0.05.
            assert!(j.unexplained < 0.1 && j.outside < 0.5, "{} {j:?}", s.case.id);
            // The fit takes up some of the noise: below the truth's 1/18, above half of it.
            let chi = j.chi_per_point();
            assert!((0.035..0.075).contains(&chi), "{} {chi}", s.case.id);
            for (h, t) in fit.half_thickness_px.iter().zip(s.case.mask_thickness_px) {
                assert!((h - t / 2.0).abs() < 0.12, "{} {h} {t}", s.case.id);
            }
        }
    }
}

#[test]
fn tips_are_found_to_a_fraction_of_a_pixel() {
    let mut errors = Vec::new();
    for index in 0..10 {
        let s = scene(Family::Easy, index, None);
        let fit = s.adaptive(&s.truth());
        let (start, end) = fit.curve.domain();
        for (t, tip) in [(start, s.case.truth.first()), (end, s.case.truth.last())] {
            let found = s.case.rig.project(&fit.curve.at(t)).unwrap();
            let true_tip = s.case.rig.project(tip.unwrap()).unwrap();
            errors.push(found.0.distance(true_tip.0));
            errors.push(found.1.distance(true_tip.1));
        }
    }
    errors.sort_by(f64::total_cmp);
    // A cap of radius 1.5 px has about 6 boundary points of 0.24 px each: 0.1 px; a tip that lies on
    // the body or points along the view is worse.
    assert!(errors[errors.len() / 2] < 0.2, "median {}", errors[errors.len() / 2]);
    assert!(errors[errors.len() * 9 / 10] < 0.6, "p90 {}", errors[errors.len() * 9 / 10]);
}

#[test]
fn a_start_a_few_pixels_off_finds_the_same_curve() {
    for (family, off_px, params) in [
        (Family::Easy, 3.0, OutlineFitParams::DEFAULT),
        (Family::Medium, 2.0, OutlineFitParams::DEFAULT),
        (Family::Medium, 5.0, OutlineFitParams::ANNEALED),
    ] {
        for index in 0..3 {
            let s = scene(family, index, None);
            let unit_per_px = 1.0 / px_per_unit(&s.case);
            let start = curve_through(&perturbed(&s.case.truth, off_px * unit_per_px, unit_per_px));
            let fit = s.fit(&start, &params);
            let (mean, max) = deviation(&fit.curve, &s.case.truth);
            assert!(fit.judgement.unexplained < 0.05, "{} {:?}", s.case.id, fit.judgement);
            assert!(mean < 0.3 * unit_per_px && max < 4.0 * unit_per_px, "{mean} {max}");
        }
    }
}

#[test]
fn the_frame_and_unit_of_the_world_do_not_matter() {
    let s = scene(Family::Medium, 1, None);
    let turn = Rotation3::new(Vector3::new(0.7, -1.1, 0.4));
    let (scale, shift) = (0.01, Vector3::new(30.0, -20.0, 5.0));
    let moved = |p: &Point3| turn * (p * scale) + shift;
    let camera = |c: &Camera| {
        // x_cam scales with the world; depth ratios do not change.
        let r = c.r() * turn.matrix().transpose();
        let t = c.t() * scale - r * shift;
        Camera::new(*c.k(), r, t, c.size()).unwrap()
    };
    let rig = &s.case.rig;
    let moved_rig = Rig::new(camera(rig.camera1()), camera(rig.camera2()), rig.unit()).unwrap();
    let truth: Vec<Point3> = s.case.truth.iter().step_by(20).copied().collect();
    let moved_truth: Vec<Point3> = truth.iter().map(moved).collect();
    let pair = OutlinePair::new(&s.one, &s.two);
    let params = OutlineFitParams::DEFAULT;
    let here = fit_outlines(&Curve3::interpolate(&truth).unwrap(), &pair, rig, &params).unwrap();
    let there =
        fit_outlines(&Curve3::interpolate(&moved_truth).unwrap(), &pair, &moved_rig, &params)
            .unwrap();
    for (a, b) in here.curve.sample(100).iter().zip(there.curve.sample(100)) {
        // Rounding, times the condition of the normal equations (some 1e6), in units of 500.
        let off = (moved(a) - b).norm();
        assert!(off < 1e-6 * 500.0 * scale, "{off}");
    }
}

/// The law by which one of several fits to the same outlines is chosen.
#[test]
fn a_curve_that_cannot_follow_the_outlines_is_more_surprising_in_every_frame() {
    let s = scene(Family::Helix, 1, None);
    let rig = &s.case.rig;
    let adaptive = AdaptiveParams { min_knot_spacing_px: 1e3, ..AdaptiveParams::DEFAULT };
    let surprise = |points: &[Point3], pair: &OutlinePair<'_>, rig: &Rig, knot_spacing_px: f64| {
        let start = Curve3::interpolate(points).unwrap();
        let params = OutlineFitParams { knot_spacing_px, ..OutlineFitParams::DEFAULT };
        let fit = fit_outlines_adaptively(&start, pair, rig, &params, &adaptive).unwrap();
        fit.surprise.unwrap()
    };
    let truth: Vec<Point3> = s.case.truth.iter().step_by(20).copied().collect();
    let pair = OutlinePair::new(&s.one, &s.two);
    // A turn of a helix has radius 15 px or more: knots 8 or 12 px apart follow it, 60 px apart they
    // cut through it and leave boundary points pixels off, each of which costs 1 px² / (3/18 px²).
    let [close, wider, far] = [8.0, 12.0, 60.0].map(|px| surprise(&truth, &pair, rig, px));
    assert!(far - close > 6.0 * 10.0, "{close} {far}");
    // Knots that suffice are as likely as more of them, up to what the estimate of the smoothness
    // leaves open (some 5); a density of the nine free unknowns that does not follow the knots would
    // add 18 ln(12 / 8), 7 to that.
    assert!((close - wider).abs() < 8.0, "{close} {wider} {far}");

    // Another unit adds the same to all.
    let scaled = |rig: &Rig, scale: f64| {
        let camera = |c: &Camera| Camera::new(*c.k(), *c.r(), c.t() * scale, c.size()).unwrap();
        Rig::new(camera(rig.camera1()), camera(rig.camera2()), rig.unit()).unwrap()
    };
    let small: Vec<Point3> = truth.iter().map(|p| p * 0.01).collect();
    let [close_small, far_small] =
        [8.0, 60.0].map(|px| surprise(&small, &pair, &scaled(rig, 0.01), px));
    assert!(((far - close) - (far_small - close_small)).abs() < 0.1, "{far_small} {close_small}");

    let one = Outline::<View1>::from_mask(s.case.masks[1].view()).unwrap();
    let two = Outline::<View2>::from_mask(s.case.masks[0].view()).unwrap();
    let exchanged = surprise(&truth, &OutlinePair::new(&one, &two), &rig.swapped(), 8.0);
    assert!((exchanged - close).abs() < 0.1, "{exchanged} {close}");
}

#[test]
fn exchanging_the_views_changes_nothing() {
    let s = scene(Family::Medium, 2, None);
    let one = Outline::<View1>::from_mask(s.case.masks[1].view()).unwrap();
    let two = Outline::<View2>::from_mask(s.case.masks[0].view()).unwrap();
    let pair = OutlinePair::new(&one, &two);
    let params = OutlineFitParams::DEFAULT;
    let start = s.truth();
    let here = s.fit(&start, &params);
    let swapped = fit_outlines(&start, &pair, &s.case.rig.swapped(), &params).unwrap();
    for (a, b) in here.curve.sample(100).iter().zip(swapped.curve.sample(100)) {
        assert!((a - b).norm() < 5e-4, "{a} {b}");
    }
    assert!((here.judgement.chi - swapped.judgement.chi).abs() < 1e-3);
}

#[test]
fn an_image_upside_down_under_a_negative_f_y_gives_the_same_curve() {
    let s = scene(Family::Easy, 3, None);
    let flipped = |mask: &Array2<bool>| {
        let rows = mask.nrows();
        Array2::from_shape_fn(mask.dim(), |(r, c)| mask[[rows - 1 - r, c]])
    };
    let camera = |c: &Camera| {
        let mut k: Matrix3<f64> = *c.k();
        k[(1, 1)] = -k[(1, 1)];
        k[(1, 2)] = f64::from(c.size().height) - 1.0 - k[(1, 2)];
        Camera::new(k, *c.r(), *c.t(), c.size()).unwrap()
    };
    let rig = &s.case.rig;
    let upside_down = Rig::new(camera(rig.camera1()), camera(rig.camera2()), rig.unit()).unwrap();
    let one = Outline::<View1>::from_mask(flipped(&s.case.masks[0]).view()).unwrap();
    let two = Outline::<View2>::from_mask(flipped(&s.case.masks[1]).view()).unwrap();
    let params = OutlineFitParams { subsample: false, ..OutlineFitParams::DEFAULT };
    let start = s.truth();
    let here = s.fit(&start, &params);
    let pair = OutlinePair::new(&one, &two);
    let there = fit_outlines(&start, &pair, &upside_down, &params).unwrap();
    for (a, b) in here.curve.sample(100).iter().zip(there.curve.sample(100)) {
        assert!((a - b).norm() < 5e-4, "{a} {b}");
    }
}

#[test]
fn a_gap_is_crossed_freely_where_a_bridge_allows_it() {
    let options = CaseOptions { gaps: 1..=1, gap_length_px: 24.0..=24.0, ..CaseOptions::default() };
    let case = generate(Family::Easy, SEED, 5, &options).unwrap();
    let one = Outline::<View1>::from_mask(case.masks[0].view()).unwrap();
    let two = Outline::<View2>::from_mask(case.masks[1].view()).unwrap();
    let truth = curve_through(&case.truth);
    let params = OutlineFitParams::DEFAULT;
    let closed = judge_curve(&truth, &OutlinePair::new(&one, &two), &case.rig, &params).unwrap();
    // 24 px less the caps, up to 4 px each, over 10, in two views.
    assert!(closed.outside > 5.0, "{closed:?}");
    let line: Vec<_> = case.truth.iter().map(|p| case.rig.project(p).unwrap()).collect();
    let bridges1: Vec<_> = line.windows(2).map(|w| (w[0].0, w[1].0)).collect();
    let bridges2: Vec<_> = line.windows(2).map(|w| (w[0].1, w[1].1)).collect();
    let open = OutlinePair::new(&one, &two).with_bridges(&bridges1, &bridges2);
    assert_eq!(judge_curve(&truth, &open, &case.rig, &params).unwrap().outside, 0.0);
}

#[test]
fn a_missing_loop_end_shows_as_an_unexplained_stretch() {
    let s = scene(Family::Easy, 0, None);
    // Leave the last eighth out.
    let short = curve_through(&s.case.truth[..1750]);
    let pair = OutlinePair::new(&s.one, &s.two);
    let params = OutlineFitParams { iterations: 0, ..OutlineFitParams::DEFAULT };
    let fit = fit_outlines(&short, &pair, &s.case.rig, &params).unwrap();
    assert!(fit.judgement.unexplained > 5.0);
    let total: f64 = fit.unexplained.iter().map(|u| u.unexplained).sum();
    assert!((total - fit.judgement.unexplained).abs() < 1e-9 * total);
    let tip = s.case.rig.project(s.case.truth.last().unwrap()).unwrap();
    let worst = &fit.unexplained[0];
    let (x, y) = if worst.view == 1 { (tip.0.x, tip.0.y) } else { (tip.1.x, tip.1.y) };
    let nearest =
        worst.points.iter().map(|p| (p[0] - x).hypot(p[1] - y)).fold(f64::INFINITY, f64::min);
    assert!(nearest < 3.0, "{nearest}");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let s = scene(Family::Easy, 1, None);
    let pair = OutlinePair::new(&s.one, &s.two);
    let rig = &s.case.rig;
    let truth = s.truth();
    let bad = OutlineFitParams { lambda3: f64::NAN, ..OutlineFitParams::DEFAULT };
    assert!(matches!(
        fit_outlines(&truth, &pair, rig, &bad),
        Err(FitError::BadParameter { name: "lambda3", .. })
    ));
    for bad in [
        AdaptiveParams { max_unexplained: f64::NAN, ..AdaptiveParams::DEFAULT },
        AdaptiveParams { min_knot_spacing_px: f64::NAN, ..AdaptiveParams::DEFAULT },
    ] {
        let settings = &OutlineFitParams::DEFAULT;
        let refused = fit_outlines_adaptively(&truth, &pair, rig, settings, &bad);
        assert!(matches!(refused, Err(FitError::BadParameter { .. })));
    }
    let away: Vec<Point3> = s
        .case
        .truth
        .iter()
        .step_by(50)
        .map(|p| p + (rig.camera1().centre() - s.case.truth[0]) * 2.0)
        .collect();
    let behind = Curve3::interpolate(&away).unwrap();
    assert!(matches!(
        fit_outlines(&behind, &pair, rig, &OutlineFitParams::DEFAULT),
        Err(FitError::NotInFront { view: 1, .. })
    ));
    let p = s.case.truth[0];
    let dot: Vec<Point3> =
        (0..4).map(|k| p + Vector3::new(1e-3 * f64::from(k), 0.0, 0.0)).collect();
    let dot = Curve3::interpolate(&dot).unwrap();
    assert!(matches!(
        fit_outlines(&dot, &pair, rig, &OutlineFitParams::DEFAULT),
        Err(FitError::BadLength { .. })
    ));
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let s = scene(Family::Medium, 4, None);
    let start = s.truth();
    let (a, b) = (s.adaptive(&start), s.adaptive(&start));
    assert_eq!(a.curve, b.curve);
    assert_eq!(a.judgement, b.judgement);
}

#[test]
fn most_ellipses_hold_the_truth() {
    let (mut inside, mut half, mut total) = (0, 0, 0);
    for family in [Family::Easy, Family::Medium, Family::Helix, Family::Carm] {
        for index in 0..4 {
            let s = scene(family, index, None);
            let fit = s.adaptive(&s.truth());
            let covariance = fit.covariance.as_ref().unwrap();
            let d = distances_across(&fit.curve, covariance, &s.case.truth, 40);
            assert!(d.iter().all(|v| v.is_finite()));
            inside += d.iter().filter(|v| **v <= 5.991).count();
            half += d.iter().filter(|v| **v <= 1.386).count();
            total += d.len();
        }
    }
    // 95 %; 16 curves of some 10 independent stretches each: 1.7 %, three times.
    let share = inside as f64 / total as f64;
    assert!((0.90..=1.0).contains(&share), "{share}");
    // The ellipses of 50 % hold 1 - 2^-2 of the truth where variances are twice too large, 1 - 2^-0.5
    // where they are twice too small.
    let half = half as f64 / total as f64;
    assert!((0.29..=0.75).contains(&half), "{half}");
}
