use ndarray::Array2;

use crate::{Mask, SegError};

/// Foreground is every pixel strictly above `level`.
///
/// `image` is `(height, width)` in any grey values; 8- and 16-bit images come in exactly by
/// `image.mapv(f32::from)`, a wire darker than its surroundings by negating the image.
///
/// # Errors
/// [`SegError::NotFinite`] with the position of the first NaN or infinite pixel,
/// [`SegError::LevelIsNan`], [`SegError::EmptyImage`].
pub fn binarise_fixed(image: &Array2<f32>, level: f32) -> Result<Mask, SegError> {
    require_finite(image)?;
    require_number("level", level)?;
    Mask::from_array(image.mapv(|value| value > level))
}

/// Foreground is every pixel strictly above [`otsu_level`].
///
/// # Errors
/// Those of [`otsu_level`].
pub fn binarise_otsu(image: &Array2<f32>) -> Result<Mask, SegError> {
    let level = otsu_level(image)?;
    Mask::from_array(image.mapv(|value| value > level))
}

/// Foreground is every pixel strictly above `low` that is 8-connected, through such pixels, to a
/// pixel strictly above `high`.
///
/// # Errors
/// [`SegError::LevelsOutOfOrder`] if `low > high`, and those of [`binarise_fixed`].
///
/// # Source
/// Canny, "A computational approach to edge detection", PAMI 1986.
///
/// # Cost
/// O(pixels) time and memory; iterative.
pub fn binarise_hysteresis(image: &Array2<f32>, low: f32, high: f32) -> Result<Mask, SegError> {
    require_number("low", low)?;
    require_number("high", high)?;
    if low > high {
        return Err(SegError::LevelsOutOfOrder { low, high });
    }
    let strong = binarise_fixed(image, high)?;
    let mut open: Vec<(usize, usize)> = strong.foreground().collect();
    let mut reached = strong;
    while let Some((row, col)) = open.pop() {
        for r in row.saturating_sub(1)..=row + 1 {
            for c in col.saturating_sub(1)..=col + 1 {
                let weak = image.get((r, c)).is_some_and(|&value| value > low);
                if weak && !reached.get(r, c) {
                    reached.set(r, c, true);
                    open.push((r, c));
                }
            }
        }
    }
    Ok(reached)
}

/// The grey value that splits the pixels into the two classes of greatest between-class variance:
/// the lower class is `value <= level`, and `level` is the greatest value in it.
///
/// The histogram has 65 536 bins of equal width from the least to the greatest value, each with
/// its count and the exact sum of its pixels. Integer images of 8 or 16 bits get at most one value
/// per bin, so that the optimum is exact; other images are split at a resolution of 1/65 536 of
/// their range. On ties the lowest level wins.
///
/// # Errors
/// [`SegError::NotFinite`], [`SegError::EmptyImage`], [`SegError::Constant`] if all pixels are
/// equal.
///
/// # Source
/// Otsu, "A threshold selection method from gray-level histograms", IEEE SMC 1979, eq. 18.
///
/// # Cost
/// Two passes over the image and one over the bins.
pub fn otsu_level(image: &Array2<f32>) -> Result<f32, SegError> {
    #[derive(Clone, Copy)]
    struct Bin {
        count: u64,
        sum: f64,
        greatest: f32,
    }
    const LAST: f64 = 65_535.0;

    require_finite(image)?;
    let Some(&first) = image.first() else {
        let (height, width) = image.dim();
        return Err(SegError::EmptyImage { height, width });
    };
    let (least, greatest) =
        image.iter().fold((first, first), |(lo, hi), &value| (lo.min(value), hi.max(value)));
    if least == greatest {
        return Err(SegError::Constant { value: first });
    }

    // In f64 the range of two finite f32 cannot overflow.
    let (origin, range) = (f64::from(least), f64::from(greatest) - f64::from(least));
    let mut bins = vec![Bin { count: 0, sum: 0.0, greatest: least }; 65_536];
    for &value in image {
        // Sums are taken from the least value: they stay small and exact for integer images.
        let above = f64::from(value) - origin;
        // The cast saturates, and above <= range: the index is within 0..=65_535.
        if let Some(bin) = bins.get_mut((above / range * LAST).round() as usize) {
            bin.count += 1;
            bin.sum += above;
            bin.greatest = bin.greatest.max(value);
        }
    }

    let total_count = image.len() as f64;
    let total_sum: f64 = bins.iter().map(|bin| bin.sum).sum();
    let (mut count, mut sum) = (0.0, 0.0);
    let (mut best_level, mut best_variance) = (least, f64::NEG_INFINITY);
    for bin in bins.iter().filter(|bin| bin.count > 0) {
        count += bin.count as f64;
        sum += bin.sum;
        let rest = total_count - count;
        if rest < 1.0 {
            break;
        }
        // n^2 times the between-class variance w0 w1 (m0 - m1)^2, in a form that divides once.
        let spread = total_count * sum - total_sum * count;
        let variance = spread / count * (spread / rest);
        if variance > best_variance {
            (best_level, best_variance) = (bin.greatest, variance);
        }
    }
    Ok(best_level)
}

/// # Errors
/// [`SegError::NotFinite`] with the position of the first NaN or infinite pixel.
pub(crate) fn require_finite(image: &Array2<f32>) -> Result<(), SegError> {
    // The indexed search is slow; it runs only when the plain pass has found something.
    if image.iter().fold(true, |all, value| all & value.is_finite()) {
        return Ok(());
    }
    match image.indexed_iter().find(|(_, value)| !value.is_finite()) {
        Some(((row, column), &value)) => Err(SegError::NotFinite { row, column, value }),
        None => Ok(()),
    }
}

fn require_number(name: &'static str, level: f32) -> Result<(), SegError> {
    if level.is_nan() { Err(SegError::LevelIsNan { name }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(values: &[f32]) -> Array2<f32> {
        Array2::from_shape_vec((1, values.len()), values.to_vec()).unwrap()
    }

    #[test]
    fn nan_is_refused_with_its_position() {
        let mut bad = Array2::zeros((3, 4));
        bad[[1, 2]] = f32::NAN;
        for result in
            [binarise_fixed(&bad, 0.5), binarise_otsu(&bad), binarise_hysteresis(&bad, 0.1, 0.2)]
        {
            assert!(matches!(result, Err(SegError::NotFinite { row: 1, column: 2, .. })));
        }
        bad[[1, 2]] = f32::NEG_INFINITY;
        assert!(matches!(otsu_level(&bad), Err(SegError::NotFinite { row: 1, column: 2, .. })));
    }

    #[test]
    fn a_threshold_that_is_no_number_or_out_of_order_is_refused() {
        let grey = image(&[0.0, 1.0]);
        assert_eq!(binarise_fixed(&grey, f32::NAN), Err(SegError::LevelIsNan { name: "level" }));
        assert_eq!(
            binarise_hysteresis(&grey, 0.5, f32::NAN),
            Err(SegError::LevelIsNan { name: "high" })
        );
        assert_eq!(
            binarise_hysteresis(&grey, 0.6, 0.5),
            Err(SegError::LevelsOutOfOrder { low: 0.6, high: 0.5 })
        );
    }

    #[test]
    fn a_constant_image_has_no_otsu_level() {
        assert_eq!(otsu_level(&image(&[7.0, 7.0])), Err(SegError::Constant { value: 7.0 }));
        assert!(matches!(otsu_level(&Array2::zeros((0, 3))), Err(SegError::EmptyImage { .. })));
    }

    #[test]
    fn otsu_splits_two_well_separated_groups_at_the_top_of_the_lower_one() {
        let level = otsu_level(&image(&[1.0, 2.0, 3.0, 250.0, 251.0])).unwrap();
        assert_eq!(level, 3.0);
    }

    #[test]
    fn otsu_survives_the_extremes_of_f32() {
        let level = otsu_level(&image(&[f32::MIN, f32::MAX, f32::MAX])).unwrap();
        assert_eq!(level, f32::MIN);
        let tiny = f32::from_bits(1);
        assert_eq!(otsu_level(&image(&[0.0, tiny])).unwrap(), 0.0);
    }

    #[test]
    fn a_weak_stretch_survives_only_beside_a_strong_pixel() {
        let grey = image(&[0.4, 0.4, 0.9, 0.4, 0.0, 0.4, 0.4]);
        let mask = binarise_hysteresis(&grey, 0.3, 0.8).unwrap();
        assert_eq!(mask.to_string(), "####...\n");
    }
}
