use std::fmt;

use ndarray::{Array2, Axis};

use crate::SegError;
use crate::threshold::require_finite;

/// A binary image with at least one pixel: `true` is foreground.
///
/// Shape `(height, width)`, indexed `[[row, col]]`, that is `[[y, x]]`; pixel `(row, col)` has its
/// centre at `x = col, y = row`. What lies outside of the image counts as background for thinning
/// and labelling.
///
/// Printed with one text line per row, `#` for foreground and `.` for background.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    /// Always in standard (row-major, contiguous) layout and never of size 0.
    pixels: Array2<bool>,
}

impl Mask {
    /// Takes an array of shape `(height, width)` in any memory layout.
    ///
    /// # Errors
    /// [`SegError::EmptyImage`] if a side is 0. A mask without foreground is allowed.
    pub fn from_array(pixels: Array2<bool>) -> Result<Self, SegError> {
        let (height, width) = pixels.dim();
        if height == 0 || width == 0 {
            return Err(SegError::EmptyImage { height, width });
        }
        let standard = pixels.is_standard_layout();
        Ok(Self {
            pixels: if standard { pixels } else { pixels.as_standard_layout().into_owned() },
        })
    }

    /// Any non-zero value is foreground, as in a mask file of 0 and 255 or of 0 and 1.
    ///
    /// # Errors
    /// [`SegError::EmptyImage`] if a side is 0.
    pub fn from_u8(image: &Array2<u8>) -> Result<Self, SegError> {
        Self::from_array(image.mapv(|value| value != 0))
    }

    /// Rows, px; at least 1.
    pub fn height(&self) -> usize {
        self.pixels.nrows()
    }

    /// Columns, px; at least 1.
    pub fn width(&self) -> usize {
        self.pixels.ncols()
    }

    /// `(height, width)`, px.
    pub fn shape(&self) -> (usize, usize) {
        self.pixels.dim()
    }

    /// Whether `(row, col)` is foreground; `false` outside of the image.
    pub fn get(&self, row: usize, col: usize) -> bool {
        self.pixels.get((row, col)).copied().unwrap_or(false)
    }

    /// The pixels, `(height, width)`.
    pub fn as_array(&self) -> &Array2<bool> {
        &self.pixels
    }

    /// The pixels, `(height, width)`.
    pub fn into_array(self) -> Array2<bool> {
        self.pixels
    }

    /// 255 for foreground, 0 for background.
    pub fn to_u8(&self) -> Array2<u8> {
        self.pixels.mapv(|pixel| if pixel { 255 } else { 0 })
    }

    /// Number of foreground pixels.
    pub fn count(&self) -> usize {
        self.raster().iter().filter(|&&pixel| pixel).count()
    }

    /// Whether there is no foreground pixel.
    pub fn is_empty(&self) -> bool {
        !self.raster().contains(&true)
    }

    /// Refuses a mask without foreground.
    ///
    /// # Errors
    /// [`SegError::EmptyMask`].
    pub fn require_foreground(&self) -> Result<(), SegError> {
        if self.is_empty() {
            return Err(SegError::EmptyMask { height: self.height(), width: self.width() });
        }
        Ok(())
    }

    /// Refuses a mask without foreground, and one that is mostly foreground.
    ///
    /// # Errors
    /// [`SegError::EmptyMask`], [`SegError::MostlyForeground`].
    pub fn require_thin_body(&self) -> Result<(), SegError> {
        self.require_foreground()?;
        let (foreground, pixels) = (self.foreground().count(), self.height() * self.width());
        if 2 * foreground > pixels {
            return Err(SegError::MostlyForeground { foreground, pixels });
        }
        Ok(())
    }

    /// Refuses a map of other pixels than the mask's, or one that is not finite everywhere.
    ///
    /// # Errors
    /// [`SegError::WrongShape`], [`SegError::NotFinite`].
    pub(crate) fn require_map(&self, map: &Array2<f32>) -> Result<(), SegError> {
        if map.dim() != self.shape() {
            return Err(SegError::WrongShape { expected: self.shape(), found: map.dim() });
        }
        require_finite(map)
    }

    /// Foreground pixels as `(row, col)` in raster order: row by row, left to right.
    pub fn foreground(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        // A wire covers about 1 % of its image: skipping empty blocks makes the scan as fast as
        // memory.
        const BLOCK: usize = 64;
        self.raster().chunks(self.width()).enumerate().flat_map(|(row, line)| {
            let blocks = line.chunks(BLOCK).zip((0..).step_by(BLOCK));
            let used = |block: &[bool]| block.iter().fold(false, |any, &pixel| any | pixel);
            blocks.filter(move |(block, _)| used(block)).flat_map(move |(block, start)| {
                let set = block.iter().enumerate().filter(|&(_, &pixel)| pixel);
                set.map(move |(k, _)| (row, start + k))
            })
        })
    }

    /// Rows become columns: `(row, col)` moves to `(col, row)`.
    pub fn transposed(&self) -> Self {
        Self { pixels: self.pixels.t().as_standard_layout().into_owned() }
    }

    /// Left and right exchanged.
    pub fn flipped_left_right(&self) -> Self {
        self.reversed(Axis(1))
    }

    /// Top and bottom exchanged.
    pub fn flipped_top_bottom(&self) -> Self {
        self.reversed(Axis(0))
    }

    fn reversed(&self, axis: Axis) -> Self {
        let mut view = self.pixels.view();
        view.invert_axis(axis);
        Self { pixels: view.as_standard_layout().into_owned() }
    }

    /// Nothing but background, in the size of this mask.
    pub(crate) fn cleared(&self) -> Self {
        Self { pixels: Array2::from_elem(self.shape(), false) }
    }

    /// All pixels in raster order.
    pub(crate) fn raster(&self) -> &[bool] {
        // The layout is standard by construction, so there is always a slice.
        self.pixels.as_slice().unwrap_or_default()
    }

    /// All pixels in raster order.
    pub(crate) fn raster_mut(&mut self) -> &mut [bool] {
        self.pixels.as_slice_mut().unwrap_or_default()
    }

    /// The same size with the pixels for which `keep(index in raster order)` holds.
    pub(crate) fn retain(mut self, keep: impl Fn(usize) -> bool) -> Self {
        for (index, pixel) in self.pixels.iter_mut().enumerate() {
            *pixel = *pixel && keep(index);
        }
        self
    }

    pub(crate) fn set(&mut self, row: usize, col: usize, value: bool) {
        if let Some(pixel) = self.pixels.get_mut((row, col)) {
            *pixel = value;
        }
    }
}

impl fmt::Display for Mask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for row in self.raster().chunks(self.width()) {
            let line: String = row.iter().map(|&pixel| if pixel { '#' } else { '.' }).collect();
            writeln!(f, "{line}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_without_pixels_is_refused() {
        for shape in [(0, 0), (0, 5), (5, 0)] {
            let error = Mask::from_array(Array2::from_elem(shape, true)).unwrap_err();
            assert_eq!(error, SegError::EmptyImage { height: shape.0, width: shape.1 });
        }
    }

    #[test]
    fn any_non_zero_value_is_foreground() {
        let image = Array2::from_shape_vec((2, 2), vec![0, 1, 128, 255]).unwrap();
        let mask = Mask::from_u8(&image).unwrap();
        assert_eq!(mask.foreground().collect::<Vec<_>>(), [(0, 1), (1, 0), (1, 1)]);
        assert_eq!(mask.to_string(), ".#\n##\n");
    }

    #[test]
    fn a_column_major_array_is_the_same_mask() {
        let rows = Array2::from_shape_fn((5, 130), |(row, col)| (row * 7 + col) % 13 == 0);
        let columns = rows.t().as_standard_layout().into_owned().reversed_axes();
        assert!(!columns.is_standard_layout());
        let mask = Mask::from_array(columns).unwrap();
        assert_eq!(mask, Mask::from_array(rows.clone()).unwrap());
        let expected: Vec<_> = rows.indexed_iter().filter(|(_, p)| **p).map(|(at, _)| at).collect();
        assert_eq!(mask.foreground().collect::<Vec<_>>(), expected);
        assert_eq!(mask.count(), expected.len());
    }

    #[test]
    fn outside_of_the_image_is_background() {
        let mask = Mask::from_array(Array2::from_elem((2, 3), true)).unwrap();
        assert!(mask.get(1, 2) && !mask.get(2, 2) && !mask.get(1, 3));
    }
}
