//! ECDP end to end: known 3D curves through random rigs.
#![allow(clippy::unwrap_used, clippy::panic)]

mod scenes;

use accurate_geom::{GeomError, Pixel, Point3, Rig, Triangulation, View1, View2};
use accurate_match::{
    CostModel, CurveMatcher, CurvePoint, DistanceKind, Ecdp, EcdpParams, MatchError, PixelPair,
    RefineDirections, RefineRule, TieOrder, triangulate_pairs,
};
use proptest::prelude::*;
use scenes::{DISTANCE_TOLERANCE_PX, Helix, KINDS, helices, relabelled, rig, rigs, view1, view2};

fn variants() -> Vec<EcdpParams> {
    let mut variants = vec![EcdpParams::PAPER, EcdpParams::PAPER_REFINED];
    for distance in KINDS {
        for triangulation in [Triangulation::Dlt, Triangulation::LindstromNiter2] {
            variants.push(EcdpParams {
                distance,
                ties: TieOrder::DiagonalFirst,
                refine: RefineRule::Signed,
                refine_directions: RefineDirections::Both,
                triangulation,
            });
        }
    }
    variants
}

/// How far the triangulated point may be from the truth when both pixels carry rounding only.
///
/// A pixel is known to a few ε of its size (about 4 roundings in projection, 4 in the line). At
/// depth Z an error e px across the view is e Z / f in the world, and Z / b times that in depth for
/// a baseline b. The linear solve (singular values span the ratio of f to 1) may lose another
/// factor f.
fn position_tolerance(rig: &Rig) -> f64 {
    let (c1, c2) = (rig.camera1().centre(), rig.camera2().centre());
    let depth = c1.coords.norm().max(c2.coords.norm());
    let focal_px = rig.camera1().k()[(0, 0)].min(rig.camera2().k()[(0, 0)]);
    let pixel_error = 8.0 * f64::EPSILON * scenes::REACH_PX;
    let across = pixel_error * depth / focal_px;
    across * (1.0 + depth / (c1 - c2).norm()) * focal_px
}

fn noisy(curve: Vec<Pixel<View1>>, noise: &[f64]) -> Vec<Pixel<View1>> {
    let shifted = |(k, p): (usize, &Pixel<View1>)| {
        Pixel::new(p.x + noise[2 * k % noise.len()], p.y + noise[(2 * k + 1) % noise.len()])
    };
    curve.iter().enumerate().map(shifted).collect()
}

fn positions(points: &[CurvePoint]) -> Vec<Point3> {
    points.iter().map(|p| p.position).collect()
}

proptest! {
    #[test]
    fn an_exact_helix_comes_back(rig in rigs(), helix in helices(), n in 2..60_usize) {
        let truth: Vec<_> = Helix::parameters(n, 0.3).into_iter().map(|s| helix.at(s)).collect();
        let (c1, c2) = (view1(&rig, &truth), view2(&rig, &truth));
        let diagonal: Vec<_> = (0..n).map(|k| (k, k)).collect();
        for params in variants() {
            let found = Ecdp::new(params).reconstruct(&c1, &c2, &rig).unwrap();
            // The diagonal costs nothing but rounding, and no other path can be as cheap unless two
            // points share an epipolar plane to the last digits.
            prop_assert_eq!(&found.pairs, &diagonal);
            prop_assert_eq!(found.dropped, 0);
            prop_assert!(found.mean_epipolar_distance_px() <= DISTANCE_TOLERANCE_PX);
            for (point, truth) in found.points.iter().zip(&truth) {
                let error = (point.position - truth).norm();
                prop_assert!(error <= position_tolerance(&rig), "{} {}", error, position_tolerance(&rig));
            }
        }
    }

    #[test]
    fn the_path_costs_no_more_than_the_true_correspondence(
        rig in rigs(), helix in helices(), n1 in 2..50_usize, n2 in 2..50_usize, warp in -0.5..1.0_f64
    ) {
        // Sampled differently in the two views: no point has an exact partner.
        let (s1, s2) = (Helix::parameters(n1, warp), Helix::parameters(n2, 0.0));
        let points = |s: &[f64]| s.iter().map(|&s| helix.at(s)).collect::<Vec<_>>();
        let (c1, c2) = (view1(&rig, &points(&s1)), view2(&rig, &points(&s2)));
        let mut truth = vec![(0, 0)];
        let (mut i, mut j) = (0, 0);
        while (i, j) != (n1 - 1, n2 - 1) {
            if j + 1 == n2 || i + 1 < n1 && s1[i + 1] <= s2[j + 1] { i += 1 } else { j += 1 }
            truth.push((i, j));
        }
        for params in variants() {
            let costs = CostModel::new(rig.fundamental(), &c1, &c2, params.distance).unwrap();
            let true_cost: f64 = truth.iter().map(|&(i, j)| costs.cost(i, j)).sum();
            let found = Ecdp::new(params).align(&c1, &c2, &rig).unwrap();
            prop_assert!(found.total_cost <= true_cost * (1.0 + (n1 + n2) as f64 * f64::EPSILON));
        }
    }

    #[test]
    fn every_cell_of_the_path_becomes_a_finite_point_that_projects_near_its_pixels(
        rig in rigs(), helix in helices(), n1 in 2..40_usize, n2 in 2..40_usize
    ) {
        let points = |n| Helix::parameters(n, 0.0).into_iter().map(|s| helix.at(s)).collect::<Vec<_>>();
        let (c1, c2) = (view1(&rig, &points(n1)), view2(&rig, &points(n2)));
        let optimal = EcdpParams { triangulation: Triangulation::LindstromNiter2, ..EcdpParams::PAPER_REFINED };
        let path = Ecdp::new(optimal).align(&c1, &c2, &rig).unwrap().path;
        let found = Ecdp::new(optimal).reconstruct(&c1, &c2, &rig).unwrap();
        prop_assert_eq!(&found.pairs, &path);
        prop_assert_eq!((found.points.len(), found.dropped), (path.len(), 0));
        for point in &found.points {
            prop_assert!(point.position.coords.iter().all(|v| v.is_finite()));
            let (q1, q2) = rig.project(&point.position).unwrap();
            // Moving p1 alone onto the line is one way to make the rays meet; the least correction
            // of both is no longer. Two closed-form steps reach it within a small fraction.
            let moved = q1.distance(point.pixel1).hypot(q2.distance(point.pixel2));
            prop_assert!(moved <= 1.01 * point.epipolar_distance_px + DISTANCE_TOLERANCE_PX);
        }
    }

    #[test]
    fn exchanging_the_views_gives_the_same_curve_with_a_symmetric_distance(
        rig in rigs(), helix in helices(), n1 in 2..40_usize, n2 in 2..40_usize,
        noise in prop::collection::vec(-0.5..0.5_f64, 80)
    ) {
        let points = |n| Helix::parameters(n, 0.0).into_iter().map(|s| helix.at(s)).collect::<Vec<_>>();
        // Noise makes ties impossible, so that the order in which they are broken cannot matter.
        let (c1, c2) = (noisy(view1(&rig, &points(n1)), &noise), view2(&rig, &points(n2)));
        let (s1, s2) = (relabelled(&c2), relabelled(&c1));
        for distance in [DistanceKind::Symmetric, DistanceKind::Sampson] {
            let ecdp = Ecdp::new(EcdpParams {
                distance,
                ties: TieOrder::DiagonalFirst,
                triangulation: Triangulation::LindstromNiter2,
                ..EcdpParams::PAPER
            });
            let one = ecdp.reconstruct(&c1, &c2, &rig).unwrap();
            let other = ecdp.reconstruct(&s1, &s2, &rig.swapped()).unwrap();
            let transposed: Vec<_> = other.pairs.iter().map(|&(j, i)| (i, j)).collect();
            prop_assert_eq!(&one.pairs, &transposed);
            for (a, b) in positions(&one.points).into_iter().zip(positions(&other.points)) {
                prop_assert!((a - b).norm() <= position_tolerance(&rig));
            }
        }
    }

    #[test]
    fn reversing_both_curves_reverses_the_reconstruction(
        rig in rigs(), helix in helices(), n1 in 2..40_usize, n2 in 2..40_usize,
        noise in prop::collection::vec(-0.5..0.5_f64, 80)
    ) {
        let points = |n| Helix::parameters(n, 0.0).into_iter().map(|s| helix.at(s)).collect::<Vec<_>>();
        let (mut c1, mut c2) = (noisy(view1(&rig, &points(n1)), &noise), view2(&rig, &points(n2)));
        let forwards = Ecdp::default().reconstruct(&c1, &c2, &rig).unwrap();
        c1.reverse();
        c2.reverse();
        let mut backwards = Ecdp::default().reconstruct(&c1, &c2, &rig).unwrap();
        backwards.points.reverse();
        prop_assert_eq!(forwards.points, backwards.points);
    }

    #[test]
    fn the_signed_rule_lowers_the_mean_distance(
        rig in rigs(), helix in helices(), n1 in 5..40_usize, n2 in 5..40_usize
    ) {
        let points = |n| Helix::parameters(n, 0.0).into_iter().map(|s| helix.at(s)).collect::<Vec<_>>();
        let (c1, c2) = (view1(&rig, &points(n1)), view2(&rig, &points(n2)));
        let mean = |refine| {
            let params = EcdpParams { refine, ..EcdpParams::PAPER };
            Ecdp::new(params).reconstruct(&c1, &c2, &rig).unwrap().mean_epipolar_distance_px()
        };
        prop_assert!(mean(RefineRule::Signed) <= mean(RefineRule::Off) + DISTANCE_TOLERANCE_PX);
    }
}

#[test]
fn the_name_and_the_published_parameters_stay() {
    assert_eq!(Ecdp::default().name(), "ecdp");
    assert_eq!(Ecdp::default().params, EcdpParams::PAPER);
    assert_eq!(EcdpParams::PAPER.refine, RefineRule::Off);
    assert_eq!(EcdpParams::PAPER_REFINED.refine, RefineRule::Paper);
    let matcher: Box<dyn CurveMatcher> = Box::new(Ecdp::default());
    assert_eq!(matcher.name(), "ecdp");
}

#[test]
fn unusable_curves_are_refused_by_name() {
    let rig = rig(0.8, 10.0, 1000.0, 1000.0);
    let (ok1, ok2) = ([Pixel::<View1>::new(1.0, 2.0)], [Pixel::<View2>::new(1.0, 2.0)]);
    let run = |c1: &[Pixel<View1>], c2: &[Pixel<View2>]| Ecdp::default().reconstruct(c1, c2, &rig);
    assert_eq!(run(&[], &ok2), Err(MatchError::Empty { view: 1 }));
    assert_eq!(run(&ok1, &[]), Err(MatchError::Empty { view: 2 }));
    let nan = run(&[Pixel::new(f64::NAN, 0.0)], &ok2);
    assert!(matches!(nan, Err(MatchError::NotFinite { view: 1, index: 0, .. })), "{nan:?}");
    for size in [1e12, 1e160, 1e308] {
        let far = [Pixel::new(size, -size), Pixel::new(-size, size)];
        if let Ok(found) = run(&far, &ok2) {
            assert!(found.points.iter().all(|p| p.position.coords.iter().all(|v| v.is_finite())));
        }
    }
}

#[test]
fn pairs_that_cannot_be_triangulated_are_counted_or_reported() {
    let rig = rig(0.8, 10.0, 1000.0, 1000.0);
    let (p1, p2) = rig.project(&Point3::new(1.0, 2.0, 3.0)).unwrap();
    let good = PixelPair { cell: (4, 5), pixel1: p1, pixel2: p2 };
    // The rays of the two images of a point at infinity are parallel. Both cameras look at the
    // origin from the x axis and from azimuth 0.8; the direction half way is seen by both.
    let direction = accurate_geom::nalgebra::Vector3::new(-0.4_f64.cos(), -0.4_f64.sin(), 0.1);
    let at_infinity = |camera: &accurate_geom::Camera| {
        let h = camera.k() * camera.r() * direction;
        accurate_geom::Point2::new(h.x / h.z, h.y / h.z)
    };
    let parallel = PixelPair {
        cell: (0, 0),
        pixel1: at_infinity(rig.camera1()).into(),
        pixel2: at_infinity(rig.camera2()).into(),
    };
    let run = |pairs: &[PixelPair]| triangulate_pairs("test", &rig, Triangulation::Dlt, pairs);
    let found = run(&[parallel, good]).unwrap();
    assert_eq!((found.points.len(), found.dropped, found.pairs), (1, 1, vec![(4, 5)]));
    match run(&[parallel, parallel]) {
        Err(MatchError::NothingTriangulated { method: "test", pairs: 2, first }) => {
            assert!(matches!(
                first,
                GeomError::ParallelRays { .. }
                    | GeomError::PointAtInfinity { .. }
                    | GeomError::NotInFront { .. }
            ));
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(run(&[]), Err(MatchError::NoCorrespondence { method: "test", candidates: 0 }));
}

#[test]
fn a_pair_that_meets_behind_the_cameras_is_dropped() {
    let rig = rig(0.8, 10.0, 1000.0, 1000.0);
    // A point behind both cameras has images all the same: the pinhole's other side.
    let behind = accurate_geom::nalgebra::Point3::new(600.0, 260.0, 5.0);
    let image = |camera: &accurate_geom::Camera| {
        let h = camera.k() * (camera.r() * behind.coords + camera.t());
        assert!(h.z < 0.0);
        accurate_geom::Point2::new(h.x / h.z, h.y / h.z)
    };
    let pair = PixelPair {
        cell: (0, 0),
        pixel1: image(rig.camera1()).into(),
        pixel2: image(rig.camera2()).into(),
    };
    match triangulate_pairs("test", &rig, Triangulation::Midpoint, &[pair]) {
        Err(MatchError::NothingTriangulated { first: GeomError::NotInFront { depth }, .. }) => {
            assert!(depth < 0.0);
        }
        other => panic!("{other:?}"),
    }
}
