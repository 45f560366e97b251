use accurate_geom::nalgebra::{Matrix2, Matrix3, Vector2};
use accurate_geom::{Camera, GeomError, ImageSize, Pixel, View};
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
    /// turned ones that whose `body`, the part that shows it, is the least, row by row; or the image, where
    /// the body is symmetric.
    pub(crate) fn upright(body: &Array2<bool>, image: &Array2<bool>) -> Self {
        let all = (0..8).map(|k| Self::new(k & 1 != 0, k & 2 != 0, k & 4 != 0));
        let order_of = |array: &Array2<bool>, a: &Self, b: &Self| {
            let [a, b] = [a, b].map(|turn| turn.view(array));
            a.shape().cmp(b.shape()).then_with(|| a.iter().cmp(b.iter()))
        };
        let order = |a: &Self, b: &Self| order_of(body, a, b).then_with(|| order_of(image, a, b));
        all.min_by(order).unwrap_or(Self::NONE)
    }

    /// The camera whose image is the turned one, with `fy` above 0 and the same optical axis.
    ///
    /// # Errors
    /// [`GeomError`] if that is no camera, which cannot happen to one.
    pub(crate) fn camera(self, camera: &Camera) -> Result<Camera, GeomError> {
        let ImageSize { width, height } = camera.size();
        let (k, axes) = (camera.k(), self.axes());
        let [w, h] = [width, height].map(|n| f64::from(n) - 1.0);
        let (cx, cy) = (k[(0, 2)], k[(1, 2)]);
        let cx = if self.flip_x { w - cx } else { cx };
        let cy = if self.flip_y { h - cy } else { cy };
        let (centre, size) = if self.transposed {
            ([cy, cx], ImageSize { width: height, height: width })
        } else {
            ([cx, cy], camera.size())
        };
        // A turn about the optical axis makes the focal part triangular again.
        let focal = axes * k.fixed_view::<2, 2>(0, 0);
        let last = focal.row(1).transpose();
        let roll = Matrix2::from_columns(&[Vector2::new(last.y, -last.x), last]) / last.norm();
        let focal = focal * roll;
        let k = Matrix3::new(
            focal[(0, 0)],
            focal[(0, 1)],
            centre[0],
            0.0,
            focal[(1, 1)],
            centre[1],
            0.0,
            0.0,
            1.0,
        );
        let back = roll.transpose().to_homogeneous();
        Camera::new(k, back * camera.r(), back * camera.t(), size)
    }

    /// Where the turned image's directions come from: of one in the image, `[x, y]`, the turned one.
    pub(crate) fn axes(self) -> Matrix2<f64> {
        let sign = |flip| if flip { -1.0 } else { 1.0 };
        let (x, y) = (sign(self.flip_x), sign(self.flip_y));
        if self.transposed { Matrix2::new(0.0, y, x, 0.0) } else { Matrix2::new(x, 0.0, 0.0, y) }
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

    /// The camera whose image is turned as the part is.
    ///
    /// # Errors
    /// As [`Turn::camera`].
    pub(crate) fn camera(&self, camera: &Camera) -> Result<Camera, GeomError> {
        self.turn.camera(camera)
    }

    /// A direction of the turned part in the image.
    pub(crate) fn axes_in_image(&self) -> Matrix2<f64> {
        self.turn.axes().transpose()
    }

    fn flipped(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let Turn { flip_x, flip_y, .. } = self.turn;
        [if flip_x { self.last[0] - x } else { x }, if flip_y { self.last[1] - y } else { y }]
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::{Rotation3, Vector3};
    use accurate_geom::{Point3, View1};
    use ndarray::Slice;

    use super::*;

    fn every_turn() -> impl Iterator<Item = Turn> + Clone {
        (0..8).map(|k| Turn::new(k & 1 != 0, k & 2 != 0, k & 4 != 0))
    }

    /// One turn, and then another.
    fn both(first: Turn, next: Turn) -> Turn {
        let turned = next.array(&first.array(&image()));
        every_turn().find(|turn| turn.array(&image()) == turned).unwrap()
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
    fn a_turned_camera_sees_a_point_where_the_turned_image_shows_it() {
        let k = Matrix3::new(900.0, 7.0, 250.0, 0.0, 1100.0, 300.0, 0.0, 0.0, 1.0);
        let r = Rotation3::from_euler_angles(0.2, -0.3, 0.5).into_inner();
        let size = ImageSize { width: 640, height: 480 };
        let camera = Camera::new(k, r, Vector3::new(3.0, -5.0, 800.0), size).unwrap();
        let image = Array2::from_elem((480, 640), false);
        for turn in every_turn() {
            let turned = turn.camera(&camera).unwrap();
            let frame = Frame::new(turn, [0.0; 2], &image);
            assert!(turned.k()[(1, 1)] > 0.0, "{turn:?}");
            for x in [-80.0, 0.0, 35.0] {
                let point = Point3::new(x, 40.0 - x, 0.5 * x);
                let seen = turned.project(&point).unwrap();
                let back = frame.in_image(Pixel::<View1>::new(seen.x, seen.y));
                let expected = camera.project(&point).unwrap();
                let off = (back.x - expected.x).hypot(back.y - expected.y);
                assert!(off < 1e-9, "{turn:?} {off}");
                assert!((turned.depth(&point) - camera.depth(&point)).abs() < 1e-9);
            }
            // A camera that was turned before comes out the same to the last bits.
            for before in every_turn() {
                let twice = turn.camera(&before.camera(&camera).unwrap()).unwrap();
                let once = both(before, turn).camera(&camera).unwrap();
                assert!((twice.k() - once.k()).amax() < 1e-9, "{before:?} {turn:?}");
                assert!((twice.r() - once.r()).amax() < 1e-14, "{before:?} {turn:?}");
            }
            let direction = frame.axes_in_image() * Vector2::new(1.0, 0.0);
            let [a, b] = [0.0, 1.0].map(|x| frame.in_image(Pixel::<View1>::new(x, 0.0)));
            assert_eq!([direction.x, direction.y], [b.x - a.x, b.y - a.y], "{turn:?}");
        }
    }

    #[test]
    fn upright_is_the_same_however_an_image_was_turned() {
        let image = image();
        let symmetric = Array2::from_elem((4, 4), true);
        for body in [&image, &symmetric] {
            let upright = Turn::upright(body, &image).array(&image);
            for turn in every_turn() {
                let turned = turn.array(&image);
                let again = Turn::upright(&turn.array(body), &turned).array(&turned);
                assert_eq!(again, upright, "{turn:?}");
            }
        }
    }
}
