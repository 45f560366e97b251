use std::fmt;

use accurate_fit::OutlineFit;
use accurate_geom::Rig;
use serde::Serialize;

use super::score::Candidate;
use super::shape::px_per_unit;

/// A reason to doubt a reconstruction.
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
    /// The curve is weakly seen somewhere, as along epipolar lines.
    Uncertain,
    /// Ordered points were matched, but the match is no basis for an adjustment.
    NotAdjusted,
}

/// Thresholds of the reasons, chosen on 300 generated pairs (seeds 1021 to 1025, `carm`, `medium` with
/// discs or turned, `hard`; 11 of them wrong by more than 5 px). docs/deviations.md shows what they
/// catch and what they cost: a result without a reason is likely, not certain, to be right.
const UNEXPLAINED: f64 = 0.07;
const OUTSIDE: f64 = 0.1;
const CHI_PER_POINT_PX2: f64 = 0.068;
const MARGIN: f64 = 0.9;
const DISTANCE_PX: f64 = 0.4;
const COVERAGE: f64 = 0.9;
const SIGMA_PX: f64 = 1.9;

/// The reasons to doubt a final choice, in the order of [`Suspicion`].
pub(crate) fn suspicions(
    chosen: &Candidate,
    margin: f64,
    coverage: [f64; 2],
    rig: &Rig,
) -> Vec<Suspicion> {
    let judgement = &chosen.fit.judgement;
    let unexplained = chosen.misfit - judgement.outside;
    [
        (unexplained > UNEXPLAINED, Suspicion::UnexplainedOutline),
        (judgement.outside > OUTSIDE, Suspicion::OutsideMask),
        (judgement.chi_per_point() > CHI_PER_POINT_PX2, Suspicion::Misfit),
        (margin < MARGIN, Suspicion::Ambiguous),
        (chosen.mean_distance_px > DISTANCE_PX, Suspicion::ViewsDisagree),
        (coverage[0].min(coverage[1]) < COVERAGE, Suspicion::Uncovered),
        (largest_sigma_px(&chosen.fit, rig) > SIGMA_PX, Suspicion::Uncertain),
    ]
    .into_iter()
    .filter_map(|(holds, reason)| holds.then_some(reason))
    .collect()
}

/// The largest standard deviation of the curve across its own direction, px; 0 if unknown.
fn largest_sigma_px(fit: &OutlineFit, rig: &Rig) -> f64 {
    const SAMPLES: usize = 200;
    let Some(covariance) = &fit.covariance else { return 0.0 };
    let curve = &fit.curve;
    let variance = curve
        .uniform_parameters(SAMPLES)
        .into_iter()
        .map(|t| covariance.across(curve, t).1.symmetric_eigenvalues().max())
        .fold(0.0, f64::max);
    variance.sqrt() * px_per_unit(&curve.sample(16), rig)
}

impl fmt::Display for Suspicion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::UnexplainedOutline => "unexplained outline",
            Self::OutsideMask => "curve outside the mask",
            Self::Misfit => "misfit",
            Self::Uncertain => "weakly seen",
            Self::Ambiguous => "ambiguous order",
            Self::ViewsDisagree => "views disagree",
            Self::Uncovered => "skeleton not covered",
            Self::NotAdjusted => "match not adjusted",
        })
    }
}
