use ndarray::{Array2, Axis};

/// Gaussian mean of `values` weighed by `weights` (Knutsson and Westin, CVPR 1993): what lies under
/// pixels of weight 0 is carried in from around them. Where no weight is within reach, 0.
///
/// Cost: O(pixels · sigma).
pub(crate) fn weighted_mean(
    values: &Array2<f64>,
    weights: &Array2<f64>,
    sigma_px: f64,
) -> Array2<f64> {
    let mut sum = values * weights;
    let mut total = weights.clone();
    for image in [&mut sum, &mut total] {
        for axis in [Axis(0), Axis(1)] {
            smooth_along(image, axis, sigma_px);
        }
    }
    // Below that, the sum is rounding of what lies far beyond the kernel.
    sum.zip_mut_with(&total, |sum, &total| *sum = if total > 1e-9 { *sum / total } else { 0.0 });
    sum
}

/// Convolves every line along an axis with a Gaussian cut at 3 sigma; nothing lies beyond the border.
fn smooth_along(image: &mut Array2<f64>, axis: Axis, sigma_px: f64) {
    let reach = (3.0 * sigma_px).ceil() as usize;
    let half: Vec<f64> =
        (0..=reach).map(|k| (-0.5 * (k as f64 / sigma_px).powi(2)).exp()).collect();
    let total = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    let n = image.len_of(axis);
    let mut padded = vec![0.0; n + 2 * reach];
    for mut line in image.lanes_mut(axis) {
        padded[reach..reach + n].iter_mut().zip(line.iter()).for_each(|(p, v)| *p = *v);
        for (k, out) in line.iter_mut().enumerate() {
            let at = k + reach;
            let mut sum = half[0] * padded[at];
            for (d, weight) in half.iter().enumerate().skip(1) {
                sum += weight * (padded[at - d] + padded[at + d]);
            }
            *out = sum / total;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_constant_stays_whatever_is_hidden(
            level in -5.0..5.0f64,
            sigma in 0.5..4.0f64,
            hidden in prop::collection::vec(prop::bool::ANY, 12 * 9),
        ) {
            let values = Array2::from_elem((12, 9), level);
            let mut weights =
                Array2::from_shape_vec((12, 9), hidden).unwrap().mapv(|h| if h { 0.0 } else { 1.0 });
            weights[(0, 0)] = 1.0;
            let mean = weighted_mean(&values, &weights, sigma);
            for ((y, x), value) in mean.indexed_iter() {
                // Sums of up to a hundred products, both off by the same rounding at most.
                let seen = *value != 0.0;
                prop_assert!(!seen || (value - level).abs() < 1e-9 * (1.0 + level.abs()), "{y} {x}");
            }
            prop_assert!((mean[(0, 0)] - level).abs() < 1e-9 * (1.0 + level.abs()));
        }
    }
}
