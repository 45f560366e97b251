use ndarray::Array2;

use crate::Skeleton;
use crate::median::median;

/// How much there is of a part of a mask, and how sure a probability map is of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surety {
    /// Skeleton pixels.
    pub length_px: usize,
    /// Median over them of the logit, ln(p / (1 - p)); minus infinity if there are none.
    pub logit: f64,
}

/// Nearer to 0 or 1 a probability of single precision says nothing.
const SURE: f64 = 1e-6;

impl Surety {
    /// Of each of the `count` parts of `labels`, `(height, width)`, which number them from 1; pixels of
    /// the skeleton that have no number count for none. Where `probability` has no pixel it is 0.
    pub fn of_parts(
        skeleton: &Skeleton,
        labels: &Array2<u32>,
        count: usize,
        probability: &Array2<f32>,
    ) -> Vec<Self> {
        let mut logits = vec![Vec::new(); count];
        for &pixel in skeleton.pixels() {
            let number = labels.get(pixel).copied().unwrap_or(0) as usize;
            let Some(of_part) = number.checked_sub(1).and_then(|part| logits.get_mut(part)) else {
                continue;
            };
            let sure = f64::from(probability.get(pixel).copied().unwrap_or(0.0));
            let sure = sure.clamp(SURE, 1.0 - SURE);
            of_part.push((sure / (1.0 - sure)).ln());
        }
        let of_part = |logits: Vec<f64>| Self {
            length_px: logits.len(),
            logit: median(logits).unwrap_or(f64::NEG_INFINITY),
        };
        logits.into_iter().map(of_part).collect()
    }

    /// The greatest logit of the parts of at least `least_px`; minus infinity if there are none.
    pub fn surest(parts: &[Self], least_px: f64) -> f64 {
        let long = parts.iter().filter(|part| part.length_px as f64 >= least_px);
        long.map(|part| part.logit).fold(f64::NEG_INFINITY, f64::max)
    }
}
