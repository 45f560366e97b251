//! Scores of known curves, and what cannot be scored.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_eval::{
    EvalError, align_rigid, align_similarity, curve_scores, discrete_frechet, reprojection_rms,
    table_scores,
};
use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Point3, Rig};
use proptest::prelude::*;

fn line(n: usize, y: f64) -> Vec<Point3> {
    (0..n).map(|k| Point3::new(k as f64, y, 0.0)).collect()
}

/// Two cameras at distance 1000 and a right angle, looking at the origin; 2 px per unit there.
fn rig() -> Rig {
    let k = Matrix3::new(2000.0, 0.0, 500.0, 0.0, 2000.0, 500.0, 0.0, 0.0, 1.0);
    let camera = |angle: f64| {
        let r = Rotation3::from_axis_angle(&Vector3::y_axis(), angle).into_inner();
        let size = ImageSize { width: 1000, height: 1000 };
        Camera::new(k, r, Vector3::new(0.0, 0.0, 1000.0), size).unwrap()
    };
    Rig::new(camera(0.0), camera(std::f64::consts::FRAC_PI_2), LengthUnit::Millimetre).unwrap()
}

#[test]
fn parallel_lines_are_as_far_apart_as_they_are() {
    // Sampled differently, shifted by 0.5, one shorter by 2 at its end.
    let (truth, found) = (line(11, 0.0), [Point3::new(0.0, 0.5, 0.0), Point3::new(8.0, 0.5, 0.0)]);
    let scores = curve_scores(&found, &truth, 0.25).unwrap();
    assert_eq!((scores.accuracy, scores.max_reconstruction_to_truth), (0.5, 0.5));
    assert_eq!(scores.max_truth_to_reconstruction, 4.25_f64.sqrt());
    assert_eq!(scores.hausdorff, 4.25_f64.sqrt());
    assert_eq!(scores.frechet, 4.25_f64.sqrt());
    assert_eq!((scores.length_error, scores.relative_length_error), (-2.0, -0.2));
    let mut reversed = found;
    reversed.reverse();
    let reversed = curve_scores(&reversed, &truth, 0.25).unwrap();
    assert!(reversed.frechet_reversed && !scores.frechet_reversed);
    assert_eq!(reversed.frechet, scores.frechet);
}

#[test]
fn reprojection_is_the_shift_in_px() {
    // 0.5 up at distance 1000 with 2000 px focal length is 1 px in view 1; the truth is longer.
    let truth: Vec<Point3> = (-30..=30).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect();
    let found: Vec<Point3> = (-20..=20).map(|k| Point3::new(f64::from(k), 0.5, 0.0)).collect();
    let rms = reprojection_rms(&found, &truth, &rig(), 0.1).unwrap();
    assert!((rms.view1_px - 1.0).abs() < 1e-10, "{rms:?}");
    // View 2 looks along x: the distance varies between 980 and 1020.
    assert!((rms.view2_px - 1.0).abs() < 0.01, "{rms:?}");
    let same = reprojection_rms(&truth, &truth, &rig(), 0.1).unwrap();
    // Pixels of 500 with a rounding of a few units in the last place.
    assert!(same.view1_px.max(same.view2_px) <= 16.0 * f64::EPSILON * 500.0, "{same:?}");
}

#[test]
fn a_point_behind_a_camera_is_refused_by_name() {
    let mut far = line(3, 0.0);
    far[1].z = -2000.0;
    let error = reprojection_rms(&line(3, 0.0), &far, &rig(), 1.0).unwrap_err();
    assert!(matches!(error, EvalError::Projection { which: "truth", index: 1, .. }), "{error}");
}

#[test]
fn an_empty_side_is_an_error_and_never_a_zero() {
    let (some, none) = (line(3, 0.0), Vec::new());
    assert_eq!(table_scores(&none, &some), Err(EvalError::Empty { which: "reconstruction" }));
    assert_eq!(table_scores(&some, &none), Err(EvalError::Empty { which: "truth" }));
    assert_eq!(curve_scores(&none, &some, 1.0), Err(EvalError::Empty { which: "reconstruction" }));
    assert_eq!(discrete_frechet(&some, &none), Err(EvalError::Empty { which: "second curve" }));
    assert!(reprojection_rms(&some, &none, &rig(), 1.0).is_err());
}

#[test]
fn coordinates_that_are_not_finite_or_overflow_are_refused_by_index() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut curve = line(4, 0.0);
        curve[2].y = bad;
        let error = EvalError::NotFinite { which: "truth", index: 2 };
        assert_eq!(table_scores(&line(2, 0.0), &curve), Err(error.clone()));
        assert_eq!(curve_scores(&line(2, 0.0), &curve, 1.0), Err(error));
    }
    let mut curve = line(4, 0.0);
    curve[3].z = -1e200;
    let error = table_scores(&curve, &line(2, 0.0)).unwrap_err();
    assert!(matches!(error, EvalError::TooLarge { which: "reconstruction", index: 3, .. }));
}

#[test]
fn a_curve_without_length_and_a_useless_spacing_are_refused() {
    let (curve, point) = (line(4, 0.0), vec![Point3::origin(); 3]);
    let no_length = EvalError::NoLength { which: "truth", points: 3 };
    assert_eq!(curve_scores(&curve, &point, 1.0), Err(no_length));
    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = curve_scores(&curve, &curve, spacing).unwrap_err();
        assert!(matches!(error, EvalError::InvalidArgument { name: "spacing_world", .. }));
    }
    let error = curve_scores(&curve, &curve, 1e-9).unwrap_err();
    assert!(matches!(error, EvalError::TooManySamples { .. }), "{error}");
    // A set of one point still has table scores.
    assert_eq!(table_scores(&point[..1], &curve).unwrap().max_error, 3.0);
}

#[test]
fn one_huge_and_one_tiny_curve_stay_finite() {
    for size in [1e-140, 1e140] {
        let curve: Vec<Point3> = line(5, 0.3).into_iter().map(|p| p * size).collect();
        let other: Vec<Point3> = line(5, 0.9).into_iter().map(|p| p * size).collect();
        let scores = curve_scores(&curve, &other, 0.1 * size).unwrap();
        assert!((scores.overall / size - 0.6).abs() < 1e-9, "{scores:?}");
    }
}

#[test]
fn finite_numbers_whose_scores_are_not_are_refused() {
    let overflow = |error: EvalError| matches!(error, EvalError::Overflow { .. });
    let span = |size: f64| [Point3::origin(), Point3::new(size, 0.0, 0.0)];
    let error = curve_scores(&span(1e150), &span(1e-160), 1e150).unwrap_err();
    assert!(overflow(error.clone()), "{error}");

    let corners = |size: f64| {
        [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(|p| Point3::from(p) * size)
    };
    let (huge, tiny) = (corners(1e150), corners(1e-160));
    let error = align_similarity(&tiny, &huge, None).unwrap_err();
    assert!(overflow(error.clone()), "{error}");

    // Depths next to 0 send images far away: further than the square of a number, or than a number.
    let near = |depth: f64| [Point3::new(1.0, 0.0, depth), Point3::new(2.0, 0.0, depth)];
    let k = Matrix3::new(2000.0, 0.0, 500.0, 0.0, 2000.0, 500.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 1000, height: 1000 };
    let camera =
        |x: f64| Camera::new(k, Matrix3::identity(), Vector3::new(x, 0.0, 0.0), size).unwrap();
    let rig = Rig::new(camera(0.0), camera(5.0), LengthUnit::Millimetre).unwrap();
    let error = reprojection_rms(&near(1e-200), &near(1.0), &rig, 1.0).unwrap_err();
    assert!(overflow(error.clone()), "{error}");
    let error = reprojection_rms(&near(1.0), &near(1e-320), &rig, 1.0).unwrap_err();
    assert_eq!(error, EvalError::NotFinite { which: "truth", index: 0 });
}

#[test]
fn points_on_a_line_fix_no_rotation() {
    let curve = line(9, 2.0);
    let error = align_similarity(&curve, &curve, None).unwrap_err();
    assert!(matches!(error, EvalError::Collinear { .. }), "{error}");
    let point = vec![Point3::new(1.0, 2.0, 3.0); 4];
    assert!(matches!(align_rigid(&point, &curve[..4], None), Err(EvalError::Collinear { .. })));
}

#[test]
fn a_plane_curve_is_aligned_by_a_rotation_and_not_by_a_reflection() {
    let source: Vec<Point3> =
        (0..20).map(|k| Point3::new(f64::from(k), (f64::from(k) * 0.4).sin() * 3.0, 0.0)).collect();
    // A mirror image in space of a curve in the plane z = 0 is itself; mirrored in y it is the
    // rotation about x by half a turn.
    let target: Vec<Point3> = source.iter().map(|p| Point3::new(p.x, -p.y, p.z)).collect();
    let found = align_rigid(&source, &target, None).unwrap();
    assert!(found.rms <= 1e-12 && found.target_from_source.rotation.determinant() > 0.99);
}

#[test]
fn weights_choose_the_pairs_that_count() {
    let source =
        [[0., 0., 0.], [4., 0., 0.], [0., 3., 0.], [0., 0., 5.], [9., 9., 9.]].map(Point3::from);
    let mut target = source.map(|p| p * 2.0);
    target[4] = Point3::new(-70.0, 3.0, 8.0);
    let found = align_similarity(&source, &target, Some(&[1.0, 1.0, 1.0, 1.0, 0.0])).unwrap();
    assert!((found.target_from_source.scale - 2.0).abs() < 1e-14 && found.rms < 1e-13);
    for (weights, name) in [([-1.0, 1.0, 1.0, 1.0, 1.0], "negative"), ([0.0; 5], "zero")] {
        let error = align_similarity(&source, &target, Some(&weights)).unwrap_err();
        assert!(matches!(error, EvalError::InvalidArgument { name: "weights", .. }), "{name}");
    }
    let error = align_similarity(&source, &target[..4], None).unwrap_err();
    assert_eq!(error, EvalError::LengthMismatch { which: "target", found: 4, expected: 5 });
    let error = align_similarity(&source, &target, Some(&[1.0; 4])).unwrap_err();
    assert_eq!(error, EvalError::LengthMismatch { which: "weights", found: 4, expected: 5 });
}

proptest! {
    #[test]
    fn any_numbers_give_finite_scores_or_an_error(
        a in prop::collection::vec(prop::array::uniform3(any::<f64>()), 0..6),
        b in prop::collection::vec(prop::array::uniform3(any::<f64>()), 0..6),
        spacing in any::<f64>(),
    ) {
        let a: Vec<Point3> = a.into_iter().map(Point3::from).collect();
        let b: Vec<Point3> = b.into_iter().map(Point3::from).collect();
        if let Ok(s) = table_scores(&a, &b) {
            prop_assert!([s.accuracy, s.completeness, s.overall, s.max_error].iter().all(|v| v.is_finite()));
        }
        if let Ok(s) = curve_scores(&a, &b, spacing) {
            prop_assert!(s.overall.is_finite() && s.frechet.is_finite() && s.relative_length_error.is_finite());
        }
        if let Ok(f) = align_similarity(&a, &b, None) {
            prop_assert!(f.rms.is_finite() && f.target_from_source.scale.is_finite());
        }
    }
}
