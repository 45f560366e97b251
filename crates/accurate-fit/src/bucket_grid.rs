use std::ops::Range;

/// Side of a bucket, px. The search radius is 5 to 8 px: 4 keeps the searched area close to it.
const CELL_PX: f64 = 4.0;

/// Points of an image sorted into square buckets.
#[derive(Debug, Clone)]
pub(crate) struct BucketGrid {
    x0: f64,
    y0: f64,
    columns: usize,
    rows: usize,
    /// Points of bucket `b` are `start[b]..start[b + 1]` of the sorted list.
    start: Vec<u32>,
}

impl BucketGrid {
    /// Sorts `[x, y, ..]` points by bucket; points of one bucket keep their order.
    pub(crate) fn sort(points: Vec<[f64; 4]>) -> (Self, Vec<[f64; 4]>) {
        let fold =
            |k: usize, f: fn(f64, f64) -> f64, init: f64| points.iter().map(|p| p[k]).fold(init, f);
        let (x0, y0) = (fold(0, f64::min, f64::INFINITY), fold(1, f64::min, f64::INFINITY));
        let (x1, y1) = (fold(0, f64::max, f64::NEG_INFINITY), fold(1, f64::max, f64::NEG_INFINITY));
        let columns = ((x1 - x0) / CELL_PX) as usize + 1;
        let rows = ((y1 - y0) / CELL_PX) as usize + 1;
        let bucket = |p: &[f64; 4]| {
            let column = ((p[0] - x0) / CELL_PX) as usize;
            let row = ((p[1] - y0) / CELL_PX) as usize;
            row * columns + column
        };
        let mut start = vec![0u32; rows * columns + 1];
        for p in &points {
            start[bucket(p) + 1] += 1;
        }
        for b in 0..rows * columns {
            start[b + 1] += start[b];
        }
        let mut next = start.clone();
        let mut sorted = vec![[0.0; 4]; points.len()];
        for p in points {
            let at = &mut next[bucket(&p)];
            sorted[*at as usize] = p;
            *at += 1;
        }
        (Self { x0, y0, columns, rows, start }, sorted)
    }

    /// Calls `visit` with ranges of sorted points that together hold every point of the box
    /// `[x_min, y_min, x_max, y_max]` (and some more).
    pub(crate) fn for_box(&self, bounds: [f64; 4], mut visit: impl FnMut(Range<usize>)) {
        let (rows, columns) = self.buckets_of(bounds);
        for row in rows {
            visit(self.points_of(row, &columns));
        }
    }

    /// Rows and columns of the buckets of a box.
    #[inline(always)]
    pub(crate) fn buckets_of(&self, bounds: [f64; 4]) -> (Range<usize>, Range<usize>) {
        let low = |v: f64, origin: f64| ((v - origin) / CELL_PX).floor().max(0.0) as usize;
        let (c0, r0) = (low(bounds[0], self.x0), low(bounds[1], self.y0));
        let (x1, y1) = ((bounds[2] - self.x0) / CELL_PX, (bounds[3] - self.y0) / CELL_PX);
        // Also refuses NaN.
        if !(x1 >= 0.0 && y1 >= 0.0) {
            return (0..0, 0..0);
        }
        // Empty if it begins behind the last.
        let behind = |v: f64, count: usize| (v as usize).saturating_add(1).min(count);
        (r0..behind(y1, self.rows), c0..behind(x1, self.columns))
    }

    /// The sorted points of some columns of a row of buckets.
    #[inline(always)]
    pub(crate) fn points_of(&self, row: usize, columns: &Range<usize>) -> Range<usize> {
        if columns.is_empty() {
            return 0..0;
        }
        let first = row * self.columns;
        self.start[first + columns.start] as usize..self.start[first + columns.end] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_box_query_finds_every_point_of_the_box(
            points in prop::collection::vec((-40.0..90.0f64, 0.0..70.0f64), 1..60),
            (x, y) in (-60.0..110.0f64, -20.0..90.0f64),
            (w, h) in (0.0..40.0f64, 0.0..40.0f64),
        ) {
            let list: Vec<[f64; 4]> = points.iter().map(|&(x, y)| [x, y, 1.0, 0.0]).collect();
            let (grid, sorted) = BucketGrid::sort(list);
            let mut seen = vec![false; sorted.len()];
            grid.for_box([x, y, x + w, y + h], |range| seen[range].fill(true));
            for (p, seen) in sorted.iter().zip(seen) {
                let inside = p[0] >= x && p[0] <= x + w && p[1] >= y && p[1] <= y + h;
                prop_assert!(seen || !inside);
            }
        }
    }
}
