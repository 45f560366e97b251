use ndarray::Array2;

/// Whether the body is darker or brighter than its surroundings in the grey values as stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Polarity {
    /// Darker, as in DICOM's MONOCHROME2 and in ordinary image files.
    #[default]
    BodyDark,
    /// Brighter, as the stored values of DICOM's MONOCHROME1.
    BodyBright,
}

impl Polarity {
    /// The image as whatever segments or fits it expects it, the body dark: a bright one has its values
    /// mirrored within their own range, so that their scale stays. What is not finite stays so.
    pub fn with_body_dark(self, mut image: Array2<f32>) -> Array2<f32> {
        if self == Self::BodyBright {
            let finite = image.iter().copied().filter(|value| value.is_finite());
            let (least, greatest) =
                finite.fold((f32::MAX, f32::MIN), |(lo, hi), v| (lo.min(v), hi.max(v)));
            let sum = f64::from(least) + f64::from(greatest);
            image.mapv_inplace(|value| (sum - f64::from(value)) as f32);
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bright_body_becomes_dark_and_the_range_stays() {
        let image = Array2::from_shape_fn((4, 5), |(row, col)| (30 + row * 40 + col * 7) as f32);
        assert_eq!(Polarity::BodyDark.with_body_dark(image.clone()), image);
        let turned = Polarity::BodyBright.with_body_dark(image.clone());
        // 30 to 178.
        assert_eq!(turned, image.mapv(|value| 208.0 - value));
        assert_eq!(Polarity::BodyBright.with_body_dark(turned), image);
    }

    #[test]
    fn extremes_and_broken_values_take_nothing_from_the_others() {
        let values = vec![f32::NAN, f32::INFINITY, f32::MIN, 0.0, f32::MAX, 1.0];
        let image = Array2::from_shape_vec((1, 6), values).unwrap();
        let turned = Polarity::BodyBright.with_body_dark(image).into_raw_vec_and_offset().0;
        assert!(turned[0].is_nan() && turned[1].is_infinite());
        assert_eq!(turned[2..], [f32::MAX, 0.0, f32::MIN, -1.0]);
        let empty = Polarity::BodyBright.with_body_dark(Array2::zeros((0, 3)));
        assert!(empty.is_empty());
    }
}
