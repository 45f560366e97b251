use accurate_fit::{
    AdaptiveParams, CalibrationEstimate, OutlineFit, OutlineFitParams, fit_outlines,
    fit_outlines_adaptively, fit_outlines_and_calibration,
};
use accurate_geom::{Curve3, Rig};

use super::score::Candidate;
use super::search::Search;

/// For a start within a few px: to tell the good from the bad, not to the end.
pub(crate) const PLAIN: OutlineFitParams =
    OutlineFitParams { tolerance: 1e-3, ..OutlineFitParams::DEFAULT };

/// For a start that may run along the wrong strand for a stretch.
pub(crate) const ANNEALED: OutlineFitParams =
    OutlineFitParams { tolerance: 1e-3, ..OutlineFitParams::ANNEALED };

/// For a start that is a fit already: the last settings from the first step on.
pub(crate) const SETTLED: OutlineFitParams = OutlineFitParams {
    cauchy_scale_start_px: OutlineFitParams::DEFAULT.cauchy_scale_px,
    subsample: false,
    iterations: 8,
    // Less than a tenth of what scores are compared by.
    tolerance: 3e-4,
    ..OutlineFitParams::DEFAULT
};

/// The same for curves that bend more than the usual knots and smoothness allow.
pub(crate) const FINE: OutlineFitParams = OutlineFitParams {
    iterations: SETTLED.iterations,
    tolerance: SETTLED.tolerance,
    ..OutlineFitParams::FINE
};

/// Steps of the last fit before those that find its smoothness too.
const LAST_ITERATIONS: usize = 3;

/// A margin beyond this is as good as any larger one.
const CLEAR: f64 = 5.0;

impl Search<'_> {
    pub(crate) fn fit(&self, start: &Curve3, params: &OutlineFitParams) -> Option<OutlineFit> {
        fit_outlines(start, self.outlines, self.rig, params).ok()
    }

    /// Another curve of the same walks, from a start of its own; to be carried on with `settings`.
    pub(crate) fn anew(
        &self,
        candidate: &Candidate,
        start: &Curve3,
        params: &OutlineFitParams,
        settings: OutlineFitParams,
    ) -> Option<Candidate> {
        let fit = self.fit(start, params)?;
        let mut other = candidate.refitted(fit, settings, self.rig);
        other.good = other.is_good(self.params);
        Some(other)
    }

    /// The candidate carried on with these settings.
    fn carried_on(&self, candidate: &Candidate, settings: OutlineFitParams) -> Option<Candidate> {
        let fit = self.fit(&candidate.fit.curve, &settings)?;
        Some(candidate.refitted(fit, settings, self.rig))
    }

    /// The candidate with knots and smoothness for curves that bend much: a J tip bends more than the usual
    /// ones can.
    pub(crate) fn finer(&self, candidate: &Candidate) -> Option<Candidate> {
        if candidate.settings == FINE && candidate.rests {
            return Some(candidate.clone());
        }
        self.carried_on(candidate, FINE)
    }

    /// The candidate with the usual knots and smoothness again, to stand beside others that have them.
    pub(crate) fn usual(&self, candidate: Candidate) -> Candidate {
        if candidate.settings == SETTLED {
            return candidate;
        }
        self.carried_on(&candidate, SETTLED).unwrap_or(candidate)
    }

    /// The fit carried on with its last settings until it rests; ranking before that picks wrong
    /// loops. What cannot come near the score `to_beat` at its pace is left.
    pub(crate) fn converged(&self, candidate: &Candidate, to_beat: f64) -> Candidate {
        const ROUNDS: usize = 4;
        const REST: f64 = 0.3;
        let mut best = candidate.clone();
        if best.rests {
            return best;
        }
        for round in 1..=ROUNDS {
            let Some(next) = self.carried_on(&best, best.settings) else { break };
            let gain = best.score - next.score;
            let rests = gain < REST || next.fit.converged;
            if gain > 0.0 {
                best = next;
            }
            best.rests = rests;
            // Later rounds gain less than the ones before.
            let hope = gain * (ROUNDS - round) as f64;
            if best.rests || best.score - hope > to_beat + CLEAR {
                break;
            }
        }
        best
    }

    /// The candidate with its last, adaptive fit under the given cameras, and what that says about the
    /// calibration if it is among the unknowns; as it is if there is no such fit.
    pub(crate) fn last_fit(
        &self,
        candidate: &Candidate,
        given_rig: &Rig,
    ) -> (Candidate, Option<CalibrationEstimate>) {
        // The steps of the smoothness move the curve as well.
        let settings = &OutlineFitParams { iterations: LAST_ITERATIONS, ..candidate.settings };
        let start = &candidate.fit.curve;
        let (outlines, adaptive) = (self.outlines, AdaptiveParams::DEFAULT);
        let found = match &self.params.calibration {
            Some(priors) => fit_outlines_and_calibration(
                start, outlines, given_rig, settings, &adaptive, priors,
            )
            .map(|found| (found.fit, Some(found.calibration))),
            None => fit_outlines_adaptively(start, outlines, given_rig, settings, &adaptive)
                .map(|fit| (fit, None)),
        };
        found.map_or_else(
            |_| (candidate.clone(), None),
            |(fit, calibration)| {
                (candidate.refitted(fit, candidate.settings, given_rig), calibration)
            },
        )
    }
}
