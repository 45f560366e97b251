use accurate_geom::nalgebra::Vector3;
use pulp::{Arch, Simd, WithSimd};

use crate::FitError;
use crate::bridges::Bridges;
use crate::chords::Chords;
use crate::nearest::NearestPoints;
use crate::normal::NormalEquations;
use crate::outline::OutlineData;
use crate::projector::{Nuisance, Projector};
use crate::span_blocks::LinearRow;
use crate::uniform_spline::UniformSpline;

/// What the boundary fit solves for.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub(crate) spline: UniformSpline,
    /// Half thickness of the body in each view, px.
    pub(crate) half_px: [f64; 2],
    pub(crate) nuisance: Nuisance,
}

/// The settings of one iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settings {
    /// Outline points farther than this from the body's own outline are no data, px.
    pub(crate) reach_px: f64,
    /// Scale of the Cauchy weights, px.
    pub(crate) scale_px: f64,
    /// One outline point in so many is used.
    pub(crate) stride: usize,
    /// Smoothness, already in world units.
    pub(crate) lambda2: f64,
    pub(crate) lambda3: f64,
    /// Weight of a curve sample outside the mask, per px of length on average.
    pub(crate) outside_weight: f64,
    /// Whether nearest points are looked for as far as [`judge`](crate::judgement::judge) needs them,
    /// or only as far as they are data.
    pub(crate) judged: bool,
}

/// One residual `|q - x(u)| - offset` of a projected curve point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) view: usize,
    pub(crate) span: usize,
    pub(crate) basis: [f64; 4],
    /// Derivative with respect to the curve point, per world unit.
    pub(crate) gradient: [f64; 3],
    /// Derivatives with respect to the shift and the roll of view 2.
    pub(crate) nuisance: [f64; 3],
    pub(crate) distance: f64,
    /// Weight by how exactly digitisation places the point, 1 on average.
    pub(crate) precision: f64,
    /// Whether the gates let it be a datum of this state ...
    pub(crate) passes: bool,
    /// ... and whether it is one of the step being tried.
    pub(crate) held: bool,
    /// Cosine between the pixel pair's axis and the curve's normal.
    pub(crate) share: f64,
    /// Curve samples outside the mask have a fixed weight and no half thickness.
    pub(crate) outside: bool,
    /// Index of the outline point.
    pub(crate) point: usize,
}

/// A state with its residuals.
#[derive(Debug, Clone)]
pub(crate) struct Evaluation {
    pub(crate) state: State,
    pub(crate) rows: Vec<Row>,
    /// Data of the step being tried that are out of reach now.
    pub(crate) lost: usize,
    pub(crate) nearest: [NearestPoints; 2],
    /// If not empty: the precisions of the outline points that are data of the step being tried;
    /// not positive for the others.
    pub(crate) precision: [Vec<f64>; 2],
    pub(crate) chords: [Chords; 2],
}

/// Two outlines, two cameras.
#[derive(Debug, Clone)]
pub(crate) struct OutlineProblem<'a> {
    pub(crate) outlines: [&'a OutlineData; 2],
    /// Where the curve may leave the mask.
    pub(crate) bridges: [&'a Bridges; 2],
    pub(crate) projectors: [Projector; 2],
    /// Chords per span: about 1.5 px each.
    pub(crate) steps: usize,
    pub(crate) px_per_unit: f64,
    /// Whether view 2's nuisance parameters are unknowns.
    pub(crate) calibrating: bool,
    /// Factors of `lambda3` along the curve; empty: 1 everywhere.
    pub(crate) local_smoothness: Vec<f64>,
}

/// Variance of a boundary point besides digitisation, px²: 0.07 px rendering and model error.
const OTHER_VARIANCE: f64 = 0.005;
/// A body with a smaller half thickness is drawn as one row of pixels, px.
const ONE_PIXEL_HALF_PX: f64 = 0.75;
/// Residuals are looked for at least so far for [`Judgement`](crate::Judgement), px.
pub(crate) const JUDGED_PX: f64 = 4.8;

impl OutlineProblem<'_> {
    pub(crate) fn evaluation(&self, state: State) -> Evaluation {
        let points = self.outlines.iter().map(|outline| outline.points.len()).sum();
        Evaluation {
            state,
            rows: Vec::with_capacity(points),
            lost: 0,
            nearest: Default::default(),
            precision: Default::default(),
            chords: Default::default(),
        }
    }

    /// Recomputes association and residuals of `e.state`.
    pub(crate) fn evaluate(&self, e: &mut Evaluation, settings: &Settings) -> Result<(), FitError> {
        e.rows.clear();
        e.lost = 0;
        for view in 0..2 {
            let mut projector = self.projectors[view].clone();
            if view == 1 {
                projector.set_nuisance(e.state.nuisance);
            }
            let half = e.state.half_px[view];
            let least = if settings.judged { JUDGED_PX } else { 0.0 };
            let steps = self.steps_for(settings);
            e.chords[view].rebuild(&e.state.spline, &projector, view as u8 + 1, steps)?;
            let radius = half + settings.reach_px.max(least);
            let outline = self.outlines[view];
            e.nearest[view].find(&e.chords[view], outline, radius);
            self.boundary_rows(e, view, &projector, settings);
            self.outside_rows(e, view, &projector);
        }
        Ok(())
    }

    /// Chords per span. The parameter of a nearest point is refined on the curve itself, so that longer
    /// chords will do where nothing is judged by their points: but not for a body that is thinner than
    /// a sharp bend's chords are off.
    fn steps_for(&self, settings: &Settings) -> usize {
        let thick = self.outlines.iter().all(|o| o.half_thickness_px >= ONE_PIXEL_HALF_PX);
        if settings.judged || !thick { self.steps } else { self.steps.div_ceil(2).max(2) }
    }

    /// How exactly digitisation places a boundary point whose pixel pair makes an angle of cosine
    /// `share` with the curve's normal: the inverse of its variance `share² / 12`, with a floor for
    /// what is not digitisation, relative to the mean variance 1/18.
    /// A point of a probability map has the variance that the map gives it.
    pub(crate) fn precision(&self, view: usize, share: f64, point: usize) -> f64 {
        let outline = self.outlines[view];
        let variance = match &outline.map {
            Some(map) => map.variance[point],
            None if outline.digitised => share * share / 12.0,
            None => return 1.0,
        };
        (1.0 / 18.0 + OTHER_VARIANCE) / (variance + OTHER_VARIANCE)
    }

    /// Makes every row that passes the gates, and no other, a datum, with the precision of its own
    /// normal, and notes that in `precision`.
    pub(crate) fn renew_data(&self, e: &mut Evaluation, precision: &mut [Vec<f64>; 2]) {
        for view in 0..2 {
            precision[view].clear();
            precision[view].resize(e.nearest[view].len(), 0.0);
        }
        e.rows.retain(|row| row.passes);
        e.lost = 0;
        for row in &mut e.rows {
            row.held = true;
            if !row.outside {
                row.precision = self.precision(row.view, row.share, row.point);
                precision[row.view][row.point] = row.precision;
            }
        }
    }

    /// Twice the cost that [`OutlineProblem::assemble`] linearises.
    pub(crate) fn cost(&self, e: &Evaluation, settings: &Settings) -> f64 {
        let squared_scale = settings.scale_px * settings.scale_px;
        let factor = settings.stride as f64;
        let outside_weight = [0, 1].map(|view| self.outside_weight(e, view, settings));
        let (mut outside, mut robust) = (0.0, LogSum::default());
        for row in e.rows.iter().filter(|row| row.held) {
            if row.outside {
                outside += outside_weight[row.view] * row.distance * row.distance;
            } else {
                let r = row.distance - e.state.half_px[row.view];
                robust.add(r * r * row.precision / squared_scale);
            }
        }
        let lost = e.lost as f64 * (settings.reach_px * settings.reach_px / squared_scale).ln_1p();
        let sum = outside + factor * squared_scale * (robust.total() + lost);
        sum + smoothness(
            &e.state.spline,
            settings.lambda2,
            settings.lambda3,
            &self.local_smoothness,
        )
    }

    /// Weight of a sample of one view's curve outside its mask. All weigh the same: by the length that each
    /// has in its view, a hook seen from its front would be let go.
    fn outside_weight(&self, e: &Evaluation, view: usize, settings: &Settings) -> f64 {
        let chords = &e.chords[view];
        settings.outside_weight * chords.length_px() / (chords.points.len() - 1) as f64
    }

    /// Linearises the cost. Globals: the half thicknesses, then (if there are five) the shift and
    /// roll of view 2.
    pub(crate) fn assemble(
        &self,
        e: &Evaluation,
        settings: &Settings,
        normal: &mut NormalEquations,
    ) {
        normal.clear();
        let squared_scale = settings.scale_px * settings.scale_px;
        let factor = settings.stride as f64;
        let outside = [0, 1].map(|view| self.outside_weight(e, view, settings));
        // No operation is fused: the same sums on every machine.
        Arch::new().dispatch(AddRows { e, outside, factor, squared_scale, normal });
        normal.add_smoothness(
            &e.state.spline.control,
            settings.lambda2,
            settings.lambda3,
            &self.local_smoothness,
        );
    }
}

/// A sum of `ln(1 + x)`: many factors share one logarithm.
struct LogSum {
    sum: f64,
    product: f64,
}

impl Default for LogSum {
    fn default() -> Self {
        Self { sum: 0.0, product: 1.0 }
    }
}

impl LogSum {
    /// A product beyond this is a logarithm first; far enough from the largest number.
    const LARGE: f64 = 1e100;

    fn add(&mut self, x: f64) {
        self.product *= 1.0 + x;
        if self.product > Self::LARGE {
            self.sum += self.product.ln();
            self.product = 1.0;
        }
    }

    fn total(self) -> f64 {
        self.sum + self.product.ln()
    }
}

struct AddRows<'a> {
    e: &'a Evaluation,
    /// Weight of a row outside the mask, by view.
    outside: [f64; 2],
    /// Weight of a boundary point.
    factor: f64,
    squared_scale: f64,
    normal: &'a mut NormalEquations,
}

impl WithSimd for AddRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let globals = self.normal.globals();
        for row in self.e.rows.iter().filter(|row| row.held) {
            let mut global = [0.0; 5];
            global[2..].copy_from_slice(&row.nuisance);
            let (residual, weight) = if row.outside {
                (row.distance, self.outside[row.view])
            } else {
                global[row.view] = -1.0;
                let r = row.distance - self.e.state.half_px[row.view];
                let robust = 1.0 + r * r * row.precision / self.squared_scale;
                (r, self.factor * row.precision / robust)
            };
            let Row { span, basis, gradient, .. } = row;
            let global = &global[..globals];
            let row = LinearRow { span: *span, basis, gradient, global, residual, weight };
            self.normal.add(simd, &row);
        }
    }
}

/// `lambda2 |D2 c|² + lambda3 |D3 c|²`, the latter with the local factors.
pub(crate) fn smoothness(spline: &UniformSpline, lambda2: f64, lambda3: f64, local: &[f64]) -> f64 {
    let c = &spline.control;
    let second: f64 = c.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).norm_squared()).sum();
    let third: f64 = (0..c.len() - 3)
        .map(|k| {
            let factor = local.get(k).copied().unwrap_or(1.0);
            factor * third_difference(c, k).norm_squared()
        })
        .sum();
    lambda2 * second + lambda3 * third
}

/// `c[k + 3] - 3 c[k + 2] + 3 c[k + 1] - c[k]`.
pub(crate) fn third_difference(c: &[Vector3<f64>], k: usize) -> Vector3<f64> {
    c[k + 3] - c[k] + 3.0 * (c[k + 1] - c[k + 2])
}

#[cfg(test)]
mod tests {
    use accurate_geom::{Curve3, View1, View2};
    use accurate_synth::{CaseOptions, Family, generate};
    use proptest::prelude::*;

    use super::*;
    use crate::pose::pose;
    use crate::{Outline, OutlinePair};

    proptest! {
        /// Rounding of each factor is 1.1e-16 of it, of the sum as usual.
        #[test]
        fn one_logarithm_of_many_factors_is_the_sum_of_theirs(
            exponents in prop::collection::vec(-12.0..60.0f64, 0..400),
        ) {
            let (mut shared, mut one_by_one) = (LogSum::default(), 0.0);
            for x in exponents.iter().map(|e| 10f64.powf(*e)) {
                shared.add(x);
                one_by_one += x.ln_1p();
            }
            let tolerance = exponents.len() as f64 * (1.0 + one_by_one) * 2.0 * f64::EPSILON;
            prop_assert!((shared.total() - one_by_one).abs() <= tolerance);
        }
    }

    /// Half the cost is what `assemble` differentiates: by the envelope theorem the motion of the
    /// nearest points does not count, and neither does that of the weights' normals, which are held.
    #[test]
    fn the_gradient_is_the_derivative_of_the_cost_in_every_unknown() {
        // C-arm rigs have f_y < 0.
        for (family, index) in [(Family::Medium, 0), (Family::Carm, 1), (Family::SimPaper, 4)] {
            let case = generate(family, 1900, index, &CaseOptions::default()).unwrap();
            let one = Outline::<View1>::from_mask(case.masks[0].view()).unwrap();
            let two = Outline::<View2>::from_mask(case.masks[1].view()).unwrap();
            let pair = OutlinePair::new(&one, &two);
            let points: Vec<_> = case.truth.iter().step_by(25).copied().collect();
            let truth = Curve3::interpolate(&points).unwrap();
            let (mut problem, mut spline) = pose(&truth, &pair, &case.rig, 10.0).unwrap();
            problem.calibrating = true;
            for (k, c) in spline.control.iter_mut().enumerate() {
                // Half a px off, so that there is a gradient.
                c.y += 0.5 / problem.px_per_unit * (k as f64).sin();
            }
            let settings = Settings {
                reach_px: 3.0,
                scale_px: 0.7,
                stride: 1,
                lambda2: 0.1 * problem.px_per_unit.powi(2),
                lambda3: 0.3 * problem.px_per_unit.powi(2),
                outside_weight: 0.0,
                judged: false,
            };
            let nuisance = Nuisance { shift_px: [0.2, -0.1], roll: 1e-3 };
            let state = State { spline, half_px: [1.0, 1.2], nuisance };
            let mut e = problem.evaluation(state);
            problem.evaluate(&mut e, &settings).unwrap();
            let mut trial = problem.evaluation(e.state.clone());
            problem.renew_data(&mut e, &mut trial.precision);
            let controls = e.state.spline.control.len();
            let mut normal = NormalEquations::new(controls, 5).unwrap();
            problem.assemble(&e, &settings, &mut normal);
            let analytic = normal.gradient().to_vec();

            let mut cost_at = |unknown: usize, offset: f64| {
                trial.state.clone_from(&e.state);
                let s = &mut trial.state;
                match unknown.checked_sub(3 * controls) {
                    None => s.spline.control[unknown / 3][unknown % 3] += offset,
                    Some(view @ (0 | 1)) => s.half_px[view] += offset,
                    Some(axis @ (2 | 3)) => s.nuisance.shift_px[axis - 2] += offset,
                    Some(_) => s.nuisance.roll += offset,
                }
                problem.evaluate(&mut trial, &settings).unwrap();
                0.5 * problem.cost(&trial, &settings)
            };
            for (unknown, &gradient) in analytic.iter().enumerate() {
                // A move of 0.003 px; the roll acts at an arm of about 200 px.
                let h = match unknown.checked_sub(3 * controls) {
                    None => 0.003 / problem.px_per_unit,
                    Some(4) => 1.5e-5,
                    Some(_) => 0.003,
                };
                let numeric = (cost_at(unknown, h) - cost_at(unknown, -h)) / (2.0 * h);
                // Per px of motion a control point moves some 50 boundary points by up to 1 px each.
                // Those whose nearest point jumps to another strand within the step, and the second
                // order of the parameter step, are allowed 2 % of that scale.
                let scale = 0.003 / h * if unknown < 3 * controls { 50.0 } else { 1000.0 };
                assert!(
                    (numeric - gradient).abs() < 0.02 * scale + 0.02 * gradient.abs(),
                    "{family} unknown {unknown} of {}: {numeric} {gradient}",
                    analytic.len()
                );
            }
        }
    }
}
