mod batch;
mod dlt;
mod gauss_newton;
mod lindstrom;
mod method;
mod midpoint;
mod solution;
mod two_view;

use std::fmt;
use std::str::FromStr;

use crate::{GeomError, Pixel, Point3, Rig, View1, View2};
use dlt::Dlt;
use lindstrom::LindstromNiter2;
use method::Method;
use midpoint::Midpoint;
use solution::check_pixels;
use two_view::TwoView;

/// How a pair of pixels becomes a 3D point. All four agree on exact data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Triangulation {
    /// Homogeneous linear least squares: the paper's choice. Minimises no distance of the images.
    Dlt,
    /// The midpoint of the shortest segment between the rays. Minimises a distance of the world.
    Midpoint,
    /// The two pixels moved least so that their rays meet, by two Lindstrom steps in closed form,
    /// then the point where they meet. The default: for errors of a few pixels the cost is within
    /// about 10⁻⁶ of the least.
    #[default]
    LindstromNiter2,
    /// Least sum of squared reprojection errors by iteration, started at [`Self::Dlt`] and never
    /// worse than it.
    GaussNewton,
}

impl Triangulation {
    /// All methods, in the order of the enum.
    pub const ALL: [Self; 4] =
        [Self::Dlt, Self::Midpoint, Self::LindstromNiter2, Self::GaussNewton];

    /// The name: `dlt`, `midpoint`, `lindstrom` or `gauss-newton`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dlt => "dlt",
            Self::Midpoint => "midpoint",
            Self::LindstromNiter2 => "lindstrom",
            Self::GaussNewton => "gauss-newton",
        }
    }
}

impl fmt::Display for Triangulation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The text names no triangulation method.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown triangulation `{0}`: expected dlt, midpoint, lindstrom or gauss-newton")]
pub struct UnknownTriangulation(pub String);

impl FromStr for Triangulation {
    type Err = UnknownTriangulation;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|method| method.name() == text)
            .ok_or_else(|| UnknownTriangulation(text.to_owned()))
    }
}

/// Turns pairs of pixels of one rig into 3D points.
///
/// Inside, the world is moved and scaled so that the camera centres are one unit apart on both
/// sides of the origin: results do not depend on the world's frame or unit beyond rounding.
#[derive(Debug, Clone)]
pub struct Triangulator {
    method: Triangulation,
    geometry: TwoView,
}

impl Triangulator {
    /// The least sine of the angle between two rays: a point farther than 10¹² baselines is not
    /// told from one at infinity by `f64` pixels.
    pub const LEAST_SINE: f64 = 1e-12;

    /// A triangulator for `rig`. Owns what it needs.
    pub fn new(rig: &Rig, method: Triangulation) -> Self {
        Self { method, geometry: TwoView::new(rig) }
    }

    /// The method in use.
    pub fn method(&self) -> Triangulation {
        self.method
    }

    /// The world point, in the rig's unit, seen at (undistorted) `p1` and `p2`.
    ///
    /// Rays are taken as whole lines: a wrong pair may meet behind a camera, and
    /// [`Camera::depth`](crate::Camera::depth) tells. The result is always finite.
    ///
    /// # Errors
    /// [`GeomError::NotFinite`] for a pixel that is not finite, [`GeomError::ParallelRays`] or
    /// [`GeomError::PointAtInfinity`] if the rays do not meet, [`GeomError::AtEpipole`] if one
    /// pixel is the epipole (the rays then meet in a camera centre, which is no visible point),
    /// [`GeomError::NoConvergence`] if the singular value decomposition of
    /// [`Triangulation::Dlt`] fails.
    ///
    /// # Cost
    /// O(1): about 0.1 µs for midpoint and Lindstrom, 0.2 µs for DLT, 1 to 4 µs for Gauss-Newton
    /// and for DLT where the rays pass each other at some distance. Many pairs:
    /// [`triangulate_all`](Self::triangulate_all).
    pub fn triangulate(&self, p1: Pixel<View1>, p2: Pixel<View2>) -> Result<Point3, GeomError> {
        let (q1, q2) = ([p1.x, p1.y], [p2.x, p2.y]);
        let g = &self.geometry;
        check_pixels(g, p1, p2)?;
        let solution = match self.method {
            Triangulation::Dlt => dlt::solve(g, &q1, &q2)?,
            Triangulation::Midpoint => Midpoint::solve(g, &q1, &q2),
            Triangulation::LindstromNiter2 => LindstromNiter2::solve(g, &q1, &q2),
            Triangulation::GaussNewton => gauss_newton::solve(g, &q1, &q2)?,
        };
        solution.checked(g, p1, p2)
    }

    /// What [`triangulate`](Self::triangulate) gives for each pair, bit by bit.
    ///
    /// # Cost
    /// O(number of pairs). As many pairs at once as the machine's vectors hold (AVX-512, AVX2, else
    /// one by one): with 8, about 10 ns a pair for midpoint, 15 for Lindstrom and 20 for DLT, and as
    /// much again for writing to memory fresh from the system, which
    /// [`triangulate_into`](Self::triangulate_into) avoids.
    pub fn triangulate_all(
        &self,
        pairs: impl IntoIterator<Item = (Pixel<View1>, Pixel<View2>)>,
    ) -> Triangulated {
        let mut found = Triangulated::default();
        self.triangulate_into(pairs, &mut found);
        found
    }

    /// [`triangulate_all`](Self::triangulate_all) into lists that are used again: what was in
    /// `found` is gone, its memory is kept.
    pub fn triangulate_into(
        &self,
        pairs: impl IntoIterator<Item = (Pixel<View1>, Pixel<View2>)>,
        found: &mut Triangulated,
    ) {
        let pairs = pairs.into_iter();
        found.points.clear();
        found.failures.clear();
        found.points.reserve(pairs.size_hint().0);
        match self.method {
            Triangulation::Dlt => batch::run::<Dlt, _>(self, pairs, found),
            Triangulation::Midpoint => batch::run::<Midpoint, _>(self, pairs, found),
            Triangulation::LindstromNiter2 => batch::run::<LindstromNiter2, _>(self, pairs, found),
            Triangulation::GaussNewton => {
                for (index, (p1, p2)) in pairs.enumerate() {
                    found.push(index, self.triangulate(p1, p2));
                }
            }
        }
    }
}

/// The points of many pairs, and the pairs that have none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Triangulated {
    /// The points of all pairs that have one, in the order of the pairs.
    pub points: Vec<Point3>,
    /// The other pairs: their indices, ascending, and what is wrong with each.
    pub failures: Vec<(usize, GeomError)>,
}

impl Triangulated {
    /// Each pair's point or failure, in the order of the pairs.
    pub fn results(&self) -> impl Iterator<Item = Result<Point3, &GeomError>> {
        let mut points = self.points.iter();
        let mut failures = self.failures.iter().peekable();
        (0..self.points.len() + self.failures.len()).map_while(move |index| {
            match failures.next_if(|(failed, _)| *failed == index) {
                Some((_, failure)) => Some(Err(failure)),
                None => points.next().copied().map(Ok),
            }
        })
    }

    fn push(&mut self, index: usize, result: Result<Point3, GeomError>) {
        match result {
            Ok(point) => self.points.push(point),
            Err(failure) => self.failures.push((index, failure)),
        }
    }
}
