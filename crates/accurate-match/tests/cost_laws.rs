//! Laws of the epipolar costs.
#![allow(clippy::unwrap_used, clippy::panic)]

mod scenes;

use accurate_geom::nalgebra::Vector3;
use accurate_geom::{
    Fundamental, LengthUnit, Pixel, Rig, View1, View2, epipolar_distance, sampson_distance,
    symmetric_epipolar_distance,
};
use accurate_match::{CostModel, DistanceKind, MatchError, TieOrder, align_rows};
use proptest::prelude::*;
use scenes::{
    DISTANCE_TOLERANCE_PX, KINDS, camera_at, curves, helices, relabelled, rigs, scattered, view1,
    view2,
};

fn rows(costs: &CostModel) -> Vec<Vec<f64>> {
    let row = |i| {
        let mut row = vec![f64::NAN; costs.n2()];
        costs.fill_row(i, &mut row);
        row
    };
    (0..costs.n1()).map(row).collect()
}

fn cells(costs: &CostModel) -> Vec<Vec<f64>> {
    (0..costs.n1()).map(|i| (0..costs.n2()).map(|j| costs.cost(i, j)).collect()).collect()
}

fn assert_close(a: &[Vec<f64>], b: &[Vec<f64>]) {
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!((a - b).abs() <= DISTANCE_TOLERANCE_PX, "{a} {b}");
    }
}

proptest! {
    #[test]
    fn costs_are_the_distances_of_the_geometry(
        rig in rigs(), c1 in scattered::<View1>(1..=6), c2 in scattered::<View2>(1..=6)
    ) {
        let f = rig.fundamental();
        for kind in KINDS {
            let costs = CostModel::new(f, &c1, &c2, kind).unwrap();
            for (i, &p1) in c1.iter().enumerate() {
                for (j, &p2) in c2.iter().enumerate() {
                    let expected = match kind {
                        DistanceKind::View1 => epipolar_distance(f, p1, p2),
                        DistanceKind::View2 => f.transpose().line(p1).map(|l| l.distance(p2)),
                        DistanceKind::Symmetric => symmetric_epipolar_distance(f, p1, p2),
                        DistanceKind::Sampson => sampson_distance(f, p1, p2),
                    };
                    prop_assert!((costs.cost(i, j) - expected.unwrap()).abs() <= DISTANCE_TOLERANCE_PX);
                }
            }
        }
    }

    #[test]
    fn a_sweep_gives_the_same_bits_as_single_cells(
        rig in rigs(), c1 in scattered(1..=9), c2 in scattered(1..=9)
    ) {
        for kind in KINDS {
            let costs = CostModel::new(rig.fundamental(), &c1, &c2, kind).unwrap();
            prop_assert_eq!(rows(&costs), cells(&costs));
        }
    }

    #[test]
    fn the_scale_of_f_does_not_matter(
        rig in rigs(), c1 in scattered(1..=6), c2 in scattered(1..=6), scale in 1e-6..1e6_f64, flip: bool
    ) {
        let scale = if flip { -scale } else { scale };
        let scaled = Fundamental::from_matrix(rig.fundamental().matrix() * scale).unwrap();
        for kind in KINDS {
            let costs = CostModel::new(rig.fundamental(), &c1, &c2, kind).unwrap();
            assert_close(&cells(&CostModel::new(&scaled, &c1, &c2, kind).unwrap()), &cells(&costs));
        }
    }

    #[test]
    fn exchanging_the_views_transposes_the_costs(
        rig in rigs(), c1 in scattered::<View1>(1..=6), c2 in scattered::<View2>(1..=6)
    ) {
        use DistanceKind::{Sampson, Symmetric, View1, View2};
        let swapped = rig.swapped();
        for (kind, mirrored) in [(View1, View2), (View2, View1), (Symmetric, Symmetric), (Sampson, Sampson)] {
            let costs = CostModel::new(rig.fundamental(), &c1, &c2, kind).unwrap();
            let (s1, s2) = (relabelled(&c2), relabelled(&c1));
            let exchanged = CostModel::new(swapped.fundamental(), &s1, &s2, mirrored).unwrap();
            for i in 0..c1.len() {
                for j in 0..c2.len() {
                    let difference = costs.cost(i, j) - exchanged.cost(j, i);
                    prop_assert!(difference.abs() <= DISTANCE_TOLERANCE_PX);
                }
            }
        }
    }

    #[test]
    fn the_two_images_of_a_point_cost_nothing(rig in rigs(), helix in helices()) {
        let points: Vec<_> = (0..9).map(|k| helix.at(f64::from(k) / 8.0)).collect();
        let (c1, c2) = (view1(&rig, &points), view2(&rig, &points));
        for kind in KINDS {
            let costs = CostModel::new(rig.fundamental(), &c1, &c2, kind).unwrap();
            for k in 0..points.len() {
                prop_assert!(costs.cost(k, k) <= DISTANCE_TOLERANCE_PX);
            }
        }
    }

    #[test]
    fn sampson_is_below_both_distances_and_symmetric_between_them(
        rig in rigs(), c1 in scattered(1..=6), c2 in scattered(1..=6)
    ) {
        let costs = |kind| CostModel::new(rig.fundamental(), &c1, &c2, kind).unwrap();
        let (sampson, symmetric) = (costs(DistanceKind::Sampson), costs(DistanceKind::Symmetric));
        for i in 0..c1.len() {
            for j in 0..c2.len() {
                let (d1, d2) = (sampson.distance_in_view1(i, j), sampson.distance_in_view2(i, j));
                let slack = DISTANCE_TOLERANCE_PX;
                prop_assert!(sampson.cost(i, j) <= d1.min(d2) + slack);
                prop_assert!(symmetric.cost(i, j) <= d1.max(d2) + slack);
                prop_assert!(symmetric.cost(i, j) >= d1.min(d2) - slack);
                let s1 = sampson.signed_distance_in_view1(i, j).unwrap();
                let s2 = sampson.signed_distance_in_view2(i, j).unwrap();
                prop_assert_eq!((s1.abs(), s2.abs()), (d1, d2));
            }
        }
    }

    #[test]
    fn reversing_both_curves_reverses_the_costs_and_keeps_the_optimum(
        rig in rigs(), c1 in curves(1..=30), c2 in curves(1..=30)
    ) {
        let (r1, r2) = (c1.iter().rev().copied().collect::<Vec<_>>(), c2.iter().rev().copied().collect::<Vec<_>>());
        let total = |costs: &CostModel| {
            let fill = |i: usize, row: &mut [f64]| costs.fill_row(i, row);
            align_rows(costs.n1(), costs.n2(), fill, TieOrder::DiagonalFirst).unwrap().total_cost
        };
        for kind in KINDS {
            let forwards = CostModel::new(rig.fundamental(), &c1, &c2, kind).unwrap();
            let backwards = CostModel::new(rig.fundamental(), &r1, &r2, kind).unwrap();
            let mut turned = cells(&backwards);
            turned.reverse();
            turned.iter_mut().for_each(|row| row.reverse());
            prop_assert_eq!(turned, cells(&forwards));
            // The same terms in the other order: one rounding per addition.
            let tolerance = (c1.len() + c2.len()) as f64 * f64::EPSILON * total(&forwards);
            prop_assert!((total(&forwards) - total(&backwards)).abs() <= tolerance);
        }
    }

    #[test]
    fn near_the_epipole_costs_stay_finite(
        c1 in scattered(1..=4), exponent in -14.0..2.0_f64, direction in -3.0..3.0_f64
    ) {
        let (rig, _, epipole2) = facing_rig();
        let offset = 10_f64.powf(exponent);
        let p2 = Pixel::new(epipole2.x + offset * direction.cos(), epipole2.y + offset * direction.sin());
        for kind in KINDS {
            let costs = CostModel::new(rig.fundamental(), &c1, &[p2], kind).unwrap();
            prop_assert!(cells(&costs).into_iter().flatten().all(|d| d.is_finite() && d >= 0.0));
        }
    }
}

/// Cameras that see each other: both epipoles lie in the images.
fn facing_rig() -> (Rig, Pixel<View1>, Pixel<View2>) {
    let camera1 = camera_at(Vector3::new(200.0, 0.0, 0.0), 1000.0, 1000.0);
    let camera2 = camera_at(Vector3::new(-150.0, 40.0, 30.0), 1200.0, 1200.0);
    let epipole1 = camera1.project(&camera2.centre()).unwrap().into();
    let epipole2 = camera2.project(&camera1.centre()).unwrap().into();
    (Rig::new(camera1, camera2, LengthUnit::Unit).unwrap(), epipole1, epipole2)
}

#[test]
fn at_the_epipole_the_cost_is_the_partners_distance_to_the_other_epipole() {
    let (rig, e1, e2) = facing_rig();
    let (p1, p2) = (Pixel::new(e1.x + 3.0, e1.y - 4.0), Pixel::new(e2.x - 5.0, e2.y + 12.0));
    let (c1, c2) = ([p1, e1], [e2, p2]);
    // Rows: an ordinary p1, the epipole. Columns: the epipole, an ordinary p2.
    let expected = |kind, i, j| -> f64 {
        let ordinary = CostModel::new(rig.fundamental(), &[p1], &[p2], kind).unwrap().cost(0, 0);
        // Partner's distance in view 1 and in view 2; every line passes through its epipole.
        let (d1, d2): (f64, f64) = match (i, j) {
            (0, 1) => return ordinary,
            (0, 0) => (5.0, 0.0),
            (1, 1) => (0.0, 13.0),
            _ => (0.0, 0.0),
        };
        match kind {
            DistanceKind::View1 => d1,
            DistanceKind::View2 => d2,
            DistanceKind::Symmetric => (d1 + d2) * std::f64::consts::FRAC_1_SQRT_2,
            DistanceKind::Sampson => d1 + d2,
        }
    };
    for kind in KINDS {
        let costs = CostModel::new(rig.fundamental(), &c1, &c2, kind).unwrap();
        assert_eq!(rows(&costs), cells(&costs));
        for i in 0..2 {
            for j in 0..2 {
                let (found, expected) = (costs.cost(i, j), expected(kind, i, j));
                assert!(
                    (found - expected).abs() < DISTANCE_TOLERANCE_PX,
                    "{kind:?} {i} {j}: {found} {expected}"
                );
            }
        }
        assert_eq!(costs.signed_distance_in_view1(0, 0), None);
        assert_eq!(costs.signed_distance_in_view2(1, 1), None);
    }
}

#[test]
fn an_unusable_curve_is_refused_with_its_point() {
    let rig = scenes::rig(0.8, 10.0, 1000.0, 1000.0);
    let ok = [Pixel::new(1.0, 2.0)];
    let new = |c1: &[Pixel<View1>], c2: &[Pixel<View2>]| {
        CostModel::new(rig.fundamental(), c1, c2, DistanceKind::View1).map(|costs| costs.n1())
    };
    assert_eq!(new(&[], &relabelled(&ok)), Err(MatchError::Empty { view: 1 }));
    assert_eq!(new(&ok, &[]), Err(MatchError::Empty { view: 2 }));
    let bad = [Pixel::new(1.0, 2.0), Pixel::new(3.0, f64::INFINITY)];
    let expected = MatchError::NotFinite { view: 2, index: 1, x: 3.0, y: f64::INFINITY };
    assert_eq!(new(&ok, &bad), Err(expected));
}

#[test]
fn huge_pixels_give_large_costs_or_an_error_never_nan() {
    let rig = scenes::rig(0.8, 10.0, 1000.0, 1000.0);
    for size in [1e9, 1e100, 1e200, 1e308] {
        let (c1, c2) = ([Pixel::new(size, -size)], [Pixel::new(-size, 0.3 * size)]);
        for kind in KINDS {
            // Both pixels lie as far from the other's line as they lie from their images.
            match CostModel::new(rig.fundamental(), &c1, &c2, kind) {
                Ok(costs) => {
                    let cost = costs.cost(0, 0);
                    assert!(cost.is_finite() && cost > 1e-3 * size, "{size} {kind:?}: {cost}");
                    let aligned =
                        align_rows(1, 1, |i, row| costs.fill_row(i, row), TieOrder::DiagonalFirst);
                    assert_eq!(aligned.unwrap().total_cost, cost);
                }
                Err(error) => assert!(size > 1e150, "{size} {kind:?}: {error}"),
            }
        }
    }
}
