use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::quantile::sorted_quantile;
use crate::{EvalError, check};

/// A mean over cases with its bootstrap 95 % percentile interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanInterval {
    /// Cases.
    pub n: usize,
    /// Mean over the cases.
    pub mean: f64,
    /// 2.5 % quantile of the resampled means.
    pub low: f64,
    /// 97.5 % quantile of the resampled means.
    pub high: f64,
}

/// Resamples drawn when nothing else is asked for.
pub const DEFAULT_RESAMPLES: usize = 2000;

/// The mean of `values` with its bootstrap 95 % percentile interval.
///
/// `resamples` times as many values are drawn with replacement, by ChaCha8 from the seed called
/// `seed_name`: the same name gives the same interval on every machine.
///
/// # Errors
/// [`EvalError::Empty`] or [`EvalError::NotFinite`]; [`EvalError::InvalidArgument`] if `resamples` is
/// 0 or above a million.
///
/// # Source
/// Efron and Tibshirani, An introduction to the bootstrap, 1993, section 13.3.
///
/// # Cost
/// O(n `resamples`).
pub fn bootstrap_mean(
    values: &[f64],
    resamples: usize,
    seed_name: &str,
) -> Result<MeanInterval, EvalError> {
    check::values("values", values)?;
    if resamples == 0 || resamples > 1_000_000 {
        return Err(EvalError::InvalidArgument {
            name: "resamples",
            value: resamples as f64,
            expected: "from 1 to 1000000",
        });
    }
    let n = values.len();
    let mut rng = ChaCha8Rng::seed_from_u64(seed_from_name(seed_name));
    let mut means: Vec<f64> = (0..resamples)
        .map(|_| (0..n).map(|_| values[index_below(n, &mut rng)]).sum::<f64>() / n as f64)
        .collect();
    means.sort_by(f64::total_cmp);
    let mean = values.iter().sum::<f64>() / n as f64;
    for (index, mean) in [mean, means[0], means[resamples - 1]].into_iter().enumerate() {
        // Finite values can still have a sum that is not.
        if !mean.is_finite() {
            return Err(EvalError::NotFinite { which: "means", index });
        }
    }
    Ok(MeanInterval {
        n,
        mean,
        low: sorted_quantile(&means, 0.025),
        high: sorted_quantile(&means, 0.975),
    })
}

/// A uniform index below `n`, from 64 bits by multiplication; written out because the sampling of a
/// library may change between its versions. The bias is below `n` in 2^64.
fn index_below(n: usize, rng: &mut ChaCha8Rng) -> usize {
    ((u128::from(rng.next_u64()) * n as u128) >> 64) as usize
}

/// FNV-1a, 64 bit (Fowler, Noll, Vo).
fn seed_from_name(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
