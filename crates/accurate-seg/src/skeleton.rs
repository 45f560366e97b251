use accurate_geom::{Pixel, View};

use crate::{Components, Mask, SegError, zhang_suen};

/// The pixels of a thinned mask and how they hang together.
///
/// Positions are `(row, col)` in raster order throughout. Two pixels are neighbours when they
/// touch by a side or a corner.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skeleton {
    mask: Mask,
    pixels: Vec<(usize, usize)>,
    /// Number of neighbours of each pixel, 0 to 8.
    neighbours: Vec<u8>,
}

impl Skeleton {
    /// Thins `mask` by [`zhang_suen`].
    ///
    /// # Errors
    /// [`SegError::EmptyMask`] if there is no foreground.
    pub fn of(mask: &Mask) -> Result<Self, SegError> {
        Self::from_thin(zhang_suen(mask))
    }

    /// Takes a mask that is already thin, as it is.
    ///
    /// # Errors
    /// [`SegError::EmptyMask`] if there is no foreground.
    pub fn from_thin(mask: Mask) -> Result<Self, SegError> {
        mask.require_foreground()?;
        let pixels: Vec<_> = mask.foreground().collect();
        let neighbours = pixels.iter().map(|&at| neighbour_count(&mask, at)).collect();
        Ok(Self { mask, pixels, neighbours })
    }

    /// The skeleton as a mask.
    pub fn mask(&self) -> &Mask {
        &self.mask
    }

    /// All pixels; at least one.
    pub fn pixels(&self) -> &[(usize, usize)] {
        &self.pixels
    }

    /// Number of neighbours of each of [`Self::pixels`], 0 to 8.
    pub fn neighbour_counts(&self) -> &[u8] {
        &self.neighbours
    }

    /// All pixels as positions in the image of view `V`: x = column, y = row, no half-pixel shift.
    pub fn pixels_as<V: View>(&self) -> Vec<Pixel<V>> {
        as_pixels(&self.pixels)
    }

    /// Pixels with exactly one neighbour. A closed curve has none.
    pub fn endpoints(&self) -> Vec<(usize, usize)> {
        self.with_neighbours(|count| count == 1)
    }

    /// Pixels without a neighbour.
    pub fn isolated(&self) -> Vec<(usize, usize)> {
        self.with_neighbours(|count| count == 0)
    }

    /// Pixels with three neighbours or more, in clusters of those that touch, each in raster
    /// order; the clusters in raster order of their first pixel.
    ///
    /// # Errors
    /// [`SegError::TooLarge`] as in [`Components::of`].
    pub fn junctions(&self) -> Result<Vec<Vec<(usize, usize)>>, SegError> {
        let branching = self.with_neighbours(|count| count >= 3);
        let mut mask = self.mask.clone().retain(|_| false);
        for &(row, col) in &branching {
            mask.set(row, col, true);
        }
        let components = Components::of(&mask)?;
        let mut clusters = vec![Vec::new(); components.sizes().len()];
        for at in branching {
            clusters[components.labels()[at] as usize - 1].push(at);
        }
        Ok(clusters)
    }

    /// Refuses a skeleton of a single pixel, which has no direction.
    ///
    /// # Errors
    /// [`SegError::TooSmall`].
    pub fn require_curve(&self) -> Result<(), SegError> {
        match self.pixels.len() {
            pixels @ 0..=1 => Err(SegError::TooSmall { pixels }),
            _ => Ok(()),
        }
    }

    /// Joins by a straight line of pixels every two endpoints that do not touch and are at most
    /// `max_gap_px` apart in rows and in columns, then thins the result.
    ///
    /// With `max_gap_px` of 1, the value behind the published numbers of ACCURATE (whose text does
    /// not mention the step), there is nothing to join and nothing changes. Larger values also join
    /// the two ends of one strand.
    ///
    /// # Cost
    /// Pairs of endpoints within `max_gap_px` rows of each other.
    pub fn fix_gaps(&self, max_gap_px: usize) -> Self {
        let ends = self.endpoints();
        let mut mask = self.mask.clone();
        let mut joined = false;
        for (k, &a) in ends.iter().enumerate() {
            // Endpoints are sorted by row: the rest is farther still.
            let near = ends[k + 1..].iter().take_while(|b| b.0 - a.0 <= max_gap_px);
            for &b in near {
                let gap = a.0.abs_diff(b.0).max(a.1.abs_diff(b.1));
                if (2..=max_gap_px).contains(&gap) {
                    draw_line(&mut mask, a, b);
                    joined = true;
                }
            }
        }
        if !joined {
            return self.clone();
        }
        let mask = zhang_suen(&mask);
        let pixels: Vec<_> = mask.foreground().collect();
        let neighbours = pixels.iter().map(|&at| neighbour_count(&mask, at)).collect();
        Self { mask, pixels, neighbours }
    }

    fn with_neighbours(&self, wanted: impl Fn(u8) -> bool) -> Vec<(usize, usize)> {
        let counted = self.pixels.iter().zip(&self.neighbours);
        counted.filter(|&(_, &count)| wanted(count)).map(|(&at, _)| at).collect()
    }
}

fn as_pixels<V: View>(positions: &[(usize, usize)]) -> Vec<Pixel<V>> {
    positions.iter().map(|&(row, col)| Pixel::new(col as f64, row as f64)).collect()
}

fn neighbour_count(mask: &Mask, (row, col): (usize, usize)) -> u8 {
    let rows = row.saturating_sub(1)..=row + 1;
    let around = rows.flat_map(|r| (col.saturating_sub(1)..=col + 1).map(move |c| (r, c)));
    around.filter(|&(r, c)| (r, c) != (row, col) && mask.get(r, c)).count() as u8
}

/// Sets one pixel per step along the longer side, rounded half up.
fn draw_line(mask: &mut Mask, a: (usize, usize), b: (usize, usize)) {
    let steps = a.0.abs_diff(b.0).max(a.1.abs_diff(b.1));
    // Weighted mean of two positions: no sign, no overflow below 2^32 pixels a side.
    let between = |from: usize, to: usize, k: usize| {
        (2 * (from * (steps - k) + to * k) + steps) / (2 * steps)
    };
    for k in 1..steps {
        mask.set(between(a.0, b.0, k), between(a.1, b.1, k), true);
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;
    use ndarray::Array2;

    use super::*;

    fn thin(rows: &[&str]) -> Skeleton {
        let pixels = Array2::from_shape_fn((rows.len(), rows[0].len()), |(r, c)| {
            rows[r].as_bytes()[c] == b'#'
        });
        Skeleton::from_thin(Mask::from_array(pixels).unwrap()).unwrap()
    }

    #[test]
    fn a_cross_has_four_ends_and_one_junction() {
        let cross = thin(&["#...#", ".#.#.", "..#..", ".#.#.", "#...#"]);
        assert_eq!(cross.endpoints(), [(0, 0), (0, 4), (4, 0), (4, 4)]);
        assert_eq!(cross.junctions().unwrap(), [vec![(2, 2)]]);
        assert_eq!(cross.neighbour_counts()[4], 4);
    }

    #[test]
    fn branching_pixels_that_touch_are_one_junction() {
        let tee = thin(&["#####", "..#..", "..#.."]);
        assert_eq!(tee.junctions().unwrap(), [vec![(0, 1), (0, 2), (0, 3), (1, 2)]]);
        assert_eq!(tee.endpoints(), [(0, 0), (0, 4), (2, 2)]);
    }

    #[test]
    fn a_closed_curve_has_no_end_and_a_point_no_curve() {
        let ring = thin(&[".##.", "#..#", ".##."]);
        assert!(ring.endpoints().is_empty() && ring.junctions().unwrap().is_empty());
        let dot = thin(&["...", ".#."]);
        assert_eq!(dot.isolated(), [(1, 1)]);
        assert_eq!(dot.require_curve(), Err(SegError::TooSmall { pixels: 1 }));
        assert_eq!(ring.require_curve(), Ok(()));
    }

    #[test]
    fn pixels_are_x_column_y_row() {
        let pixels = thin(&["....", "...#"]).pixels_as::<View1>();
        assert_eq!(pixels, [Pixel::new(3.0, 1.0)]);
    }

    #[test]
    fn an_empty_mask_has_no_skeleton() {
        let empty = Mask::from_array(Array2::from_elem((2, 2), false)).unwrap();
        assert_eq!(Skeleton::of(&empty), Err(SegError::EmptyMask { height: 2, width: 2 }));
    }

    #[test]
    fn a_gap_is_bridged_when_it_is_narrow_enough() {
        let broken = thin(&["###....", ".......", ".....##"]);
        assert_eq!(broken.fix_gaps(2), broken);
        let whole = broken.fix_gaps(3);
        assert_eq!(whole.endpoints(), [(0, 0), (2, 6)]);
        assert!(whole.junctions().unwrap().is_empty());
        assert_eq!(broken.fix_gaps(usize::MAX).isolated(), []);
    }
}
