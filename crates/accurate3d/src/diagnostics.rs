use accurate_match::CurveReconstruction;
use serde::Serialize;

use crate::Traces;

/// How far a reconstruction can be trusted, without knowing the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Diagnostics {
    /// Mean distance in view 1 of matched pixels to their epipolar lines, px. Right orders stay
    /// below about 0.5; a wrong traversal or direction shows as more.
    pub mean_epipolar_distance_px: f64,
    /// The largest such distance, px.
    pub max_epipolar_distance_px: f64,
    /// Fraction of each view's skeleton that the trace passes.
    pub trace_coverage: [f64; 2],
    /// Steps longer than 3 px in each view's trace.
    pub trace_jumps: [usize; 2],
    /// Fraction of each view's ordered points that found a partner.
    pub matched_fraction: [f64; 2],
    /// Whether the points of view 2 were given against those of view 1, and turned round.
    pub view2_reversed: bool,
    /// Matched pairs whose rays gave no finite point.
    pub dropped_pairs: usize,
}

impl Diagnostics {
    pub(crate) fn of(matched: &CurveReconstruction, traces: &Traces) -> Self {
        let fraction = |mut indices: Vec<usize>, total: usize| {
            indices.sort_unstable();
            indices.dedup();
            indices.len() as f64 / total as f64
        };
        let (first, second) = matched.pairs.iter().copied().unzip();
        Self {
            mean_epipolar_distance_px: matched.mean_epipolar_distance_px(),
            max_epipolar_distance_px: matched
                .points
                .iter()
                .map(|p| p.epipolar_distance_px)
                .fold(0.0, f64::max),
            trace_coverage: traces.coverage,
            trace_jumps: traces.jumps,
            matched_fraction: [
                fraction(first, traces.points1.len()),
                fraction(second, traces.points2.len()),
            ],
            view2_reversed: traces.view2_reversed,
            dropped_pairs: matched.dropped,
        }
    }
}
