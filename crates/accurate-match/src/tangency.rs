use accurate_geom::{AngleSample, EpipolarAngle, GeomError, Pixel, View, View1, View2};

use crate::angle_signal::cumulative_lengths;
use crate::ends::not_negative;
use crate::{MatchError, MatchedPosition, validate_curve};

/// When a stretch counts as running along the epipolar lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TangencyParams {
    /// Sine of the angle between curve and epipolar line below which, in either view, a match is not
    /// trusted: an error of e px across the line moves it e / sine along the curve. 0.1 (6 degrees);
    /// 0 trusts everything.
    pub max_sine: f64,
    /// The direction of the curve at a point is that of the chord between the points this far, px,
    /// before and after it. 4: pixel steps are averaged out.
    pub window_px: f64,
}

impl TangencyParams {
    /// The values above, for sub-pixel curves.
    pub const DEFAULT: Self = Self { max_sine: 0.1, window_px: 4.0 };

    /// For curves on whole pixels, whose noise is larger and whose direction is less certain.
    pub const WHOLE_PIXELS: Self = Self { max_sine: 0.2, window_px: 8.0 };

    pub(crate) fn validate(&self) -> Result<(), MatchError> {
        not_negative("max_sine", self.max_sine)?;
        not_negative("window_px", self.window_px)
    }
}

/// How a point of a [`FreeMatch`](crate::FreeMatch) was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PointFlag {
    /// A point of one curve and the crossing of its epipolar line with the other.
    Exact,
    /// Two points as matched: near them no epipolar line crosses the other curve.
    Nearest,
    /// The curve runs along the epipolar line in a view. The position is interpolated by arc length
    /// between the trusted matches before and after; do not rely on it.
    Bridged,
}

/// Sine, in `[0, 1]`, of the angle between curve and epipolar line at every point of a curve of view
/// 1. 0 where there is no direction: at the epipole, and where the curve stands still.
///
/// # Errors
/// [`MatchError::Empty`], [`MatchError::NotFinite`]; [`MatchError::Geometry`] for a negative window.
///
/// # Cost
/// O(n).
pub fn tangency_sines1(
    angles: &EpipolarAngle,
    curve: &[Pixel<View1>],
    window_px: f64,
) -> Result<Vec<f64>, MatchError> {
    sines(curve, window_px, |pixel| angles.view1(pixel))
}

/// As [`tangency_sines1`], of a curve of view 2.
///
/// # Errors
/// As [`tangency_sines1`].
pub fn tangency_sines2(
    angles: &EpipolarAngle,
    curve: &[Pixel<View2>],
    window_px: f64,
) -> Result<Vec<f64>, MatchError> {
    sines(curve, window_px, |pixel| angles.view2(pixel))
}

fn sines<V: View>(
    curve: &[Pixel<V>],
    window_px: f64,
    angle: impl Fn(Pixel<V>) -> Result<AngleSample, GeomError>,
) -> Result<Vec<f64>, MatchError> {
    validate_curve(curve)?;
    not_negative("window_px", window_px)?;
    let lengths = cumulative_lengths(curve);
    let last = curve.len() - 1;
    let (mut from, mut to) = (0, 0);
    let sine = |k: usize| {
        while from < k && lengths[from] < lengths[k] - window_px {
            from += 1;
        }
        while to < last && lengths[to + 1] <= lengths[k] + window_px {
            to += 1;
        }
        // At least the neighbours.
        let (a, b) = (curve[from.min(k.saturating_sub(1))], curve[to.max(k + 1).min(last)]);
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let Ok(sample) = angle(curve[k]) else { return 0.0 };
        let across = (sample.gradient.x * dx + sample.gradient.y * dy).abs();
        let whole = sample.gradient_per_px * dx.hypot(dy);
        if whole > 0.0 && whole.is_finite() { (across / whole).min(1.0) } else { 0.0 }
    };
    Ok((0..curve.len()).map(sine).collect())
}

/// A curve as [`bridge`] needs it: arc length and tangency at every point.
#[cfg_attr(test, derive(Debug))]
pub(crate) struct Course {
    lengths: Vec<f64>,
    sines: Vec<f64>,
}

impl Course {
    pub(crate) fn new<V: View>(curve: &[Pixel<V>], sines: Vec<f64>) -> Self {
        Self { lengths: cumulative_lengths(curve), sines }
    }

    fn length_at(&self, at: f64) -> f64 {
        interpolated(&self.lengths, at)
    }

    fn sine_at(&self, at: f64) -> f64 {
        interpolated(&self.sines, at)
    }

    /// The fractional index at an arc length.
    fn at_length(&self, length: f64) -> f64 {
        let after = self.lengths.partition_point(|l| *l <= length);
        if after == 0 || after == self.lengths.len() {
            return after.saturating_sub(1) as f64;
        }
        let (from, to) = (self.lengths[after - 1], self.lengths[after]);
        (after - 1) as f64 + (length - from) / (to - from)
    }
}

/// The value at a fractional index.
fn interpolated(values: &[f64], at: f64) -> f64 {
    let k = (at as usize).min(values.len() - 1);
    let next = values[(k + 1).min(values.len() - 1)];
    values[k] + (at - k as f64) * (next - values[k])
}

/// How far along both curves together, px, the slope of the match is measured beside a bridge.
const SLOPE_PX: f64 = 20.0;

/// Replaces the stretches that run along epipolar lines.
///
/// With `w = s1 + s2` the sum of both arc lengths, a correspondence is a function `s1(w)` of slope
/// between 0 and 1. Across an untrusted stretch it becomes the cubic with the values and slopes of
/// the trusted sides, slopes limited so that both `s1` and `s2` advance (Fritsch and Carlson 1980).
/// Trusted scraps shorter than the window are given up. A stretch that reaches an end of the match
/// keeps its outermost pair.
pub(crate) fn bridge(
    matched: &[MatchedPosition],
    course1: &Course,
    course2: &Course,
    params: &TangencyParams,
) -> Vec<(MatchedPosition, PointFlag)> {
    let at: Vec<(f64, f64)> =
        matched.iter().map(|m| (course1.length_at(m.at1), course2.length_at(m.at2))).collect();
    let along = |k: usize| at[k].0 + at[k].1;
    let mut doubtful: Vec<bool> = matched
        .iter()
        .map(|m| course1.sine_at(m.at1).min(course2.sine_at(m.at2)) < params.max_sine)
        .collect();
    let runs: Vec<_> = runs(&doubtful);
    for pair in runs.windows(2) {
        let (before, after) = (pair[0].1 - 1, pair[1].0);
        if along(after) - along(before) < 2.0 * params.window_px {
            doubtful[before..after].fill(true);
        }
    }
    let plain = |k: usize| {
        let flag = if matched[k].exact { PointFlag::Exact } else { PointFlag::Nearest };
        (matched[k], flag)
    };
    let mut bridged = Vec::with_capacity(matched.len());
    let mut done = 0;
    for (from, to) in self::runs(&doubtful) {
        bridged.extend((done..from).map(plain));
        done = to;
        // Trusted neighbours, else the outermost pair of the stretch itself.
        let a = from.saturating_sub(1);
        let b = to.min(matched.len() - 1);
        if from == 0 {
            bridged.push((MatchedPosition { exact: false, ..matched[0] }, PointFlag::Bridged));
        }
        let width = along(b) - along(a);
        if width > 0.0 {
            let mean = ((at[b].0 - at[a].0) / width).clamp(0.0, 1.0);
            let bounded =
                |slope: f64| slope.clamp((3.0 * mean - 2.0).max(0.0), (3.0 * mean).min(1.0));
            let before = if from == 0 { None } else { slope_beside(&at, &doubtful, a, -1) };
            let after = if to == matched.len() { None } else { slope_beside(&at, &doubtful, b, 1) };
            let (before, after) = (bounded(before.unwrap_or(mean)), bounded(after.unwrap_or(mean)));
            let steps = (matched[b].at1 - matched[a].at1).max(matched[b].at2 - matched[a].at2);
            let steps = steps.ceil().max(1.0) as usize;
            for k in 1..steps {
                let t = k as f64 / steps as f64;
                let s1 = hermite(at[a].0, at[b].0, before * width, after * width, t);
                let s2 = along(a) + t * width - s1;
                let (at1, at2) = (course1.at_length(s1), course2.at_length(s2));
                let position = MatchedPosition {
                    at1: at1.clamp(matched[a].at1, matched[b].at1),
                    at2: at2.clamp(matched[a].at2, matched[b].at2),
                    exact: false,
                };
                bridged.push((position, PointFlag::Bridged));
            }
        }
        if to == matched.len() && b > 0 {
            bridged.push((MatchedPosition { exact: false, ..matched[b] }, PointFlag::Bridged));
        }
    }
    bridged.extend((done..matched.len()).map(plain));
    bridged
}

/// `ds1 / dw` of the trusted matches next to border `k`, on the side `direction`.
fn slope_beside(at: &[(f64, f64)], doubtful: &[bool], k: usize, direction: isize) -> Option<f64> {
    let along = |k: usize| at[k].0 + at[k].1;
    let mut far = k;
    while let Some(next) = far.checked_add_signed(direction)
        && next < at.len()
        && !doubtful[next]
        && (along(next) - along(k)).abs() <= SLOPE_PX
    {
        far = next;
    }
    let width = along(far) - along(k);
    (width != 0.0).then(|| (at[far].0 - at[k].0) / width)
}

/// Cubic on `[0, 1]` with values `a`, `b` and derivatives `da`, `db` at the ends.
fn hermite(a: f64, b: f64, da: f64, db: f64, t: f64) -> f64 {
    let u = 1.0 - t;
    let base = a + (b - a) * t * t * (3.0 - 2.0 * t);
    base + t * u * (u * da - t * db)
}

/// Half-open ranges of set flags.
fn runs(flags: &[bool]) -> Vec<(usize, usize)> {
    let mut runs = Vec::new();
    let mut start = 0;
    for run in flags.chunk_by(|a, b| a == b) {
        if run[0] {
            runs.push((start, start + run.len()));
        }
        start += run.len();
    }
    runs
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PARAMS: TangencyParams = TangencyParams { max_sine: 0.3, window_px: 4.0 };

    /// A few hundred roundings of lengths below 300 px, over the 0.1 px at least of a step.
    const TOLERANCE: f64 = 300.0 * f64::EPSILON * 300.0 / 0.1;

    /// Stretches across epipolar lines and along them, in turn.
    fn courses(points: usize) -> impl Strategy<Value = Course> {
        let step = (0.1..2.0_f64, prop::bool::weighted(0.15));
        prop::collection::vec(step, points).prop_map(|steps| {
            let (mut length, mut tangent) = (0.0, false);
            let (lengths, sines) = steps
                .into_iter()
                .map(|(step, turns)| {
                    length += step;
                    tangent ^= turns;
                    (length, if tangent { 0.01 } else { 0.9 })
                })
                .unzip();
            Course { lengths, sines }
        })
    }

    /// Any match that advances; now and then one view stands still.
    fn cases() -> impl Strategy<Value = (Vec<MatchedPosition>, [Course; 2])> {
        let step = || prop_oneof![1 => Just(0.0), 4 => 0.1..1.5_f64];
        let steps = prop::collection::vec((step(), step(), any::<bool>()), 1..60);
        (steps, courses(100), courses(100)).prop_map(|(steps, one, two)| {
            let (mut at1, mut at2) = (0.0, 0.0);
            let matched = steps.into_iter().map(|(step1, step2, exact)| {
                (at1, at2) = (at1 + step1, at2 + step2);
                MatchedPosition { at1, at2, exact }
            });
            (matched.collect(), [one, two])
        })
    }

    /// By the words of [`bridge`]: too near to an epipolar line, or between two such without a window of
    /// curve between them.
    fn doubted(matched: &[MatchedPosition], [one, two]: &[Course; 2]) -> Vec<bool> {
        let tangent = |m: &MatchedPosition| one.sine_at(m.at1) < 0.3 || two.sine_at(m.at2) < 0.3;
        let along = |m: &MatchedPosition| one.length_at(m.at1) + two.length_at(m.at2);
        (0..matched.len())
            .map(|k| {
                let before = matched[..=k].iter().rfind(|m| tangent(m));
                let after = matched[k..].iter().find(|m| tangent(m));
                match (before, after) {
                    // Along both curves together, so twice.
                    (Some(a), Some(b)) => tangent(&matched[k]) || along(b) - along(a) < 8.0,
                    _ => false,
                }
            })
            .collect()
    }

    proptest! {
        #[test]
        fn trusted_matches_and_the_ends_stay_and_the_bridges_advance_between_them(
            (matched, courses) in cases(),
        ) {
            let [one, two] = &courses;
            let bridged = bridge(&matched, one, two, &PARAMS);
            let doubted = doubted(&matched, &courses);
            let flag = |m: &MatchedPosition| if m.exact { PointFlag::Exact } else { PointFlag::Nearest };
            let trusted: Vec<_> = matched.iter().zip(&doubted).filter(|(_, doubted)| !**doubted)
                .map(|(m, _)| (*m, flag(m))).collect();
            let kept: Vec<_> =
                bridged.iter().copied().filter(|(_, flag)| *flag != PointFlag::Bridged).collect();
            prop_assert_eq!(kept, trusted);
            for (given, found) in [(matched.first(), bridged.first()), (matched.last(), bridged.last())] {
                let (given, found) = (given.unwrap(), found.unwrap().0);
                prop_assert_eq!((given.at1, given.at2), (found.at1, found.at2));
            }
            for pair in bridged.windows(2) {
                let (a, b) = (pair[0].0, pair[1].0);
                prop_assert!(b.at1 - a.at1 >= -TOLERANCE && b.at2 - a.at2 >= -TOLERANCE, "{:?} {:?}", a, b);
            }
            let all = bridge(&matched, one, two, &TangencyParams { max_sine: 0.0, ..PARAMS });
            prop_assert_eq!(all, matched.iter().map(|m| (*m, flag(m))).collect::<Vec<_>>());
        }

        /// Whatever was matched within: the cubic of the textbook, in equal steps along both curves.
        #[test]
        fn a_bridge_is_the_cubic_with_the_values_and_slopes_of_its_sides(
            mut one in courses(300), mut two in courses(300), before in 0.1..0.9_f64, mean in 0.05..0.95_f64,
            after in 0.1..0.9_f64, width in 25.0..40.0_f64, stray in -0.2..0.2_f64,
        ) {
            // From 30 px along either curve on; in the middle of the gap one stray match.
            let sides = |w: f64| match w {
                w if w <= 0.0 => before * w,
                w if w >= width => mean * width + after * (w - width),
                w => mean * w + stray * mean.min(1.0 - mean) * width,
            };
            let beyond = (0..30).map(|k| width + f64::from(k));
            let marks = (-30..=0).map(f64::from).chain([0.5 * width]).chain(beyond);
            let matched: Vec<_> = marks
                .map(|w| {
                    let s1 = sides(w);
                    let (at1, at2) = (one.at_length(30.0 + s1), two.at_length(30.0 + w - s1));
                    MatchedPosition { at1, at2, exact: true }
                })
                .collect();
            // Only that one is doubted, in the view that advances more.
            one.sines = vec![1.0; 300];
            two.sines = vec![1.0; 300];
            let (sines, at) = if mean > 0.5 {
                (&mut one.sines, [30, 31, 32].map(|k: usize| matched[k].at1))
            } else {
                (&mut two.sines, [30, 31, 32].map(|k: usize| matched[k].at2))
            };
            prop_assume!(at[1] - at[0] > 2.0 && at[2] - at[1] > 2.0);
            sines[at[1].floor() as usize..=at[1].ceil() as usize].fill(0.0);

            let bounded = |slope: f64| slope.min(3.0 * mean).max(1.0 - 3.0 * (1.0 - mean));
            let (p, q) = (width * bounded(before), width * bounded(after));
            let found = bridge(&matched, &one, &two, &PARAMS);
            let inside: Vec<_> = found.iter().filter(|(_, flag)| *flag == PointFlag::Bridged).collect();
            prop_assert_eq!(found.len() - inside.len(), matched.len() - 1);
            for (k, (m, _)) in inside.iter().enumerate() {
                let t = (k + 1) as f64 / (inside.len() + 1) as f64;
                let s1 = (t.powi(3) - 2.0 * t * t + t) * p
                    + (3.0 * t * t - 2.0 * t.powi(3)) * mean * width
                    + (t.powi(3) - t * t) * q;
                let off1 = one.length_at(m.at1) - 30.0 - s1;
                let off2 = two.length_at(m.at2) - 30.0 - (t * width - s1);
                prop_assert!(off1.abs().max(off2.abs()) <= TOLERANCE, "{} {} at {}", off1, off2, t);
            }
        }
    }
}
