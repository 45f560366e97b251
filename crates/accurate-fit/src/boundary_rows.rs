//! What the points of an outline say of a curve.

use accurate_geom::nalgebra::Vector2;
use pulp::{Arch, NullaryFnOnce};

use crate::nearest::LANES;
use crate::outline_problem::{Evaluation, OutlineProblem, Row, Settings};
use crate::projector::{CameraNumbers, Projector};
use crate::uniform_spline::{UniformSpline, basis, basis_1};

/// An outline point is no datum if its outward normal turns more than this (cosine) away from the
/// curve: the cut face of a gap, or the other side of the body.
const MIN_COSINE: f64 = 0.2;
/// ... or if it lies deeper in the body than this fraction of the half thickness.
const MIN_DEPTH: f64 = 0.3;

impl OutlineProblem<'_> {
    /// Adds the rows of one view's outline.
    pub(crate) fn boundary_rows(
        &self,
        e: &mut Evaluation,
        view: usize,
        projector: &Projector,
        settings: &Settings,
    ) {
        let limit = (e.state.half_px[view] + settings.reach_px).powi(2);
        let trying = !e.precision[view].is_empty();
        let camera = projector.numbers();
        let mut batch = Batch::default();
        for i in 0..e.nearest[view].len() {
            if settings.stride > 1 && !is_sampled(i, settings.stride) {
                continue;
            }
            // Refuses NaN too.
            if !(e.nearest[view].squared()[i] < limit) {
                e.lost += usize::from(trying && e.precision[view][i] > 0.0);
                continue;
            }
            let near_u = e.nearest[view].u()[i];
            batch.push(&e.state.spline, i, &self.outlines[view].points[i], near_u);
            if batch.len == LANES {
                self.rows_of(&mut batch, &camera, e, view, projector, settings);
            }
        }
        self.rows_of(&mut batch, &camera, e, view, projector, settings);
    }

    /// Adds the rows of a batch, which is empty after that.
    fn rows_of(
        &self,
        batch: &mut Batch,
        camera: &CameraNumbers,
        e: &mut Evaluation,
        view: usize,
        projector: &Projector,
        settings: &Settings,
    ) {
        let half = e.state.half_px[view];
        let trying = !e.precision[view].is_empty();
        let end = e.state.spline.spans() as f64;
        // No operation is fused: the same rows on every machine.
        Arch::new().dispatch(Residuals { batch, camera, end });
        for lane in 0..batch.len {
            let i = batch.point[lane];
            let (u, distance, outward) = (batch.u[lane], batch.distance[lane], batch.outward[lane]);
            e.nearest[view].set(i, distance * distance, u);
            let passes = distance > MIN_DEPTH * half
                && distance < half + settings.reach_px
                && outward > MIN_COSINE * distance;
            let known = if trying { e.precision[view][i] } else { 0.0 };
            let held = if trying { known > 0.0 } else { passes };
            if !(passes || held) {
                continue;
            }
            let towards = batch.towards.map(|axis| axis[lane]);
            let image = Vector2::new(batch.image[0][lane], batch.image[1][lane]);
            let (span, t) = e.state.spline.locate(u);
            let share = outward / distance;
            let precision = if known > 0.0 { known } else { self.precision(view, share, i) };
            e.rows.push(Row {
                view,
                span,
                basis: basis(t),
                gradient: batch.gradient.map(|axis| axis[lane]),
                nuisance: match view {
                    0 => [0.0; 3],
                    _ => projector.nuisance_derivative(&image, towards.into()),
                },
                distance,
                precision,
                passes,
                held,
                share,
                outside: false,
                point: i,
            });
        }
        batch.len = 0;
    }
}

/// Outline points side by side, and what becomes of them. What is in a lane beyond `len` means nothing.
#[derive(Default)]
struct Batch {
    len: usize,
    point: [usize; LANES],
    boundary: [[f64; LANES]; 2],
    inward: [[f64; LANES]; 2],
    /// Control points of the nearest chord's span.
    control: [[[f64; LANES]; 3]; 4],
    /// Place in the span.
    t: [f64; LANES],
    /// Parameter: of the nearest point of the chords, then of the curve itself.
    u: [f64; LANES],
    image: [[f64; LANES]; 2],
    distance: [f64; LANES],
    outward: [f64; LANES],
    towards: [[f64; LANES]; 2],
    /// Derivative of the distance with respect to the curve point.
    gradient: [[f64; LANES]; 3],
}

impl Batch {
    fn push(&mut self, spline: &UniformSpline, i: usize, point: &[f64; 4], u: f64) {
        let lane = self.len;
        let (span, t) = spline.locate(u);
        self.point[lane] = i;
        for axis in 0..2 {
            self.boundary[axis][lane] = point[axis];
            self.inward[axis][lane] = point[2 + axis];
        }
        for (control, c) in self.control.iter_mut().zip(&spline.control[span..span + 4]) {
            for axis in 0..3 {
                control[axis][lane] = c[axis];
            }
        }
        self.t[lane] = t;
        self.u[lane] = u;
        self.len += 1;
    }

    /// The chords are within their sag of the curve: one Gauss-Newton step of the parameter leaves an
    /// error of second order in it.
    #[inline(always)]
    fn compute(&mut self, camera: &CameraNumbers, end: f64, lane: usize) {
        let (at, ahead) = (basis(self.t[lane]), basis_1(self.t[lane]));
        let combine = |w: [f64; 4], axis: usize| {
            let c = |k: usize| self.control[k][axis][lane];
            c(0) * w[0] + c(1) * w[1] + c(2) * w[2] + c(3) * w[3]
        };
        let x = [combine(at, 0), combine(at, 1), combine(at, 2)];
        let dx = [combine(ahead, 0), combine(ahead, 1), combine(ahead, 2)];
        let (image, jacobian) = camera.project_with_jacobian(x);
        let along = |row: [f64; 3]| row[0] * dx[0] + row[1] * dx[1] + row[2] * dx[2];
        let tangent = [along(jacobian[0]), along(jacobian[1])];
        let (bx, by) = (self.boundary[0][lane], self.boundary[1][lane]);
        let ahead = (bx - image[0]) * tangent[0] + (by - image[1]) * tangent[1];
        let squared = tangent[0] * tangent[0] + tangent[1] * tangent[1];
        let step = between(ahead / larger(squared, f64::MIN_POSITIVE), -0.5, 0.5);
        let u = between(self.u[lane] + step, 0.0, end);
        let moved = u - self.u[lane];
        let image = [image[0] + tangent[0] * moved, image[1] + tangent[1] * moved];
        let (out_x, out_y) = (bx - image[0], by - image[1]);
        let distance = (out_x * out_x + out_y * out_y).sqrt();
        // On the curve itself no direction is better than another.
        let inverse = if distance > 0.0 { 1.0 / distance } else { 0.0 };
        let towards = [out_x * inverse, out_y * inverse];
        self.u[lane] = u;
        self.distance[lane] = distance;
        self.outward[lane] = -(out_x * self.inward[0][lane] + out_y * self.inward[1][lane]);
        for axis in 0..2 {
            self.image[axis][lane] = image[axis];
            self.towards[axis][lane] = towards[axis];
        }
        for axis in 0..3 {
            self.gradient[axis][lane] =
                -(towards[0] * jacobian[0][axis] + towards[1] * jacobian[1][axis]);
        }
    }
}

/// The residuals of a batch on a curve whose parameter ends at `end`.
struct Residuals<'a> {
    batch: &'a mut Batch,
    camera: &'a CameraNumbers,
    end: f64,
}

impl NullaryFnOnce for Residuals<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        for lane in 0..LANES {
            self.batch.compute(self.camera, self.end, lane);
        }
    }
}

// Comparisons instead of clamp and max, which keep a loop from becoming vectors. NaN becomes `least`.

#[inline(always)]
fn larger(value: f64, least: f64) -> f64 {
    if value > least { value } else { least }
}

#[inline(always)]
fn between(value: f64, least: f64, most: f64) -> f64 {
    let value = larger(value, least);
    if value < most { value } else { most }
}

/// Whether point `i` belongs to the sample of one in `stride`. A plain `i % stride` would take one
/// side only of a vertical strand, whose points alternate left and right.
#[inline]
fn is_sampled(i: usize, stride: usize) -> bool {
    ((i as u32).wrapping_mul(2_654_435_769) >> 16).is_multiple_of(stride as u32)
}
