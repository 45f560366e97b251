use accurate_geom::nalgebra::Vector3;

use crate::normal::THIRD_DIFFERENCE;
use crate::outline_problem::third_difference;
use crate::selected_inverse::SelectedInverse;

/// A Gaussian window along the curve, and a little of the mean over all of it.
#[derive(Debug, Clone)]
pub(crate) struct Pool {
    kernel: Vec<f64>,
}

impl Pool {
    pub(crate) fn new(sigma: f64, windows: usize) -> Self {
        let reach = ((4.0 * sigma).ceil() as usize).min(windows);
        let kernel = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
        Self { kernel }
    }

    fn mean(&self, values: &[f64]) -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (0..values.len())
            .map(|k| {
                // As much as one window's worth of the mean: a stretch that happens to be straight
                // is not infinitely stiff.
                let (mut sum, mut weight) = (mean, 1.0);
                for (offset, w) in self.kernel.iter().enumerate() {
                    for j in [k.checked_sub(offset), Some(k + offset)] {
                        if let Some(value) = j.and_then(|j| values.get(j)) {
                            // The middle is met twice.
                            let w = if offset == 0 { 0.5 * w } else { *w };
                            sum += w * value;
                            weight += w;
                        }
                    }
                }
                sum / weight
            })
            .collect()
    }

    /// What one step of expectation maximisation changes the logarithms of the local factors of
    /// `lambda3` by, such that third differences have the variance that is seen, given residuals of
    /// variance `variance`.
    pub(crate) fn log_changes(
        &self,
        factors: &[f64],
        inverse: &SelectedInverse,
        control: &[Vector3<f64>],
        variance: f64,
        lambda3: f64,
    ) -> Vec<f64> {
        let seen: Vec<f64> = (0..factors.len())
            .map(|k| {
                let spread = inverse.combination(k, &THIRD_DIFFERENCE).trace() * variance;
                (third_difference(control, k).norm_squared() + spread) / 3.0
            })
            .collect();
        let wanted = self.mean(&seen).into_iter().map(|v| variance / (v * lambda3));
        factors.iter().zip(wanted).map(|(factor, wanted)| (wanted / factor).ln()).collect()
    }
}

/// The largest of some changes, in size.
pub(crate) fn largest(changes: &[f64]) -> f64 {
    changes.iter().fold(0.0, |most, change| most.max(change.abs()))
}

/// Factors changed by `relaxation` times the logarithms, within bounds.
pub(crate) fn changed(factors: &[f64], changes: &[f64], relaxation: f64) -> Vec<f64> {
    let factors = factors.iter().zip(changes);
    factors
        .map(|(factor, change)| (factor * (relaxation * change).exp()).clamp(1e-9, 1e5))
        .collect()
}
