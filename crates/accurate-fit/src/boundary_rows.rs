//! What the points of an outline say of a curve.

use accurate_geom::nalgebra::Vector2;
use accurate_geom::number::{Number, Vector, dot};
use pulp::{Arch, Simd, WithSimd};

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
                self.rows_of(&mut batch, e, view, projector, settings);
            }
        }
        self.rows_of(&mut batch, e, view, projector, settings);
    }

    /// Adds the rows of a batch, which is empty after that.
    fn rows_of(
        &self,
        batch: &mut Batch,
        e: &mut Evaluation,
        view: usize,
        projector: &Projector,
        settings: &Settings,
    ) {
        let half = e.state.half_px[view];
        let trying = !e.precision[view].is_empty();
        let (camera, end) = (projector.numbers(), e.state.spline.spans() as f64);
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
                nuisance: if self.calibrating && view == 1 {
                    projector.nuisance_derivative(&image, towards.into())
                } else {
                    [0.0; 3]
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
}

/// The residuals of a batch on a curve whose parameter ends at `end`.
struct Residuals<'a> {
    batch: &'a mut Batch,
    camera: &'a CameraNumbers,
    end: f64,
}

impl WithSimd for Residuals<'_> {
    type Output = ();

    // No closures here and below: they would be compiled without the instructions of the vectors.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { batch, camera, end } = self;
        for k in 0..LANES / S::F64_LANES {
            let t = Vector::load(simd, &batch.t, k);
            let zero = t.all(0.0);
            let mut control = [[zero; 3]; 4];
            for (control, lanes) in control.iter_mut().zip(&batch.control) {
                for (coordinate, lanes) in control.iter_mut().zip(lanes) {
                    *coordinate = Vector::load(simd, lanes, k);
                }
            }
            let u = Vector::load(simd, &batch.u, k);
            let [x, y] = &batch.boundary;
            let boundary = [Vector::load(simd, x, k), Vector::load(simd, y, k)];
            let found = residual(camera, end, &control, t, u, boundary);
            found.u.store(&mut batch.u, k);
            found.distance.store(&mut batch.distance, k);
            let [x, y] = &batch.inward;
            let inward = [Vector::load(simd, x, k), Vector::load(simd, y, k)];
            (zero - dot(&found.out, &inward)).store(&mut batch.outward, k);
            for axis in 0..2 {
                found.image[axis].store(&mut batch.image[axis], k);
                found.towards[axis].store(&mut batch.towards[axis], k);
            }
            for axis in 0..3 {
                found.gradient[axis].store(&mut batch.gradient[axis], k);
            }
        }
    }
}

/// Where a curve is nearest to a boundary point.
struct Residual<N> {
    u: N,
    image: [N; 2],
    /// To the boundary point.
    out: [N; 2],
    distance: N,
    towards: [N; 2],
    gradient: [N; 3],
}

/// The chords are within their sag of the curve: one Gauss-Newton step of the parameter leaves an error
/// of second order in it.
#[inline(always)]
fn residual<N: Number>(
    camera: &CameraNumbers,
    end: f64,
    control: &[[N; 3]; 4],
    t: N,
    u: N,
    boundary: [N; 2],
) -> Residual<N> {
    let (zero, one) = (t.all(0.0), t.all(1.0));
    let x = combined(control, &basis(t));
    let ahead = combined(control, &basis_1(t));
    let (near, jacobian) = camera.project_with_jacobian(&x);
    let tangent = [dot(&jacobian[0], &ahead), dot(&jacobian[1], &ahead)];
    let off = [boundary[0] - near[0], boundary[1] - near[1]];
    let squared = dot(&tangent, &tangent).larger(t.all(f64::MIN_POSITIVE));
    let step = (dot(&off, &tangent) / squared).larger(t.all(-0.5)).smaller(t.all(0.5));
    let nearest = (u + step).larger(zero).smaller(t.all(end));
    let moved = nearest - u;
    let image = [near[0] + tangent[0] * moved, near[1] + tangent[1] * moved];
    let out = [boundary[0] - image[0], boundary[1] - image[1]];
    let distance = dot(&out, &out).sqrt();
    // On the curve itself no direction is better than another.
    let inverse = distance.if_positive(one / distance, zero);
    let towards = [out[0] * inverse, out[1] * inverse];
    let mut gradient = [zero; 3];
    for axis in 0..3 {
        gradient[axis] = zero - dot(&towards, &[jacobian[0][axis], jacobian[1][axis]]);
    }
    Residual { u: nearest, image, out, distance, towards, gradient }
}

/// The control points of a span, weighted.
#[inline(always)]
fn combined<N: Number>(control: &[[N; 3]; 4], weights: &[N; 4]) -> [N; 3] {
    let mut sum = [weights[0].all(0.0); 3];
    for axis in 0..3 {
        let [a, b, c, d] = control;
        sum[axis] = a[axis] * weights[0]
            + b[axis] * weights[1]
            + c[axis] * weights[2]
            + d[axis] * weights[3];
    }
    sum
}

/// Whether point `i` belongs to the sample of one in `stride`. A plain `i % stride` would take one
/// side only of a vertical strand, whose points alternate left and right.
#[inline]
fn is_sampled(i: usize, stride: usize) -> bool {
    ((i as u32).wrapping_mul(2_654_435_769) >> 16).is_multiple_of(stride as u32)
}

#[cfg(test)]
mod tests {
    use accurate_synth::{CaseOptions, Family, generate};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Eight at a time are the bits of one by one, on any machine.
        #[test]
        fn residuals_side_by_side_are_those_of_single_points(
            control in prop::collection::vec(prop::array::uniform3(-60.0..60.0f64), 11),
            points in prop::collection::vec((prop::array::uniform2(-10.0..500.0f64), 0.0..6.0f64, -1.0..9.0f64), 8),
        ) {
            let case = generate(Family::Carm, 1902, 0, &CaseOptions::default()).unwrap();
            let projector = &Projector::pair(&case.rig)[1];
            let camera = projector.numbers();
            let middle = case.truth[case.truth.len() / 2].coords;
            let control = control.into_iter().map(|c| middle + accurate_geom::nalgebra::Vector3::from(c));
            let spline = UniformSpline { control: control.collect() };
            let end = spline.spans() as f64;
            let mut batch = Batch::default();
            for (i, (at, turn, u)) in points.iter().enumerate() {
                batch.push(&spline, i, &[at[0], at[1], turn.cos(), turn.sin()], *u);
            }
            Arch::new().dispatch(Residuals { batch: &mut batch, camera, end });
            for (lane, (at, turn, u)) in points.iter().enumerate() {
                let (span, t) = spline.locate(*u);
                let c = |k: usize| <[f64; 3]>::from(spline.control[span + k]);
                let one = residual(camera, end, &[c(0), c(1), c(2), c(3)], t, *u, *at);
                prop_assert_eq!(batch.u[lane].to_bits(), one.u.to_bits());
                prop_assert_eq!(batch.distance[lane].to_bits(), one.distance.to_bits());
                prop_assert_eq!(batch.gradient.map(|axis| axis[lane]), one.gradient);
                prop_assert_eq!(batch.towards.map(|axis| axis[lane]), one.towards);
                let outward = 0.0 - dot(&one.out, &[turn.cos(), turn.sin()]);
                prop_assert_eq!(batch.outward[lane].to_bits(), outward.to_bits());
                // The projection is that of the camera, to rounding.
                let x = spline.combine(span, basis(t));
                let seen = case.rig.camera2().project(&x.into()).unwrap();
                prop_assert!((projector.project(&x) - Vector2::new(seen.x, seen.y)).norm() < 1e-8);
            }
        }
    }
}
