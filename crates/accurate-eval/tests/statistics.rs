//! Means, intervals and quantiles over cases.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_eval::{
    DEFAULT_RESAMPLES, EvalError, bootstrap_mean, fraction_below, median, quantile, wilson_interval,
};
use proptest::prelude::*;

proptest! {
    #[test]
    fn the_interval_contains_the_mean_and_is_reproducible(
        values in prop::collection::vec(0.0..10.0_f64, 1..40), name in "[a-z]{1,8}",
    ) {
        let first = bootstrap_mean(&values, 500, &name).unwrap();
        let second = bootstrap_mean(&values, 500, &name).unwrap();
        prop_assert_eq!(first, second);
        // The mean and its resamples are sums of up to 40 numbers below 10 in different orders.
        let rounding = 40.0 * f64::EPSILON * 10.0;
        prop_assert!(first.low <= first.mean + rounding && first.mean <= first.high + rounding);
        let (least, largest) = (quantile(&values, 0.0).unwrap(), quantile(&values, 1.0).unwrap());
        prop_assert!(least - rounding <= first.low && first.high <= largest + rounding);
    }

    #[test]
    fn quantiles_rise_from_the_minimum_to_the_maximum(
        values in prop::collection::vec(-1e3..1e3_f64, 1..50), p in 0.0..=1.0_f64, q in 0.0..=1.0_f64,
    ) {
        let (low, high) = (p.min(q), p.max(q));
        let rounding = 4.0 * f64::EPSILON * 1e3;
        prop_assert!(quantile(&values, low).unwrap() <= quantile(&values, high).unwrap() + rounding);
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        prop_assert_eq!(quantile(&values, 0.0).unwrap(), least);
        // At least half lie on either side of the median.
        let middle = median(&values).unwrap();
        prop_assert!(2 * values.iter().filter(|v| **v <= middle + rounding).count() >= values.len());
        prop_assert!(2 * values.iter().filter(|v| **v >= middle - rounding).count() >= values.len());
    }

    #[test]
    fn the_wilson_interval_solves_its_defining_equation(n in 1..400_usize, part in 0.0..=1.0_f64) {
        let k = (part * n as f64) as usize;
        let interval = wilson_interval(k, n).unwrap();
        prop_assert!(0.0 <= interval.low && interval.low <= interval.fraction);
        prop_assert!(interval.fraction <= interval.high && interval.high <= 1.0);
        let z = 1.959_963_984_540_054;
        for end in [interval.low, interval.high] {
            // |fraction - p| = z sqrt(p (1 - p) / n) at both ends; squared, all terms are below 4.
            let left = (interval.fraction - end).powi(2);
            let right = z * z * end * (1.0 - end) / n as f64;
            prop_assert!((left - right).abs() <= 64.0 * f64::EPSILON, "{left} {right}");
        }
    }
}

#[test]
fn the_interval_of_known_values_is_that_of_the_binomial() {
    // 50 zeros and 50 ones: a resampled mean is binomial / 100 with standard deviation 0.05, so the
    // ends are at 0.40 and 0.60, give or take the noise of the 2.5 % quantile of 2000 draws:
    // sqrt(0.025 * 0.975 / 2000) / 1.17 = 0.003, rounded up to the grid of 0.01.
    let values: Vec<f64> = (0..100).map(|k| f64::from(k % 2)).collect();
    let interval = bootstrap_mean(&values, DEFAULT_RESAMPLES, "binomial").unwrap();
    assert_eq!((interval.n, interval.mean), (100, 0.5));
    assert!((interval.low - 0.40).abs() <= 0.0101, "{interval:?}");
    assert!((interval.high - 0.60).abs() <= 0.0101, "{interval:?}");
}

#[test]
fn the_seed_is_its_name() {
    let values: Vec<f64> = (0..30).map(|k| f64::from(k * k)).collect();
    let interval = bootstrap_mean(&values, DEFAULT_RESAMPLES, "sim-paper/overall").unwrap();
    // The same figures on every machine and with every version of the random number crates.
    // Sums of whole numbers over 30, interpolated: a few roundings of numbers below 512.
    let tolerance = 8.0 * f64::EPSILON * 512.0;
    assert!((interval.low - 196.4375).abs() <= tolerance, "{interval:?}");
    assert!((interval.high - 379.2375).abs() <= tolerance, "{interval:?}");
    let other = bootstrap_mean(&values, DEFAULT_RESAMPLES, "sim-paper/accuracy").unwrap();
    assert_ne!((interval.low, interval.high), (other.low, other.high));
}

#[test]
fn quantiles_and_fractions_of_known_values() {
    let values = [4.0, 1.0, 3.0, 2.0];
    assert_eq!(median(&values), Ok(2.5));
    assert_eq!(quantile(&values, 0.25), Ok(1.75));
    let below = fraction_below(&values, 3.0).unwrap();
    assert_eq!((below.successes, below.trials, below.fraction), (2, 4, 0.5));
    // Wilson 1927 for 0 of 10: z² / (n + z²).
    let none = wilson_interval(0, 10).unwrap();
    assert_eq!(none.low, 0.0);
    assert!((none.high - 0.277_532_799_862_889_2).abs() < 1e-12);
}

#[test]
fn numbers_that_are_no_numbers_are_refused() {
    assert_eq!(median(&[]), Err(EvalError::Empty { which: "values" }));
    assert_eq!(
        quantile(&[1.0, f64::NAN], 0.5),
        Err(EvalError::NotFinite { which: "values", index: 1 })
    );
    assert!(matches!(quantile(&[1.0], 1.5), Err(EvalError::InvalidArgument { .. })));
    assert!(matches!(quantile(&[1.0], f64::NAN), Err(EvalError::InvalidArgument { .. })));
    assert!(matches!(fraction_below(&[1.0], f64::NAN), Err(EvalError::NotFinite { .. })));
    assert!(matches!(wilson_interval(3, 2), Err(EvalError::InvalidArgument { .. })));
    assert_eq!(wilson_interval(0, 0), Err(EvalError::Empty { which: "trials" }));
    assert!(matches!(bootstrap_mean(&[1.0], 0, "s"), Err(EvalError::InvalidArgument { .. })));
    assert!(matches!(bootstrap_mean(&[], 10, "s"), Err(EvalError::Empty { .. })));
    assert!(matches!(bootstrap_mean(&[1e308; 3], 10, "s"), Err(EvalError::NotFinite { .. })));
}
