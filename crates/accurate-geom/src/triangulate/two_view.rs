use nalgebra::{Matrix3, Matrix3x2, Vector3};

use crate::number::{Number, constant, cross, dot, scaled};
use crate::{Camera, Point3, Rig};

/// One camera in the frame of [`TwoView`].
#[derive(Debug, Clone)]
pub(super) struct PinholeView {
    /// `K R`: world direction to homogeneous pixel.
    pub pixel_from_direction: Matrix3<f64>,
    /// `R⁻¹ K⁻¹`: homogeneous pixel to world direction.
    pub direction_from_pixel: Matrix3<f64>,
    /// Camera centre, in baselines.
    pub centre: Vector3<f64>,
}

impl PinholeView {
    fn new(camera: &Camera, centre: Vector3<f64>) -> Self {
        Self {
            pixel_from_direction: camera.k() * camera.r(),
            direction_from_pixel: camera.r_inverse() * camera.k_inverse(),
            centre,
        }
    }

    /// Direction of the ray of a pixel; z in the camera frame is 1, so its length is at least 1.
    #[inline(always)]
    pub fn ray<N: Number>(&self, p: &[N; 2]) -> [N; 3] {
        let m = &self.direction_from_pixel;
        let row = |r: usize| [m[(r, 0)], m[(r, 1)], m[(r, 2)]];
        let rows = [row(0), row(1), row(2)];
        let mut ray = [p[0]; 3];
        for k in 0..3 {
            let [x, y, one] = constant(p[0], &rows[k]);
            ray[k] = x * p[0] + y * p[1] + one;
        }
        ray
    }

    /// How `normal · ray` changes along x and y of the image.
    #[inline(always)]
    pub fn along_pixel_axes<N: Number>(&self, normal: &[N; 3]) -> [N; 2] {
        let m = &self.direction_from_pixel;
        let column = |c: usize| [m[(0, c)], m[(1, c)], m[(2, c)]];
        let (x, y) = (column(0), column(1));
        [dot(&constant(normal[0], &x), normal), dot(&constant(normal[0], &y), normal)]
    }

    /// The centre in all lanes of numbers like `like`.
    #[inline(always)]
    pub fn centre_as<N: Number>(&self, like: N) -> [N; 3] {
        constant(like, &self.centre.into())
    }
}

/// Two cameras with their centres at `-b/2` and `b/2`, `|b| = 1`: the world moved and scaled, not
/// turned.
#[derive(Debug, Clone)]
pub(super) struct TwoView {
    pub view1: PinholeView,
    pub view2: PinholeView,
    /// Unit vector from centre 1 to centre 2.
    pub baseline: Vector3<f64>,
    /// The upper left 2 x 2 block of `F` with `p1ᵀ F p2 = 0`, row by row.
    pub fundamental_2x2: [[f64; 2]; 2],
    /// Midway between the centres, in the world.
    pub origin: Point3,
    /// The baseline in the rig's unit.
    pub scale: f64,
}

impl TwoView {
    pub fn new(rig: &Rig) -> Self {
        let (c1, c2) = (rig.camera1().centre(), rig.camera2().centre());
        // A rig has refused a zero baseline.
        let scale = (c2 - c1).norm();
        let baseline = (c2 - c1) / scale;
        let view1 = PinholeView::new(rig.camera1(), -0.5 * baseline);
        let view2 = PinholeView::new(rig.camera2(), 0.5 * baseline);
        let m1: Matrix3x2<f64> = view1.direction_from_pixel.fixed_columns::<2>(0).into();
        let m2: Matrix3x2<f64> = view2.direction_from_pixel.fixed_columns::<2>(0).into();
        let f = m1.transpose() * baseline.cross_matrix() * m2;
        let fundamental_2x2 = [[f[(0, 0)], f[(0, 1)]], [f[(1, 0)], f[(1, 1)]]];
        let origin = nalgebra::center(&c1, &c2);
        Self { view1, view2, baseline, fundamental_2x2, origin, scale }
    }

    /// The rays of two pixels, each with its largest entry near ±1: products of a few are safe from
    /// overflow.
    #[inline(always)]
    pub fn bounded_rays<N: Number>(&self, p1: &[N; 2], p2: &[N; 2]) -> ([N; 3], [N; 3]) {
        let (ray1, ray2) = (self.view1.ray(p1), self.view2.ray(p2));
        let largest1 = ray1[0].abs().larger(ray1[1].abs()).larger(ray1[2].abs());
        let largest2 = ray2[0].abs().larger(ray2[1].abs()).larger(ray2[2].abs());
        // Division is what takes longest here: one for both.
        let both = p1[0].all(1.0) / (largest1 * largest2);
        (scaled(both * largest2, &ray1), scaled(both * largest1, &ray2))
    }

    /// Above 0 where the rays of two pixels meet at an angle whose sine is clearly above `least`;
    /// not so, or NaN, if squares of a ray overflow. [`Self::parallax`] tells more and divides.
    #[inline(always)]
    pub fn meet_beyond<N: Number>(&self, p1: &[N; 2], p2: &[N; 2], least: f64) -> N {
        // A ray is at least 1 long: nothing underflows.
        let (d1, d2) = (self.view1.ray(p1), self.view2.ray(p2));
        Parallax::between(&d1, &d2, &cross(&d1, &d2)).beyond(least)
    }

    /// The angle between the rays of two pixels; NaN where a ray overflows.
    #[inline(always)]
    pub fn parallax<N: Number>(&self, p1: &[N; 2], p2: &[N; 2]) -> Parallax<N> {
        let (d1, d2) = self.bounded_rays(p1, p2);
        Parallax::between(&d1, &d2, &cross(&d1, &d2))
    }
}

/// The angle between two rays, whose sine costs more than to tell whether it is large enough.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parallax<N> {
    /// Squared length of the cross product.
    normal_2: N,
    /// Product of the squared lengths.
    lengths_2: N,
}

impl<N: Number> Parallax<N> {
    /// `normal` is `d1 x d2`.
    #[inline(always)]
    pub fn between(d1: &[N; 3], d2: &[N; 3], normal: &[N; 3]) -> Self {
        Self { normal_2: dot(normal, normal), lengths_2: dot(d1, d1) * dot(d2, d2) }
    }

    /// Of a method that intersects no rays: a right angle.
    #[inline(always)]
    pub fn right_angle(like: N) -> Self {
        Self { normal_2: like.all(1.0), lengths_2: like.all(1.0) }
    }

    /// Above 0 where the sine is clearly above `least`; NaN if it is.
    #[inline(always)]
    pub fn beyond(&self, least: f64) -> N {
        // Twice the sine, four times its square: roundings do not matter.
        self.normal_2 - self.normal_2.all(4.0 * least * least) * self.lengths_2
    }
}

impl Parallax<f64> {
    pub fn sine(&self) -> f64 {
        (self.normal_2 / self.lengths_2).sqrt()
    }
}
