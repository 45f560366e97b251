use super::Triangulator;
use super::number::{Number, add_scaled, constant, dot};
use super::two_view::TwoView;
use crate::error::finite;
use crate::{GeomError, Pixel, Point3, View1, View2};

/// What a method found, and what tells whether it is a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solution<N> {
    /// In the frame of [`TwoView`].
    pub position: [N; 3],
    /// Sine of the angle between the rays that were intersected; 1 for a method that has none.
    pub sine: N,
    /// Homogeneous weight; 1 for a method that has none.
    pub weight: N,
    /// Above 0, or NaN, where an iteration has not settled.
    pub open: N,
}

impl Solution<f64> {
    /// Whether the method has arrived.
    pub fn settled(&self) -> bool {
        self.open <= 0.0
    }
}

/// A [`Solution`] with all that the checks and the caller want to know.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finding<N> {
    pub world: [N; 3],
    /// Sine of the angle between the rays of the pixels as given.
    pub sine: N,
    pub solved_sine: N,
    pub weight: N,
    pub open: N,
    /// Squared distances to the camera centres, in baselines.
    pub from_centres_2: [N; 2],
}

impl<N: Number> Finding<N> {
    #[inline(always)]
    pub fn of(g: &TwoView, p1: &[N; 2], p2: &[N; 2], solution: &Solution<N>) -> Self {
        let x = &solution.position;
        let minus = p1[0].all(-1.0);
        let from1 = add_scaled(x, minus, &g.view1.centre_as(minus));
        let from2 = add_scaled(x, minus, &g.view2.centre_as(minus));
        let origin = constant(minus, &g.origin.coords.into());
        Self {
            world: add_scaled(&origin, minus.all(g.scale), x),
            sine: g.sine(p1, p2),
            solved_sine: solution.sine,
            weight: solution.weight,
            open: solution.open,
            from_centres_2: [dot(&from1, &from1), dot(&from2, &from2)],
        }
    }
}

impl Finding<f64> {
    /// The point, or what is wrong with it.
    pub fn checked(&self, p1: Pixel<View1>, p2: Pixel<View2>) -> Result<Point3, GeomError> {
        check_pixels(p1, p2, self.sine)?;
        check_sine(self.solved_sine)?;
        let least = Triangulator::LEAST_SINE;
        if !(self.weight.abs() >= least) {
            return Err(GeomError::PointAtInfinity { weight: self.weight });
        }
        // In baselines: the other ray then runs along the baseline.
        let [from1, from2] = self.from_centres_2;
        if from1 < least * least {
            return Err(GeomError::AtEpipole { view: 2, x: p2.x, y: p2.y });
        }
        if from2 < least * least {
            return Err(GeomError::AtEpipole { view: 1, x: p1.x, y: p1.y });
        }
        for (row, &value) in self.world.iter().enumerate() {
            finite(value, || format!("coordinate {row} of the triangulated point"))?;
        }
        Ok(Point3::from(self.world))
    }
}

/// Refuses pixels that are not finite, or whose rays, `sine` being that of their angle, run side by
/// side.
pub(super) fn check_pixels(p1: Pixel<View1>, p2: Pixel<View2>, sine: f64) -> Result<(), GeomError> {
    for (value, what) in [(p1.x, "x1"), (p1.y, "y1"), (p2.x, "x2"), (p2.y, "y2")] {
        finite(value, || what.into())?;
    }
    check_sine(sine)
}

fn check_sine(sine: f64) -> Result<(), GeomError> {
    let least = Triangulator::LEAST_SINE;
    // NaN (overflow in a ray) fails the comparison and is refused with it.
    if sine >= least { Ok(()) } else { Err(GeomError::ParallelRays { sine, least }) }
}
