//! Scores of masks and image centrelines: fixtures that Python reads too, brute force, laws.
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate_eval::{
    EvalError, betti_0, betti_0_error, centreline_distance, cl_dice, dice, skeleton_agreement,
    soft_dice,
};
use accurate_geom::Point2;
use ndarray::Array2;
use proptest::prelude::*;
use serde_json::Value;

/// Sums of at most 400 numbers, one quotient, one harmonic mean.
const ROUNDING: f64 = 1e-13;

fn rows<T: Clone>(value: &Value, convert: impl Fn(&Value) -> T) -> Array2<T> {
    let rows = value.as_array().unwrap();
    let width = rows[0].as_array().unwrap().len();
    let values = rows.iter().flat_map(|r| r.as_array().unwrap()).map(convert).collect();
    Array2::from_shape_vec((rows.len(), width), values).unwrap()
}

fn mask(value: &Value) -> Array2<bool> {
    rows(value, |v| v.as_u64().unwrap() == 1)
}

#[test]
fn the_shared_fixtures_are_met() {
    let all: Value = serde_json::from_str(include_str!("fixtures/masks.json")).unwrap();
    let cases = all["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 6);
    for case in cases {
        let [p, t] = ["predicted", "truth"].map(|name| mask(&case[name]));
        let [sp, st] = ["predicted_skeleton", "truth_skeleton"].map(|name| mask(&case[name]));
        let close = |found: f64, name: &str| {
            let expected = case[name].as_f64().unwrap();
            assert!((found - expected).abs() < ROUNDING, "{name}: {found} {expected}");
        };
        close(dice(p.view(), t.view()).unwrap(), "dice");
        let probability = rows(&case["probability"], |v| v.as_f64().unwrap() as f32);
        close(soft_dice(probability.view(), t.view()).unwrap(), "soft_dice");
        close(cl_dice(p.view(), t.view(), sp.view(), st.view()).unwrap(), "cl_dice");
        for r in ["0", "1", "2", "3"] {
            let found = skeleton_agreement(sp.view(), st.view(), r.parse().unwrap()).unwrap();
            let expected = |name: &str| case[name][r].as_f64().unwrap();
            assert!((found.recall - expected("skeleton_recall")).abs() < ROUNDING);
            assert!((found.precision - expected("skeleton_precision")).abs() < ROUNDING);
        }
        assert_eq!(betti_0(p.view()) as u64, case["betti_0"].as_u64().unwrap());
        let error = betti_0_error(p.view(), t.view()).unwrap();
        assert_eq!(error as u64, case["betti_0_error"].as_u64().unwrap());
    }
}

/// Two masks of one shape, each with at least one pixel.
fn two_masks() -> impl Strategy<Value = [Array2<bool>; 2]> {
    (1..9_usize, 1..9_usize).prop_flat_map(|(h, w)| {
        let one = move || {
            (prop::collection::vec(any::<bool>(), h * w), 0..h * w).prop_map(move |(mut v, k)| {
                v[k] = true;
                Array2::from_shape_vec((h, w), v).unwrap()
            })
        };
        [one(), one()]
    })
}

fn polylines() -> impl Strategy<Value = Vec<Vec<Point2>>> {
    let point = (-20.0..20.0, -20.0..20.0).prop_map(|(x, y)| Point2::new(x, y));
    prop::collection::vec(prop::collection::vec(point, 1..6), 1..4)
}

/// Distance to the nearest of all segments and single points, one after another.
fn brute(at: &Point2, pieces: &[Vec<Point2>]) -> f64 {
    let to = |a: &Point2, b: &Point2| {
        let along = b - a;
        let length2 = along.norm_squared();
        let t = if length2 > 0.0 { ((at - a).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
        (at - (a + along * t)).norm()
    };
    pieces
        .iter()
        .flat_map(|p| {
            let single = p.first().map(|a| to(a, a));
            p.windows(2).map(|w| to(&w[0], &w[1])).chain(single)
        })
        .fold(f64::INFINITY, f64::min)
}

/// Components by merging the labels of neighbours until nothing changes.
fn components_by_merging(mask: &Array2<bool>) -> usize {
    let mut label = Array2::from_shape_fn(mask.dim(), |(r, c)| r * mask.ncols() + c);
    let at: Vec<_> = mask.indexed_iter().filter(|(_, set)| **set).map(|(at, _)| at).collect();
    let mut changed = true;
    while changed {
        changed = false;
        for a in &at {
            for b in &at {
                if a.0.abs_diff(b.0) <= 1 && a.1.abs_diff(b.1) <= 1 && label[*a] > label[*b] {
                    label[*a] = label[*b];
                    changed = true;
                }
            }
        }
    }
    at.iter().map(|at| label[*at]).collect::<std::collections::BTreeSet<_>>().len()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn scores_are_symmetric_bounded_and_one_for_the_same([a, b] in two_masks()) {
        let score = dice(a.view(), b.view()).unwrap();
        prop_assert_eq!(score, dice(b.view(), a.view()).unwrap());
        prop_assert!((0.0..=1.0).contains(&score));
        prop_assert_eq!(dice(a.view(), a.view()).unwrap(), 1.0);
        let hard = a.mapv(|set| f32::from(u8::from(set)));
        prop_assert!((soft_dice(hard.view(), b.view()).unwrap() - score).abs() < ROUNDING);
        let centre = cl_dice(a.view(), b.view(), a.view(), b.view()).unwrap();
        // A mask that is its own skeleton: centreline Dice is Dice.
        prop_assert!((centre - score).abs() < ROUNDING);
    }

    #[test]
    fn agreement_grows_with_the_tolerance_and_swaps_with_the_arguments([a, b] in two_masks()) {
        let mut last = (0.0, 0.0);
        for r in [0.0, 1.0, 2.0_f64.sqrt(), 2.5, 16.0] {
            let found = skeleton_agreement(a.view(), b.view(), r).unwrap();
            let swapped = skeleton_agreement(b.view(), a.view(), r).unwrap();
            prop_assert_eq!((found.recall, found.precision), (swapped.precision, swapped.recall));
            prop_assert!(found.recall >= last.0 && found.precision >= last.1);
            last = (found.recall, found.precision);
        }
        // No two pixels of an 8 x 8 image are farther apart than 16.
        prop_assert_eq!(last, (1.0, 1.0));
    }

    #[test]
    fn components_are_counted_as_by_merging([a, b] in two_masks()) {
        prop_assert_eq!(betti_0(a.view()), components_by_merging(&a));
        let error = betti_0_error(a.view(), b.view()).unwrap();
        prop_assert_eq!(error, components_by_merging(&a).abs_diff(components_by_merging(&b)));
    }

    #[test]
    fn centreline_distances_are_those_of_brute_force(a in polylines(), b in polylines()) {
        let found = centreline_distance(&a, &b).unwrap();
        let all = |from: &[Vec<Point2>], to: &[Vec<Point2>]| -> Vec<f64> {
            from.iter().flatten().map(|p| brute(p, to)).collect()
        };
        let mean = |d: &[f64]| d.iter().sum::<f64>() / d.len() as f64;
        let (there, back) = (all(&a, &b), all(&b, &a));
        // Coordinates below 20: the projection onto a segment loses a few bits of their squares.
        let rounding = 1e-9;
        prop_assert!((found.predicted_to_truth - mean(&there)).abs() < rounding);
        prop_assert!((found.truth_to_predicted - mean(&back)).abs() < rounding);
        prop_assert!((found.mean - 0.5 * (mean(&there) + mean(&back))).abs() < rounding);
        let max = there.iter().chain(&back).copied().fold(0.0, f64::max);
        prop_assert!((found.max - max).abs() < rounding);
        prop_assert_eq!(centreline_distance(&a, &a).unwrap().max, 0.0);
    }
}

#[test]
fn what_cannot_be_scored_is_refused() {
    let none = Array2::from_elem((3, 4), false);
    let some = Array2::from_elem((3, 4), true);
    let other = Array2::from_elem((4, 3), true);
    let empty = |which| EvalError::Empty { which };
    assert_eq!(dice(none.view(), none.view()), Err(empty("prediction and truth")));
    assert_eq!(dice(none.view(), some.view()), Ok(0.0));
    assert_eq!(
        dice(some.view(), other.view()),
        Err(EvalError::ShapeMismatch { which: "truth", found: (4, 3), expected: (3, 4) })
    );
    let [n, s] = [none.view(), some.view()];
    assert_eq!(cl_dice(s, s, n, s), Err(empty("predicted skeleton")));
    assert_eq!(cl_dice(s, s, s, n), Err(empty("true skeleton")));
    assert!(matches!(cl_dice(s, s, s, other.view()), Err(EvalError::ShapeMismatch { .. })));
    assert_eq!(skeleton_agreement(n, s, 1.0), Err(empty("predicted skeleton")));
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = skeleton_agreement(s, s, bad);
        assert!(matches!(refused, Err(EvalError::InvalidArgument { .. })), "{bad}");
    }
    for bad in [-0.1, 1.1, f32::NAN] {
        let refused = soft_dice(Array2::from_elem((3, 4), bad).view(), s);
        assert!(matches!(refused, Err(EvalError::InvalidArgument { .. })), "{bad}");
    }
    assert!(matches!(betti_0_error(s, other.view()), Err(EvalError::ShapeMismatch { .. })));
    let point = |x| vec![vec![Point2::new(x, 0.0)]];
    assert_eq!(centreline_distance(&[], &point(0.0)), Err(empty("predicted centreline")));
    assert_eq!(
        centreline_distance(&point(0.0), &point(f64::NAN)),
        Err(EvalError::NotFinite { which: "true centreline", index: 0 })
    );
    assert!(matches!(
        centreline_distance(&point(1e200), &point(0.0)),
        Err(EvalError::TooLarge { .. })
    ));
}
