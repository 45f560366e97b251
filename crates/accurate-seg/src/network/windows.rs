use ndarray::Array2;

/// An image with sides made larger by its border, and how much was added before its first row and
/// column.
pub(super) struct Padded {
    pub image: Array2<f32>,
    pub before: [usize; 2],
}

/// Lets the border pixels of the image go on until its sides are `sides`, half of the addition on
/// either side, the odd one behind. Reflection would make a thin dark line, like a wire, of the edge
/// of a collimator near the border.
pub(super) fn extend_to(image: &Array2<f32>, sides: [usize; 2]) -> Padded {
    let (height, width) = image.dim();
    let before = [(sides[0] - height) / 2, (sides[1] - width) / 2];
    let within =
        |at: usize, before: usize, length: usize| at.saturating_sub(before).min(length - 1);
    let padded = Array2::from_shape_fn((sides[0], sides[1]), |(row, col)| {
        image[[within(row, before[0], height), within(col, before[1], width)]]
    });
    Padded { image: padded, before }
}

/// Where windows begin along one axis: from 0 to `length - window`, equally spaced, at most half a
/// window apart.
pub(super) fn starts(length: usize, window: usize) -> Vec<usize> {
    let room = length.saturating_sub(window);
    let steps = room.div_ceil((window / 2).max(1));
    (0..=steps).map(|k| (room * k + steps / 2).checked_div(steps).unwrap_or(0)).collect()
}

/// How much a pixel of a window counts: a Gaussian of an eighth of the window about its middle, at
/// least a thousandth of the middle's weight.
///
/// # Source
/// Isensee et al., nnU-Net, Nature Methods 2021, inference (sigma of an eighth of the patch).
pub(super) fn window_weights(window: [usize; 2]) -> Array2<f32> {
    let along = |side: usize| -> Vec<f64> {
        let (middle, sigma) = ((side as f64 - 1.0) / 2.0, side as f64 / 8.0);
        (0..side).map(|k| (-0.5 * ((k as f64 - middle) / sigma).powi(2)).exp()).collect()
    };
    let (rows, columns) = (along(window[0]), along(window[1]));
    Array2::from_shape_fn((window[0], window[1]), |(row, col)| {
        (rows[row] * columns[col]).max(1e-3) as f32
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_border_goes_on() {
        let row = Array2::from_shape_vec((1, 3), vec![1.0, 2.0, 3.0]).unwrap();
        let padded = extend_to(&row, [1, 8]);
        assert_eq!(padded.before, [0, 2]);
        let expected = [1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0];
        assert_eq!(padded.image.into_raw_vec_and_offset().0, expected);
    }

    proptest! {
        #[test]
        fn the_image_stands_in_the_middle_of_its_padding(
            height in 1_usize..9, width in 1_usize..9, more in (0_usize..20, 0_usize..20),
        ) {
            let image = Array2::from_shape_fn((height, width), |(r, c)| (10 * r + c) as f32);
            let padded = extend_to(&image, [height + more.0, width + more.1]);
            for ((r, c), value) in image.indexed_iter() {
                prop_assert_eq!(padded.image[[r + padded.before[0], c + padded.before[1]]], *value);
            }
        }

        #[test]
        fn windows_cover_every_pixel_and_overlap_by_half(length in 1_usize..3000, window in 2_usize..600) {
            prop_assume!(length >= window);
            let starts = starts(length, window);
            prop_assert_eq!(starts[0], 0);
            prop_assert_eq!(starts[starts.len() - 1], length - window);
            for pair in starts.windows(2) {
                // Rounding to whole pixels may add one.
                prop_assert!(pair[1] > pair[0] && pair[1] - pair[0] <= window / 2 + 1);
            }
        }

        #[test]
        fn weights_are_symmetric_and_largest_in_the_middle(h in 2_usize..40, w in 2_usize..40) {
            let weights = window_weights([h, w]);
            let middle = weights[[h / 2, w / 2]];
            for ((r, c), value) in weights.indexed_iter() {
                prop_assert!(*value >= 1e-3 && *value <= middle);
                prop_assert!((value - weights[[h - 1 - r, w - 1 - c]]).abs() <= f32::EPSILON);
            }
        }
    }
}
