use super::Triangulator;
use super::two_view::{Parallax, TwoView};
use crate::error::finite;
use crate::number::{Number, add_scaled, constant, dot};
use crate::{GeomError, Pixel, Point3, View1, View2};

/// What a method found, and what tells whether it is a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solution<N> {
    /// In the frame of [`TwoView`].
    pub position: [N; 3],
    /// Of the rays that were intersected.
    pub parallax: Parallax<N>,
    /// Above 0, or NaN, where an iteration has not settled.
    pub open: N,
}

impl<N: Number> Solution<N> {
    /// The world point, and a number above 0 where it is one beyond doubt. Elsewhere
    /// [`checked`](Solution::checked) has to tell.
    #[inline(always)]
    pub fn world(&self, g: &TwoView, p1: &[N; 2], p2: &[N; 2]) -> ([N; 3], N) {
        let least = Triangulator::LEAST_SINE;
        let x = &self.position;
        let zero = self.open.all(0.0);
        let world = self.in_world(g);
        let [distance1_2, distance2_2] = self.distances_to_centres_2(g);
        let mut fine = self.open.all(1.0);
        // All above 0, or something may be wrong; NaN is not.
        for margin in [
            self.open.all(f64::MIN_POSITIVE) - self.open,
            g.meet_beyond(p1, p2, least),
            self.parallax.beyond(least),
            distance1_2 - zero.all(4.0 * least * least),
            distance2_2 - zero.all(4.0 * least * least),
            // At infinity the weight of the unit 4-vector, 1 / sqrt(1 + |x|²), vanishes.
            zero.all(0.25 / (least * least)) - dot(x, x),
            zero.all(f64::MAX) - (world[0].abs() + world[1].abs() + world[2].abs()),
        ] {
            fine = margin.if_positive(fine, zero);
        }
        (world, fine)
    }

    #[inline(always)]
    fn in_world(&self, g: &TwoView) -> [N; 3] {
        let origin = constant(self.open, &g.origin.coords.into());
        add_scaled(&origin, self.open.all(g.scale), &self.position)
    }

    /// Squared distances to the camera centres, in baselines.
    #[inline(always)]
    fn distances_to_centres_2(&self, g: &TwoView) -> [N; 2] {
        let minus = self.open.all(-1.0);
        let from1 = add_scaled(&self.position, minus, &g.view1.centre_as(minus));
        let from2 = add_scaled(&self.position, minus, &g.view2.centre_as(minus));
        [dot(&from1, &from1), dot(&from2, &from2)]
    }
}

impl Solution<f64> {
    /// Whether the method has arrived.
    pub fn settled(&self) -> bool {
        self.open <= 0.0
    }

    /// The point, or what is wrong with it. The pixels have passed [`check_pixels`].
    pub fn checked(
        &self,
        g: &TwoView,
        p1: Pixel<View1>,
        p2: Pixel<View2>,
    ) -> Result<Point3, GeomError> {
        check_sine(self.parallax.sine())?;
        let least = Triangulator::LEAST_SINE;
        let [x, y, z] = self.position;
        let weight = 1.0 / (1.0 + x * x + y * y + z * z).sqrt();
        if !(weight >= least) {
            return Err(GeomError::PointAtInfinity { weight });
        }
        // In baselines: the other ray then runs along the baseline.
        let [from1, from2] = self.distances_to_centres_2(g);
        if from1 < least * least {
            return Err(GeomError::AtEpipole { view: 2, x: p2.x, y: p2.y });
        }
        if from2 < least * least {
            return Err(GeomError::AtEpipole { view: 1, x: p1.x, y: p1.y });
        }
        let world = self.in_world(g);
        for (row, &value) in world.iter().enumerate() {
            finite(value, || format!("coordinate {row} of the triangulated point"))?;
        }
        Ok(Point3::from(world))
    }
}

/// Refuses pixels that are not finite, or whose rays run side by side.
pub(super) fn check_pixels(
    g: &TwoView,
    p1: Pixel<View1>,
    p2: Pixel<View2>,
) -> Result<(), GeomError> {
    for (value, what) in [(p1.x, "x1"), (p1.y, "y1"), (p2.x, "x2"), (p2.y, "y2")] {
        finite(value, || what.into())?;
    }
    check_sine(g.parallax(&[p1.x, p1.y], &[p2.x, p2.y]).sine())
}

fn check_sine(sine: f64) -> Result<(), GeomError> {
    let least = Triangulator::LEAST_SINE;
    // NaN (overflow in a ray) fails the comparison and is refused with it.
    if sine >= least { Ok(()) } else { Err(GeomError::ParallelRays { sine, least }) }
}
