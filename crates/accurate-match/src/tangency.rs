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
