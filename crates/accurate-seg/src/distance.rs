use imageproc::distance_transform::euclidean_squared_distance_transform;
use ndarray::Array2;

use crate::components::to_image;
use crate::median::median;
use crate::{Mask, SegError, zhang_suen};

/// Euclidean distance of each foreground pixel to the nearest background pixel, px, centre to
/// centre; 0 for background.
///
/// So a line one pixel wide has distance 1, not 0.5. Outside of the image there is no background:
/// a wire that leaves the image keeps its width up to the border.
///
/// # Errors
/// [`SegError::NoBackground`] if every pixel is foreground, [`SegError::TooLarge`] from 2^32
/// pixels on.
///
/// # Source
/// Felzenszwalb and Huttenlocher, "Distance transforms of sampled functions", Theory of Computing
/// 2012 (imageproc's implementation).
///
/// # Cost
/// O(pixels), 8 bytes each.
pub fn distance_to_background(mask: &Mask) -> Result<Array2<f64>, SegError> {
    let (height, width) = mask.shape();
    if mask.count() == height * width {
        return Err(SegError::NoBackground { height, width });
    }
    // imageproc measures the distance to the non-zero pixels.
    let background = mask.raster().iter().map(|&pixel| u8::from(!pixel));
    let squared = euclidean_squared_distance_transform(&to_image(height, width, background)?);
    let distances = squared.into_raw().into_iter().map(f64::sqrt).collect();
    // imageproc's buffer is row by row, as ours; the sizes agree by construction.
    Array2::from_shape_vec((height, width), distances)
        .map_err(|_| SegError::TooLarge { height, width })
}

/// Median width of the strands of a mask, px: `2 median(d) - 1`, with `d` the
/// [`distance_to_background`] on the pixels of the [`zhang_suen`] skeleton.
///
/// Exact for straight horizontal or vertical strands of odd width; an even width comes out one
/// less, since no pixel centre lies on its middle.
///
/// # Errors
/// [`SegError::EmptyMask`] and those of [`distance_to_background`].
pub fn median_width_px(mask: &Mask) -> Result<f64, SegError> {
    mask.require_foreground()?;
    let distances = distance_to_background(mask)?;
    let on_skeleton =
        zhang_suen(mask).foreground().map(|(row, col)| distances[[row, col]]).collect();
    // Thinning never erases a component, so there is at least one value.
    Ok(median(on_skeleton).map_or(0.0, |distance| 2.0 * distance - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strand(width_px: usize) -> Mask {
        let rows = 10..10 + width_px;
        Mask::from_array(Array2::from_shape_fn((40, 80), |(row, _)| rows.contains(&row))).unwrap()
    }

    #[test]
    fn the_median_width_of_a_straight_strand_is_exact_for_odd_widths() {
        for width in [1, 3, 5, 7, 9] {
            assert_eq!(median_width_px(&strand(width)).unwrap(), width as f64);
        }
        for width in [2, 4, 6, 8] {
            assert_eq!(median_width_px(&strand(width)).unwrap(), width as f64 - 1.0);
        }
    }

    #[test]
    fn a_strand_keeps_its_width_up_to_the_border_of_the_image() {
        let distances = distance_to_background(&strand(5)).unwrap();
        assert!((0..80).all(|col| distances[[12, col]] == 3.0));
    }

    #[test]
    fn no_background_and_no_foreground_are_refused() {
        let full = Mask::from_array(Array2::from_elem((3, 4), true)).unwrap();
        let no_background = SegError::NoBackground { height: 3, width: 4 };
        assert_eq!(distance_to_background(&full), Err(no_background.clone()));
        assert_eq!(median_width_px(&full), Err(no_background));
        let empty = Mask::from_array(Array2::from_elem((3, 4), false)).unwrap();
        assert_eq!(distance_to_background(&empty).unwrap(), Array2::<f64>::zeros((3, 4)));
        assert!(matches!(median_width_px(&empty), Err(SegError::EmptyMask { .. })));
    }
}
