use accurate_geom::nalgebra::Vector2;
use accurate_geom::{ImageSize, Pixel, View};

/// Half width of a bridge, px.
const HALF_PX: f64 = 4.0;
/// Side of a cell, px.
const CELL_PX: f64 = 32.0;

/// Straight stretches on which the curve may leave the mask, by the places that they are near to: a mask
/// of many pieces has thousands of them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bridges {
    /// `[x0, y0, x1, y1]`, px.
    segments: Vec<[f64; 4]>,
    /// By cell, row after row, the segments that may be near to a place in it, in order.
    cells: Vec<Vec<usize>>,
    columns: usize,
}

impl Bridges {
    /// Of those that are finite, in an image of `size`, asked for no farther than `reach_px` from them.
    pub(crate) fn new<V: View>(
        bridges: &[(Pixel<V>, Pixel<V>)],
        size: ImageSize,
        reach_px: f64,
    ) -> Self {
        let finite = bridges.iter().filter(|(a, b)| a.is_finite() && b.is_finite());
        let segments: Vec<_> = finite.map(|(a, b)| [a.x, a.y, b.x, b.y]).collect();
        if segments.is_empty() {
            return Self::default();
        }
        let count = |pixels: u32| (f64::from(pixels) / CELL_PX) as usize + 1;
        let (columns, rows) = (count(size.width), count(size.height));
        let mut cells = vec![Vec::new(); columns * rows];
        // From the middle of a cell to its corner, and half a pixel around the image.
        let reach = reach_px + HALF_PX + CELL_PX * std::f64::consts::FRAC_1_SQRT_2 + 1.0;
        for (k, segment) in segments.iter().enumerate() {
            let [x0, y0, x1, y1] = *segment;
            for row in covered(y0, y1, reach, rows) {
                for column in covered(x0, x1, reach, columns) {
                    let middle = [column, row].map(|c| (c as f64 + 0.5) * CELL_PX);
                    let middle = Vector2::new(middle[0], middle[1]);
                    if (nearest(segment, &middle) - middle).norm() <= reach {
                        cells[row * columns + column].push(k);
                    }
                }
            }
        }
        Self { segments, cells, columns }
    }

    /// Distances from the bridges near `p`, which lies in the image, and their nearest places: negative on
    /// a bridge.
    pub(crate) fn near(&self, p: &Vector2<f64>) -> impl Iterator<Item = (f64, Vector2<f64>)> {
        let cell = |at: f64| (at.max(0.0) / CELL_PX) as usize;
        let near = self.cells.get(cell(p.y) * self.columns + cell(p.x));
        near.into_iter().flatten().map(move |&k| {
            let q = nearest(&self.segments[k], p);
            ((q - p).norm() - HALF_PX, q)
        })
    }
}

fn nearest(&[x0, y0, x1, y1]: &[f64; 4], p: &Vector2<f64>) -> Vector2<f64> {
    let (a, b) = (Vector2::new(x0, y0), Vector2::new(x1, y1));
    let e = b - a;
    let t = (p - a).dot(&e) / e.norm_squared().max(f64::MIN_POSITIVE);
    a + e * t.clamp(0.0, 1.0)
}

/// Cells between two coordinates and `reach` around them.
fn covered(from: f64, to: f64, reach: f64, count: usize) -> std::ops::Range<usize> {
    let cell = |at: f64| (at / CELL_PX).clamp(0.0, count as f64) as usize;
    let (first, last) = (cell(from.min(to) - reach), cell(from.max(to) + reach));
    first.min(count - 1)..(last + 1).min(count)
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Within reach it is the list, one after the other.
        #[test]
        fn near_bridges_are_those_of_the_whole_list(
            ends in prop::collection::vec(prop::array::uniform4(-60.0..300.0f64), 0..60),
            places in prop::collection::vec((-0.5..255.5f64, -0.5..130.5f64), 1..40),
        ) {
            const REACH_PX: f64 = 25.0;
            let size = ImageSize { width: 256, height: 131 };
            let pairs: Vec<(Pixel<View1>, Pixel<View1>)> =
                ends.iter().map(|[a, b, c, d]| (Pixel::new(*a, *b), Pixel::new(*c, *d))).collect();
            let bridges = Bridges::new(&pairs, size, REACH_PX);
            for (x, y) in places {
                let p = Vector2::new(x, y);
                let within = |list: Vec<(f64, Vector2<f64>)>| {
                    list.into_iter().filter(|(d, _)| *d <= REACH_PX).collect::<Vec<_>>()
                };
                let all = ends.iter().map(|segment| {
                    let q = nearest(segment, &p);
                    ((q - p).norm() - HALF_PX, q)
                });
                prop_assert_eq!(within(bridges.near(&p).collect()), within(all.collect()));
            }
        }
    }
}
