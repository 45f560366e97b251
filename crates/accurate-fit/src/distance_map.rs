use ndarray::ArrayView2;

/// For every pixel of a window around a mask: the nearest foreground pixel.
///
/// The window is the mask's bounding box and a margin, cut at the image border; a position outside
/// it is first moved to the nearest pixel of the window.
///
/// Exact. Columns are scanned once; a row when a pixel of it is asked for, as far as something nearer
/// may lie. A curve is asked about where it passes, on the body or near it, and a map of all pixels costs
/// more than those few.
#[derive(Debug, Clone)]
pub(crate) struct DistanceMap {
    /// Column and row of the window's first pixel.
    x0: usize,
    y0: usize,
    width: usize,
    height: usize,
    /// Row of the window of the nearest foreground pixel in the same column, row by row; of two the
    /// upper one.
    row_of: Vec<u32>,
}

/// A column without foreground; farther than any row.
const NONE: u32 = u32::MAX;

impl DistanceMap {
    /// `mask` must have a foreground pixel; `bounds` is its bounding box `[x_min, y_min, x_max, y_max]`.
    ///
    /// Cost: O(window) time and memory; a look-up O(distance).
    pub(crate) fn new(mask: &ArrayView2<'_, bool>, bounds: [usize; 4], margin: usize) -> Self {
        let (rows, columns) = mask.dim();
        let (x0, y0) = (bounds[0].saturating_sub(margin), bounds[1].saturating_sub(margin));
        let width = (bounds[2] + margin).min(columns - 1) - x0 + 1;
        let height = (bounds[3] + margin).min(rows - 1) - y0 + 1;

        let mut row_of = vec![NONE; width * height];
        for y in 0..height {
            let (above, rest) = row_of.split_at_mut(y * width);
            let here = &mut rest[..width];
            if y > 0 {
                here.copy_from_slice(&above[(y - 1) * width..]);
            }
            let pixels = mask.row(y0 + y);
            for (found, &set) in here.iter_mut().zip(pixels.iter().skip(x0)) {
                *found = if set { y as u32 } else { *found };
            }
        }
        for y in (0..height.saturating_sub(1)).rev() {
            let (rest, below) = row_of.split_at_mut((y + 1) * width);
            for (here, &below) in rest[y * width..].iter_mut().zip(&below[..width]) {
                // `NONE` is farther than any row.
                let nearer = below.abs_diff(y as u32) < here.abs_diff(y as u32);
                *here = if nearer { below } else { *here };
            }
        }

        Self { x0, y0, width, height, row_of }
    }

    /// The foreground pixel nearest to the pixel of the window nearest to `(x, y)`.
    pub(crate) fn nearest(&self, x: f64, y: f64) -> [f64; 2] {
        self.look_up(x, y, x + 0.5, y + 0.5).0
    }

    /// The foreground pixel nearest to `(x, y)`; beyond 1 px perhaps one that is up to 0.1 px farther.
    ///
    /// Looked up at the nearest pixel of the window, and at the others around `(x, y)` if that gives
    /// more than a distance that is certainly right: on masks 1 px thick, half a pixel counts.
    pub(crate) fn nearest_around(&self, x: f64, y: f64) -> [f64; 2] {
        /// The nearest pixel itself is never farther than half a diagonal.
        const CERTAIN_PX: f64 = std::f64::consts::FRAC_1_SQRT_2;
        let (mut best, mut least) = self.look_up(x, y, x + 0.5, y + 0.5);
        // So far away it is a matter of direction only.
        if least > CERTAIN_PX && least < 8.0 {
            for (cx, cy) in [
                (x.floor(), y.floor()),
                (x.floor() + 1.0, y.floor()),
                (x.floor(), y.floor() + 1.0),
                (x.floor() + 1.0, y.floor() + 1.0),
            ] {
                let (other, distance) = self.look_up(x, y, cx, cy);
                if distance < least {
                    (best, least) = (other, distance);
                }
            }
        }
        best
    }

    /// The foreground pixel nearest to the pixel at `(column, row)`, cut to whole numbers, and its
    /// distance from `(x, y)`.
    fn look_up(&self, x: f64, y: f64, column: f64, row: f64) -> ([f64; 2], f64) {
        // `as usize` saturates, so that far or non-finite positions stay in the window.
        let column = (column as usize).clamp(self.x0, self.x0 + self.width - 1) - self.x0;
        let row = (row as usize).clamp(self.y0, self.y0 + self.height - 1) - self.y0;
        let [qx, qy] = self.nearest_in_window(column, row);
        let found = [(self.x0 + qx) as f64, (self.y0 + qy) as f64];
        let (dx, dy) = (found[0] - x, found[1] - y);
        (found, (dx * dx + dy * dy).sqrt())
    }

    /// Column and row of the foreground pixel nearest to another, all in the window; of equally near
    /// ones that of the last column.
    fn nearest_in_window(&self, column: usize, row: usize) -> [usize; 2] {
        let rows = &self.row_of[row * self.width..(row + 1) * self.width];
        let squared_in = |q: usize| match rows[q] {
            // Leaves room for a sum.
            NONE => u64::MAX / 2,
            found => u64::from(found.abs_diff(row as u32)).pow(2),
        };
        let (mut best, mut least) = (column, squared_in(column));
        for aside in 1.. {
            let across = (aside * aside) as u64;
            let (left, right) = (column.checked_sub(aside), column + aside);
            if across > least || (left.is_none() && right >= self.width) {
                break;
            }
            // The right one first: it wins a tie, also with the pixel's own column.
            if right < self.width && squared_in(right) + across <= least {
                (best, least) = (right, squared_in(right) + across);
            }
            if let Some(left) = left.filter(|left| squared_in(*left) + across < least) {
                (best, least) = (left, squared_in(left) + across);
            }
        }
        [best, rows[best] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_pixel_is_as_near_as_a_search_of_all_finds(
            (rows, columns) in (1usize..14, 1usize..14),
            bits in prop::collection::vec(prop::bool::weighted(0.2), 196),
            first in 0usize..196,
        ) {
            let mut mask = Array2::from_shape_fn((rows, columns), |(r, c)| bits[r * 14 + c]);
            mask[[first % rows, first % columns]] = true;
            let foreground: Vec<(usize, usize)> = mask.indexed_iter()
                .filter(|(_, set)| **set).map(|(at, _)| at).collect();
            let bounds = [0, 0, columns - 1, rows - 1];
            let map = DistanceMap::new(&mask.view(), bounds, 3);
            for y in 0..rows {
                for x in 0..columns {
                    let [qx, qy] = map.nearest(x as f64, y as f64);
                    prop_assert!(mask[[qy as usize, qx as usize]]);
                    let found = (qx - x as f64).powi(2) + (qy - y as f64).powi(2);
                    let best = foreground.iter()
                        .map(|&(r, c)| (c as f64 - x as f64).powi(2) + (r as f64 - y as f64).powi(2))
                        .fold(f64::INFINITY, f64::min);
                    prop_assert_eq!(found, best);
                }
            }
        }
    }
}
