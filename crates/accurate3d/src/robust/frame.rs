use accurate_geom::{Pixel, View};
use ndarray::{Array2, Axis};

/// How an image is turned before its skeleton is taken. Thinning peels from one side first, and walks
/// that cost the same come in some order: turned, another pixel of a crossing stays, and other walks
/// are proposed of a body whose strands run together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turn {
    Upright,
    Mirrored,
    Transposed,
    /// Transposed and turned upside down.
    AntiTransposed,
}

impl Turn {
    /// All but the upright one, in the order in which they are tried.
    pub(crate) const OTHERS: [Self; 3] = [Self::Mirrored, Self::Transposed, Self::AntiTransposed];

    const fn is_transposed(self) -> bool {
        matches!(self, Self::Transposed | Self::AntiTransposed)
    }

    const fn flips(self) -> [bool; 2] {
        match self {
            Self::Upright | Self::Transposed => [false, false],
            Self::Mirrored => [true, false],
            Self::AntiTransposed => [true, true],
        }
    }

    /// The turned image.
    pub(crate) fn array(self, image: &Array2<bool>) -> Array2<bool> {
        let [flip_x, flip_y] = self.flips();
        let mut turned = image.view();
        if flip_x {
            turned.invert_axis(Axis(1));
        }
        if flip_y {
            turned.invert_axis(Axis(0));
        }
        if self.is_transposed() {
            turned.swap_axes(0, 1);
        }
        turned.as_standard_layout().into_owned()
    }
}

/// Where a part of an image, turned, lies in the image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    turn: Turn,
    /// First column and row of the part.
    origin: [f64; 2],
    /// Last column and row of the part, counted from its first.
    last: [f64; 2],
}

impl Frame {
    /// Of the part `cut`, not turned yet, that begins at `origin`, column and row.
    pub(crate) fn new(turn: Turn, origin: [f64; 2], cut: &Array2<bool>) -> Self {
        let (rows, columns) = cut.dim();
        Self { turn, origin, last: [columns as f64 - 1.0, rows as f64 - 1.0] }
    }

    /// A point of the turned part in the image.
    pub(crate) fn in_image<V: View>(&self, point: Pixel<V>) -> Pixel<V> {
        let [x, y] =
            if self.turn.is_transposed() { [point.y, point.x] } else { [point.x, point.y] };
        let [x, y] = self.flipped([x, y]);
        Pixel::new(x + self.origin[0], y + self.origin[1])
    }

    /// A point of the image in the turned part.
    pub(crate) fn in_part<V: View>(&self, point: Pixel<V>) -> Pixel<V> {
        let [x, y] = self.flipped([point.x - self.origin[0], point.y - self.origin[1]]);
        if self.turn.is_transposed() { Pixel::new(y, x) } else { Pixel::new(x, y) }
    }

    fn flipped(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [flip_x, flip_y] = self.turn.flips();
        [if flip_x { self.last[0] - x } else { x }, if flip_y { self.last[1] - y } else { y }]
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;
    use ndarray::Slice;

    use super::*;

    #[test]
    fn a_point_of_the_turned_part_shows_the_same_pixel_of_the_image() {
        let image = Array2::from_shape_fn((7, 9), |(y, x)| (3 * x + 5 * y) % 4 == 0);
        let rows = image.slice_axis(Axis(0), Slice::from(1..6));
        let cut = rows.slice_axis(Axis(1), Slice::from(2..8)).to_owned();
        for turn in [Turn::Upright].into_iter().chain(Turn::OTHERS) {
            let frame = Frame::new(turn, [2.0, 1.0], &cut);
            let turned = turn.array(&cut);
            for ((y, x), shown) in turned.indexed_iter() {
                let point = Pixel::<View1>::new(x as f64, y as f64);
                let there = frame.in_image(point);
                assert_eq!(image[(there.y as usize, there.x as usize)], *shown, "{turn:?}");
                assert_eq!(frame.in_part(there), point);
            }
        }
    }
}
