use nalgebra::{Point, SVector};

use crate::GeomError;
use crate::error::finite;

/// A clamped cubic B-spline curve in `D` dimensions.
///
/// With `n` control points there are `n + 4` knots; the first four are equal, the last four are
/// equal, and the curve starts and ends in its first and last control points. The parameter lives
/// in [`domain`](Self::domain); values outside are clamped to it. Simple interior knots make the
/// curve twice continuously differentiable; a knot may be repeated up to three times.
///
/// # Source
/// Piegl and Tiller, The NURBS Book, 2nd ed., chapters 2 and 3.
#[derive(Debug, Clone, PartialEq)]
pub struct BSpline<const D: usize> {
    knots: Vec<f64>,
    control: Vec<Point<f64, D>>,
}

/// A B-spline in an image, px.
pub type Curve2 = BSpline<2>;
/// A B-spline in the world, in the rig's unit.
pub type Curve3 = BSpline<3>;

/// The four basis functions that do not vanish at a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Basis {
    /// Index of the first of the four control points they belong to.
    pub first: usize,
    /// Their values: not negative, sum 1.
    pub values: [f64; 4],
}

/// A point of a curve with its derivatives with respect to the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet<const D: usize> {
    /// Position.
    pub point: Point<f64, D>,
    /// First derivative.
    pub first: SVector<f64, D>,
    /// Second derivative.
    pub second: SVector<f64, D>,
    /// Third derivative: constant between knots, taken from the right at a knot.
    pub third: SVector<f64, D>,
}

/// Least distance of different knots, relative to the domain and absolute: third derivatives divide
/// by its cube, which must not overflow.
const LEAST_RELATIVE_SPAN: f64 = 1e-30;
const LEAST_SPAN: f64 = 1e-60;

impl<const D: usize> BSpline<D> {
    /// A curve from its knots and control points.
    ///
    /// # Errors
    /// [`GeomError::TooFewPoints`] for fewer than 4 control points, [`GeomError::LengthMismatch`]
    /// unless there are 4 more knots than control points, [`GeomError::NotFinite`], and
    /// [`GeomError::BadKnot`] for knots that are not clamped, decrease, repeat more than thrice
    /// inside, or differ by less than 1e-30 of the domain.
    pub fn new(knots: Vec<f64>, control: Vec<Point<f64, D>>) -> Result<Self, GeomError> {
        let n = control.len();
        if n < 4 {
            return Err(GeomError::TooFewPoints { found: n, needed: 4 });
        }
        if knots.len() != n + 4 {
            let found = knots.len();
            return Err(GeomError::LengthMismatch { what: "knots", expected: n + 4, found });
        }
        for (index, &knot) in knots.iter().enumerate() {
            finite(knot, || format!("knot {index}"))?;
        }
        for (index, point) in control.iter().enumerate() {
            for &value in &point.coords {
                finite(value, || format!("control point {index}"))?;
            }
        }
        let width = finite(knots[n] - knots[3], || "width of the domain".into())?;
        let least_span = (LEAST_RELATIVE_SPAN * width).max(LEAST_SPAN);
        for index in 1..n + 4 {
            let step = knots[index] - knots[index - 1];
            let good = if index < 4 || index > n {
                step == 0.0
            } else if index == 4 || index == n {
                step >= least_span
            } else {
                step >= least_span || step == 0.0 && knots[index] > knots[index - 3]
            };
            if !good {
                return Err(GeomError::BadKnot { index, value: knots[index] });
            }
        }
        Ok(Self { knots, control })
    }

    /// A curve over `[0, 1]` with equally spaced knots.
    ///
    /// # Errors
    /// [`GeomError::TooFewPoints`] for fewer than 4 control points, [`GeomError::NotFinite`].
    pub fn with_uniform_knots(control: Vec<Point<f64, D>>) -> Result<Self, GeomError> {
        Self::new(uniform_knots(0.0, 1.0, control.len().saturating_sub(3).max(1)), control)
    }

    /// The knots, clamped: `control_points().len() + 4` of them.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// The control points.
    pub fn control_points(&self) -> &[Point<f64, D>] {
        &self.control
    }

    /// First and last parameter.
    pub fn domain(&self) -> (f64, f64) {
        (self.knots[3], self.knots[self.control.len()])
    }

    /// The distinct knots: the ends of the polynomial pieces, ascending.
    pub fn breakpoints(&self) -> Vec<f64> {
        let mut distinct = self.knots[3..=self.control.len()].to_vec();
        distinct.dedup();
        distinct
    }

    /// The basis functions at `t`: the curve is their weighted mean of four control points.
    ///
    /// # Cost
    /// A binary search over the knots and a few dozen operations.
    pub fn basis(&self, t: f64) -> Basis {
        let (span, t) = self.span(t);
        Basis { first: span - 3, values: basis_table(&self.knots, span, t)[3] }
    }

    /// The derivatives of the basis functions at `t`: row `k` of [`values`](Basis::values) is
    /// replaced by the `k`-th derivative, `k = 0..=3`; the index of the first control point beside.
    pub fn basis_derivatives(&self, t: f64) -> (usize, [[f64; 4]; 4]) {
        let (span, t) = self.span(t);
        (span - 3, basis_derivatives(&self.knots, span, t))
    }

    /// The point at `t`.
    pub fn at(&self, t: f64) -> Point<f64, D> {
        let basis = self.basis(t);
        Point::from(self.combine(basis.first, &basis.values))
    }

    /// First derivative at `t`.
    pub fn derivative(&self, t: f64) -> SVector<f64, D> {
        self.nth_derivative(t, 1)
    }

    /// Second derivative at `t`.
    pub fn second_derivative(&self, t: f64) -> SVector<f64, D> {
        self.nth_derivative(t, 2)
    }

    /// Third derivative at `t`; from the right at a knot.
    pub fn third_derivative(&self, t: f64) -> SVector<f64, D> {
        self.nth_derivative(t, 3)
    }

    /// The point and its three derivatives at `t`, cheaper than one by one.
    pub fn jet(&self, t: f64) -> Jet<D> {
        let (span, t) = self.span(t);
        self.jet_in_span(span, t)
    }

    /// The jet of the polynomial piece of a non-empty span.
    pub(crate) fn jet_in_span(&self, span: usize, t: f64) -> Jet<D> {
        let (first, rows) = (span - 3, basis_derivatives(&self.knots, span, t));
        Jet {
            point: Point::from(self.combine(first, &rows[0])),
            first: self.combine(first, &rows[1]),
            second: self.combine(first, &rows[2]),
            third: self.combine(first, &rows[3]),
        }
    }

    /// The same curve run from its end to its start, over the same domain.
    pub fn reversed(&self) -> Self {
        let (start, end) = self.domain();
        // end - (t - start): exact at both ends, hence still clamped.
        let knots =
            self.knots.iter().rev().map(|t| if *t == end { start } else { end - (t - start) });
        Self { knots: knots.collect(), control: self.control.iter().rev().copied().collect() }
    }

    fn nth_derivative(&self, t: f64, order: usize) -> SVector<f64, D> {
        let (first, rows) = self.basis_derivatives(t);
        self.combine(first, &rows[order])
    }

    fn combine(&self, first: usize, weights: &[f64; 4]) -> SVector<f64, D> {
        self.control[first..first + 4]
            .iter()
            .zip(weights)
            .fold(SVector::zeros(), |sum, (point, weight)| sum + point.coords * *weight)
    }

    /// The knot span of `t` (index of its left knot) and `t` clamped to the domain. NaN counts as
    /// the start.
    fn span(&self, t: f64) -> (usize, f64) {
        let (start, end) = self.domain();
        let t = if t > start { t.min(end) } else { start };
        (span_of(&self.knots, self.control.len(), t), t)
    }
}

/// Clamped knots over `[start, end]` with `spans` equal spans.
pub(crate) fn uniform_knots(start: f64, end: f64, spans: usize) -> Vec<f64> {
    let mut knots = vec![start; 4];
    knots.extend((1..spans).map(|i| start + (end - start) * i as f64 / spans as f64));
    knots.extend([end; 4]);
    knots
}

/// Index `s` with `knots[s] <= t < knots[s + 1]`; the last non-empty span for the end of the domain.
pub(crate) fn span_of(knots: &[f64], control_count: usize, t: f64) -> usize {
    let interior = &knots[4..control_count];
    let end = knots[control_count];
    if t >= end {
        return 3 + interior.partition_point(|knot| *knot < end);
    }
    3 + interior.partition_point(|knot| *knot <= t)
}

/// Row `k` holds the values of the basis functions of degree `k` that do not vanish on `span`
/// (`k + 1` of them, the rest zero).
///
/// # Source
/// Cox and de Boor; The NURBS Book, algorithm A2.2.
pub(crate) fn basis_table(knots: &[f64], span: usize, t: f64) -> [[f64; 4]; 4] {
    let mut table = [[0.0; 4]; 4];
    table[0][0] = 1.0;
    for degree in 1..4 {
        for j in 0..degree {
            let left = knots[span + 1 + j - degree];
            let right = knots[span + 1 + j];
            // left < right always: both bound a stretch that contains the (non-empty) span.
            let share = table[degree - 1][j] / (right - left);
            table[degree][j] += (right - t) * share;
            table[degree][j + 1] += (t - left) * share;
        }
    }
    table
}

/// Row `k` holds the `k`-th derivatives of the four cubic basis functions of `span`.
pub(crate) fn basis_derivatives(knots: &[f64], span: usize, t: f64) -> [[f64; 4]; 4] {
    let table = basis_table(knots, span, t);
    let mut rows = [table[3]; 4];
    for (order, row) in rows.iter_mut().enumerate().skip(1) {
        // A derivative of a spline of degree d is one of degree d - 1 whose coefficients are
        // divided differences; applied `order` times to the values of degree 3 - order.
        let mut values = table[3 - order];
        for degree in 4 - order..4 {
            let mut raised = [0.0; 4];
            for j in 0..degree {
                let width = knots[span + 1 + j] - knots[span + 1 + j - degree];
                let share = degree as f64 * values[j] / width;
                raised[j] -= share;
                raised[j + 1] += share;
            }
            values = raised;
        }
        *row = values;
    }
    rows
}
