use std::fmt;
use std::marker::PhantomData;

use nalgebra::Vector3;

use crate::Point2;

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::View1 {}
    impl Sealed for super::View2 {}
}

/// One of the two views of a [`Rig`](crate::Rig). Sealed: [`View1`] and [`View2`] are all there are.
pub trait View:
    sealed::Sealed + Copy + Clone + fmt::Debug + PartialEq + Send + Sync + 'static
{
    /// 1 or 2.
    const NUMBER: u8;
    /// The other view.
    type Other: View<Other = Self>;
}

/// The first view (L in a pair folder).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View1;

/// The second view (R in a pair folder).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View2;

impl View for View1 {
    const NUMBER: u8 = 1;
    type Other = View2;
}

impl View for View2 {
    const NUMBER: u8 = 2;
    type Other = View1;
}

/// A sub-pixel position in the image of view `V`: x right, y down, px, pixel centres at integers.
///
/// The view is part of the type, so that a pixel of one view cannot be handed in for the other.
/// The line in view 1 takes a pixel of view 2:
///
/// ```
/// use accurate_geom::{Fundamental, Pixel, View1, View2};
/// fn right_way_round(f: &Fundamental<View1, View2>, p2: Pixel<View2>) {
///     let _ = f.line(p2);
/// }
/// ```
///
/// and refuses one of view 1. All else is as above:
///
/// ```compile_fail,E0308
/// use accurate_geom::{Fundamental, Pixel, View1, View2};
/// fn swapped(f: &Fundamental<View1, View2>, p1: Pixel<View1>) {
///     let _ = f.line(p1);
/// }
/// ```
#[derive(Clone, Copy, PartialEq)]
pub struct Pixel<V> {
    /// Column, px.
    pub x: f64,
    /// Row, px.
    pub y: f64,
    view: PhantomData<V>,
}

impl<V: View> Pixel<V> {
    /// The pixel at column `x` and row `y`.
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y, view: PhantomData }
    }

    /// `(x, y)` without its view.
    pub fn point(self) -> Point2 {
        Point2::new(self.x, self.y)
    }

    /// `(x, y, 1)`.
    pub fn homogeneous(self) -> Vector3<f64> {
        Vector3::new(self.x, self.y, 1.0)
    }

    /// Euclidean distance to another pixel of the same view, px.
    pub fn distance(self, other: Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }

    /// Whether both coordinates are finite.
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }
}

impl<V: View> From<Point2> for Pixel<V> {
    fn from(p: Point2) -> Self {
        Self::new(p.x, p.y)
    }
}

impl<V: View> fmt::Debug for Pixel<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Pixel{}({}, {})", V::NUMBER, self.x, self.y)
    }
}
