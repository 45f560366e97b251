use std::fmt;

use serde::Serialize;

use super::score::Candidate;

/// A reason to doubt a reconstruction from masks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Suspicion {
    /// Part of an outline is not explained by the curve.
    UnexplainedOutline,
    /// Part of the curve is not shown by a mask.
    OutsideMask,
    /// The outlines lie farther from the curve than whole pixels explain.
    Misfit,
    /// Another order of the strands explains the outlines almost as well.
    Ambiguous,
    /// The walks of the two views do not agree epipolarly.
    ViewsDisagree,
    /// Part of a skeleton is not walked along.
    Uncovered,
}

/// Thresholds of the reasons; calibrated on generated wires (see `examples/joint_study.rs`).
const UNEXPLAINED: f64 = 0.3;
const OUTSIDE: f64 = 0.3;
const CHI_PER_POINT_PX2: f64 = 0.065;
const MARGIN: f64 = 0.0;
const DISTANCE_PX: f64 = 0.6;
const COVERAGE: f64 = 0.97;

/// The reasons to doubt a final choice, in the order of [`Suspicion`].
pub(crate) fn suspicions(chosen: &Candidate, margin: f64, coverage: [f64; 2]) -> Vec<Suspicion> {
    let judgement = &chosen.fit.judgement;
    let unexplained = chosen.misfit - judgement.outside;
    [
        (unexplained > UNEXPLAINED, Suspicion::UnexplainedOutline),
        (judgement.outside > OUTSIDE, Suspicion::OutsideMask),
        (judgement.chi_per_point() > CHI_PER_POINT_PX2, Suspicion::Misfit),
        (margin < MARGIN, Suspicion::Ambiguous),
        (chosen.mean_distance_px > DISTANCE_PX, Suspicion::ViewsDisagree),
        (coverage[0].min(coverage[1]) < COVERAGE, Suspicion::Uncovered),
    ]
    .into_iter()
    .filter_map(|(holds, reason)| holds.then_some(reason))
    .collect()
}

impl fmt::Display for Suspicion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::UnexplainedOutline => "unexplained outline",
            Self::OutsideMask => "curve outside the mask",
            Self::Misfit => "misfit",
            Self::Ambiguous => "ambiguous order",
            Self::ViewsDisagree => "views disagree",
            Self::Uncovered => "skeleton not covered",
        })
    }
}
