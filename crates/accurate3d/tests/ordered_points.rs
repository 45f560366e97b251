//! `accurate` mode on ordered points: a wrong calibration, turned images, threads.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "support/turned_cameras.rs"]
mod turned_cameras;

use accurate3d::eval::curve_scores;
use accurate3d::fit::CalibrationPriors;
use accurate3d::geom::{Camera, Pixel, Rig, View};
use accurate3d::io::OrderedPoints;
use accurate3d::synth::{CalibrationError, CaseOptions, Family, SynthCase, generate};
use accurate3d::{
    Error, InputKind, Method, Params, Reconstruction, Suspicion, ViewPair, reconstruct,
};
use ndarray::Array2;
use turned_cameras::{mirrored, transposed};

const SEED: u64 = 1907;

fn pair(rig: &Rig, points: Option<OrderedPoints>, masks: Option<[Array2<bool>; 2]>) -> ViewPair {
    ViewPair { points, masks, ..ViewPair::new("ordered-points", rig.clone()) }
}

fn accurate(pair: &ViewPair, input: InputKind) -> Result<Reconstruction, Error> {
    reconstruct(pair, &Params::new(input, Method::Accurate))
}

fn per_px(case: &SynthCase) -> f64 {
    let camera = case.rig.camera1();
    let depth: f64 =
        case.truth.iter().map(|p| camera.depth(p)).sum::<f64>() / case.truth.len() as f64;
    depth / camera.k()[(0, 0)].abs()
}

/// What a wrong principal point shifts across the epipolar lines is found from ordered points; what it
/// shifts along them is not, and the posterior says so.
#[test]
fn a_shift_of_image_2_is_estimated_from_ordered_points_where_it_can_be_seen() {
    // The larger one puts the right pairs farther from their lines than a match of exact cameras may be.
    for shift_px in [0.6, 2.0] {
        let error = CalibrationError { rotation_deg: 0.0, shift_px };
        let options = CaseOptions { calibration_error: Some(error), ..CaseOptions::default() };
        let mut seen = 0;
        for index in 0..4 {
            let case = generate(Family::Medium, SEED, index, &options).unwrap();
            let of = |rig: &Rig, k: usize| rig.camera2().k()[(k, 2)];
            let shift = [0, 1].map(|k| of(&case.true_rig, k) - of(&case.rig, k));
            let points = Some(case.exact_points.clone());
            let pair = ViewPair { points, ..ViewPair::from(case) };
            let mut params = Params::new(InputKind::Points, Method::Accurate);
            params.robust.calibration = Some(CalibrationPriors::DEFAULT);
            let found = reconstruct(&pair, &params).unwrap();
            let c = found.diagnostics.calibration.expect("an estimate");
            assert!(c.observed_sigma_px < c.unobserved_sigma_px);
            // The prior, of 0.7 px, is no worse than the posterior.
            assert!(c.unobserved_sigma_px <= 0.7 * 1.0001, "{c:?}");
            let along = |v: [f64; 2]| c.observed[0] * v[0] + c.observed[1] * v[1];
            // A roll of a milliradian at 200 px from the middle is 0.2 px.
            seen += usize::from((along(c.shift_px) - along(shift)).abs() < 0.2);
        }
        assert!(seen >= 3, "{shift_px} px: {seen} of 4");
    }
}

/// The epipolar lines of a C-arm are all but parallel: along them whole pixels say nothing, and what is
/// left is the prior, of 0.7 px, neither more nor less.
#[test]
fn what_no_point_shows_of_the_calibration_keeps_the_spread_of_its_prior() {
    for index in 0..4 {
        let case = generate(Family::Carm, SEED, index, &CaseOptions::default()).unwrap();
        let (points1, points2) = &case.exact_points;
        let points = Some((
            points1.iter().map(|p| Pixel::new(p.x.round(), p.y.round())).collect(),
            points2.iter().map(|p| Pixel::new(p.x.round(), p.y.round())).collect(),
        ));
        let pair = ViewPair { points, ..ViewPair::from(case) };
        let mut params = Params::new(InputKind::Points, Method::Accurate);
        params.robust.calibration = Some(CalibrationPriors::DEFAULT);
        let found = reconstruct(&pair, &params).unwrap();
        let c = found.diagnostics.calibration.expect("an estimate");
        assert!((0.69..=0.7 * 1.0001).contains(&c.unobserved_sigma_px), "{c:?}");
    }
}

/// How an image is turned.
#[derive(Debug, Clone, Copy)]
enum Turn {
    MirrorX,
    Transpose,
}

impl Turn {
    fn camera(self, camera: &Camera) -> Camera {
        match self {
            Self::MirrorX => mirrored(camera),
            Self::Transpose => transposed(camera),
        }
    }

    fn points<V: View>(self, points: &[Pixel<V>], width: f64) -> Vec<Pixel<V>> {
        let turned = |p: &Pixel<V>| match self {
            Self::MirrorX => Pixel::new(width - 1.0 - p.x, p.y),
            Self::Transpose => Pixel::new(p.y, p.x),
        };
        points.iter().map(turned).collect()
    }
}

#[test]
fn a_direction_that_the_match_leaves_open_is_told_by_the_fits() {
    // Whole pixels whose match is cheaper, by less than 0.01 px a point, against the truth.
    for (seed, index) in [(1060, 19), (1064, 14), (1067, 6)] {
        let case = generate(Family::Medium, seed, index, &CaseOptions::default()).unwrap();
        let per_px = per_px(&case);
        let truth = case.truth.clone();
        let points = case.rounded_points.clone();
        let pair = ViewPair { points: Some(points), ..ViewPair::from(case) };
        let found = accurate(&pair, InputKind::Points).unwrap();
        assert!(!found.diagnostics.view2_reversed, "{}", found.id);
        assert!(found.diagnostics.direction_margin_px.unwrap() < 0.0, "{}", found.id);
        let scores = curve_scores(&found.positions(), &truth, 0.5 * per_px).unwrap();
        assert!(scores.hausdorff < per_px, "{}: {:.2} px", found.id, scores.hausdorff / per_px);
    }
}

/// At these tips the match leaves a few points without a partner. That is a reason to doubt the tip, not
/// to end the curve dozens of points before it.
#[test]
fn a_doubtful_tip_is_not_left_out_with_all_before_it() {
    for (family, index) in [(Family::SimPaper, 16), (Family::SimPaper, 30), (Family::Medium, 25)] {
        let case = generate(family, 1080, index, &CaseOptions::default()).unwrap();
        let (px, truth) = (per_px(&case), case.truth.clone());
        let points = case.rounded_points.clone();
        let pair = ViewPair { points: Some(points), ..ViewPair::from(case) };
        let found = accurate(&pair, InputKind::Points).unwrap();
        let scores = curve_scores(&found.positions(), &truth, 0.5 * px).unwrap();
        // As the others of the family; without the tips 48 to 74 px.
        assert!(scores.hausdorff < 5.0 * px, "{family} {index}: {} px", scores.hausdorff / px);
    }
}

/// Ordered points leave nothing to thinning: turned images give the same curve to the convergence of
/// the fit, far below its own error.
#[test]
fn turned_images_and_swapped_views_give_the_same_curve() {
    for (family, index) in [(Family::Medium, 0), (Family::Helix, 1), (Family::SimPaper, 2)] {
        let case = generate(family, SEED, index, &CaseOptions::default()).unwrap();
        let unit = per_px(&case);
        let (one, two) = case.rounded_points.clone();
        let given = pair(&case.rig, Some((one.clone(), two.clone())), None);
        let here = accurate(&given, InputKind::Points).unwrap().positions();
        let mut others = Vec::new();
        for turn in [Turn::MirrorX, Turn::Transpose] {
            let [a, b] = [case.rig.camera1(), case.rig.camera2()].map(|c| turn.camera(c));
            let rig = Rig::new(a, b, case.rig.unit()).unwrap();
            let width = |c: &Camera| f64::from(c.size().width);
            let points = (
                turn.points(&one, width(case.rig.camera1())),
                turn.points(&two, width(case.rig.camera2())),
            );
            others.push((format!("{turn:?}"), pair(&rig, Some(points), None)));
        }
        let swapped = (
            two.iter().map(|p| Pixel::new(p.x, p.y)).collect(),
            one.iter().map(|p| Pixel::new(p.x, p.y)).collect(),
        );
        others.push(("swapped".to_owned(), pair(&case.rig.swapped(), Some(swapped), None)));
        for (name, other) in others {
            let there = accurate(&other, InputKind::Points).unwrap().positions();
            let scores = curve_scores(&there, &here, 0.5 * unit).unwrap();
            let largest = scores.hausdorff / unit;
            // The fit ends when an update changes smoothness by 3 %, which moves the curve by about
            // that share of its own error of some 0.3 px.
            assert!(largest < 0.1, "{family} {index} {name}: {largest} px");
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let cases: Vec<ViewPair> = [Family::Medium, Family::Tangency]
        .into_iter()
        .map(|f| ViewPair::from(generate(f, SEED, 3, &CaseOptions::default()).unwrap()))
        .collect();
    let run = |threads: usize| -> Vec<String> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            use rayon::prelude::*;
            cases
                .par_iter()
                .flat_map(|pair| [InputKind::Points, InputKind::Mask].map(|i| (pair, i)))
                .map(|(pair, input)| format!("{:?}", accurate(pair, input).unwrap()))
                .collect()
        })
    };
    let one = run(1);
    // `Debug` of a number is the shortest text that reads back as the same bits.
    assert_eq!(one, run(2));
    assert_eq!(one, run(8));
}

/// A polyline that was clicked by hand has a vertex every dozen pixels; it stands for its chords.
#[test]
fn vertices_of_a_polyline_give_the_curve_between_them() {
    for index in 0..4 {
        let case = generate(Family::Easy, SEED, index, &CaseOptions::default()).unwrap();
        let (points1, points2) = case.exact_points.clone();
        fn every<V: View>(points: &[Pixel<V>], step: usize) -> Vec<Pixel<V>> {
            let last = points.last().copied();
            points[..points.len() - 1].iter().step_by(step).copied().chain(last).collect()
        }
        let off = |step: usize| {
            let points = Some((every(&points1, step), every(&points2, step)));
            let found = accurate(&pair(&case.rig, points, None), InputKind::Points).unwrap();
            curve_scores(&found.positions(), &case.truth, 0.5).unwrap().hausdorff / per_px(&case)
        };
        // The height of a chord over 12 px of the tightest bends of this family is some 0.5 px in the image,
        // and may lie along an epipolar line.
        let (fine, coarse) = (off(1), off(12));
        assert!(fine < 0.1 && coarse < 4.0, "{index}: {fine} {coarse} px");
    }
}

/// What is swapped or displaced leaves parts of both curves without partners, which a wire of which one view
/// sees more does not.
#[test]
fn parts_left_out_in_both_views_are_a_reason_for_doubt() {
    for index in 0..4 {
        let case = generate(Family::Medium, SEED, index, &CaseOptions::default()).unwrap();
        let (points1, points2) = case.exact_points.clone();
        let doubts = |points: OrderedPoints| {
            let found = accurate(&pair(&case.rig, Some(points), None), InputKind::Points);
            found.map(|found| found.diagnostics.suspicions)
        };
        let (n1, n2) = (points1.len(), points2.len());
        let sees_more = doubts((points1.clone(), points2[n2 / 5..].to_vec())).unwrap();
        assert_eq!(sees_more, [], "{index}: one view sees more");
        let both = doubts((points1[..n1 - n1 / 5].to_vec(), points2[n2 / 5..].to_vec())).unwrap();
        assert!(both.contains(&Suspicion::Uncovered), "{index}: {both:?}");
    }
}

#[test]
fn right_curves_of_whole_pixels_are_not_doubted() {
    for family in [Family::Easy, Family::Carm] {
        for index in 0..10 {
            let case = generate(family, 1302, index, &CaseOptions::default()).unwrap();
            let given = pair(&case.rig, Some(case.rounded_points.clone()), None);
            let found = accurate(&given, InputKind::Points).unwrap().diagnostics;
            // All the pixels that a diagonal crosses lie up to 0.7 px from it.
            assert_eq!(found.suspicions, [], "{family} {index}: {:?}", found.points_fit);
        }
    }
}

/// A match that leaves out a tenth of a view, 60 px off; one that was fitted to something else, 9 px off.
#[test]
fn what_buys_its_fit_and_what_does_not_fit_is_doubted() {
    for (family, index, reason) in
        [(Family::Easy, 40, Suspicion::Ambiguous), (Family::Carm, 7, Suspicion::Misfit)]
    {
        let case = generate(family, 1301, index, &CaseOptions::default()).unwrap();
        let given = pair(&case.rig, Some(case.rounded_points.clone()), None);
        let found = accurate(&given, InputKind::Points).unwrap().diagnostics;
        assert_eq!(found.suspicions, [reason], "{family} {index}");
    }
}

#[test]
fn a_straight_wire_along_the_baseline_is_weakly_seen() {
    let case = generate(Family::Easy, SEED, 0, &CaseOptions::default()).unwrap();
    let cameras = [case.rig.camera1(), case.rig.camera2()];
    let baseline = cameras[1].centre() - cameras[0].centre();
    let middle = case.truth[case.truth.len() / 2];
    let length: f64 = case.truth.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let along = baseline.normalize() * (0.3 * length / 200.0);
    let seen = |k: i32| case.rig.project(&(middle + along * f64::from(k))).unwrap();
    let points: OrderedPoints = (-100..100).map(seen).unzip();
    let found = accurate(&pair(&case.rig, Some(points), None), InputKind::Points);
    let found = found.unwrap().diagnostics;
    assert!(found.suspicions.contains(&Suspicion::Uncertain), "{found:?}");
}
