use std::f64::consts::TAU;

use accurate_geom::{AngleSample, EpipolarAngle, GeomError, Pixel, View, View1, View2};

use crate::ends::positive;
use crate::{MatchError, validate_curve};

/// More samples than any use of a signal.
const MAX_SAMPLES: f64 = 1e7;

/// The epipolar angle along a curve, equally spaced by arc length.
///
/// Made once per curve; [`signal`](Self::signal) then gives its signals at any coarser step.
#[derive(Debug, Clone, PartialEq)]
pub struct AngleProfile {
    length_px: f64,
    /// Radians, without jumps of 2π along the curve.
    phi: Vec<f64>,
    /// Radians per px, across the epipolar line.
    gradient: Vec<f64>,
}

impl AngleProfile {
    /// The profile of a curve of view 1, sampled at most about `spacing_px` apart.
    ///
    /// # Errors
    /// [`MatchError::Empty`], [`MatchError::NotFinite`]; [`MatchError::Geometry`] if a sample lies
    /// at the epipole, the spacing is not positive or the curve is longer than 10⁷ samples.
    ///
    /// # Cost
    /// O(points + samples), about 50 ns per sample.
    pub fn of_view1(
        angles: &EpipolarAngle,
        curve: &[Pixel<View1>],
        spacing_px: f64,
    ) -> Result<Self, MatchError> {
        Self::new(curve, spacing_px, |pixel| angles.view1(pixel))
    }

    /// The profile of a curve of view 2.
    ///
    /// # Errors
    /// As [`of_view1`](Self::of_view1).
    pub fn of_view2(
        angles: &EpipolarAngle,
        curve: &[Pixel<View2>],
        spacing_px: f64,
    ) -> Result<Self, MatchError> {
        Self::new(curve, spacing_px, |pixel| angles.view2(pixel))
    }

    fn new<V: View>(
        curve: &[Pixel<V>],
        spacing_px: f64,
        angle: impl Fn(Pixel<V>) -> Result<AngleSample, GeomError>,
    ) -> Result<Self, MatchError> {
        validate_curve(curve)?;
        positive("spacing of an angle profile (px)", spacing_px)?;
        let cumulative = cumulative_lengths(curve);
        let length_px = cumulative[cumulative.len() - 1];
        let count = sample_count(length_px, spacing_px)?;
        let mut phi: Vec<f64> = Vec::with_capacity(count);
        let mut gradient = Vec::with_capacity(count);
        let mut segment = 0;
        for k in 0..count {
            let s = length_px * (k as f64 / (count - 1).max(1) as f64);
            while segment + 2 < curve.len() && cumulative[segment + 1] <= s {
                segment += 1;
            }
            let sample = angle(between(curve, &cumulative, segment, s))?;
            let turns = phi.last().map_or(0.0, |last| (last - sample.phi) / TAU);
            let jumps = if turns.abs() < 0.5 { 0.0 } else { turns.round() };
            phi.push(sample.phi + TAU * jumps);
            gradient.push(sample.gradient_per_px);
        }
        Ok(Self { length_px, phi, gradient })
    }

    /// Arc length of the curve, px.
    pub fn length_px(&self) -> f64 {
        self.length_px
    }

    /// Angle (radians) and gradient (radians per px) of the first sample.
    pub fn first(&self) -> (f64, f64) {
        (self.phi[0], self.gradient[0])
    }

    /// Angle (radians) and gradient (radians per px) of the last sample.
    pub fn last(&self) -> (f64, f64) {
        let last = self.phi.len() - 1;
        (self.phi[last], self.gradient[last])
    }

    /// The signal at about `step_px`: equally spaced samples, ends included, each owning the range
    /// of angles from half way to the sample before it to half way to the one after it.
    ///
    /// # Errors
    /// [`MatchError::Geometry`] if the step is not positive or gives more than 10⁷ samples.
    ///
    /// # Cost
    /// O(samples of the profile + samples of the signal).
    pub fn signal(&self, step_px: f64) -> Result<AngleSignal, MatchError> {
        positive("step of an angle signal (px)", step_px)?;
        let count = sample_count(self.length_px, step_px)?;
        let last = (self.phi.len() - 1) as f64;
        // In samples of the profile.
        let spacing = last / (count - 1).max(1) as f64;
        let at = |x: f64| {
            // Casts cut off: `x` is not negative.
            let k = x as usize;
            let part = x - k as f64;
            let (a, b) = (self.phi[k], self.phi[k + usize::from(part > 0.0)]);
            a + part * (b - a)
        };
        let mut signal = AngleSignal {
            step_px,
            low: Vec::with_capacity(count),
            high: Vec::with_capacity(count),
            squared_gradient: Vec::with_capacity(count),
        };
        for k in 0..count {
            let centre = k as f64 * spacing;
            let from = (centre - 0.5 * spacing).max(0.0);
            let to = (centre + 0.5 * spacing).min(last);
            let (a, b) = (at(from), at(to));
            let (mut low, mut high) = (a.min(b), a.max(b));
            // Both roundings stay inside the profile: 0 <= from <= to <= last.
            let first = from as usize;
            let first = first + usize::from(from > first as f64);
            for &phi in self.phi.get(first..=to as usize).unwrap_or(&[]) {
                low = low.min(phi);
                high = high.max(phi);
            }
            let gradient = self.gradient[((centre + 0.5) as usize).min(self.gradient.len() - 1)];
            signal.push(low, high, gradient);
        }
        Ok(signal)
    }
}

/// A curve as a sequence of intervals of epipolar angle, for
/// [`interval_energy`](crate::interval_energy).
///
/// A sample stands for its whole cell: two samples that differ only by where they were taken along
/// the same stretch overlap and differ by 0, however coarse the step.
#[derive(Debug, Clone, PartialEq)]
pub struct AngleSignal {
    pub(crate) step_px: f64,
    /// Radians.
    pub(crate) low: Vec<f32>,
    /// Radians.
    pub(crate) high: Vec<f32>,
    /// (radians per px)².
    pub(crate) squared_gradient: Vec<f32>,
}

impl AngleSignal {
    /// A signal from its parts: per sample least and greatest angle (radians) and gradient (radians
    /// per px), `step_px` apart.
    ///
    /// # Errors
    /// [`MatchError::Geometry`] if there is no sample, a number is not finite, an interval is upside
    /// down, or the step or a gradient is not positive.
    pub fn from_samples(step_px: f64, samples: &[(f64, f64, f64)]) -> Result<Self, MatchError> {
        positive("step of an angle signal (px)", step_px)?;
        if samples.is_empty() {
            return Err(GeomError::TooFewPoints { found: 0, needed: 1 }.into());
        }
        let mut signal =
            Self { step_px, low: Vec::new(), high: Vec::new(), squared_gradient: Vec::new() };
        for &(low, high, gradient) in samples {
            positive("gradient of an angle signal (radians per px)", gradient)?;
            for value in [low, high] {
                if !value.is_finite() {
                    let what = "angle of a sample".to_owned();
                    return Err(GeomError::NotFinite { what, value }.into());
                }
            }
            if high < low {
                let (what, expected) = ("greatest angle of a sample", "the least angle or more");
                return Err(GeomError::OutOfRange { what, value: high, expected }.into());
            }
            signal.push(low, high, gradient);
        }
        Ok(signal)
    }

    fn push(&mut self, low: f64, high: f64, gradient: f64) {
        // Within these bounds differences and quotients of f32 stay finite; real gradients are
        // about one over the focal length in px.
        let squared = (gradient * gradient).clamp(1e-24, 1e24);
        self.low.push(low.clamp(-1e6, 1e6) as f32);
        self.high.push(high.clamp(-1e6, 1e6) as f32);
        self.squared_gradient.push(squared as f32);
    }

    /// Number of samples, at least 1.
    pub fn samples(&self) -> usize {
        self.low.len()
    }

    /// The step it was asked for, px; the actual one differs so that both ends are samples.
    pub fn step_px(&self) -> f64 {
        self.step_px
    }

    /// Least and greatest angle of sample `k`, radians; `None` beyond the last.
    pub fn interval(&self, k: usize) -> Option<(f32, f32)> {
        Some((*self.low.get(k)?, *self.high.get(k)?))
    }

    /// Samples that a free end of `free_px` may leave out; one always stays.
    pub(crate) fn samples_in(&self, free_px: f64) -> usize {
        // A float to integer cast saturates: infinity becomes the last sample.
        ((free_px / self.step_px).floor() as usize).min(self.samples() - 1)
    }
}

/// Arc length up to each point, px.
pub(crate) fn cumulative_lengths<V: View>(curve: &[Pixel<V>]) -> Vec<f64> {
    let mut lengths = Vec::with_capacity(curve.len());
    let mut length = 0.0;
    lengths.push(length);
    for step in curve.windows(2) {
        let (dx, dy) = (step[1].x - step[0].x, step[1].y - step[0].y);
        length += (dx * dx + dy * dy).sqrt();
        lengths.push(length);
    }
    lengths
}

fn sample_count(length_px: f64, step_px: f64) -> Result<usize, MatchError> {
    let steps = (length_px / step_px).round();
    if !(steps < MAX_SAMPLES) {
        let expected = "at most 1e7 samples";
        return Err(
            GeomError::OutOfRange { what: "samples of a curve", value: steps, expected }.into()
        );
    }
    Ok(if length_px > 0.0 { (steps as usize).max(1) + 1 } else { 1 })
}

/// The point at arc length `s` on the segment after point `segment`.
fn between<V: View>(curve: &[Pixel<V>], cumulative: &[f64], segment: usize, s: f64) -> Pixel<V> {
    let a = curve[segment];
    let Some(b) = curve.get(segment + 1) else { return a };
    let (from, to) = (cumulative[segment], cumulative[segment + 1]);
    let t = if to > from { ((s - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
    Pixel::new(a.x + t * (b.x - a.x), a.y + t * (b.y - a.y))
}
