use accurate_geom::nalgebra::Vector2;

use pulp::Scalar;

use crate::FitError;
use crate::chords::Chords;
use crate::normal::NormalEquations;
use crate::outline_problem::smoothness;
use crate::point_data::PointData;
use crate::projector::{Nuisance, Projector};
use crate::span_blocks::LinearRow;
use crate::uniform_spline::{UniformSpline, basis, basis_1};

/// Ordered points of two views and their cameras.
#[derive(Debug, Clone)]
pub(crate) struct PointProblem<'a> {
    pub(crate) data: &'a [PointData; 2],
    pub(crate) projectors: [Projector; 2],
    /// Chords per span.
    pub(crate) steps: usize,
    /// Factors of `lambda3` along the curve.
    pub(crate) local_smoothness: Vec<f64>,
    /// Weights of the priors of view 2's shift and roll, in units of a residual's variance; `None`:
    /// its calibration is exact.
    pub(crate) nuisance_weights: Option<[f64; 3]>,
}

/// Weight of a point's progress along the curve in its association, beside its distance.
const ALONG: f64 = 0.2;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PointSettings {
    pub(crate) lambda3: f64,
    /// Residuals beyond this are weighed down (Huber), px.
    pub(crate) huber_px: f64,
    /// How far along the curve a point may move in one step, in spans.
    pub(crate) window: f64,
}

/// A spline and the parameter of every data point on it.
#[derive(Debug, Clone)]
pub(crate) struct PointState {
    pub(crate) spline: UniformSpline,
    pub(crate) parameters: [Vec<f64>; 2],
    pub(crate) nuisance: Nuisance,
}

/// One residual: the distance of a point from the projected curve along its normal, or one
/// coordinate of an end point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointRow {
    pub(crate) span: usize,
    pub(crate) basis: [f64; 4],
    pub(crate) gradient: [f64; 3],
    /// Derivatives with respect to view 2's shift and roll; zero in view 1.
    pub(crate) global: [f64; 3],
    pub(crate) residual: f64,
    /// A point of a free end that lies beyond the curve is no datum.
    pub(crate) used: bool,
}

#[derive(Debug, Clone)]
pub(crate) struct PointEvaluation {
    pub(crate) state: PointState,
    pub(crate) rows: Vec<PointRow>,
    chords: Chords,
}

impl PointEvaluation {
    pub(crate) fn new(state: PointState) -> Self {
        Self { state, rows: Vec::new(), chords: Chords::default() }
    }
}

impl PointProblem<'_> {
    /// Associates every point anew, within the window around its parameter and never falling, and
    /// computes the residuals. Row order does not depend on the state.
    pub(crate) fn evaluate(
        &self,
        e: &mut PointEvaluation,
        settings: &PointSettings,
    ) -> Result<(), FitError> {
        e.rows.clear();
        let end = e.state.spline.spans() as f64;
        for view in 0..2 {
            let mut projector = self.projectors[view].clone();
            if view == 1 {
                projector.set_nuisance(e.state.nuisance);
            }
            let projector = &projector;
            let first_row = e.rows.len();
            e.chords.rebuild(&e.state.spline, projector, view as u8 + 1, self.steps)?;
            e.chords.measure();
            let data = &self.data[view];
            let last = data.points.len() - 1;
            let mut reached = 0.0;
            for (i, &[x, y]) in data.points.iter().enumerate() {
                let q = Vector2::new(x, y);
                let fixed = match i {
                    0 if !data.free[0] => Some(0.0),
                    _ if i == last && !data.free[1] => Some(end),
                    _ => None,
                };
                if let Some(u) = fixed {
                    e.state.parameters[view][i] = u;
                    reached = u;
                    self.end_rows(&e.state.spline, projector, u, &q, &mut e.rows);
                    continue;
                }
                let from = (e.state.parameters[view][i] - settings.window).max(reached);
                let to = (e.state.parameters[view][i] + settings.window).max(from).min(end);
                // One step of the data is one step of the curve.
                let expected = e.chords.arc_at(reached)
                    + data.points[..i]
                        .last()
                        .map_or(0.0, |p| (q - Vector2::new(p[0], p[1])).norm());
                let u = e.chords.follow(&q, from, to, expected, ALONG);
                let (row, u) = self.normal_row(&e.state.spline, projector, u, &q, reached);
                let beyond = (data.free[0] && u <= 0.0) || (data.free[1] && u >= end);
                e.rows.push(PointRow { used: !beyond, ..row });
                e.state.parameters[view][i] = u;
                reached = u;
            }
            if view == 0 {
                // The calibration of view 1 is exact.
                e.rows[first_row..].iter_mut().for_each(|row| row.global = [0.0; 3]);
            }
        }
        Ok(())
    }

    fn normal_row(
        &self,
        spline: &UniformSpline,
        projector: &Projector,
        u: f64,
        q: &Vector2<f64>,
        reached: f64,
    ) -> (PointRow, f64) {
        let end = spline.spans() as f64;
        let (span, t) = spline.locate(u);
        let x = spline.combine(span, basis(t));
        let (p, jacobian) = projector.project_with_jacobian(&x);
        let tangent = jacobian * spline.combine(span, basis_1(t));
        let squared = tangent.norm_squared().max(f64::MIN_POSITIVE);
        // One Gauss-Newton step of the parameter; what it leaves is of second order.
        let step = ((q - p).dot(&tangent) / squared).clamp(-0.5, 0.5);
        let moved = (u + step).max(reached).min(end);
        let (span, t) = spline.locate(moved);
        let x = spline.combine(span, basis(t));
        let (p, jacobian) = projector.project_with_jacobian(&x);
        let tangent = jacobian * spline.combine(span, basis_1(t));
        let length = tangent.norm().max(f64::MIN_POSITIVE);
        // Signed, so that it has a derivative at 0.
        let normal = Vector2::new(-tangent.y, tangent.x) / length;
        let g = -(normal.transpose() * jacobian);
        let row = PointRow {
            span,
            basis: basis(t),
            gradient: [g.x, g.y, g.z],
            global: [-normal.x, -normal.y, -normal.dot(&projector.roll_derivative(&p))],
            residual: normal.dot(&(q - p)),
            used: true,
        };
        (row, moved)
    }

    /// An end point ties both coordinates.
    fn end_rows(
        &self,
        spline: &UniformSpline,
        projector: &Projector,
        u: f64,
        q: &Vector2<f64>,
        rows: &mut Vec<PointRow>,
    ) {
        let (span, t) = spline.locate(u);
        let (p, jacobian) = projector.project_with_jacobian(&spline.combine(span, basis(t)));
        let roll = projector.roll_derivative(&p);
        for axis in 0..2 {
            let g = -jacobian.row(axis);
            let mut global = [0.0, 0.0, -roll[axis]];
            global[axis] = -1.0;
            rows.push(PointRow {
                span,
                basis: basis(t),
                gradient: [g[0], g[1], g[2]],
                global,
                residual: q[axis] - p[axis],
                used: true,
            });
        }
    }

    /// Twice the cost; rows that `data` does not use do not count.
    pub(crate) fn cost(
        &self,
        e: &PointEvaluation,
        data: &[PointRow],
        settings: &PointSettings,
    ) -> f64 {
        let k = settings.huber_px;
        let sum: f64 = e
            .rows
            .iter()
            .zip(data)
            .filter(|(_, datum)| datum.used)
            .map(|(row, _)| {
                let r = row.residual.abs();
                if r <= k { r * r } else { k * (2.0 * r - k) }
            })
            .sum();
        let prior: f64 = self
            .nuisance_weights
            .map_or(0.0, |w| e.state.nuisance.values().iter().zip(w).map(|(v, w)| w * v * v).sum());
        sum + prior + smoothness(&e.state.spline, 0.0, settings.lambda3, &self.local_smoothness)
    }

    pub(crate) fn assemble(
        &self,
        e: &PointEvaluation,
        settings: &PointSettings,
        normal: &mut NormalEquations,
    ) {
        normal.clear();
        for row in e.rows.iter().filter(|row| row.used) {
            let weight = huber_weight(row.residual, settings.huber_px);
            let PointRow { span, basis, gradient, global, residual, .. } = row;
            let global: &[f64] = if self.nuisance_weights.is_some() { global } else { &[] };
            let (span, residual) = (*span, *residual);
            let row = LinearRow { span, basis, gradient, global, residual, weight };
            normal.add(Scalar::new(), &row);
        }
        if let Some(weights) = self.nuisance_weights {
            for (k, (value, weight)) in
                e.state.nuisance.values().into_iter().zip(weights).enumerate()
            {
                normal.add_prior(k, value, weight);
            }
        }
        let control = &e.state.spline.control;
        normal.add_smoothness(control, 0.0, settings.lambda3, &self.local_smoothness);
    }
}

/// Weight of a residual.
pub(crate) fn huber_weight(residual: f64, huber_px: f64) -> f64 {
    let r = residual.abs();
    if r <= huber_px { 1.0 } else { huber_px / r }
}
