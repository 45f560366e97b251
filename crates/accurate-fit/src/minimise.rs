use crate::FitError;
use crate::normal::NormalEquations;
use crate::outline_problem::{Evaluation, OutlineProblem, Settings, State};

/// Levenberg-Marquardt on an [`OutlineProblem`], one iteration at a time, with its memory.
#[derive(Debug)]
pub(crate) struct Minimiser<'a> {
    pub(crate) problem: OutlineProblem<'a>,
    pub(crate) current: Evaluation,
    trial: Evaluation,
    pub(crate) normal: NormalEquations,
    /// Fraction of the diagonal that is added to it.
    damping: f64,
    evaluated: Option<Settings>,
    /// Whether the last step was taken: `trial` is the state before it.
    stepped: bool,
    priors: Priors,
}

/// Standard deviations of the nuisance parameters, in units of the residual noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Priors {
    /// Weights of `du`, `dv`, roll; `None`: view 2 is exact.
    pub(crate) nuisance_weights: Option<[f64; 3]>,
}

/// A half thickness may leave its first guess by this factor at most: what is beyond is a strand
/// that explains two.
const HALF_RANGE: f64 = 1.7;
const DAMPING: [f64; 2] = [1e-4, 1e3];

impl<'a> Minimiser<'a> {
    pub(crate) fn new(
        problem: OutlineProblem<'a>,
        start: State,
        damping: f64,
        priors: Priors,
    ) -> Result<Self, FitError> {
        let globals = if priors.nuisance_weights.is_some() { 5 } else { 2 };
        let normal = NormalEquations::new(start.spline.control.len(), globals)?;
        let current = problem.evaluation(start);
        let trial = current.clone();
        Ok(Self {
            problem,
            current,
            trial,
            normal,
            damping,
            evaluated: None,
            stepped: false,
            priors,
        })
    }

    /// What the priors of the nuisance parameters add to twice the cost.
    pub(crate) fn prior_cost(&self, e: &Evaluation) -> f64 {
        let Some(weights) = self.priors.nuisance_weights else { return 0.0 };
        let n = e.state.nuisance;
        [n.shift_px[0], n.shift_px[1], n.roll].iter().zip(weights).map(|(v, w)| w * v * v).sum()
    }

    /// Brings residuals and association of the current state up to date with `settings`.
    pub(crate) fn refresh(&mut self, settings: &Settings) -> Result<(), FitError> {
        let fresh = self.evaluated.is_some_and(|was| {
            was.stride == settings.stride
                && was.reach_px == settings.reach_px
                && (was.judged || !settings.judged)
        });
        if !fresh {
            self.current.precision = Default::default();
            self.problem.evaluate(&mut self.current, settings)?;
        }
        self.evaluated = Some(*settings);
        Ok(())
    }

    /// Twice the cost of the current state.
    pub(crate) fn cost(&mut self, settings: &Settings) -> Result<f64, FitError> {
        self.refresh(settings)?;
        Ok(self.problem.cost(&self.current, settings) + self.prior_cost(&self.current))
    }

    /// Normal equations at the current state.
    pub(crate) fn assemble(&mut self, settings: &Settings) -> Result<(), FitError> {
        self.refresh(settings)?;
        self.problem.assemble(&self.current, settings, &mut self.normal);
        let Self { problem, current, normal, priors, .. } = self;
        for view in 0..2 {
            // A weak tie to the first guess: a view whose points are all out of reach must not
            // leave its thickness undefined.
            let guess = problem.outlines[view].half_thickness_px;
            normal.add_prior(view, current.state.half_px[view] - guess, 1.0);
        }
        if let Some(weights) = priors.nuisance_weights {
            let n = current.state.nuisance;
            for (k, (v, w)) in
                [n.shift_px[0], n.shift_px[1], n.roll].into_iter().zip(weights).enumerate()
            {
                normal.add_prior(2 + k, v, w);
            }
        }
        Ok(())
    }

    /// Goes on from another state.
    pub(crate) fn restart(&mut self, state: State) {
        self.current.state = state;
        self.evaluated = None;
        self.stepped = false;
    }

    /// Takes the last step back, if there was one.
    pub(crate) fn undo(&mut self) {
        if std::mem::take(&mut self.stepped) {
            std::mem::swap(&mut self.current, &mut self.trial);
        }
    }

    /// One accepted step, or none if no damping makes the cost smaller. Returns the relative drop
    /// of the cost.
    pub(crate) fn step(&mut self, settings: &Settings) -> Result<f64, FitError> {
        self.refresh(settings)?;
        self.stepped = false;
        // Fixed during the step: costs before and after must be sums with the same weights.
        self.problem.renew_data(&mut self.current, &mut self.trial.precision);
        let before = self.cost(settings)?;
        self.assemble(settings)?;
        let with_nuisance = self.normal.globals() == 5;
        for _ in 0..5 {
            match self.normal.solve(self.damping) {
                Ok(step) => {
                    let controls = 3 * self.current.state.spline.control.len();
                    self.trial.state.clone_from(&self.current.state);
                    let state = &mut self.trial.state;
                    state.spline.add(&step[..controls]);
                    for view in 0..2 {
                        let guess = self.problem.outlines[view].half_thickness_px;
                        state.half_px[view] = (state.half_px[view] + step[controls + view])
                            .clamp(guess / HALF_RANGE, guess * HALF_RANGE);
                    }
                    if with_nuisance {
                        state.nuisance.shift_px[0] += step[controls + 2];
                        state.nuisance.shift_px[1] += step[controls + 3];
                        state.nuisance.roll += step[controls + 4];
                    }
                    // A step behind a camera is a step too long.
                    if self.problem.evaluate(&mut self.trial, settings).is_ok() {
                        let after =
                            self.problem.cost(&self.trial, settings) + self.prior_cost(&self.trial);
                        if after <= before {
                            std::mem::swap(&mut self.current, &mut self.trial);
                            self.stepped = true;
                            self.damping = (self.damping / 4.0).max(DAMPING[0]);
                            return Ok((before - after) / before.max(f64::MIN_POSITIVE));
                        }
                    }
                }
                Err(error) if self.damping >= DAMPING[1] => return Err(error),
                Err(_) => {}
            }
            self.damping = (self.damping * 8.0).min(DAMPING[1]);
        }
        Ok(0.0)
    }
}
