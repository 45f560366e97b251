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
/// 2012 (imageproc's implementation) for thick bodies; for thin ones their columns, then a search
/// along the row, which is exact too.
///
/// # Cost
/// O(pixels), 12 bytes each.
pub fn distance_to_background(mask: &Mask) -> Result<Array2<f64>, SegError> {
    let (height, width) = mask.shape();
    if mask.count() == height * width {
        return Err(SegError::NoBackground { height, width });
    }
    let columns = column_distances(mask);
    match distances_along_rows(&columns, height, width, MOST_STEPS_A_PIXEL * columns.len()) {
        Some(distances) => Ok(distances),
        None => distances_of_thick(mask),
    }
}

/// A search of so many steps, on average, takes as long as a transform that needs none.
const MOST_STEPS_A_PIXEL: usize = 2;
/// A column without background; farther than any.
const NONE: u32 = u32::MAX;

/// Distance of each pixel to the background in its column, px, row by row.
fn column_distances(mask: &Mask) -> Vec<u32> {
    let (height, width) = mask.shape();
    let mut distances: Vec<u32> =
        mask.raster().iter().map(|&pixel| if pixel { NONE } else { 0 }).collect();
    let closer = |here: &mut [u32], beside: &[u32]| {
        for (here, beside) in here.iter_mut().zip(beside) {
            *here = (*here).min(beside.saturating_add(1));
        }
    };
    for y in 1..height {
        let (above, here) = distances.split_at_mut(y * width);
        closer(&mut here[..width], &above[(y - 1) * width..]);
    }
    for y in (1..height).rev() {
        let (here, below) = distances.split_at_mut(y * width);
        closer(&mut here[(y - 1) * width..], &below[..width]);
    }
    distances
}

/// Of each pixel: the least distance to the nearest background of the columns around it. `None` if that
/// takes more than so many steps.
fn distances_along_rows(
    columns: &[u32],
    height: usize,
    width: usize,
    most_steps: usize,
) -> Option<Array2<f64>> {
    let mut steps = 0;
    let mut distances = Array2::zeros((height, width));
    let rows = distances.rows_mut().into_iter().zip(columns.chunks_exact(width));
    for (mut found, row) in rows {
        for (x, found) in found.iter_mut().enumerate() {
            if row[x] == 0 {
                continue;
            }
            let squared = |distance: u32| u64::from(distance) * u64::from(distance);
            let mut least = squared(row[x]);
            for aside in 1.. {
                let across = (aside * aside) as u64;
                if across >= least || (aside > x && x + aside >= width) {
                    steps += aside;
                    break;
                }
                let left = x.checked_sub(aside).map_or(NONE, |left| row[left]);
                let right = row.get(x + aside).copied().unwrap_or(NONE);
                least = least.min(squared(left.min(right)).saturating_add(across));
            }
            *found = (least as f64).sqrt();
            // Not once a row: one row may be the whole mask.
            if steps > most_steps {
                return None;
            }
        }
    }
    Some(distances)
}

/// At a cost that does not depend on thickness.
fn distances_of_thick(mask: &Mask) -> Result<Array2<f64>, SegError> {
    let (height, width) = mask.shape();
    // imageproc measures the distance to the non-zero pixels.
    let background = mask.raster().iter().map(|&pixel| u8::from(!pixel));
    let squared = euclidean_squared_distance_transform(&to_image(height, width, background)?);
    let distances = squared.into_raw().into_iter().map(f64::sqrt).collect();
    // imageproc's buffer is row by row, as ours; the sizes agree by construction.
    Array2::from_shape_vec((height, width), distances).map_err(|_| SegError::TooLarge {
        height,
        width,
        most: u32::MAX.into(),
    })
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
    use proptest::prelude::*;

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

    proptest! {
        /// Two ways to the same bits.
        #[test]
        fn thin_and_thick_bodies_are_measured_alike(
            (height, width) in (1usize..30, 1usize..30),
            seed in prop::collection::vec(prop::bool::weighted(0.9), 900),
            hole in 0usize..900,
        ) {
            let mut array = Array2::from_shape_fn((height, width), |(y, x)| seed[y * 30 + x]);
            array[[hole % height, hole % width]] = false;
            let mask = Mask::from_array(array).unwrap();
            let columns = column_distances(&mask);
            let thin = distances_along_rows(&columns, height, width, usize::MAX);
            prop_assert_eq!(thin.unwrap(), distances_of_thick(&mask).unwrap());
        }
    }

    /// One row, all of it body but for a pixel: every other is measured against its whole half.
    #[test]
    fn the_steps_of_a_wide_row_are_counted_within_it() {
        let mut row = vec![NONE; 4000];
        row[0] = 0;
        assert!(distances_along_rows(&row, 1, 4000, 100_000).is_none());
        assert!(distances_along_rows(&row[..300], 1, 300, 100_000).is_some());
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
