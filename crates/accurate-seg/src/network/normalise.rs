use ndarray::Array2;

use super::Normalisation;
use crate::SegError;
use crate::threshold::require_finite;

/// Grey values as the network wants them. In f64 until the last step: a 16-bit image has a
/// mean far from 0.
///
/// # Errors
/// [`SegError::EmptyImage`], [`SegError::NotFinite`], [`SegError::Constant`] if every
/// pixel is the same.
pub(super) fn normalise(
    image: &Array2<f32>,
    scheme: Normalisation,
) -> Result<Array2<f32>, SegError> {
    let (height, width) = image.dim();
    let Some(&first) = image.first() else {
        return Err(SegError::EmptyImage { height, width });
    };
    require_finite(image)?;
    let (least, greatest) =
        image.iter().fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    if least == greatest {
        return Err(SegError::Constant { value: first });
    }
    let scaled = |shift: f64, scale: f64| image.mapv(|v| ((f64::from(v) - shift) / scale) as f32);
    Ok(match scheme {
        Normalisation::ZScore { least_std } => {
            let n = image.len() as f64;
            let mean = image.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
            let variance = image.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n;
            scaled(mean, variance.sqrt().max(least_std))
        }
        Normalisation::Fixed { low, high, mean, std } => {
            image.mapv(|v| ((f64::from(v).clamp(low, high) - mean) / std) as f32)
        }
        Normalisation::ZeroToOne => {
            let range = f64::from(greatest) - f64::from(least);
            scaled(f64::from(least), range)
        }
        Normalisation::Over255 => scaled(0.0, 255.0),
        Normalisation::None => scaled(0.0, 1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Polarity;

    const Z: Normalisation = Normalisation::ZScore { least_std: 1e-6 };

    fn ramp(scale: f32, offset: f32) -> Array2<f32> {
        Array2::from_shape_fn((16, 16), |(row, col)| {
            offset + scale * ((row * 16 + col) * 37 % 256) as f32
        })
    }

    #[test]
    fn depth_does_not_matter_to_a_z_score() {
        // A permutation of 0..=255: mean 127.5, variance (256^2 - 1) / 12.
        let eight = normalise(&ramp(1.0, 0.0), Z).unwrap();
        let std = (65_535.0_f64 / 12.0).sqrt();
        for (got, grey) in eight.iter().zip(ramp(1.0, 0.0).iter()) {
            let expected = ((f64::from(*grey) - 127.5) / std) as f32;
            // f64 throughout and one rounding to f32 of values below 2.
            assert!((got - expected).abs() <= 2.0 * f32::EPSILON, "{got} {expected}");
        }
        // 257 maps 8 bits onto 16 exactly, so that only the last rounding may differ.
        let sixteen = normalise(&ramp(257.0, 0.0), Z).unwrap();
        for (a, b) in eight.iter().zip(&sixteen) {
            assert!((a - b).abs() <= 2.0 * f32::EPSILON, "{a} {b}");
        }
    }

    #[test]
    fn the_other_polarity_of_an_inverted_image_is_the_image() {
        let image = ramp(1.0, 0.0);
        let inverted = Polarity::BodyBright.with_body_dark(image.mapv(|v| 255.0 - v));
        for scheme in [Z, Normalisation::ZeroToOne, Normalisation::Over255] {
            let a = normalise(&image, scheme).unwrap();
            let b = normalise(&inverted, scheme).unwrap();
            assert_eq!(a, b, "{scheme:?}");
        }
    }

    #[test]
    fn the_training_sets_own_figures_clip_and_scale() {
        let scheme = Normalisation::Fixed { low: 10.0, high: 20.0, mean: 15.0, std: 5.0 };
        let image = Array2::from_shape_vec((1, 4), vec![0.0, 10.0, 17.5, 99.0]).unwrap();
        let got = normalise(&image, scheme).unwrap();
        assert_eq!(got.into_raw_vec_and_offset().0, [-1.0, -1.0, 0.5, 1.0]);
    }

    #[test]
    fn blank_empty_and_broken_images_are_refused() {
        let blank = Array2::from_elem((3, 3), 7.0);
        assert_eq!(normalise(&blank, Z), Err(SegError::Constant { value: 7.0 }));
        let mut broken = ramp(1.0, 0.0);
        broken[[2, 3]] = f32::NAN;
        let error = normalise(&broken, Z).unwrap_err();
        assert!(matches!(error, SegError::NotFinite { row: 2, column: 3, .. }));
        let empty = normalise(&Array2::zeros((0, 4)), Z);
        assert_eq!(empty, Err(SegError::EmptyImage { height: 0, width: 4 }));
    }

    #[test]
    fn the_extremes_of_f32_do_not_overflow() {
        let image = Array2::from_shape_vec((1, 3), vec![f32::MIN, 0.0, f32::MAX]).unwrap();
        let got = normalise(&image, Z).unwrap();
        assert!(got.iter().all(|v| v.is_finite()));
    }
}
