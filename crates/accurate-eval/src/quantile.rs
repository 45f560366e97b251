use crate::{EvalError, check};

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
    /// The 97.5 % quantile of the standard normal distribution.
    const Z: f64 = 1.959_963_984_540_054;
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
