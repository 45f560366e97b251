use crate::{EvalError, check};

/// The 97.5 % quantile of the standard normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// The `probability`-quantile of `values`, by linear interpolation between order statistics (0 is
/// the minimum, 1 the maximum).
///
/// # Errors
/// [`EvalError::Empty`] or [`EvalError::NotFinite`]; [`EvalError::InvalidArgument`] if `probability`
/// is not in [0, 1].
///
/// # Source
/// Hyndman and Fan, Sample quantiles in statistical packages, 1996, definition 7.
pub fn quantile(values: &[f64], probability: f64) -> Result<f64, EvalError> {
    check::values("values", values)?;
    if !(0.0..=1.0).contains(&probability) {
        return Err(EvalError::InvalidArgument {
            name: "probability",
            value: probability,
            expected: "from 0 to 1",
        });
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    Ok(sorted_quantile(&sorted, probability))
}

/// A quantile over cases with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuantileInterval {
    /// The quantile.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// [`quantile`] with its 95 % interval: the values at the ranks between which the quantile lies, by the
/// normal approximation of how many values lie below it. Of few values it ends at the least and the largest,
/// and holds the quantile less often.
///
/// # Errors
/// As [`quantile`].
///
/// # Source
/// Conover, Practical nonparametric statistics, 3rd edition, 1999, section 3.2.
pub fn quantile_interval(values: &[f64], probability: f64) -> Result<QuantileInterval, EvalError> {
    let spread = Z * (probability * (1.0 - probability) / values.len() as f64).sqrt();
    Ok(QuantileInterval {
        value: quantile(values, probability)?,
        low: quantile(values, (probability - spread).max(0.0))?,
        high: quantile(values, (probability + spread).min(1.0))?,
    })
}

/// The median of `values`.
///
/// # Errors
/// [`EvalError::Empty`] or [`EvalError::NotFinite`].
pub fn median(values: &[f64]) -> Result<f64, EvalError> {
    quantile(values, 0.5)
}

/// The same for a non-empty ascending list and a probability in [0, 1].
pub(crate) fn sorted_quantile(sorted: &[f64], probability: f64) -> f64 {
    let position = probability * (sorted.len() - 1) as f64;
    let (low, high) = (sorted[position.floor() as usize], sorted[position.ceil() as usize]);
    // Weighted, not as a difference, which could overflow.
    let weight = position.fract();
    low * (1.0 - weight) + high * weight
}

/// How many of a number of trials succeeded, with a 95 % interval for the probability behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proportion {
    /// Trials that succeeded.
    pub successes: usize,
    /// Trials.
    pub trials: usize,
    /// `successes / trials`.
    pub fraction: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// The fraction of `values` below `threshold` (strictly), with its Wilson 95 % interval.
///
/// # Errors
/// [`EvalError::Empty`] or [`EvalError::NotFinite`], also for the threshold.
pub fn fraction_below(values: &[f64], threshold: f64) -> Result<Proportion, EvalError> {
    check::values("values", values)?;
    check::values("threshold", &[threshold])?;
    let successes = values.iter().filter(|v| **v < threshold).count();
    wilson_interval(successes, values.len())
}

/// The Wilson score interval (95 %) of `successes` out of `trials`.
///
/// # Errors
/// [`EvalError::Empty`] if there was no trial; [`EvalError::InvalidArgument`] if more succeeded than
/// there were.
///
/// # Source
/// Wilson, Probable inference, the law of succession, and statistical inference, 1927.
pub fn wilson_interval(successes: usize, trials: usize) -> Result<Proportion, EvalError> {
    if trials == 0 {
        return Err(EvalError::Empty { which: "trials" });
    }
    if successes > trials {
        return Err(EvalError::InvalidArgument {
            name: "successes",
            value: successes as f64,
            expected: "at most the number of trials",
        });
    }
    let n = trials as f64;
    let fraction = successes as f64 / n;
    let denominator = 1.0 + Z * Z / n;
    let centre = (fraction + Z * Z / (2.0 * n)) / denominator;
    let half = Z / denominator * (fraction * (1.0 - fraction) / n + Z * Z / (4.0 * n * n)).sqrt();
    // At 0 and 1 the ends are exactly 0 and 1; rounding must not put them beyond.
    let low = if successes == 0 { 0.0 } else { centre - half };
    let high = if successes == trials { 1.0 } else { centre + half };
    Ok(Proportion { successes, trials, fraction, low, high })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_lies_in_its_interval_as_often_as_it_says() {
        let mut state = 7_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for probability in [0.5, 0.9] {
            let mut held = 0;
            for _ in 0..2000 {
                // Long tails, as errors have; the median of this is 1.
                let values: Vec<f64> = (0..100).map(|_| uniform()).map(|u| u / (1.0 - u)).collect();
                let found = quantile_interval(&values, probability).unwrap();
                assert_eq!(found.value, quantile(&values, probability).unwrap());
                let truth = probability / (1.0 - probability);
                held += usize::from((found.low..=found.high).contains(&truth));
            }
            // Ranks are whole; the binomial's own spread over 2,000 draws is 0.5 %.
            assert!((1840..=1960).contains(&held), "{probability}: {held}");
        }
    }

    #[test]
    fn the_interval_of_few_values_ends_with_them() {
        let found = quantile_interval(&[3.0, 1.0], 0.95).unwrap();
        assert!((found.value - 2.9).abs() < 1e-12 && found.high == 3.0);
        assert!(found.low > 1.0 && found.low < found.value);
        let one = quantile_interval(&[2.0], 0.5).unwrap();
        assert_eq!([one.low, one.value, one.high], [2.0; 3]);
        assert!(quantile_interval(&[], 0.5).is_err());
        assert!(quantile_interval(&[1.0], 1.5).is_err());
    }
}
