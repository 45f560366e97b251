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

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest distance of the logarithms from their limit after `steps`, if each step left to itself
    /// closes a part of the distance.
    fn left(steps: usize, extrapolate: bool) -> f64 {
        const LIMIT: [f64; 3] = [2.0, -1.0, 0.5];
        const CLOSED: f64 = 0.15;
        let (mut factors, mut extrapolation) = (vec![1.0; 3], Extrapolation::default());
        for _ in 0..steps {
            let changes: Vec<f64> = factors
                .iter()
                .zip(LIMIT)
                .map(|(f, limit)| CLOSED * (limit - f64::ln(*f)))
                .collect();
            factors = if extrapolate {
                extrapolation.next(&factors, &changes, 2.0)
            } else {
                changed(&factors, &changes, 2.0)
            };
        }
        factors.iter().zip(LIMIT).map(|(f, limit)| (f.ln() - limit).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_linear_sequence_ends_after_two_steps() {
        // Steps of one and the same rate: the mixture of two has no change left.
        assert!(left(2, true) < 1e-9, "{}", left(2, true));
        // Plain steps leave 0.7 each.
        assert!((left(2, false) - 2.0 * 0.7 * 0.7).abs() < 1e-9);
    }

    #[test]
    fn what_is_at_rest_stays() {
        let mut extrapolation = Extrapolation::default();
        let factors = vec![0.5, 3.0];
        for _ in 0..3 {
            let next = extrapolation.next(&factors, &[0.0, 0.0], 2.0);
            assert!(next.iter().zip(&factors).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }
}
