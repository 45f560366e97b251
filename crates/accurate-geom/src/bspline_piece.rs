use nalgebra::{Point, SVector};

use crate::BSpline;

/// One polynomial piece of a curve, between two different knots: a cubic of `t - start`.
///
/// Evaluates several times faster than the basis functions do; what leaves the library as a point
/// is still computed by [`BSpline::at`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece<const D: usize> {
    pub start: f64,
    pub end: f64,
    coefficients: [SVector<f64, D>; 4],
}

impl<const D: usize> Piece<D> {
    pub fn at(&self, t: f64) -> Point<f64, D> {
        let [c0, c1, c2, c3] = &self.coefficients;
        let s = t - self.start;
        Point::from(c0 + (c1 + (c2 + c3 * s) * s) * s)
    }

    pub fn velocity(&self, t: f64) -> SVector<f64, D> {
        let [_, c1, c2, c3] = &self.coefficients;
        let s = t - self.start;
        c1 + (c2 * 2.0 + c3 * (3.0 * s)) * s
    }

    pub fn acceleration(&self, t: f64) -> SVector<f64, D> {
        let [_, _, c2, c3] = &self.coefficients;
        c2 * 2.0 + c3 * (6.0 * (t - self.start))
    }
}

impl<const D: usize> BSpline<D> {
    /// The index of the left knot of every span that is not empty, ascending.
    pub(crate) fn spans(&self) -> impl Iterator<Item = usize> + '_ {
        let knots = self.knots();
        (3..self.control_points().len()).filter(move |i| knots[*i] < knots[i + 1])
    }

    /// The polynomial piece of a non-empty span.
    pub(crate) fn piece(&self, span: usize) -> Piece<D> {
        let (start, end) = (self.knots()[span], self.knots()[span + 1]);
        let jet = self.jet_in_span(span, start);
        Piece {
            start,
            end,
            coefficients: [jet.point.coords, jet.first, jet.second / 2.0, jet.third / 6.0],
        }
    }
}
