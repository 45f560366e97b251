use crate::{Diagnostics, Suspicion};

impl Diagnostics {
    /// The [`suspicions`](Self::suspicions) for a reader, each with the number that it rests on where one
    /// number says it: `weakly seen (standard deviation up to 1.4 px)`.
    pub fn reasons(&self) -> Vec<String> {
        let reason = |suspicion: &Suspicion| match self.number_behind(*suspicion) {
            Some(number) => format!("{suspicion} ({number})"),
            None => suspicion.to_string(),
        };
        self.suspicions.iter().map(reason).collect()
    }

    fn number_behind(&self, suspicion: Suspicion) -> Option<String> {
        let evidence = self.outline.map(|outline| outline.evidence);
        match suspicion {
            Suspicion::UnexplainedOutline => {
                evidence.map(|e| format!("{:.2}, 0 at the truth", e.unexplained))
            }
            Suspicion::OutsideMask => evidence.map(|e| format!("{:.2}, 0 at the truth", e.outside)),
            Suspicion::Misfit => match (evidence, self.points_fit) {
                (Some(e), _) => Some(format!("mean square {:.3} px²", e.chi_per_point)),
                (None, Some(fit)) => Some(format!("{:.1} times the noise", fit.chi2_per_point)),
                (None, None) => None,
            },
            Suspicion::Ambiguous => self.ambiguity(),
            Suspicion::ViewsDisagree => {
                Some(format!("mean epipolar distance {:.2} px", self.mean_epipolar_distance_px))
            }
            Suspicion::Uncovered => {
                // Of given points, which are their own trace, the larger part that has partners decides.
                let covered = match self.trace_coverage {
                    [1.0, 1.0] => self.matched_fraction[0].max(self.matched_fraction[1]),
                    [one, two] => one.min(two),
                };
                let uncovered = evidence.map_or(1.0 - covered, |e| e.uncovered);
                Some(format!("{:.0} %", 100.0 * uncovered))
            }
            Suspicion::Uncertain => {
                let of_points = self.points_fit.map(|fit| fit.sigma_px);
                let sigma_px = evidence.map(|e| e.sigma_px).or(of_points);
                sigma_px.map(|px| format!("standard deviation up to {px:.1} px"))
            }
            Suspicion::TurnsBack => {
                evidence.map(|e| format!("over {:.0} px upon itself in both views", e.doubled_px))
            }
            Suspicion::EndNotShown => self.grey_levels.as_ref().and_then(|found| {
                let [begin, end] = found.cut_px;
                let cut_px = begin + end;
                if cut_px > 0.0 {
                    return Some(format!("{cut_px:.0} px were cut off"));
                }
                found.lacking_px.map(|px| format!("{px:.0} px are lacking in pictures and maps"))
            }),
            Suspicion::NotInOrder => Some(
                "many lie nearer to others than to those beside them in the list; `accurate trace` orders \
                 a mask"
                    .to_owned(),
            ),
            Suspicion::NotAdjusted => self.not_adjusted.clone(),
        }
    }

    /// Whether two segmentations agree decides about images, else the likeliest rival.
    fn ambiguity(&self) -> Option<String> {
        if let Some(px) = self.careful_look.and_then(|look| look.apart_px) {
            return Some(format!("two segmentations are {px:.0} px apart"));
        }
        let margin = self.outline.and_then(|outline| outline.margin);
        let behind = margin.map(|margin| format!("the likeliest other one is {margin:.1} behind"));
        behind.or_else(|| {
            self.direction_margin_px
                .map(|px| format!("another match costs {px:.2} px a point more"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CarefulLook, Evidence, OutlineDiagnostics, PointsDiagnostics};

    const FOUND: Diagnostics = Diagnostics {
        mean_epipolar_distance_px: 0.52,
        max_epipolar_distance_px: None,
        trace_coverage: [1.0, 0.9],
        trace_jumps: [0; 2],
        matched_fraction: [1.0; 2],
        view2_reversed: false,
        dropped_pairs: 0,
        along_epipolar_line: 0.0,
        suspicions: Vec::new(),
        outline: None,
        grey_levels: None,
        calibration: None,
        not_adjusted: None,
        points_fit: None,
        direction_margin_px: None,
        closed: false,
        careful_look: None,
    };

    const EVIDENCE: Evidence = Evidence {
        boundary_points: 2600,
        unexplained: 0.213,
        outside: 0.3,
        chi_per_point: 0.0712,
        worst_chi_per_point: 0.1,
        margin: Some(1.26),
        walks_distance_px: 0.52,
        uncovered: 0.14,
        walks_behind: 0.0,
        overlap: 0.0,
        bridges: 0,
        junctions: 0,
        sigma_px: 1.43,
        along_epipolar_line: 0.0,
        last_move_px: 0.1,
        bending: 0.1,
        kinks: 0.0,
        doubled_px: 0.0,
    };

    fn outline() -> OutlineDiagnostics {
        let Evidence { unexplained, outside, chi_per_point, margin, .. } = EVIDENCE;
        let evidence = EVIDENCE;
        OutlineDiagnostics {
            unexplained,
            outside,
            chi_per_point,
            margin,
            fits: 4,
            strays_px: [0; 2],
            evidence,
        }
    }

    #[test]
    fn a_suspicion_on_masks_comes_with_the_number_that_its_limit_is_about() {
        let suspicions = vec![
            Suspicion::UnexplainedOutline,
            Suspicion::OutsideMask,
            Suspicion::Misfit,
            Suspicion::Ambiguous,
            Suspicion::ViewsDisagree,
            Suspicion::Uncovered,
            Suspicion::Uncertain,
        ];
        let found = Diagnostics { suspicions, outline: Some(outline()), ..FOUND };
        let expected = [
            "unexplained outline (0.21, 0 at the truth)",
            "curve outside the mask (0.30, 0 at the truth)",
            "misfit (mean square 0.071 px²)",
            "ambiguous order (the likeliest other one is 1.3 behind)",
            "views disagree (mean epipolar distance 0.52 px)",
            "part of the body left out (14 %)",
            "weakly seen (standard deviation up to 1.4 px)",
        ];
        assert_eq!(found.reasons(), expected);
        assert!(Diagnostics { suspicions: Vec::new(), ..found }.reasons().is_empty());
    }

    #[test]
    fn of_images_looked_at_twice_the_distance_of_both_curves_is_told_if_there_are_two() {
        let looked = |apart_px| Diagnostics {
            suspicions: vec![Suspicion::Ambiguous],
            outline: Some(outline()),
            careful_look: Some(CarefulLook { taken: false, apart_px }),
            ..FOUND
        };
        assert_eq!(
            looked(Some(7.2)).reasons(),
            ["ambiguous order (two segmentations are 7 px apart)"]
        );
        assert_eq!(
            looked(None).reasons(),
            ["ambiguous order (the likeliest other one is 1.3 behind)"]
        );
    }

    #[test]
    fn on_ordered_points_the_noise_and_the_refusal_are_told() {
        let points_fit = PointsDiagnostics {
            noise_px: 0.3,
            rms_px: [0.5, 0.4],
            chi2_per_point: 2.13,
            beyond: [0; 2],
            sigma_px: 2.34,
        };
        let found = Diagnostics {
            suspicions: vec![
                Suspicion::Misfit,
                Suspicion::Ambiguous,
                Suspicion::Uncovered,
                Suspicion::Uncertain,
                Suspicion::NotAdjusted,
            ],
            points_fit: Some(points_fit),
            direction_margin_px: Some(0.021),
            not_adjusted: Some("no basis".to_owned()),
            ..FOUND
        };
        let expected = [
            "misfit (2.1 times the noise)",
            "ambiguous order (another match costs 0.02 px a point more)",
            "part of the body left out (10 %)",
            "weakly seen (standard deviation up to 2.3 px)",
            "match not adjusted (no basis)",
        ];
        assert_eq!(found.reasons(), expected);
    }
}
