use super::score::Candidate;
use super::search::{Effort, Search};

/// Two curves that are nowhere farther apart than this are one, px.
pub(crate) const SAME_PX: f64 = 2.0;
/// A score so much worse than a good one's is no rival's.
pub(crate) const BEHIND: f64 = 10.0;

impl Search<'_> {
    /// The best different curves, converged, best first. Beside a good one, those far behind are
    /// not carried on.
    pub(crate) fn finalists(&self, mut found: Vec<Candidate>) -> Vec<Candidate> {
        let different = |mut list: Vec<Candidate>| {
            list.sort_by(|a, b| a.score.total_cmp(&b.score));
            let mut kept: Vec<Candidate> = Vec::new();
            for candidate in list {
                if kept.iter().all(|k| !k.shape.is_like(&candidate.shape, SAME_PX)) {
                    kept.push(candidate);
                }
            }
            kept
        };
        found = different(found);
        found.truncate(self.params.finalists);
        if let Some(best) = found.first().filter(|best| best.good).map(|best| best.score) {
            found.retain(|candidate| candidate.score < best + BEHIND);
        }
        let good = found.first().is_some_and(|best| best.is_good(self.params));
        if good && (found.len() == 1 || self.effort == Effort::Quick) {
            // The last fit carries them on.
            return found;
        }
        let mut to_beat = f64::INFINITY;
        let mut converged = Vec::with_capacity(found.len());
        for candidate in &found {
            let candidate = self.converged(candidate, to_beat);
            to_beat = to_beat.min(candidate.score);
            converged.push(candidate);
        }
        different(converged)
    }
}
