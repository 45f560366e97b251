//! What every generated case keeps, whatever its family, seed and index.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeSet;

use accurate_geom::{Camera, Pixel, Point2, Point3, View};
use accurate_synth::{CalibrationError, CaseOptions, Family, SynthCase, SynthError, generate};
use ndarray::Array2;
use proptest::prelude::*;

fn plain(family: Family, seed: u64, index: u64) -> SynthCase {
    generate(family, seed, index, &CaseOptions::default()).unwrap()
}

fn families() -> impl Strategy<Value = Family> {
    prop::sample::select(Family::ALL.to_vec())
}

fn cases() -> impl Strategy<Value = SynthCase> {
    (families(), any::<u64>(), any::<u64>()).prop_map(|(f, seed, index)| plain(f, seed, index))
}

fn cameras(case: &SynthCase) -> [&Camera; 2] {
    [case.true_rig.camera1(), case.true_rig.camera2()]
}

fn projected(case: &SynthCase, view: usize) -> Vec<Point2> {
    case.truth.iter().map(|x| cameras(case)[view].project(x).unwrap()).collect()
}

fn distance_to_segment(p: Point2, a: Point2, b: Point2) -> f64 {
    let (ab, ap) = (b - a, p - a);
    let t = if ab.norm_squared() > 0.0 {
        (ap.dot(&ab) / ab.norm_squared()).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (ap - ab * t).norm()
}

fn components(mask: &Array2<bool>) -> usize {
    let (height, width) = mask.dim();
    let mut seen = Array2::from_elem(mask.dim(), false);
    let mut count = 0;
    for (start, &set) in mask.indexed_iter() {
        if !set || seen[start] {
            continue;
        }
        count += 1;
        seen[start] = true;
        let mut stack = vec![start];
        while let Some((r, c)) = stack.pop() {
            for next_r in r.saturating_sub(1)..=(r + 1).min(height - 1) {
                for next_c in c.saturating_sub(1)..=(c + 1).min(width - 1) {
                    let next = (next_r, next_c);
                    if mask[next] && !seen[next] {
                        seen[next] = true;
                        stack.push(next);
                    }
                }
            }
        }
    }
    count
}

/// Rounding of arc lengths: 2000 additions of up to 2000 px at 1.1e-16 each, twice (image and
/// world, up to 20 px per unit), and as much again for the projection.
const EXACT_PX: f64 = 1e-8;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_case_does_not_depend_on_what_was_generated_before(
        family in families(), seed: u64, index: u64, other: u64,
    ) {
        let first = plain(family, seed, index);
        let _ = plain(family, seed, other);
        let elsewhere = std::thread::spawn(move || plain(family, seed, index)).join().unwrap();
        prop_assert_eq!(first, elsewhere);
    }

    #[test]
    fn another_index_or_seed_is_another_curve(family in families(), seed: u64, index in 1..u64::MAX) {
        let case = plain(family, seed, index);
        prop_assert_ne!(&case.truth, &plain(family, seed, index - 1).truth);
        prop_assert_ne!(&case.truth, &plain(family, seed ^ 1, index).truth);
    }

    #[test]
    fn options_change_neither_the_curve_nor_the_true_rig(family in families(), seed: u64) {
        let options = CaseOptions {
            mask_thickness_px: Some(5.0),
            gaps: 0..=1,
            gap_length_px: 1.0..=3.0,
            calibration_error: Some(CalibrationError { rotation_deg: 0.1, shift_px: 0.5 }),
            ..CaseOptions::default()
        };
        let (bare, other) = (plain(family, seed, 0), generate(family, seed, 0, &options).unwrap());
        prop_assert_eq!(&bare.truth, &other.truth);
        prop_assert_eq!(&bare.true_rig, &other.true_rig);
        prop_assert_eq!(&bare.rig, &bare.true_rig);
        prop_assert_ne!(&other.rig, &other.true_rig);
    }

    #[test]
    fn the_truth_lies_inside_both_images(case in cases()) {
        for view in 0..2 {
            let size = cameras(&case)[view].size();
            prop_assert_eq!(case.masks[view].dim(), (size.height as usize, size.width as usize));
            for p in projected(&case, view) {
                prop_assert!(p.x >= 2.0 && p.x <= f64::from(size.width) - 3.0);
                prop_assert!(p.y >= 2.0 && p.y <= f64::from(size.height) - 3.0);
            }
        }
    }

    #[test]
    fn the_truth_is_uniform_in_arc_length(case in cases()) {
        prop_assert_eq!(case.truth.len(), 2000);
        let step = case.length() / 1999.0;
        let chords: Vec<f64> = case.truth.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
        // A chord is never longer than its arc; the chords together are short of the arcs by what
        // they cut off at bends: less than a thousandth, most of it in few places.
        prop_assert!(chords.iter().all(|c| *c <= step * 1.001));
        let short = chords.iter().filter(|c| **c < 0.99 * step).count();
        prop_assert!(short < 40, "{short} chords cut a bend");
    }

    #[test]
    fn an_exact_point_lies_on_the_epipolar_line_of_its_partner(case in cases()) {
        let f = case.true_rig.fundamental();
        let ft = f.transpose();
        let pairs1 = case.exact_points.0.iter().zip(&case.exact_arc_lengths.0).step_by(7);
        for (p1, s) in pairs1 {
            let (same, partner) = case.true_rig.project(&case.truth_at(*s).unwrap()).unwrap();
            prop_assert!(p1.distance(same) < EXACT_PX);
            prop_assert!(ft.line(*p1).unwrap().distance(partner) < EXACT_PX);
        }
        let pairs2 = case.exact_points.1.iter().zip(&case.exact_arc_lengths.1).step_by(7);
        for (p2, s) in pairs2 {
            let (partner, same) = case.true_rig.project(&case.truth_at(*s).unwrap()).unwrap();
            prop_assert!(p2.distance(same) < EXACT_PX);
            prop_assert!(f.line(*p2).unwrap().distance(partner) < EXACT_PX);
        }
    }

    #[test]
    fn exact_points_are_a_pixel_apart_and_in_order(case in cases()) {
        fn check<V: View>(points: &[Pixel<V>], arcs: &[f64], length: f64) {
            assert_eq!(points.len(), arcs.len());
            // Along the curve the spacing is L / round(L): within 1 % of 1 px from L = 50 on.
            assert!(points.windows(2).all(|w| w[0].distance(w[1]) <= 1.02));
            assert!(arcs.windows(2).all(|w| w[0] < w[1]));
            assert_eq!(arcs[0], 0.0);
            assert!((arcs[arcs.len() - 1] - length).abs() < 1e-12 * length);
        }
        check(&case.exact_points.0, &case.exact_arc_lengths.0, case.length());
        check(&case.exact_points.1, &case.exact_arc_lengths.1, case.length());
    }

    #[test]
    fn rounded_points_are_the_nearest_truth_points_of_their_pixels_in_order(case in cases()) {
        fn check<V: View>(points: &[Pixel<V>], camera: &Camera, truth: &[Point3]) {
            // Oracle: for each truth point in order, is it the nearest of all in its pixel?
            let shown: Vec<(Point2, f64)> = truth
                .iter()
                .map(|x| {
                    let p = camera.project(x).unwrap();
                    (Point2::new(p.x.round(), p.y.round()), camera.depth(x))
                })
                .collect();
            let mut order: Vec<usize> = (0..shown.len()).collect();
            order.sort_by(|a, b| {
                let ((p, dp), (q, dq)) = (shown[*a], shown[*b]);
                p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(dp.total_cmp(&dq)).then(a.cmp(b))
            });
            order.dedup_by_key(|k| (shown[*k].0.x as i64, shown[*k].0.y as i64));
            order.sort_unstable();
            let expected: Vec<Pixel<V>> = order.into_iter().map(|k| shown[k].0.into()).collect();
            assert_eq!(points, expected);
            let size = camera.size();
            assert!(points.iter().all(|p| {
                (0.0..f64::from(size.width)).contains(&p.x)
                    && (0.0..f64::from(size.height)).contains(&p.y)
            }));
        }
        check(&case.rounded_points.0, cameras(&case)[0], &case.truth);
        check(&case.rounded_points.1, cameras(&case)[1], &case.truth);
    }

    #[test]
    fn a_whole_case_has_its_mask_pixels_within_half_the_thickness(
        case in cases(), at in 0..2000_usize,
    ) {
        for view in 0..2 {
            let curve = projected(&case, view);
            let (row, column) = (curve[at].y.round() as usize, curve[at].x.round() as usize);
            let (height, width) = case.masks[view].dim();
            let rows = row.saturating_sub(9)..(row + 10).min(height);
            for r in rows {
                for c in column.saturating_sub(9)..(column + 10).min(width) {
                    let p = Point2::new(c as f64, r as f64);
                    let d = curve.windows(2).map(|w| distance_to_segment(p, w[0], w[1]))
                        .fold(f64::INFINITY, f64::min);
                    let half = case.mask_thickness_px[view] / 2.0;
                    // The rim itself is left to rounding: 1e-9 px, coordinates times epsilon
                    // being below 1e-12.
                    if (d - half).abs() > 1e-9 {
                        prop_assert_eq!(case.masks[view][[r, c]], d <= half);
                    }
                }
            }
        }
    }

    #[test]
    fn a_whole_mask_is_one_component(
        family in families(), seed: u64, thickness in prop::option::of(1.0..9.0),
    ) {
        let options = CaseOptions { mask_thickness_px: thickness, ..CaseOptions::default() };
        let case = generate(family, seed, 0, &options).unwrap();
        prop_assert!(case.mask_thickness_px.iter().all(|t| *t >= 1.0));
        prop_assert_eq!(case.masks.map(|mask| components(&mask)), [1, 1]);
    }

    #[test]
    fn an_occlusion_hides_the_wire_but_never_a_tip(
        family in prop::sample::select(vec![Family::Easy, Family::Hard, Family::Helix, Family::SimPaper]),
        seed: u64,
    ) {
        let options = CaseOptions { occlusion_discs: 1..=2, ..CaseOptions::default() };
        let (case, whole) = (generate(family, seed, 0, &options).unwrap(), plain(family, seed, 0));
        for view in 0..2 {
            prop_assert!((1..=2).contains(&case.occlusions[view].len()));
            let curve = projected(&case, view);
            let half = case.mask_thickness_px[view] / 2.0;
            for ((row, column), &set) in case.masks[view].indexed_iter() {
                let p = Point2::new(column as f64, row as f64);
                let hidden = case.occlusions[view].iter().any(|disc| disc.covers(p.x, p.y));
                prop_assert_eq!(set, whole.masks[view][[row, column]] && !hidden);
                let tip = (p - curve[0]).norm().min((p - curve[1999]).norm());
                prop_assert!(!hidden || tip > half);
            }
            for disc in &case.occlusions[view] {
                let centre = Point2::new(disc.x, disc.y);
                let off = curve.windows(2).map(|w| distance_to_segment(centre, w[0], w[1]))
                    .fold(f64::INFINITY, f64::min);
                prop_assert!(off < EXACT_PX);
            }
        }
    }

    #[test]
    fn a_gap_is_missing_from_points_and_mask_and_spares_the_tips(
        family in prop::sample::select(vec![Family::Easy, Family::Hard, Family::Helix, Family::SimPaper]),
        seed: u64,
    ) {
        let options = CaseOptions { gaps: 1..=3, ..CaseOptions::default() };
        let (case, whole) = (generate(family, seed, 0, &options).unwrap(), plain(family, seed, 0));
        let (p, q) = (&case.exact_points.0, &whole.exact_points.0);
        let gaps = &case.gaps[0];
        let gone: f64 = gaps.iter().map(|(start, end)| end - start).sum();
        // One point fewer per px of gap; each visible stretch rounds its own count.
        let tolerance = 2.0 * (gaps.len() as f64 + 1.0);
        prop_assert!((q.len() as f64 - p.len() as f64 - gone).abs() <= tolerance);
        prop_assert!(!gaps.is_empty() && gaps.windows(2).all(|w| w[0].1 < w[1].0));
        let length: f64 = projected(&case, 0).windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        let spares_tips = gaps
            .iter()
            .all(|(start, end)| *start >= 25.0 && *end <= length - 25.0 && end > start);
        prop_assert!(spares_tips);
        // Rounded points are the pixels of the vertices outside the gaps, no more and no fewer. A gap
        // may still cost none: where the curve lies on itself, another strand shows the same pixels.
        let mut arc = 0.0;
        let (mut shown, mut at_ends) = (BTreeSet::new(), BTreeSet::new());
        let curve = projected(&case, 0);
        for (k, vertex) in curve.iter().enumerate() {
            arc += if k == 0 { 0.0 } else { (vertex - curve[k - 1]).norm() };
            let pixel = (vertex.x.round() as i64, vertex.y.round() as i64);
            let inside = |margin_px: f64| {
                gaps.iter().any(|(start, end)| start + margin_px < arc && arc < end - margin_px)
            };
            if !inside(-EXACT_PX) {
                shown.insert(pixel);
            } else if !inside(EXACT_PX) {
                at_ends.insert(pixel);
            }
        }
        let points: BTreeSet<(i64, i64)> =
            case.rounded_points.0.iter().map(|p| (p.x as i64, p.y as i64)).collect();
        prop_assert_eq!(points.len(), case.rounded_points.0.len());
        prop_assert!(points.is_superset(&shown));
        prop_assert!(points.difference(&shown).all(|pixel| at_ends.contains(pixel)));
        let (left, all) = (&case.masks[0], &whole.masks[0]);
        prop_assert!(left.iter().zip(all).all(|(left, all)| !left || *all));
    }

    #[test]
    fn the_calibration_error_has_the_stated_size(
        family in families(), seed: u64, rotation_deg in 0.001..5.0_f64, shift_px in 0.0..50.0_f64,
    ) {
        let error = CalibrationError { rotation_deg, shift_px };
        let options = CaseOptions { calibration_error: Some(error), ..CaseOptions::default() };
        let case = generate(family, seed, 3, &options).unwrap();
        prop_assert_eq!(case.rig.camera1(), case.true_rig.camera1());
        let (nominal, real) = (case.rig.camera2(), case.true_rig.camera2());
        // |R - I|_F = 2 sqrt 2 sin(angle / 2): accurate for small angles, where the trace is not.
        let turn = nominal.r() * real.r().transpose();
        let sine = (turn - accurate_geom::nalgebra::Matrix3::identity()).norm()
            / 8_f64.sqrt();
        prop_assert!((2.0 * sine.asin() - rotation_deg.to_radians()).abs() < 1e-14);
        let shift = (nominal.k().column(2) - real.k().column(2)).norm();
        prop_assert!((shift - shift_px).abs() < 1e-12);
        // The centre stays: a few products of the distance, at most 1200 units, with epsilon.
        prop_assert!((nominal.centre() - real.centre()).norm() < 1e-11);
    }

    #[test]
    fn a_tangency_case_has_three_stretches_in_a_view(seed: u64, index: u64) {
        let case = plain(Family::Tangency, seed, index);
        let views = case.tangent_stretches(5.0, 10.0).unwrap();
        prop_assert!(views.iter().any(|view| view.len() >= 3));
        // Oracle for view 1: on a stretch the epipolar lines of the partners meet the curve at
        // less than 5 degrees.
        let f = case.true_rig.fundamental();
        let curve = projected(&case, 0);
        let mut arc = 0.0;
        for k in 0..1999 {
            let step = curve[k + 1] - curve[k];
            if views[0].iter().any(|s| s.start_px <= arc && arc < s.end_px - 1e-9) {
                let (_, partner) = case.true_rig.project(&case.truth[k]).unwrap();
                let n = f.line(partner).unwrap().coefficients().xy();
                let sine = step.dot(&n).abs() / step.norm();
                prop_assert!(sine <= 5_f64.to_radians().sin() + 1e-12);
            }
            arc += step.norm();
        }
        prop_assert!(views.iter().flatten().all(|s| s.length_px() >= 10.0));
    }

    #[test]
    fn the_cameras_stand_where_the_family_says(case in cases()) {
        let [one, two] = cameras(&case);
        let azimuth = |x: Point3| x.y.atan2(x.x).to_degrees();
        let between = (azimuth(two.centre()) - azimuth(one.centre())).rem_euclid(360.0);
        match case.family {
            Family::SimPaper => {
                let (low, high) = case.truth.iter().fold(
                    (case.truth[0].coords, case.truth[0].coords),
                    |(l, h), p| (l.inf(&p.coords), h.sup(&p.coords)),
                );
                let centre = Point3::from((low + high) / 2.0);
                let (a, b) = (one.centre() - centre, two.centre() - centre);
                // Resampling cuts the extremes of the bounding box by less than a point's step.
                let side = (high - low).max();
                prop_assert!((a.norm() - 2.0 * side).abs() < 0.3);
                prop_assert!((b.norm() - 2.0 * side).abs() < 0.3);
                let angle = a.angle(&b).to_degrees();
                prop_assert!((29.9..50.1).contains(&angle));
                prop_assert!((one.centre().z - two.centre().z).abs() < 1e-9);
            }
            Family::Carm => {
                prop_assert!((24.999..60.001).contains(&between));
                prop_assert_eq!(one.k()[(1, 1)], -1493.75);
                for camera in [one, two] {
                    prop_assert!((camera.t() - Point3::new(0.0, 0.0, 720.0).coords).norm() < 1e-9);
                    prop_assert!(camera.centre().z.abs() < 1e-9);
                }
                prop_assert!((55.0..141.0).contains(&case.length()));
            }
            _ => {
                prop_assert!((59.999..100.001).contains(&between));
                for camera in [one, two] {
                    prop_assert!((camera.centre().coords.norm() - 1200.0).abs() < 1e-9);
                }
                prop_assert!(two.centre().z.abs() <= 1200.0 * 15_f64.to_radians().sin() + 1e-9);
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_refused_with_its_size() {
    let huge = CaseOptions {
        occlusion_discs: 1..=1,
        occlusion_radius_px: 5000.0,
        ..CaseOptions::default()
    };
    let error = generate(Family::Easy, 1, 0, &huge).unwrap_err();
    assert!(matches!(error, SynthError::NoRoom { view: 1, size_px: 5000.0, .. }), "{error}");
    let long =
        CaseOptions { gaps: 1..=1, gap_length_px: 4000.0..=4000.0, ..CaseOptions::default() };
    let error = generate(Family::Easy, 1, 0, &long).unwrap_err();
    assert!(matches!(error, SynthError::NoRoom { what: "a gap", .. }), "{error}");
    let thin = CaseOptions { mask_thickness_px: Some(0.0), ..CaseOptions::default() };
    let error = generate(Family::Easy, 1, 0, &thin).unwrap_err();
    assert!(error.to_string().contains("mask_thickness_px is 0.0"), "{error}");
}

#[test]
fn the_largest_seed_and_index_are_as_good_as_any() {
    for family in Family::ALL {
        let case = plain(family, u64::MAX, u64::MAX);
        assert_eq!(case.id, format!("{family}-{}-{}", u64::MAX, u64::MAX));
    }
    assert_eq!(plain(Family::SimPaper, 1, 3).id, "sim-paper-1-003");
}
