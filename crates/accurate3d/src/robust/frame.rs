use accurate_geom::{Pixel, View};
use ndarray::{Array2, ArrayView2, Axis};

/// How an image is turned before its skeleton is taken: flipped, then perhaps transposed.
///
/// Thinning peels from one side first, and of walks that cost the same one comes first: turned,
/// another pixel of a crossing stays, and other walks are proposed of a body whose strands run together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Turn {
    flip_x: bool,
    flip_y: bool,
    transposed: bool,
}

impl Turn {
    pub(crate) const NONE: Self = Self::new(false, false, false);

    /// The turns of further looks, in the order in which they are tried.
    pub(crate) const OTHERS: [Self; 3] =
        [Self::new(true, false, false), Self::new(false, false, true), Self::new(true, true, true)];

    const fn new(flip_x: bool, flip_y: bool, transposed: bool) -> Self {
        Self { flip_x, flip_y, transposed }
    }

    /// The turn that brings an image to the same pixels however it was turned before: of all eight
    /// turned images the least, row by row.
    pub(crate) fn upright(image: &Array2<bool>) -> Self {
        let all = (0..8).map(|k| Self::new(k & 1 != 0, k & 2 != 0, k & 4 != 0));
        let order = |a: &Self, b: &Self| {
            let [a, b] = [a, b].map(|turn| turn.view(image));
            a.shape().cmp(b.shape()).then_with(|| a.iter().cmp(b.iter()))
        };
        all.min_by(order).unwrap_or(Self::NONE)
    }

    /// This turn, and then another.
    pub(crate) const fn then(self, next: Self) -> Self {
        let (x, y) =
            if self.transposed { (next.flip_y, next.flip_x) } else { (next.flip_x, next.flip_y) };
        Self::new(self.flip_x ^ x, self.flip_y ^ y, self.transposed ^ next.transposed)
    }

    /// The turned image.
    pub(crate) fn array(self, image: &Array2<bool>) -> Array2<bool> {
        self.view(image).as_standard_layout().into_owned()
    }

    fn view(self, image: &Array2<bool>) -> ArrayView2<'_, bool> {
        let mut turned = image.view();
        if self.flip_x {
            turned.invert_axis(Axis(1));
        }
        if self.flip_y {
            turned.invert_axis(Axis(0));
        }
        if self.transposed {
            turned.swap_axes(0, 1);
        }
        turned
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
        let [x, y] = if self.turn.transposed { [point.y, point.x] } else { [point.x, point.y] };
        let [x, y] = self.flipped([x, y]);
        Pixel::new(x + self.origin[0], y + self.origin[1])
    }

    /// A point of the image in the turned part.
    pub(crate) fn in_part<V: View>(&self, point: Pixel<V>) -> Pixel<V> {
        let [x, y] = self.flipped([point.x - self.origin[0], point.y - self.origin[1]]);
        if self.turn.transposed { Pixel::new(y, x) } else { Pixel::new(x, y) }
    }

    fn flipped(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let Turn { flip_x, flip_y, .. } = self.turn;
        [if flip_x { self.last[0] - x } else { x }, if flip_y { self.last[1] - y } else { y }]
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;
    use ndarray::Slice;

    use super::*;

    fn every_turn() -> impl Iterator<Item = Turn> + Clone {
        (0..8).map(|k| Turn::new(k & 1 != 0, k & 2 != 0, k & 4 != 0))
    }

    fn image() -> Array2<bool> {
        Array2::from_shape_fn((7, 9), |(y, x)| (3 * x + 5 * y) % 4 == 0)
    }

    #[test]
    fn a_point_of_the_turned_part_shows_the_same_pixel_of_the_image() {
        let image = image();
        let rows = image.slice_axis(Axis(0), Slice::from(1..6));
        let cut = rows.slice_axis(Axis(1), Slice::from(2..8)).to_owned();
        for turn in every_turn() {
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

    #[test]
    fn one_turn_after_another_is_both() {
        let image = image();
        for first in every_turn() {
            for next in every_turn() {
                assert_eq!(first.then(next).array(&image), next.array(&first.array(&image)));
            }
        }
    }

    #[test]
    fn upright_is_the_same_however_an_image_was_turned() {
        let image = image();
        let upright = Turn::upright(&image).array(&image);
        for turn in every_turn() {
            let turned = turn.array(&image);
            assert_eq!(Turn::upright(&turned).array(&turned), upright, "{turn:?}");
        }
    }
}
