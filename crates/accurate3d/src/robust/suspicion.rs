use std::fmt;

use serde::Serialize;

use super::evidence::Evidence;
use super::hairpins::{DOUBLED_PX, KINKED};
use super::score::allowance;

/// A reason to doubt a reconstruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
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
    /// Part of a skeleton is not walked along, or parts of both ordered curves have no partners.
    Uncovered,
    /// The curve is weakly seen somewhere, as along epipolar lines.
    Uncertain,
    /// The curve runs back over itself in both views, as hardly any body does.
    TurnsBack,
    /// An end of the curve goes on, or was cut off where it went on, by one view's segmentation alone: the
    /// pictures do not show it.
    EndNotShown,
    /// Ordered points were matched, but the match is no basis for an adjustment.
    NotAdjusted,
    /// Ordered points jump to and fro, as the pixels of a skeleton do row by row.
    NotInOrder,
}

/// Limits of the [`Evidence`], beyond which it is a reason for doubt: a result without a reason is
/// likely, not certain, to be right. docs/decisions/limits-of-doubt.md (masks) and
/// docs/segmentation.md (maps) show what they catch and what they cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubtLimits {
    /// Most of [`Evidence::unexplained`], for up to 3,000 boundary points; for more in proportion.
    pub unexplained: f64,
    /// The same where a walk takes bridges: the faces of what hides the body are no one's outline.
    pub unexplained_at_bridges: f64,
    /// Most of [`Evidence::chi_per_point`], px².
    pub chi_per_point_px2: f64,
    /// Least [`Evidence::margin`].
    pub margin: f64,
    /// Most of [`Evidence::sigma_px`], px, for as many; for more with their square root: of more stretches
    /// one is seen worse.
    pub sigma_px: f64,
}

impl DoubtLimits {
    /// Of masks that hold the body, after all looks: chosen on 1,240 generated pairs of tuning seeds
    /// (docs/decisions/limits-of-doubt.md).
    pub const MASKS: Self = Self {
        unexplained: 0.12,
        unexplained_at_bridges: 0.6,
        chi_per_point_px2: 0.068,
        margin: 2.0,
        sigma_px: 1.1,
    };

    /// The same where the calibration is an unknown: what is not known of it adds to every depth.
    pub const MASKS_WITH_CALIBRATION: Self = Self { sigma_px: 1.9, ..Self::MASKS };

    /// Of the same masks, beyond which a harder look is worth its time: most of what is doubted then is
    /// mended, or was right.
    pub(crate) const MASKS_TO_LOOK_ON: Self = Self {
        unexplained: 0.04,
        unexplained_at_bridges: 0.7,
        chi_per_point_px2: 0.068,
        margin: 3.0,
        sigma_px: 1.9,
    };

    /// Of a network's probability maps, which add short pieces to right curves: chosen on 340 generated
    /// pairs of images of tuning seeds (`medium`, `carm`, `easy`; 31 of them wrong by more than 5 px), the
    /// residual on 300 of `carm` (docs/segmentation.md).
    pub const MAPS: Self = Self {
        unexplained: 1.0,
        unexplained_at_bridges: 1.0,
        chi_per_point_px2: 0.068,
        margin: 2.0,
        sigma_px: 1.9,
    };

    /// Of the same maps, beyond which more is asked of the images before the choice is final: narrower,
    /// for asking costs time and no trust.
    const MAPS_TO_ASK_ON: Self = Self {
        unexplained: 0.5,
        unexplained_at_bridges: 0.5,
        chi_per_point_px2: 0.055,
        margin: 5.0,
        sigma_px: 1.0,
    };
}

/// Where a walk takes bridges, less of the outline need be explained, unless the walks go back over so
/// much of the body: then the bridges are the wrong ones.
const OVERLAP_AT_BRIDGES: f64 = 0.25;
const OUTSIDE: f64 = 0.1;
const DISTANCE_PX: f64 = 0.4;
const UNCOVERED: f64 = 0.1;

/// A rival this close is worth a second look, though most of those that stay behind are no reason for
/// doubt after it.
const MARGIN_TO_LOOK_AGAIN: f64 = 4.0;

impl Evidence {
    /// The reasons to doubt a final choice, in the order of [`Suspicion`].
    pub fn suspicions(&self, limits: &DoubtLimits) -> Vec<Suspicion> {
        let bridged = self.bridges > 0 && self.overlap < OVERLAP_AT_BRIDGES;
        let most = if bridged { limits.unexplained_at_bridges } else { limits.unexplained };
        let allowance = allowance(self.boundary_points);
        [
            (self.unexplained > allowance * most, Suspicion::UnexplainedOutline),
            (self.outside > OUTSIDE, Suspicion::OutsideMask),
            (self.chi_per_point > limits.chi_per_point_px2, Suspicion::Misfit),
            (has_rival(self, limits.margin), Suspicion::Ambiguous),
            (self.walks_distance_px > DISTANCE_PX, Suspicion::ViewsDisagree),
            (self.uncovered > UNCOVERED, Suspicion::Uncovered),
            (self.sigma_px > allowance.sqrt() * limits.sigma_px, Suspicion::Uncertain),
            (self.doubled_px > DOUBLED_PX, Suspicion::TurnsBack),
        ]
        .into_iter()
        .filter_map(|(holds, reason)| holds.then_some(reason))
        .collect()
    }
}

/// Whether a first choice is worth a second look: by the limits of masks in either case, for what a
/// map leaves unexplained may be explained better.
pub(crate) fn calls_for_a_second_look(evidence: &Evidence) -> bool {
    has_rival(evidence, MARGIN_TO_LOOK_AGAIN)
        || evidence.kinks > KINKED
        || !evidence.suspicions(&DoubtLimits::MASKS_TO_LOOK_ON).is_empty()
}

/// Walks this much dearer than the cheapest of each view are worth asking on, though the curves of most are
/// right.
const BEHIND_TO_ASK_ON: f64 = 2.0;

/// Whether the choice among the curves of maps is worth asking the pictures' grey levels about.
pub(crate) fn calls_for_the_pictures(evidence: &Evidence) -> bool {
    is_worth_asking_on(evidence, |_| true)
}

/// Whether the images are worth segmenting again with more care: noise and depth that is weakly seen
/// stay with any segmentation.
pub(crate) fn calls_for_a_careful_look(evidence: &Evidence) -> bool {
    is_worth_asking_on(evidence, |reason| {
        !matches!(reason, Suspicion::Misfit | Suspicion::Uncertain)
    })
}

fn is_worth_asking_on(evidence: &Evidence, counts: fn(&Suspicion) -> bool) -> bool {
    evidence.walks_behind > BEHIND_TO_ASK_ON
        || evidence.kinks > KINKED
        || evidence.suspicions(&DoubtLimits::MAPS_TO_ASK_ON).iter().any(counts)
}

fn has_rival(evidence: &Evidence, closer_than: f64) -> bool {
    evidence.margin.is_some_and(|margin| margin < closer_than)
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
            Self::Uncovered => "part of the body left out",
            Self::TurnsBack => "turns back",
            Self::EndNotShown => "end not shown",
            Self::NotAdjusted => "match not adjusted",
            Self::NotInOrder => "points in no order",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_masks(evidence: &Evidence) -> Vec<Suspicion> {
        evidence.suspicions(&DoubtLimits::MASKS)
    }

    const GOOD: Evidence = Evidence {
        boundary_points: 2600,
        unexplained: 0.0,
        outside: 0.0,
        chi_per_point: 1.0 / 18.0,
        worst_chi_per_point: 0.08,
        margin: None,
        walks_distance_px: 0.2,
        uncovered: 0.0,
        walks_behind: 0.0,
        overlap: 0.0,
        bridges: 0,
        junctions: 0,
        sigma_px: 0.3,
        along_epipolar_line: 0.0,
        last_move_px: 0.1,
        bending: 0.1,
        kinks: 0.0,
        doubled_px: 0.0,
    };

    #[test]
    fn every_reason_is_given_for_its_own_evidence_and_no_other() {
        assert!(of_masks(&GOOD).is_empty());
        let cases = [
            (Evidence { unexplained: 0.2, ..GOOD }, Suspicion::UnexplainedOutline),
            (Evidence { outside: 0.2, ..GOOD }, Suspicion::OutsideMask),
            (Evidence { chi_per_point: 0.1, ..GOOD }, Suspicion::Misfit),
            (Evidence { margin: Some(0.1), ..GOOD }, Suspicion::Ambiguous),
            (Evidence { walks_distance_px: 2.0, ..GOOD }, Suspicion::ViewsDisagree),
            (Evidence { uncovered: 0.5, ..GOOD }, Suspicion::Uncovered),
            (Evidence { sigma_px: 5.0, ..GOOD }, Suspicion::Uncertain),
        ];
        for (evidence, reason) in cases {
            assert_eq!(of_masks(&evidence), [reason]);
        }
    }

    #[test]
    fn a_long_outline_may_leave_more_unexplained_and_be_seen_worse() {
        let long = Evidence { boundary_points: 9000, unexplained: 0.3, sigma_px: 1.8, ..GOOD };
        assert!(of_masks(&long).is_empty());
        let shorter = Evidence { boundary_points: 6000, ..long };
        assert_eq!(of_masks(&shorter), [Suspicion::UnexplainedOutline, Suspicion::Uncertain]);
        // No less is asked of short ones.
        let short = Evidence { boundary_points: 800, unexplained: 0.1, sigma_px: 1.0, ..GOOD };
        assert!(of_masks(&short).is_empty());
    }

    #[test]
    fn an_unknown_calibration_may_leave_depths_less_sure() {
        let evidence = Evidence { sigma_px: 1.5, ..GOOD };
        assert_eq!(of_masks(&evidence), [Suspicion::Uncertain]);
        assert!(evidence.suspicions(&DoubtLimits::MASKS_WITH_CALIBRATION).is_empty());
    }

    #[test]
    fn a_rival_that_stays_behind_calls_for_a_second_look_only() {
        let rival = |margin| Evidence { margin: Some(margin), ..GOOD };
        let close = 0.5 * (DoubtLimits::MASKS.margin + MARGIN_TO_LOOK_AGAIN);
        assert!(of_masks(&rival(close)).is_empty());
        assert!(calls_for_a_second_look(&rival(close)));
        assert!(!calls_for_a_second_look(&rival(MARGIN_TO_LOOK_AGAIN)));
        assert!(calls_for_a_second_look(&Evidence { outside: 0.2, ..GOOD }));
    }

    #[test]
    fn what_runs_back_over_itself_is_doubted_and_a_kink_looked_at_harder() {
        let doubled = Evidence { doubled_px: DOUBLED_PX + 1.0, ..GOOD };
        for limits in [DoubtLimits::MASKS, DoubtLimits::MAPS] {
            assert_eq!(doubled.suspicions(&limits), [Suspicion::TurnsBack]);
        }
        // The points of a map lie nearer than whole pixels.
        let calm = Evidence { chi_per_point: 0.04, ..GOOD };
        let kinked = Evidence { kinks: KINKED + 0.1, ..calm };
        assert!(kinked.suspicions(&DoubtLimits::MAPS).is_empty());
        for calls in [calls_for_a_second_look, calls_for_a_careful_look, calls_for_the_pictures] {
            assert!(calls(&kinked) && !calls(&calm));
        }
    }

    #[test]
    fn cut_faces_at_bridges_are_no_reason_unless_the_walks_run_back_over_the_body() {
        let bridged = Evidence { unexplained: 0.4, bridges: 2, ..GOOD };
        assert!(of_masks(&bridged).is_empty());
        let back = Evidence { overlap: 0.4, ..bridged };
        assert_eq!(of_masks(&back), [Suspicion::UnexplainedOutline]);
        let much = Evidence { unexplained: 2.0, ..bridged };
        assert_eq!(of_masks(&much), [Suspicion::UnexplainedOutline]);
    }

    #[test]
    fn a_map_may_leave_short_pieces_unexplained() {
        let pieces = Evidence { unexplained: 0.5, ..GOOD };
        assert!(pieces.suspicions(&DoubtLimits::MAPS).is_empty());
        assert_eq!(of_masks(&pieces), [Suspicion::UnexplainedOutline]);
    }

    #[test]
    fn images_are_asked_on_before_there_is_a_reason_for_doubt() {
        let maps = Evidence { chi_per_point: 0.04, ..GOOD };
        assert!(!calls_for_the_pictures(&maps) && !calls_for_a_careful_look(&maps));
        for evidence in [
            Evidence { unexplained: 0.7, ..maps },
            Evidence { margin: Some(4.0), ..maps },
            Evidence { walks_behind: 3.0, ..maps },
        ] {
            assert!(evidence.suspicions(&DoubtLimits::MAPS).is_empty());
            assert!(calls_for_the_pictures(&evidence) && calls_for_a_careful_look(&evidence));
        }
        // Noise and depth stay as they are in another segmentation.
        for evidence in
            [Evidence { sigma_px: 1.5, ..maps }, Evidence { chi_per_point: 0.057, ..maps }]
        {
            assert!(evidence.suspicions(&DoubtLimits::MAPS).is_empty());
            assert!(calls_for_the_pictures(&evidence) && !calls_for_a_careful_look(&evidence));
        }
    }
}
