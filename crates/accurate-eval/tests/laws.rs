//! What must hold for all scores.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_eval::{
    accuracy, align_rigid, align_similarity, completeness, curve_scores, discrete_frechet,
    table_scores,
};
use accurate_geom::nalgebra::{Rotation3, Vector3};
use accurate_geom::{Point3, Polyline3};
use proptest::prelude::*;

/// Curves within a cube of half side 50.
fn curves(points: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Point3>> {
    prop::collection::vec(prop::array::uniform3(-50.0..50.0_f64), points)
        .prop_map(|xyz| xyz.into_iter().map(Point3::from).collect())
}

fn rotations() -> impl Strategy<Value = Rotation3<f64>> {
    prop::array::uniform3(-3.0..3.0_f64).prop_map(|axis| Rotation3::new(Vector3::from(axis)))
}

/// Rounding of a distance between points of coordinates below `size`: three differences, three
/// products and a root, and the motion of both points, nine products each.
fn rounding(size: f64) -> f64 {
    64.0 * f64::EPSILON * size
}

fn brute_nearest(from: &[Point3], to: &[Point3]) -> Vec<f64> {
    from.iter().map(|p| to.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min)).collect()
}

proptest! {
    #[test]
    fn accuracy_is_completeness_with_the_roles_exchanged(a in curves(1..40), b in curves(1..40)) {
        prop_assert_eq!(accuracy(&a, &b).unwrap(), completeness(&b, &a).unwrap());
        let scores = table_scores(&a, &b).unwrap();
        prop_assert_eq!(scores.accuracy, accuracy(&a, &b).unwrap());
        prop_assert_eq!(scores.completeness, completeness(&a, &b).unwrap());
    }

    #[test]
    fn table_scores_equal_their_definition_by_brute_force(a in curves(1..60), b in curves(1..60)) {
        let scores = table_scores(&a, &b).unwrap();
        let (to_truth, to_found) = (brute_nearest(&a, &b), brute_nearest(&b, &a));
        let mean = |d: &[f64]| d.iter().sum::<f64>() / d.len() as f64;
        // Sums of at most 60 distances below 200.
        let tolerance = 60.0 * f64::EPSILON * 200.0;
        prop_assert!((scores.accuracy - mean(&to_truth)).abs() <= tolerance);
        prop_assert!((scores.completeness - mean(&to_found)).abs() <= tolerance);
        prop_assert_eq!(scores.overall, (scores.accuracy + scores.completeness) / 2.0);
        let max = to_found.iter().copied().fold(0.0, f64::max);
        prop_assert!((scores.max_error - max).abs() <= tolerance);
    }

    #[test]
    fn a_curve_against_itself_scores_zero(a in curves(2..30)) {
        let table = table_scores(&a, &a).unwrap();
        prop_assert_eq!(
            [table.accuracy, table.completeness, table.overall, table.max_error], [0.0; 4]
        );
        let curve = curve_scores(&a, &a, 8.0).unwrap();
        // Samples are rounded off the line they are on by a product and a sum.
        prop_assert!(curve.hausdorff <= rounding(50.0));
        prop_assert_eq!((curve.frechet, curve.frechet_reversed, curve.length_error), (0.0, false, 0.0));
    }

    #[test]
    fn curve_scores_equal_their_definition_by_brute_force(
        a in curves(2..12), b in curves(2..12), spacing in 1.0..20.0_f64,
    ) {
        let scores = curve_scores(&a, &b, spacing).unwrap();
        let samples = |points: &[Point3]| {
            let line = Polyline3::new(points.to_vec()).unwrap();
            let steps = (line.length() / spacing).ceil();
            (0..=steps as usize).map(|k| line.at(line.length() * (k as f64 / steps))).collect::<Vec<_>>()
        };
        let ascending = |from: &[Point3], to: &[Point3]| {
            let line = Polyline3::new(to.to_vec()).unwrap();
            let mut distances: Vec<_> = from.iter().map(|p| line.closest(p).distance).collect();
            distances.sort_by(f64::total_cmp);
            distances
        };
        let (to_truth, to_found) = (ascending(&samples(&a), &b), ascending(&samples(&b), &a));
        let mean = |d: &[f64]| d.iter().sum::<f64>() / d.len() as f64;
        let percentile_95 = |d: &[f64]| {
            let at = 0.95 * (d.len() - 1) as f64;
            let next = d[(at as usize + 1).min(d.len() - 1)];
            d[at as usize] + at.fract() * (next - d[at as usize])
        };
        // Places of samples along 11 segments shorter than 174, rounded in another order.
        let tolerance = rounding(11.0 * 174.0);
        let near = |found: f64, expected: f64| (found - expected).abs() <= tolerance;
        prop_assert!(near(scores.accuracy, mean(&to_truth)));
        prop_assert!(near(scores.completeness, mean(&to_found)));
        prop_assert!(near(scores.overall, (mean(&to_truth) + mean(&to_found)) / 2.0));
        prop_assert!(near(scores.percentile_95, percentile_95(&to_truth).max(percentile_95(&to_found))));
        let (farthest, lost) = (to_truth[to_truth.len() - 1], to_found[to_found.len() - 1]);
        prop_assert!(near(scores.max_reconstruction_to_truth, farthest));
        prop_assert!(near(scores.max_truth_to_reconstruction, lost));
        prop_assert!(near(scores.hausdorff, farthest.max(lost)));
    }

    #[test]
    fn a_common_rigid_motion_changes_no_score(
        a in curves(2..20), b in curves(2..20), rotation in rotations(),
        shift in prop::array::uniform3(-100.0..100.0_f64),
    ) {
        let moved = |c: &[Point3]| c.iter().map(|p| rotation * p + Vector3::from(shift)).collect::<Vec<_>>();
        let (before, after) = (table_scores(&a, &b).unwrap(), table_scores(&moved(&a), &moved(&b)).unwrap());
        let tolerance = rounding(200.0);
        prop_assert!((before.overall - after.overall).abs() <= tolerance);
        prop_assert!((before.max_error - after.max_error).abs() <= tolerance);
    }

    #[test]
    fn scores_scale_with_the_unit(a in curves(2..20), b in curves(2..20), power in -20..20_i32) {
        // A power of two: no rounding at all.
        let unit = 2.0_f64.powi(power);
        let scaled = |c: &[Point3]| c.iter().map(|p| p * unit).collect::<Vec<_>>();
        let before = curve_scores(&a, &b, 4.0).unwrap();
        let after = curve_scores(&scaled(&a), &scaled(&b), 4.0 * unit).unwrap();
        prop_assert_eq!(after.overall, before.overall * unit);
        prop_assert_eq!(after.hausdorff, before.hausdorff * unit);
        prop_assert_eq!(after.frechet, before.frechet * unit);
        prop_assert_eq!(after.length_error, before.length_error * unit);
        prop_assert_eq!(after.relative_length_error, before.relative_length_error);
        let (before, after) = (table_scores(&a, &b).unwrap(), table_scores(&scaled(&a), &scaled(&b)).unwrap());
        prop_assert_eq!(after.overall, before.overall * unit);
        prop_assert_eq!(after.max_error, before.max_error * unit);
    }

    #[test]
    fn hausdorff_is_symmetric_and_at_most_the_coupling_distance(
        a in curves(2..15), b in curves(2..15), spacing in 2.0..20.0_f64,
    ) {
        let (ab, ba) = (curve_scores(&a, &b, spacing).unwrap(), curve_scores(&b, &a, spacing).unwrap());
        prop_assert_eq!(ab.hausdorff, ba.hausdorff);
        prop_assert_eq!(ab.percentile_95, ba.percentile_95);
        prop_assert_eq!(ab.frechet, ba.frechet);
        prop_assert!(ab.percentile_95 <= ab.hausdorff);
        prop_assert!(ab.accuracy <= ab.max_reconstruction_to_truth);
        // A coupling pairs every sample with a point of the other polyline, off it by rounding.
        prop_assert!(ab.hausdorff <= ab.frechet + rounding(50.0));
    }

    #[test]
    fn reversing_a_curve_changes_only_the_direction_flag(a in curves(2..15), b in curves(2..15)) {
        let mut reversed = a.clone();
        reversed.reverse();
        let (one, other) = (curve_scores(&a, &b, 4.0).unwrap(), curve_scores(&reversed, &b, 4.0).unwrap());
        // Sampling from the other end rounds arc lengths below 15 * 174 differently.
        let tolerance = rounding(15.0 * 174.0);
        prop_assert!((one.frechet - other.frechet).abs() <= tolerance);
        prop_assert!((one.hausdorff - other.hausdorff).abs() <= tolerance);
        let forward = discrete_frechet(&a, &b).unwrap();
        prop_assert_eq!(forward, discrete_frechet(&b, &a).unwrap());
    }

    #[test]
    fn the_coupling_distance_equals_its_recursive_definition(a in curves(1..7), b in curves(1..7)) {
        fn recursive(a: &[Point3], b: &[Point3], i: usize, j: usize) -> f64 {
            let here = (a[i] - b[j]).norm();
            let before = match (i, j) {
                (0, 0) => return here,
                (0, _) => recursive(a, b, 0, j - 1),
                (_, 0) => recursive(a, b, i - 1, 0),
                _ => recursive(a, b, i - 1, j)
                    .min(recursive(a, b, i - 1, j - 1))
                    .min(recursive(a, b, i, j - 1)),
            };
            before.max(here)
        }
        let found = discrete_frechet(&a, &b).unwrap();
        prop_assert_eq!(found, recursive(&a, &b, a.len() - 1, b.len() - 1));
    }

    #[test]
    fn more_points_never_worsen_completeness(a in curves(1..20), more in curves(1..20), b in curves(1..40)) {
        let all: Vec<_> = a.iter().chain(&more).copied().collect();
        let (few, many) = (table_scores(&a, &b).unwrap(), table_scores(&all, &b).unwrap());
        prop_assert!(many.completeness <= few.completeness);
        prop_assert!(many.max_error <= few.max_error);
    }

    #[test]
    fn umeyama_recovers_a_similarity(
        source in curves(4..40), rotation in rotations(), log_scale in -5.0..5.0_f64,
        shift in prop::array::uniform3(-100.0..100.0_f64), seed_weights in any::<bool>(),
    ) {
        let scale = log_scale.exp();
        let target: Vec<_> =
            source.iter().map(|p| rotation * (p * scale) + Vector3::from(shift)).collect();
        let weights: Vec<f64> = (0..source.len()).map(|k| 1.0 + (k % 3) as f64).collect();
        let found = align_similarity(&source, &target, seed_weights.then_some(&weights[..])).unwrap();
        prop_assume!(found.spread_ratio > 0.05);
        let transform = found.target_from_source;
        // Target coordinates below 100 + 90 scale are rounded; the means and the covariance of 40
        // points add 40 more; the rotation is amplified by the inverse squared spread ratio.
        let size = 100.0 + 90.0 * scale;
        let error = 40.0 * 8.0 * f64::EPSILON * size / found.spread_ratio.powi(2);
        prop_assert!(found.rms <= error, "{} {}", found.rms, error);
        prop_assert!((transform.scale - scale).abs() <= error, "{} {}", transform.scale, scale);
        let turned = (transform.rotation - rotation.matrix()).norm();
        prop_assert!(turned <= error / scale, "{turned}");
        prop_assert!((transform.rotation.determinant() - 1.0).abs() <= 1e-13);
        let point = source[0];
        prop_assert!((transform.apply(&point) - target[0]).norm() <= 4.0 * error);
    }

    /// A bow so flat that it is almost a line, down to where rounding decides.
    #[test]
    fn umeyama_recovers_the_motion_of_a_nearly_straight_wire(
        rotation in rotations(), log_bow in -5.0..0.0_f64,
    ) {
        let bow = 10f64.powf(log_bow);
        let place = |x: f64| Point3::new(x, bow * (x * x / 50.0 - 17.0), 0.0);
        let source: Vec<_> = (-50..=50).map(|x| place(f64::from(x))).collect();
        let target: Vec<_> = source.iter().map(|p| rotation * p).collect();
        let found = align_rigid(&source, &target, None).unwrap();
        // As above: coordinates below 90, amplified by the inverse squared spread ratio.
        let error = 40.0 * 8.0 * f64::EPSILON * 90.0 / found.spread_ratio.powi(2);
        let turned = (found.target_from_source.rotation - rotation.matrix()).norm();
        prop_assert!(turned <= error, "{turned} {error} at {}", found.spread_ratio);
        prop_assert!(found.rms <= error, "{} {error}", found.rms);
    }

    #[test]
    fn no_rigid_motion_near_the_fitted_one_is_better(
        source in curves(4..20), noise in curves(20..21), rotation in rotations(),
        tilt in prop::array::uniform3(-0.05..0.05_f64), step in prop::array::uniform3(-0.5..0.5_f64),
    ) {
        let target: Vec<_> =
            source.iter().zip(&noise).map(|(p, n)| rotation * p + n.coords * 0.05).collect();
        let found = align_rigid(&source, &target, None).unwrap();
        let rms = |motion: &dyn Fn(&Point3) -> Point3| {
            let sum: f64 = source.iter().zip(&target).map(|(s, t)| (motion(s) - t).norm_squared()).sum();
            (sum / source.len() as f64).sqrt()
        };
        let best = found.target_from_source;
        prop_assert_eq!(best.scale, 1.0);
        prop_assert!((rms(&|p| best.apply(p)) - found.rms).abs() <= rounding(200.0));
        let tilt = Rotation3::new(Vector3::from(tilt));
        let other = rms(&|p| tilt * best.apply(p) + Vector3::from(step));
        prop_assert!(found.rms <= other + rounding(200.0));
        // And a free scale is never worse.
        prop_assert!(align_similarity(&source, &target, None).unwrap().rms <= found.rms + rounding(200.0));
    }
}
