//! The fit to grey levels, on pictures of generated wires.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use accurate_fit::{
    CalibrationPriors, CurveEnd, FitError, IntensityFitParams, IntensityPair, ShownPiece,
    fit_intensities,
};
use accurate_geom::{Camera, Curve3, Rig};
use accurate_synth::{
    CaseOptions, Family, SynthCase, XrayOptions, XrayResponse, generate, render_xray,
};
use ndarray::Array2;
use support::{curve_through, deviation, perturbed, px_per_unit};

const SEED: u64 = 1903;

fn pictures(case: &SynthCase, response: XrayResponse) -> [Array2<f32>; 2] {
    let options = XrayOptions { response, ..XrayOptions::default() };
    render_xray(case, &options).map(|image| image.mapv(f32::from))
}

/// A start that is up to 1.5 px off, `cut` px short at both ends.
fn start(case: &SynthCase, cut_px: f64) -> Curve3 {
    let unit_per_px = 1.0 / px_per_unit(case);
    let moved = perturbed(&case.truth, 1.5 * unit_per_px, unit_per_px);
    let step = (moved[1] - moved[0]).norm();
    let cut = (cut_px * unit_per_px / step).round() as usize;
    curve_through(&moved[cut..moved.len() - cut])
}

#[test]
fn a_start_that_is_off_and_short_comes_to_the_body() {
    for (family, index) in
        [(Family::Easy, 0), (Family::Easy, 1), (Family::Carm, 1), (Family::Carm, 2)]
    {
        let case = generate(family, SEED, index, &CaseOptions::default()).unwrap();
        let start = start(&case, 3.0);
        let scale = px_per_unit(&case);
        let (mean_before, _) = deviation(&start, &case.truth);
        for response in [XrayResponse::Linear, XrayResponse::Log] {
            let images = pictures(&case, response);
            let found =
                fit_intensities(&start, &images, &case.rig, &IntensityFitParams::DEFAULT, None)
                    .unwrap();
            let (mean, max) = deviation(&found.curve, &case.truth);
            // Noise of a third of the contrast (less here) places a stretch of 5 px of a blot of 1.1 px
            // to 1.1 / sqrt(5) · 0.3 = 0.15 px in each view; in 3D up to twice that, where both views
            // and a direction seen by one alone add up.
            assert!(mean * scale < 0.3, "{} {response:?}: {} px", case.id, mean * scale);
            assert!(mean < 0.5 * mean_before, "{}", case.id);
            // Ends: a radius of the body.
            assert!(max * scale < 2.0, "{} {response:?}: {} px", case.id, max * scale);
            assert!(found.moved_px < 4.0 && found.calibration.is_none(), "{found:?}");
        }
    }
}

#[test]
fn scale_of_the_grey_levels_does_not_matter_and_bytes_repeat() {
    let case = generate(Family::Easy, SEED, 2, &CaseOptions::default()).unwrap();
    let start = start(&case, 0.0);
    let images = pictures(&case, XrayResponse::Linear);
    let fit = |images: &[Array2<f32>; 2]| {
        fit_intensities(&start, images, &case.rig, &IntensityFitParams::DEFAULT, None).unwrap()
    };
    let found = fit(&images);
    assert_eq!(found.curve, fit(&images).curve);
    // A power of two changes no digit.
    assert_eq!(found.curve, fit(&images.map(|image| image * 0.25)).curve);
}

#[test]
fn a_shift_of_the_second_picture_is_found_across_the_epipolar_lines() {
    let case = generate(Family::Medium, SEED, 1, &CaseOptions::default()).unwrap();
    let images = pictures(&case, XrayResponse::Linear);
    let camera = case.rig.camera2();
    let mut k = *camera.k();
    k[(0, 2)] += 0.4;
    k[(1, 2)] -= 0.5;
    let wrong = Camera::new(k, *camera.r(), *camera.t(), camera.size()).unwrap();
    let rig = Rig::new(case.rig.camera1().clone(), wrong, case.rig.unit()).unwrap();
    let priors = CalibrationPriors::DEFAULT;
    let found = fit_intensities(
        &curve_through(&case.truth),
        &images,
        &rig,
        &IntensityFitParams::DEFAULT,
        Some((&priors, [0.0; 3])),
    )
    .unwrap()
    .calibration
    .unwrap();
    let across = |v: [f64; 2]| v[0] * found.observed[0] + v[1] * found.observed[1];
    // Principal points are shifted by an error, and back by its correction.
    let off = across(found.shift_px) - across([-0.4, 0.5]);
    assert!(found.observed_sigma_px < 0.1, "{found:?}");
    // Grey levels between the blots' shape and the cylinder's: a tenth of a pixel besides noise.
    assert!(off.abs() < 5.0 * found.observed_sigma_px + 0.1, "{off} {found:?}");
}

#[test]
fn pictures_tell_a_curve_that_runs_back_over_itself_from_the_body() {
    let case = generate(Family::Carm, SEED, 1, &CaseOptions::default()).unwrap();
    let clear = XrayOptions { dose_photons_per_px: 1e5, background: 0.0, ..XrayOptions::default() };
    let images = render_xray(&case, &clear).map(|image| image.mapv(f32::from));
    let params = IntensityFitParams::DEFAULT;
    let whole = curve_through(&case.truth);
    // The body up to the tip and 25 px back: to a mask it is the same.
    let step_px = (case.truth[1] - case.truth[0]).norm() * px_per_unit(&case);
    let back = case.truth.iter().rev().skip(1).take((25.0 / step_px) as usize);
    let folded: Vec<_> = case.truth.iter().chain(back).copied().collect();
    let folded = curve_through(&folded);
    // What no camera can see is passed over, and refused when it is fitted.
    let behind: Vec<_> =
        case.truth.iter().map(|p| p + (p - case.rig.camera1().centre()) * -3.0).collect();
    let behind = curve_through(&behind);

    let alone = IntensityPair::around(&[&whole], &images, &case.rig, &params, None).unwrap();
    let alone = alone.fit(&whole).unwrap();
    let by_itself = fit_intensities(&whole, &images, &case.rig, &params, None).unwrap();
    assert_eq!(alone.curve, by_itself.curve);
    assert_eq!(alone.cost, by_itself.cost);

    let curves = [&whole, &behind, &folded];
    let pair = IntensityPair::around(&curves, &images, &case.rig, &params, None).unwrap();
    assert!(
        matches!(pair.fit(&behind), Err(FitError::NotInFront { .. })),
        "{:?}",
        pair.fit(&behind)
    );
    let alone = IntensityPair::around(&[&behind], &images, &case.rig, &params, None);
    assert!(matches!(alone, Err(FitError::NotInFront { .. })), "{alone:?}");
    let (whole, folded) = (pair.fit(&whole).unwrap(), pair.fit(&folded).unwrap());
    // Twice the darkness along 25 px, over a width of 3 px, in both views, however the amplitude shares it:
    // at Cauchy's scale of 3 noises a pixel so far off costs 4.5 ln 2 at least.
    let least = 2.0 * 25.0 * 3.0 * 4.5 * 2f64.ln() * 0.25;
    assert!(folded.cost - whole.cost > least, "{} {}", folded.cost, whole.cost);
}

#[test]
fn a_fit_that_can_win_is_the_same_and_one_that_cannot_ends_early() {
    for index in 0..4 {
        let case = generate(Family::Medium, SEED, index, &CaseOptions::default()).unwrap();
        let images = pictures(&case, XrayResponse::Linear);
        let start = start(&case, 3.0);
        let params = IntensityFitParams::DEFAULT;
        let pair = IntensityPair::around(&[&start], &images, &case.rig, &params, None).unwrap();
        let whole = pair.fit(&start).unwrap();
        // It wins, if not by much.
        let wins = pair.fit_to_beat(&start, whole.cost + 0.1).unwrap().unwrap();
        assert_eq!((wins.curve, wins.cost, wins.steps), (whole.curve, whole.cost, whole.steps));
        // What is twice too dear is known before the last step to be so.
        for to_beat in [0.5 * whole.cost, 0.0, f64::NEG_INFINITY] {
            assert!(pair.fit_to_beat(&start, to_beat).unwrap().is_none(), "{}", whole.cost);
        }
    }
}

#[test]
fn what_shows_no_body_is_refused() {
    let case = generate(Family::Easy, SEED, 3, &CaseOptions::default()).unwrap();
    let curve = curve_through(&case.truth);
    let images = pictures(&case, XrayResponse::Linear);
    let fit = |images: &[Array2<f32>; 2]| {
        fit_intensities(&curve, images, &case.rig, &IntensityFitParams::DEFAULT, None)
    };
    let not_seen = |view| Err(FitError::NotSeenInImage { view });
    let [first, second] = images.clone();
    let outcome = |images| fit(&images).map(|_| ());
    assert_eq!(outcome([first.clone(), Array2::zeros(second.dim())]), not_seen(2));
    assert_eq!(outcome([Array2::zeros((0, 0)), second.clone()]), not_seen(1));
    assert_eq!(outcome([first.clone(), second.mapv(|v| 60_000.0 - v)]), not_seen(2));
    // A shadow: whatever lies on it, it is no darker.
    let shadow = case.masks[1].mapv(|body| if body { 0.0 } else { 255.0 });
    assert_eq!(outcome([first.clone(), shadow]), not_seen(2));
    let mut broken = first.clone();
    broken[(3, 4)] = f32::NAN;
    assert_eq!(outcome([broken, second.clone()]), not_seen(1));
    let default = IntensityFitParams::DEFAULT;
    for params in [
        IntensityFitParams { lambda3: f64::NAN, ..default },
        IntensityFitParams { tolerance: f64::NAN, ..default },
    ] {
        let refused = fit_intensities(&curve, &images, &case.rig, &params, None).map(|_| ());
        assert!(matches!(refused, Err(FitError::BadParameter { .. })), "{refused:?}");
    }
}

fn mean_shown(pieces: &[ShownPiece], view: usize) -> f64 {
    pieces.iter().map(|piece| piece.shown[view]).sum::<f64>() / pieces.len() as f64
}

#[test]
fn an_end_is_shown_where_its_darkness_is_there_and_no_further() {
    const BEYOND_PX: f64 = 20.0;
    let case = generate(Family::Carm, SEED, 1, &CaseOptions::default()).unwrap();
    let clear = XrayOptions { dose_photons_per_px: 1e5, background: 0.0, ..XrayOptions::default() };
    let images = render_xray(&case, &clear).map(|image| image.mapv(f32::from));
    let params = IntensityFitParams { extension_px: 0.0, ..IntensityFitParams::DEFAULT };
    let of = |curve: &Curve3, end: CurveEnd, cut_px: f64| {
        let pair = IntensityPair::around(&[curve], &images, &case.rig, &params, None).unwrap();
        let ends = pair.ends(curve).unwrap();
        let pieces = ends.beyond(end, cut_px);
        let length: f64 = pieces.iter().map(|piece| piece.length_px).sum();
        assert!((length - cut_px).abs() < 1.0, "{length} {cut_px}");
        pieces
    };
    // The body itself, from either end.
    let whole = curve_through(&case.truth);
    for end in [CurveEnd::Begin, CurveEnd::End] {
        let pieces = of(&whole, end, 30.0);
        for view in 0..2 {
            let shown = mean_shown(&pieces, view);
            assert!(shown > 0.8, "{end:?} {view} {shown}");
        }
    }
    // On beyond the tip, within the plane of the first camera's line of sight: nothing is there in either.
    let last = case.truth[case.truth.len() - 1];
    let ahead = (last - case.truth[case.truth.len() - 40]).normalize() / px_per_unit(&case);
    let longer: Vec<_> = case
        .truth
        .iter()
        .copied()
        .chain((1..=(2.0 * BEYOND_PX) as usize).map(|k| last + ahead * (0.5 * k as f64)))
        .collect();
    let pieces = of(&curve_through(&longer), CurveEnd::End, BEYOND_PX - 2.0);
    for view in 0..2 {
        let shown = mean_shown(&pieces, view);
        assert!(shown < -0.5, "{view} {shown}");
    }
    // Back over the body it lies upon it, and the picture has no second darkness for it.
    let step_px = (case.truth[1] - case.truth[0]).norm() * px_per_unit(&case);
    let back = case.truth.iter().rev().skip(1).take((25.0 / step_px) as usize);
    let folded: Vec<_> = case.truth.iter().chain(back).copied().collect();
    let pieces = of(&curve_through(&folded), CurveEnd::End, 20.0);
    let upon = pieces.iter().filter(|piece| piece.upon == [true, true]).count();
    assert!(upon + 2 >= pieces.len(), "{upon} of {}", pieces.len());
    assert!(mean_shown(&pieces, 0).max(mean_shown(&pieces, 1)) < -0.5, "{pieces:?}");
}

#[test]
fn no_end_is_all_of_a_curve_or_nothing() {
    let case = generate(Family::Carm, SEED, 1, &CaseOptions::default()).unwrap();
    let images = pictures(&case, XrayResponse::Linear);
    let curve = curve_through(&case.truth);
    let params = IntensityFitParams::DEFAULT;
    let pair = IntensityPair::around(&[&curve], &images, &case.rig, &params, None).unwrap();
    let ends = pair.ends(&curve).unwrap();
    for cut_px in [0.0, -5.0, f64::NAN, ends.length_px(), f64::INFINITY] {
        assert_eq!(ends.beyond(CurveEnd::Begin, cut_px), [], "{cut_px}");
        assert_eq!(ends.beyond(CurveEnd::End, cut_px), [], "{cut_px}");
    }
    // From both ends the same curve: what one calls its first half the other calls the rest.
    let half = 0.5 * ends.length_px();
    let [first, last] = [CurveEnd::Begin, CurveEnd::End].map(|end| ends.beyond(end, half));
    let total: f64 = first.iter().chain(&last).map(|piece| piece.length_px).sum();
    assert!((total - ends.length_px()).abs() < 2.0, "{total}");
}
