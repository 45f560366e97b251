use image::GrayImage;
use imageproc::region_labelling::{Connectivity, connected_components};
use ndarray::Array2;

use crate::{Mask, SegError};

/// The 8-connected components of a mask, numbered from 1 in raster order of their first pixel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Components {
    labels: Array2<u32>,
    sizes: Vec<usize>,
}

impl Components {
    /// Labels the 8-connected components. A mask without foreground has none.
    ///
    /// # Errors
    /// [`SegError::TooLarge`] from 2^32 pixels on.
    ///
    /// # Cost
    /// Near linear in the pixels (union-find of imageproc).
    pub fn of(mask: &Mask) -> Result<Self, SegError> {
        // A row of background more: without it imageproc 0.27 panics on the mask of one pixel.
        let margin = std::iter::repeat_n(0, mask.width());
        let bytes = mask.raster().iter().map(|&pixel| u8::from(pixel)).chain(margin);
        let image = to_image(mask.height() + 1, mask.width(), bytes)?;
        let raw = connected_components(&image, Connectivity::Eight, image::Luma([0]));
        let mut labels = Array2::zeros(mask.shape());
        let mut sizes = Vec::new();
        // imageproc leaves the order of its labels open; ours is part of the result.
        let mut number_of = vec![0u32; mask.count() + 1];
        for (label, raw) in labels.iter_mut().zip(raw.iter()) {
            let Some(number) = number_of.get_mut(*raw as usize).filter(|_| *raw != 0) else {
                continue;
            };
            if *number == 0 {
                sizes.push(0);
                *number = sizes.len() as u32;
            }
            *label = *number;
            sizes[*number as usize - 1] += 1;
        }
        Ok(Self { labels, sizes })
    }

    /// `(height, width)`: 0 for background, else the number of the component.
    pub fn labels(&self) -> &Array2<u32> {
        &self.labels
    }

    /// Area of each component, px; component `n` at index `n - 1`.
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// The mask that was labelled without the components of which `keep`, which is given their numbers,
    /// says so.
    pub(crate) fn select(&self, mask: &Mask, keep: impl Fn(u32) -> bool) -> Mask {
        let labels = self.labels.as_slice().unwrap_or_default();
        mask.clone().retain(|index| keep(labels[index]))
    }
}

/// Only the largest 8-connected component; of equal ones the first in raster order.
///
/// # Errors
/// [`SegError::EmptyMask`] if there is none, [`SegError::TooLarge`] as in [`Components::of`].
pub fn keep_largest(mask: &Mask) -> Result<Mask, SegError> {
    mask.require_foreground()?;
    let components = Components::of(mask)?;
    let largest = components.sizes.iter().copied().max().unwrap_or(0);
    let number = components.sizes.iter().position(|&size| size == largest).unwrap_or(0) + 1;
    Ok(components.select(mask, |label| label as usize == number))
}

/// Without the 8-connected components of fewer than `min_area_px` pixels. The result may be empty.
///
/// # Errors
/// [`SegError::TooLarge`] as in [`Components::of`].
pub fn remove_smaller_than(mask: &Mask, min_area_px: usize) -> Result<Mask, SegError> {
    let components = Components::of(mask)?;
    let large = |label: u32| components.sizes[label as usize - 1] >= min_area_px;
    Ok(components.select(mask, large))
}

/// Bytes in raster order as an image of imageproc, which counts pixels in u32.
pub(crate) fn to_image(
    height: usize,
    width: usize,
    bytes: impl Iterator<Item = u8>,
) -> Result<GrayImage, SegError> {
    let too_large = || SegError::TooLarge { height, width, most: u32::MAX.into() };
    if height.checked_mul(width).and_then(|pixels| u32::try_from(pixels).ok()).is_none() {
        return Err(too_large());
    }
    // Each side is at most the product, so both fit.
    GrayImage::from_raw(width as u32, height as u32, bytes.collect()).ok_or_else(too_large)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Mask {
        Mask::from_array(Array2::from_shape_fn((rows.len(), rows[0].len()), |(r, c)| {
            rows[r].as_bytes()[c] == b'#'
        }))
        .unwrap()
    }

    #[test]
    fn components_are_numbered_in_raster_order_and_joined_diagonally() {
        let components = Components::of(&mask(&["..#.#", ".#..#", "#....", "....#"])).unwrap();
        assert_eq!(components.sizes(), [3, 2, 1]);
        assert_eq!(components.labels()[[2, 0]], 1);
        assert_eq!(components.labels()[[1, 4]], 2);
    }

    #[test]
    fn the_first_of_two_equal_components_is_the_largest() {
        let kept = keep_largest(&mask(&["#.##", "#...", "...#"])).unwrap();
        assert_eq!(kept, mask(&["#...", "#...", "...."]));
    }

    #[test]
    fn an_image_beyond_the_indices_of_imageproc_is_refused() {
        for side in [1 << 16, usize::MAX] {
            let error = to_image(side, side, std::iter::empty()).unwrap_err();
            assert_eq!(
                error,
                SegError::TooLarge { height: side, width: side, most: u32::MAX.into() }
            );
        }
    }

    #[test]
    fn a_mask_of_a_single_pixel_is_one_component() {
        assert_eq!(Components::of(&mask(&["#"])).unwrap().sizes(), [1]);
        assert_eq!(keep_largest(&mask(&["#"])).unwrap(), mask(&["#"]));
    }

    #[test]
    fn an_empty_mask_has_no_largest_component_but_can_be_cleaned() {
        let empty = mask(&["...", "..."]);
        assert_eq!(keep_largest(&empty), Err(SegError::EmptyMask { height: 2, width: 3 }));
        assert_eq!(remove_smaller_than(&empty, 5).unwrap(), empty);
        assert!(Components::of(&empty).unwrap().sizes().is_empty());
    }
}
