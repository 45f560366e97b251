use ndarray::Array2;

use crate::spurs::nearest_seed;
use crate::{Components, Mask, SegError, Skeleton};

/// The strands of a mask, numbered from 1: what its skeleton falls into without its junctions, and the
/// pixels of the mask around each.
///
/// A piece without a junction is one strand, a cross has four, or five where thinning makes two forks of
/// it.
#[derive(Debug, Clone)]
pub struct Strands {
    labels: Array2<u32>,
    skeleton: Skeleton,
    count: usize,
}

impl Strands {
    /// Thins the mask and takes it apart.
    ///
    /// # Errors
    /// [`SegError::EmptyMask`] if there is no foreground, [`SegError::TooLarge`] as in
    /// [`Components::of`].
    ///
    /// # Cost
    /// One thinning and one flood.
    pub fn of(mask: &Mask) -> Result<Self, SegError> {
        let skeleton = Skeleton::of(mask)?;
        let mut without_junctions = skeleton.mask().clone();
        for (row, column) in skeleton.junctions()?.into_iter().flatten() {
            without_junctions.set(row, column, false);
        }
        let runs = Components::of(&without_junctions)?;
        let nearest = nearest_seed(mask, skeleton.pixels());
        let width = mask.width();
        let labels = Array2::from_shape_fn((mask.height(), width), |(row, column)| {
            nearest[row * width + column].map_or(0, |seed| runs.labels()[seed])
        });
        Ok(Self { labels, skeleton, count: runs.sizes().len() })
    }

    /// `(height, width)`: 0 for background and for what is nearest to a junction, else the number of
    /// the strand.
    pub fn labels(&self) -> &Array2<u32> {
        &self.labels
    }

    /// The skeleton that was taken apart, junctions and all.
    pub fn skeleton(&self) -> &Skeleton {
        &self.skeleton
    }

    /// How many there are. A mask that is all junction has none.
    pub fn count(&self) -> usize {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines of 3 px.
    fn drawn(lines: &[[usize; 4]]) -> Mask {
        let mut array = Array2::from_elem((60, 80), false);
        for &[row, column, end_row, end_column] in lines {
            let steps = row.abs_diff(end_row).max(column.abs_diff(end_column));
            for k in 0..=steps {
                let along = |from: usize, to: usize| {
                    (from as f64 + (to as f64 - from as f64) * k as f64 / steps as f64).round()
                        as usize
                };
                let (y, x) = (along(row, end_row), along(column, end_column));
                for pixel in
                    (y - 1..=y + 1).flat_map(|row| (x - 1..=x + 1).map(move |col| [row, col]))
                {
                    array[pixel] = true;
                }
            }
        }
        Mask::from_array(array).unwrap()
    }

    #[test]
    fn a_line_is_one_strand_and_every_pixel_of_it() {
        let mask = drawn(&[[10, 10, 30, 70]]);
        let strands = Strands::of(&mask).unwrap();
        assert_eq!(strands.count(), 1);
        assert_eq!(strands.labels(), &mask.clone().into_array().mapv(u32::from));
    }

    #[test]
    fn a_cross_has_four_strands_and_two_lines_apart_are_two() {
        let upright = drawn(&[[30, 10, 30, 70], [10, 40, 50, 40]]);
        assert_eq!(Strands::of(&upright).unwrap().count(), 4);
        let slanted = drawn(&[[10, 10, 50, 70], [50, 10, 10, 70]]);
        for (mask, ends) in [
            (&upright, [[30, 12], [30, 68], [12, 40], [48, 40]]),
            (&slanted, [[12, 13], [12, 67], [48, 13], [48, 67]]),
        ] {
            let strands = Strands::of(mask).unwrap();
            let mut arms = ends.map(|at| strands.labels()[at]);
            arms.sort_unstable();
            assert!(arms[0] > 0 && arms.windows(2).all(|pair| pair[0] < pair[1]), "{arms:?}");
            // What belongs to no strand lies around the crossing.
            for (at, _) in mask.as_array().indexed_iter().filter(|(_, set)| **set) {
                let near = at.0.abs_diff(30) < 8 && at.1.abs_diff(40) < 10;
                assert!(strands.labels()[at] > 0 || near, "{at:?}");
            }
        }
        let apart = drawn(&[[10, 10, 10, 70], [40, 10, 40, 70]]);
        assert_eq!(Strands::of(&apart).unwrap().count(), 2);
    }

    #[test]
    fn a_mask_without_foreground_is_refused() {
        let empty = Mask::from_array(Array2::from_elem((5, 5), false)).unwrap();
        assert!(matches!(Strands::of(&empty), Err(SegError::EmptyMask { .. })));
    }
}
