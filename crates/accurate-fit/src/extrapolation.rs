use crate::pool::changed;

/// Extrapolates a sequence of smoothness that converges linearly, from its last two steps.
///
/// # Source
/// Anderson, J. ACM 12, 1965, with a memory of one step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Extrapolation {
    /// Logarithms of the factors before the last step, and what it was to change them by.
    last: Option<(Vec<f64>, Vec<f64>)>,
}

/// A step is made longer by no more than this.
const LONGEST: f64 = 5.0;

impl Extrapolation {
    /// The factors after `changes` of their logarithms, taken `relaxation` times.
    pub(crate) fn next(&mut self, factors: &[f64], changes: &[f64], relaxation: f64) -> Vec<f64> {
        let logs: Vec<f64> = factors.iter().map(|factor| factor.ln()).collect();
        let steps = match &self.last {
            None => changes.to_vec(),
            Some((last_logs, last_changes)) => {
                // The mixture of both steps that leaves the least change.
                let (mut along, mut squared) = (0.0, 0.0);
                for (now, then) in changes.iter().zip(last_changes) {
                    along += now * (now - then);
                    squared += (now - then) * (now - then);
                }
                let back = if squared > 0.0 { along / squared } else { 0.0 };
                let back = back.clamp(1.0 - LONGEST, 0.5);
                let now = logs.iter().zip(changes);
                let then = last_logs.iter().zip(last_changes);
                now.zip(then)
                    .map(|((log, change), (last_log, last_change))| {
                        let moved = (log - last_log) / relaxation + (change - last_change);
                        change - back * moved
                    })
                    .collect()
            }
        };
        self.last = Some((logs, changes.to_vec()));
        changed(factors, &steps, relaxation)
    }
}
