use accurate_geom::nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use accurate_geom::{Camera, Pixel, Point3, Rig, View1, View2};

use crate::banded::{Banded, BandedFactor};
use crate::uniform_spline::UniformSpline;

/// A matched pair, its place on the curve and its first guess in space.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observation {
    /// Curve parameter, px; increases along the curve.
    pub(crate) t: f64,
    pub(crate) pixel1: Pixel<View1>,
    pub(crate) pixel2: Pixel<View2>,
    pub(crate) position: Point3,
}

/// What the fit weighs against the reprojection residuals.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Prior {
    /// Weight of the integral of the squared curvature, px³.
    pub(crate) curvature_px3: f64,
    /// Image px per world unit, to state the curvature in px.
    pub(crate) px_per_unit: f64,
    /// Known length and its standard deviation, world unit.
    pub(crate) length: Option<(f64, f64)>,
    pub(crate) max_iterations: usize,
}

/// A fit that has settled.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) spline: UniformSpline,
    pub(crate) iterations: usize,
    /// Root mean square distance, px, of an observed pixel to the projected curve point.
    pub(crate) rms_px: f64,
}

/// Half bandwidth of the normal equations: four neighbouring control points of three coordinates.
const HALF_BAND: usize = 11;

/// Damping beyond which a step is too short to change the energy.
const MAX_DAMPING: f64 = 1e16;

/// Fits a cubic B-spline of `spans` spans to the observations: first the linear fit to their
/// positions, then Levenberg-Marquardt on
/// `Σ |π(C(t)) - p|² + w ∫ |C''|² dt + ((length - L) / σ)²`. Only steps that lower the energy are
/// taken.
///
/// `None` if the observations do not determine a spline, a projection fails at the first guess, or
/// the iteration has not settled in time (its energy still falls by more than 1e-9 of itself).
///
/// # Cost
/// O(observations + spans) per iteration.
pub(crate) fn fit(
    observations: &[Observation],
    spans: usize,
    rig: &Rig,
    prior: &Prior,
) -> Option<Fit> {
    let (first, last) = (observations.first()?, observations.last()?);
    if last.t <= first.t {
        return None;
    }
    let mut spline = UniformSpline::zero(first.t, last.t, spans);
    spline.controls = linear_fit(&spline, observations, prior)?;
    let problem = Problem { observations, rig, prior };

    let mut energy = problem.energy(&spline)?;
    let mut damping = 1e-6;
    for iteration in 1..=prior.max_iterations {
        let system = problem.linearise(&spline)?;
        loop {
            let candidate = system.step(damping).map(|step| moved(&spline, &step));
            let lower = candidate
                .and_then(|c| problem.energy(&c).map(|e| (c, e)))
                .filter(|(_, e)| *e <= energy);
            if let Some((better, less)) = lower {
                let fall = energy - less;
                (spline, energy) = (better, less);
                damping = (damping * 0.1).max(1e-12);
                // Energies are sums of squared px: below 1e-18 per observation all is rounding.
                if fall <= 1e-9 * energy + 1e-18 * observations.len() as f64 {
                    let rms_px = problem.rms_px(&spline)?;
                    return Some(Fit { spline, iterations: iteration, rms_px });
                }
                break;
            }
            damping *= 10.0;
            if damping > MAX_DAMPING {
                // Not even the shortest step downhill helps: a minimum to rounding.
                let rms_px = problem.rms_px(&spline)?;
                return Some(Fit { spline, iterations: iteration, rms_px });
            }
        }
    }
    None
}

/// Least squares of the positions under the curvature weight; the three axes share one matrix.
fn linear_fit(
    shape: &UniformSpline,
    observations: &[Observation],
    prior: &Prior,
) -> Option<Vec<Vector3<f64>>> {
    let n = shape.controls.len();
    let mut matrix = Banded::zeros(n, 3);
    let mut right = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    for o in observations {
        let w = shape.value_weights(o.t);
        for a in 0..4 {
            for b in 0..=a {
                matrix.add(w.first + a, w.first + b, w.weight[a] * w.weight[b]);
            }
            for (axis, column) in right.iter_mut().enumerate() {
                column[w.first + a] += w.weight[a] * o.position[axis];
            }
        }
    }
    // A zero weight would leave spans without observations undetermined.
    let weight = prior.curvature_px3.max(1e-6);
    for (dt, _, d2) in shape.quadrature() {
        for a in 0..4 {
            for b in 0..=a {
                let value = weight * dt * d2.weight[a] * d2.weight[b];
                matrix.add(d2.first + a, d2.first + b, value);
            }
        }
    }
    let factor = matrix.factor()?;
    let [x, y, z] = right.map(|column| factor.solve(&column));
    let controls: Vec<_> = (0..n).map(|k| Vector3::new(x[k], y[k], z[k])).collect();
    controls.iter().all(|c| c.iter().all(|v| v.is_finite())).then_some(controls)
}

fn moved(spline: &UniformSpline, step: &[f64]) -> UniformSpline {
    let mut next = spline.clone();
    for (control, delta) in next.controls.iter_mut().zip(step.chunks_exact(3)) {
        *control += Vector3::new(delta[0], delta[1], delta[2]);
    }
    next
}

struct Problem<'a> {
    observations: &'a [Observation],
    rig: &'a Rig,
    prior: &'a Prior,
}

impl Problem<'_> {
    fn curvature_weight(&self) -> f64 {
        self.prior.curvature_px3 * self.prior.px_per_unit * self.prior.px_per_unit
    }

    /// `None` if a point leaves the space in front of a camera or the sum is not finite.
    fn energy(&self, spline: &UniformSpline) -> Option<f64> {
        let mut sum = self.squared_residuals(spline)?;
        let weight = self.curvature_weight();
        for (dt, _, d2) in spline.quadrature() {
            sum += weight * dt * spline.sum(&d2).norm_squared();
        }
        if let Some((length, sigma)) = self.prior.length {
            sum += ((spline.length() - length) / sigma).powi(2);
        }
        sum.is_finite().then_some(sum)
    }

    fn squared_residuals(&self, spline: &UniformSpline) -> Option<f64> {
        let mut sum = 0.0;
        for o in self.observations {
            let point = spline.point(o.t);
            sum +=
                (project(self.rig.camera1(), &point)?.0 - o.pixel1.point().coords).norm_squared();
            sum +=
                (project(self.rig.camera2(), &point)?.0 - o.pixel2.point().coords).norm_squared();
        }
        Some(sum)
    }

    fn rms_px(&self, spline: &UniformSpline) -> Option<f64> {
        let count = 2.0 * self.observations.len() as f64;
        Some((self.squared_residuals(spline)? / count).sqrt())
    }

    fn linearise(&self, spline: &UniformSpline) -> Option<System> {
        let n = 3 * spline.controls.len();
        let mut matrix = Banded::zeros(n, HALF_BAND);
        let mut gradient = vec![0.0; n];
        for o in self.observations {
            let w = spline.value_weights(o.t);
            let point = spline.point(o.t);
            let mut hessian = Matrix3::zeros();
            let mut slope = Vector3::zeros();
            for (camera, observed) in
                [(self.rig.camera1(), o.pixel1.point()), (self.rig.camera2(), o.pixel2.point())]
            {
                let (image, jacobian) = project(camera, &point)?;
                hessian += jacobian.transpose() * jacobian;
                slope += jacobian.transpose() * (image - observed.coords);
            }
            for a in 0..4 {
                let row = 3 * (w.first + a);
                for axis in 0..3 {
                    gradient[row + axis] += w.weight[a] * slope[axis];
                }
                for b in 0..=a {
                    let column = 3 * (w.first + b);
                    let both = w.weight[a] * w.weight[b];
                    for p in 0..3 {
                        for q in 0..3 {
                            if column + q <= row + p {
                                matrix.add(row + p, column + q, both * hessian[(p, q)]);
                            }
                        }
                    }
                }
            }
        }
        let weight = self.curvature_weight();
        for (dt, _, d2) in spline.quadrature() {
            let bend = spline.sum(&d2);
            for a in 0..4 {
                for axis in 0..3 {
                    let row = 3 * (d2.first + a) + axis;
                    gradient[row] += weight * dt * d2.weight[a] * bend[axis];
                    for b in 0..=a {
                        let value = weight * dt * d2.weight[a] * d2.weight[b];
                        matrix.add(row, 3 * (d2.first + b) + axis, value);
                    }
                }
            }
        }
        let mut length_row = None;
        if let Some((length, sigma)) = self.prior.length {
            let mut row = vec![0.0; n];
            for (dt, d1, _) in spline.quadrature() {
                let tangent = spline.sum(&d1);
                let speed = tangent.norm();
                if speed > 0.0 {
                    for a in 0..4 {
                        for axis in 0..3 {
                            row[3 * (d1.first + a) + axis] +=
                                dt * d1.weight[a] * tangent[axis] / (speed * sigma);
                        }
                    }
                }
            }
            let residual = (spline.length() - length) / sigma;
            for (g, r) in gradient.iter_mut().zip(&row) {
                *g += residual * r;
            }
            length_row = Some(row);
        }
        Some(System { matrix, gradient, length_row })
    }
}

/// `(A + r rᵀ) step = -gradient` with a banded `A` and the row `r` of the length residual.
struct System {
    matrix: Banded,
    gradient: Vec<f64>,
    length_row: Option<Vec<f64>>,
}

impl System {
    /// The step under `damping` times the diagonal; `None` if the matrix is singular all the same.
    fn step(&self, damping: f64) -> Option<Vec<f64>> {
        let mut damped = self.matrix.clone();
        for i in 0..self.gradient.len() {
            let own = self.matrix.diagonal(i);
            // The length residual belongs to the diagonal too, or damping could not tame it.
            let length = self.length_row.as_ref().map_or(0.0, |r| r[i] * r[i]);
            damped.add(i, i, damping * (own + length));
        }
        let factor: BandedFactor = damped.factor()?;
        let negative: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        let mut step = factor.solve(&negative);
        if let Some(row) = &self.length_row {
            // Sherman-Morrison: the dense rank-one term costs one more banded solution.
            let across = factor.solve(row);
            let share = dot(row, &step) / (1.0 + dot(row, &across));
            for (s, a) in step.iter_mut().zip(&across) {
                *s -= share * a;
            }
        }
        step.iter().all(|v| v.is_finite()).then_some(step)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The image of a point, px, and its derivative, px per world unit; `None` if it is not in front.
fn project(camera: &Camera, point: &Point3) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
    let in_camera = camera.r() * point.coords + camera.t();
    if in_camera.z <= 0.0 || in_camera.z.is_nan() {
        return None;
    }
    let k = camera.k();
    let h = k * (in_camera / in_camera.z);
    let direction = k * camera.r();
    let row = |axis: usize| (direction.row(axis) - h[axis] * direction.row(2)) / in_camera.z;
    Some((Vector2::new(h.x, h.y), Matrix2x3::from_rows(&[row(0), row(1)])))
}
