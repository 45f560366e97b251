use std::marker::PhantomData;
use std::ops::Range;

use accurate_geom::{Pixel, View};

use crate::TraverseError;

/// The pixels with exactly one 8-neighbour, in raster order (row, then column).
///
/// `skeleton` may be in any order. The result can be empty: a closed curve has no endpoint.
///
/// # Errors
/// [`TraverseError`] if the skeleton is empty, has a single pixel, or has a coordinate that is not a
/// whole finite number of reasonable size, or a pixel twice.
///
/// # Source
/// ACCURATE, section 2.2: `deg(n) = 1`.
///
/// # Cost
/// O(N log N).
pub fn endpoints<V: View>(skeleton: &[Pixel<V>]) -> Result<Vec<Pixel<V>>, TraverseError> {
    let skeleton = Skeleton::new(skeleton)?;
    Ok(skeleton.endpoints().into_iter().map(|id| skeleton.pixel(id)).collect())
}

/// Checked skeleton pixels in raster order with an index by row.
///
/// A pixel's id is its rank in raster order, so that any scan by rows and columns enumerates ids in
/// ascending order: the tie rule of the traversal. Memory is O(N + height), without hashing.
#[derive(Debug)]
pub(crate) struct Skeleton<V> {
    xs: Vec<i32>,
    ys: Vec<i32>,
    y_min: i32,
    /// Row `y` holds the ids `row_start[y - y_min] .. row_start[y - y_min + 1]`.
    row_start: Vec<usize>,
    view: PhantomData<V>,
}

impl<V: View> Skeleton<V> {
    /// Largest absolute coordinate accepted, px. No detector is that large, and the row index of
    /// such a height still fits into a few megabytes.
    pub(crate) const COORDINATE_LIMIT_PX: u32 = 1 << 20;

    pub(crate) fn new(pixels: &[Pixel<V>]) -> Result<Self, TraverseError> {
        let view = V::NUMBER;
        match pixels.len() {
            0 => return Err(TraverseError::Empty { view }),
            1 => return Err(TraverseError::TooSmall { view, pixels: 1 }),
            _ => {}
        }
        let limit = Self::COORDINATE_LIMIT_PX;
        let mut raster = Vec::with_capacity(pixels.len());
        for (index, &Pixel { x, y, .. }) in pixels.iter().enumerate() {
            if !(x.is_finite() && y.is_finite()) {
                return Err(TraverseError::NotFinite { view, index, x, y });
            }
            if x.fract() != 0.0 || y.fract() != 0.0 {
                return Err(TraverseError::NotInteger { view, index, x, y });
            }
            if x.abs().max(y.abs()) > f64::from(limit) {
                return Err(TraverseError::SizeTooLarge { view, index, x, y, limit });
            }
            // Whole and below 2^20: the conversion is exact.
            raster.push((y as i32, x as i32));
        }
        raster.sort_unstable();
        if let Some(pair) = raster.windows(2).find(|pair| pair[0] == pair[1]) {
            let (y, x) = pair[0];
            return Err(TraverseError::Duplicate { view, x: x.into(), y: y.into() });
        }
        let y_min = raster[0].0;
        let height = (raster[raster.len() - 1].0 - y_min) as usize + 1;
        let mut row_start = vec![0; height + 1];
        for &(y, _) in &raster {
            row_start[(y - y_min) as usize + 1] += 1;
        }
        for row in 0..height {
            row_start[row + 1] += row_start[row];
        }
        let (ys, xs) = raster.into_iter().unzip();
        Ok(Self { xs, ys, y_min, row_start, view: PhantomData })
    }

    pub(crate) fn len(&self) -> usize {
        self.xs.len()
    }

    pub(crate) fn xy(&self, id: usize) -> (i32, i32) {
        (self.xs[id], self.ys[id])
    }

    pub(crate) fn pixel(&self, id: usize) -> Pixel<V> {
        Pixel::new(self.xs[id].into(), self.ys[id].into())
    }

    /// The id of a pixel, if it is one of the skeleton.
    pub(crate) fn find(&self, pixel: Pixel<V>) -> Option<usize> {
        let row = pixel.y - f64::from(self.y_min);
        if !(row >= 0.0 && row.fract() == 0.0 && row < (self.row_start.len() - 1) as f64) {
            return None;
        }
        let ids = self.row_start[row as usize]..self.row_start[row as usize + 1];
        ids.into_iter().find(|&id| f64::from(self.xs[id]) == pixel.x)
    }

    /// The ids within Chebyshev distance `radius` of pixel `id`, itself included, ascending: row
    /// offset first, then column offset.
    pub(crate) fn square(&self, id: usize, radius: u32) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = (i64::from(self.xs[id]), i64::from(self.ys[id]));
        let (radius, y_min) = (i64::from(radius), i64::from(self.y_min));
        let last_row = self.row_start.len() as i64 - 2;
        let rows = (y - radius - y_min).max(0)..=(y + radius - y_min).min(last_row);
        rows.flat_map(move |row| self.span(row as usize, x - radius, x + radius))
    }

    /// The ids of row `row` with columns from `low` to `high`, both included.
    fn span(&self, row: usize, low: i64, high: i64) -> Range<usize> {
        let (start, end) = (self.row_start[row], self.row_start[row + 1]);
        let columns = &self.xs[start..end];
        let from = start + columns.partition_point(|&x| i64::from(x) < low);
        let to = start + columns.partition_point(|&x| i64::from(x) <= high);
        from..to
    }

    /// Ids with exactly one 8-neighbour, ascending.
    pub(crate) fn endpoints(&self) -> Vec<usize> {
        // The square of radius 1 holds the pixel itself and its 8-neighbours.
        (0..self.len()).filter(|&id| self.square(id, 1).take(3).count() == 2).collect()
    }

    /// For every id the number of its 8-connected piece.
    pub(crate) fn pieces(&self) -> Vec<usize> {
        const NONE: usize = usize::MAX;
        let mut piece = vec![NONE; self.len()];
        let mut stack = Vec::new();
        let mut count = 0;
        for seed in 0..self.len() {
            if piece[seed] != NONE {
                continue;
            }
            piece[seed] = count;
            stack.push(seed);
            while let Some(id) = stack.pop() {
                for neighbour in self.square(id, 1) {
                    if piece[neighbour] == NONE {
                        piece[neighbour] = count;
                        stack.push(neighbour);
                    }
                }
            }
            count += 1;
        }
        piece
    }
}
