//! Baur: the graph's optimum is the dynamic programme's, and the fit helps.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]
mod support;

use accurate_baselines::{Baur, KnownLength, Refinement, cheapest_grid_path};
use accurate_geom::{GeomError, Point3};
use accurate_match::{CostModel, DistanceKind, MatchError, TieOrder, align};
use proptest::prelude::*;
use support::*;

fn mean_error(points: impl Iterator<Item = Point3>, truth: &[Point3]) -> f64 {
    let errors: Vec<f64> = points.map(|p| distance_to_curve(&p, truth)).collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}

proptest! {
    #[test]
    fn dijkstra_on_the_graph_costs_what_the_dynamic_programme_costs(
        n1 in 1usize..60, n2 in 1usize..60, seed in prop::collection::vec(0.0..5.0f64, 97),
        ties in any::<bool>(),
    ) {
        let cost = |i: usize, j: usize| {
            let value = seed[(i * 31 + j * 17 + i * j) % seed.len()];
            // Whole numbers make ties, where the two may go different ways at the same cost.
            if ties { value.floor() } else { value }
        };
        let path = cheapest_grid_path(n1, n2, cost).unwrap();
        let alignment = align(n1, n2, cost, TieOrder::DiagonalFirst).unwrap();
        // Both sum at most 119 costs up to 5 in the order of a path.
        prop_assert!((path.cost - alignment.total_cost).abs() <= 119.0 * f64::EPSILON * 595.0);
        let sum: f64 = path.cells.iter().map(|&(i, j)| cost(i, j)).sum();
        prop_assert!((path.cost - sum).abs() <= 119.0 * f64::EPSILON * 595.0);
    }
}

#[test]
fn dijkstra_costs_what_the_dynamic_programme_costs_on_epipolar_distances() {
    let rig = turntable_rig(40.0);
    let (a, b) = rounded_images(&rig, &sampled(400, helix));
    let model = CostModel::new(rig.fundamental(), &a, &b, DistanceKind::Symmetric).unwrap();
    let path = cheapest_grid_path(a.len(), b.len(), |i, j| model.cost(i, j)).unwrap();
    let best = align(a.len(), b.len(), |i, j| model.cost(i, j), TieOrder::DiagonalFirst).unwrap();
    // Sums of at most 800 terms.
    assert!((path.cost - best.total_cost).abs() <= 800.0 * f64::EPSILON * best.total_cost);
}

#[test]
fn the_fit_converges_on_rounded_pixels_and_is_nearer_than_the_pairs() {
    let rig = turntable_rig(40.0);
    let truth = sampled(3000, helix);
    let (a, b) = rounded_images(&rig, &truth);
    let fitted = Baur::default().solve(&a, &b, &rig).unwrap();
    let Refinement::Converged { iterations, rms_px } = fitted.refinement else {
        panic!("the fit failed")
    };
    let raw = Baur { max_iterations: 0, ..Baur::default() }.solve(&a, &b, &rig).unwrap();
    assert_eq!(raw.refinement, Refinement::Failed);
    let error = mean_error(fitted.curve.points.iter().map(|p| p.position), &truth);
    let raw_error = mean_error(raw.curve.points.iter().map(|p| p.position), &truth);
    println!("{iterations} iterations, rms {rms_px} px, error {error}, pairs alone {raw_error}");
    assert!(error < raw_error);
    assert!(rms_px < 0.5);
}

#[test]
fn a_known_length_pulls_the_curve_to_it() {
    let rig = turntable_rig(40.0);
    let (a, b) = rounded_images(&rig, &sampled(3000, helix));
    let length_with = |known_length| {
        let found = Baur { known_length, ..Baur::default() }.solve(&a, &b, &rig).unwrap();
        assert!(matches!(found.refinement, Refinement::Converged { .. }));
        let steps = found.curve.points.windows(2).map(|w| (w[1].position - w[0].position).norm());
        steps.sum::<f64>()
    };
    let free = length_with(None);
    let wanted = free + 1.0;
    let held = length_with(Some(KnownLength { length: wanted, sigma: 1e-3 }));
    println!("free {free}, held {held}");
    assert!((held - wanted).abs() < 0.1 * (free - wanted).abs());
}

#[test]
fn the_output_step_sets_the_distance_of_the_points() {
    let rig = turntable_rig(40.0);
    let (a, b) = rounded_images(&rig, &sampled(3000, helix));
    let found = Baur { output_step: Some(0.5), ..Baur::default() }.solve(&a, &b, &rig).unwrap();
    for w in found.curve.points.windows(2) {
        let step = (w[1].position - w[0].position).norm();
        // The number of steps is whole, so each is off by at most half a step in some 160.
        assert!((step - 0.5).abs() < 0.005, "{step}");
    }
}

#[test]
fn parameters_outside_their_range_are_refused() {
    let rig = turntable_rig(40.0);
    let (a, b) = images(&rig, &sampled(50, line));
    for bad in [
        Baur { step_px: 0.0, ..Baur::default() },
        Baur { span_px: f64::NAN, ..Baur::default() },
        Baur { curvature_weight_px3: -1.0, ..Baur::default() },
        Baur { output_step: Some(f64::INFINITY), ..Baur::default() },
        Baur { known_length: Some(KnownLength { length: 1.0, sigma: 0.0 }), ..Baur::default() },
    ] {
        let found = bad.solve(&a, &b, &rig);
        assert!(matches!(found, Err(MatchError::Geometry(GeomError::OutOfRange { .. }))));
    }
}
