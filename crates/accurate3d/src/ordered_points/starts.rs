use accurate_geom::{Pixel, Rig, View, View1, View2};
use accurate_match::{FreeEnds, FreeMatchParams, FreeMatcher};
use accurate_traverse::{CentrelineParams, smooth_centreline};

use super::part::filled;

/// Pairs of whole pixels from a match of their smoothed curves: what rounding hides of a crossing
/// near a tangency, smoothing as far as rounding allows gives back. Once with stretches along
/// epipolar lines bridged, and once as matched; none if the curves are too short to be smoothed or do
/// not match.
///
/// The curves run the same way and show the same part of the body.
pub(super) fn smoothed_pairs(
    curve1: &[Pixel<View1>],
    curve2: &[Pixel<View2>],
    rig: &Rig,
) -> Vec<Vec<(usize, usize)>> {
    let (Some(smooth1), Some(smooth2)) = (Smoothed::of(curve1), Smoothed::of(curve2)) else {
        return Vec::new();
    };
    let mut tangency = FreeMatchParams::DEFAULT.tangency;
    let mut starts = Vec::new();
    for max_sine in [tangency.max_sine, 0.0] {
        tangency.max_sine = max_sine;
        let matcher = FreeMatcher::new(FreeMatchParams {
            tangency,
            free1: FreeEnds::NONE,
            free2: FreeEnds::NONE,
            ..FreeMatchParams::DEFAULT
        });
        let Ok(found) = matcher.match_directed(&smooth1.points, &smooth2.points, false, rig) else {
            continue;
        };
        let mut pairs: Vec<(usize, usize)> = found
            .positions
            .iter()
            .map(|&(a, b)| (smooth1.nearest(a), smooth2.nearest(b)))
            .collect();
        pairs.dedup();
        starts.push(filled(&pairs, &[Vec::new(), Vec::new()]));
    }
    starts
}

/// A smoothed curve whose points know their place on the given one.
struct Smoothed<V: View> {
    points: Vec<Pixel<V>>,
    /// Chord length of every given point, from 0.
    arc: Vec<f64>,
}

impl<V: View> Smoothed<V> {
    fn of(curve: &[Pixel<V>]) -> Option<Self> {
        let points = smooth_centreline(curve, &CentrelineParams::DEFAULT).ok()?;
        let mut arc = Vec::with_capacity(curve.len());
        let mut length = 0.0;
        for (k, point) in curve.iter().enumerate() {
            if k > 0 {
                length += point.distance(curve[k - 1]);
            }
            arc.push(length);
        }
        (points.len() >= 4 && length > 0.0).then_some(Self { points, arc })
    }

    /// The given point nearest to a fractional index: the smoothed points divide the chord length of
    /// the given ones evenly.
    fn nearest(&self, at: f64) -> usize {
        let last = self.arc.len() - 1;
        let place = at / (self.points.len() - 1) as f64 * self.arc[last];
        let after = self.arc.partition_point(|s| *s < place).min(last);
        let before = after.saturating_sub(1);
        if place - self.arc[before] < self.arc[after] - place { before } else { after }
    }
}
