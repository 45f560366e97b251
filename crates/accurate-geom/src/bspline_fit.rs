use nalgebra::{Point, SVector};

use crate::banded::{Banded, SymmetricBanded};
use crate::bspline::{basis_derivatives, basis_table, span_of, uniform_knots};
use crate::error::finite;
use crate::{BSpline, GeomError};

/// Data points per knot span with which a smoothing fit starts: fewer bend more freely than the
/// noise deserves, more cannot follow a tip.
const POINTS_PER_SPAN: usize = 4;

/// Range of the smoothing weight relative to the data, in powers of ten. Below the first the
/// penalty is lost in rounding; above the second the data are. A curve of up to a few hundred spans is
/// as good as a parabola there; what the penalty does to the longest waves falls with the sixth power of
/// the spans.
const LOG10_WEIGHT: (f64, f64) = (-14.0, 10.0);

/// Step, in powers of ten, to the least weight that still bridges a gap in the data.
const LOG10_STEP: f64 = 2.0;

impl<const D: usize> BSpline<D> {
    /// The curve through all points: chord-length parameters, not-a-knot ends.
    ///
    /// The interior knots are the parameters of the points but for the second and the last but one,
    /// as FITPACK (`splprep` with `s = 0`) places them.
    ///
    /// # Errors
    /// [`GeomError::TooFewPoints`] for fewer than 4 points, [`GeomError::NotFinite`],
    /// [`GeomError::DuplicatePoint`] for equal neighbours.
    ///
    /// # Cost
    /// O(n).
    pub fn interpolate(points: &[Point<f64, D>]) -> Result<Self, GeomError> {
        let u = chord_lengths(points)?;
        let n = points.len();
        let mut knots = vec![u[0]; 4];
        knots.extend_from_slice(&u[2..n - 2]);
        knots.extend([u[n - 1]; 4]);
        let mut matrix = Banded::zeros(n);
        for (row, &t) in u.iter().enumerate() {
            let span = span_of(&knots, n, t);
            for (j, value) in basis_table(&knots, span, t)[3].into_iter().enumerate() {
                matrix.set(row, span - 3 + j, value)?;
            }
        }
        let control = matrix.solve(points.iter().map(|p| p.coords).collect())?;
        Self::new(knots, control.into_iter().map(Point::from).collect())
    }

    /// The curve of `control_count` control points with the least sum of squared distances to
    /// `points` at the given `parameters`.
    ///
    /// The knots are spread so that every span holds about as many parameters as any other.
    ///
    /// # Errors
    /// [`GeomError::TooFewPoints`] for fewer than 4 control points or fewer data than control
    /// points, [`GeomError::LengthMismatch`], [`GeomError::NotFinite`], [`GeomError::OutOfRange`]
    /// for parameters that decrease or are all equal, [`GeomError::Underdetermined`] if repeated
    /// parameters leave a control point without data.
    ///
    /// # Source
    /// Piegl and Tiller, The NURBS Book, 2nd ed., eqs. 9.68 and 9.69 (knots), section 9.4.1.
    ///
    /// # Cost
    /// O(points + control points).
    pub fn least_squares(
        points: &[Point<f64, D>],
        parameters: &[f64],
        control_count: usize,
    ) -> Result<Self, GeomError> {
        if control_count < 4 {
            return Err(GeomError::TooFewPoints { found: control_count, needed: 4 });
        }
        if points.len() < control_count {
            return Err(GeomError::TooFewPoints { found: points.len(), needed: control_count });
        }
        check_parameters(points, parameters)?;
        let m = parameters.len();
        let mut knots = vec![parameters[0]; 4];
        let step = m as f64 / (control_count - 3) as f64;
        for j in 1..control_count - 3 {
            let position = j as f64 * step;
            let i = (position as usize).clamp(1, m - 1);
            let share = position - i as f64;
            knots.push((1.0 - share) * parameters[i - 1] + share * parameters[i]);
        }
        knots.extend([parameters[m - 1]; 4]);
        let data = Data::new(points, parameters, &knots, control_count);
        let control = data.normal.solve(data.rhs)?;
        Self::new(knots, control.into_iter().map(Point::from).collect())
    }

    /// The smoothest curve that is as far from `points` as noise of standard deviation `sigma` per
    /// coordinate (px in an image) would put it: the sum of squared distances is
    /// `points.len() * D * sigma²`, to a relative 1e-6.
    ///
    /// Smoothness is the integral of the squared third derivative over chord length, so that
    /// parabolas cost nothing. Knots are equally spaced, one per four points, and closer where that
    /// cannot follow the data. If even the smoothest curve that rounding allows is near enough, it is
    /// the result: a parabola, or beyond about a thousand points a curve of long waves only, nearer than
    /// was asked for; if the closest possible curve is too far (only where knots as dense as the points
    /// cannot follow), that is. `sigma = 0` interpolates.
    ///
    /// # Errors
    /// As [`interpolate`](Self::interpolate), and [`GeomError::OutOfRange`] for a negative or NaN
    /// `sigma`.
    ///
    /// # Source
    /// Reinsch, Smoothing by spline functions, Numer. Math. 10, 1967 (weight from the residual);
    /// O'Sullivan, Statist. Sci. 1(4), 1986 (penalised B-splines with fewer knots than data).
    ///
    /// # Cost
    /// O(points), about 50 banded solves.
    pub fn smoothing(points: &[Point<f64, D>], sigma: f64) -> Result<Self, GeomError> {
        if !(sigma >= 0.0 && sigma.is_finite()) {
            let expected = "a finite number not below 0";
            return Err(GeomError::OutOfRange { what: "sigma", value: sigma, expected });
        }
        if sigma == 0.0 {
            return Self::interpolate(points);
        }
        let u = chord_lengths(points)?;
        let (start, end) = (u[0], u[u.len() - 1]);
        let target = points.len() as f64 * D as f64 * sigma * sigma;
        let mut points_per_span = POINTS_PER_SPAN;
        loop {
            let spans = (points.len() / points_per_span).max(1);
            let knots = uniform_knots(start, end, spans);
            let fit = PenalisedFit::new(points, &u, knots);
            let (least_weight, closest) = fit.closest()?;
            if closest.residual <= target {
                return fit.meet(target, least_weight);
            }
            if points_per_span == 1 {
                return Self::new(fit.knots, closest.control);
            }
            points_per_span /= 2;
        }
    }
}

/// Cumulative chord lengths; refuses curves that no fit can take.
fn chord_lengths<const D: usize>(points: &[Point<f64, D>]) -> Result<Vec<f64>, GeomError> {
    if points.len() < 4 {
        return Err(GeomError::TooFewPoints { found: points.len(), needed: 4 });
    }
    check_points(points)?;
    let mut u = vec![0.0];
    let mut total = 0.0;
    for (index, pair) in points.windows(2).enumerate() {
        let next = total + (pair[1] - pair[0]).norm();
        // Also refuses a step too small to move the parameter.
        if next <= total {
            return Err(GeomError::DuplicatePoint { index: index + 1 });
        }
        total = finite(next, || "length of the curve".into())?;
        u.push(total);
    }
    Ok(u)
}

fn check_points<const D: usize>(points: &[Point<f64, D>]) -> Result<(), GeomError> {
    for (index, point) in points.iter().enumerate() {
        for &value in &point.coords {
            finite(value, || format!("point {index}"))?;
        }
    }
    Ok(())
}

fn check_parameters<const D: usize>(
    points: &[Point<f64, D>],
    parameters: &[f64],
) -> Result<(), GeomError> {
    let (expected, found) = (points.len(), parameters.len());
    if expected != found {
        return Err(GeomError::LengthMismatch { what: "parameters", expected, found });
    }
    check_points(points)?;
    for (index, &value) in parameters.iter().enumerate() {
        finite(value, || format!("parameter {index}"))?;
        if index > 0 && value < parameters[index - 1] {
            let expected = "parameters that do not decrease";
            return Err(GeomError::OutOfRange { what: "parameter", value, expected });
        }
    }
    if parameters[0] == parameters[found - 1] {
        let expected = "parameters that are not all equal";
        return Err(GeomError::OutOfRange { what: "parameter", value: parameters[0], expected });
    }
    Ok(())
}

/// Normal equations of the data.
struct Data<const D: usize> {
    rows: Vec<(usize, [f64; 4])>,
    normal: SymmetricBanded,
    rhs: Vec<SVector<f64, D>>,
}

impl<const D: usize> Data<D> {
    fn new(points: &[Point<f64, D>], parameters: &[f64], knots: &[f64], count: usize) -> Self {
        let mut normal = SymmetricBanded::zeros(count);
        let mut rhs = vec![SVector::zeros(); count];
        let mut rows = Vec::with_capacity(points.len());
        for (point, &t) in points.iter().zip(parameters) {
            let span = span_of(knots, count, t);
            let values = basis_table(knots, span, t)[3];
            normal.add_outer(span - 3, &values, 1.0);
            for (j, value) in values.into_iter().enumerate() {
                rhs[span - 3 + j] += point.coords * value;
            }
            rows.push((span - 3, values));
        }
        Self { rows, normal, rhs }
    }
}

/// A smoothing fit with everything but the weight of the penalty.
struct PenalisedFit<'a, const D: usize> {
    points: &'a [Point<f64, D>],
    knots: Vec<f64>,
    data: Data<D>,
    penalty: SymmetricBanded,
}

struct Solution<const D: usize> {
    control: Vec<Point<f64, D>>,
    /// Sum of squared distances to the points.
    residual: f64,
}

impl<'a, const D: usize> PenalisedFit<'a, D> {
    fn new(points: &'a [Point<f64, D>], parameters: &[f64], knots: Vec<f64>) -> Self {
        let count = knots.len() - 4;
        let data = Data::new(points, parameters, &knots, count);
        // The third derivative is constant on each span, so its squared integral is exact. Its
        // scale (length⁻⁵) is taken out by the traces.
        let mut penalty = SymmetricBanded::zeros(count);
        let width = knots[4] - knots[3];
        for span in 3..count {
            let third = basis_derivatives(&knots, span, knots[span])[3];
            // Scaled to knots one apart before squaring: tiny curves must not overflow.
            penalty.add_outer(span - 3, &third.map(|v| v * width.powi(3)), 1.0);
        }
        let scale = data.normal.trace() / penalty.trace();
        let penalty = SymmetricBanded::zeros(count).plus(&penalty, scale);
        Self { points, knots, data, penalty }
    }

    fn solve(&self, log10_weight: f64) -> Result<Solution<D>, GeomError> {
        let matrix = self.data.normal.plus(&self.penalty, 10f64.powf(log10_weight));
        let control: Vec<Point<f64, D>> =
            matrix.solve(self.data.rhs.clone())?.into_iter().map(Point::from).collect();
        let residual = self
            .points
            .iter()
            .zip(&self.data.rows)
            .map(|(point, (first, values))| {
                let fitted = values
                    .iter()
                    .zip(&control[*first..])
                    .fold(SVector::zeros(), |sum, (v, c)| sum + c.coords * *v);
                (fitted - point.coords).norm_squared()
            })
            .sum();
        Ok(Solution { control, residual })
    }

    /// The solution nearest to the data that rounding allows, and its weight. Where the points
    /// leave a gap of many spans only the penalty holds the curve, and a tiny weight is not enough.
    fn closest(&self) -> Result<(f64, Solution<D>), GeomError> {
        let mut weight = LOG10_WEIGHT.0;
        loop {
            match self.solve(weight) {
                Err(_) if weight < LOG10_WEIGHT.1 => weight += LOG10_STEP,
                result => return Ok((weight, result?)),
            }
        }
    }

    /// The solution whose residual is `target`, by bisection: the residual grows with the weight.
    fn meet(self, target: f64, least_weight: f64) -> Result<BSpline<D>, GeomError> {
        let (mut low, mut high) = (least_weight, LOG10_WEIGHT.1);
        let mut best = self.solve(high)?;
        if best.residual > target {
            while (best.residual / target - 1.0).abs() > 1e-6 {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                best = self.solve(middle)?;
                if best.residual > target {
                    high = middle;
                } else {
                    low = middle;
                }
            }
        }
        BSpline::new(self.knots, best.control)
    }
}
