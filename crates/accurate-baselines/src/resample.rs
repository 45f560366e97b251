use accurate_geom::{Pixel, Point3, Rig, Triangulation, View1, View2};
use accurate_match::{CurveReconstruction, MatchError, PixelPair, triangulate_pairs};

use crate::pchip::Pchip;
use crate::track::Track;

/// Both tracks and the rig that saw them.
pub(crate) struct Scene<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) track1: &'a Track<View1>,
    pub(crate) track2: &'a Track<View2>,
}

/// A matched pair of places `(u1, u2)`, px along the tracks.
pub(crate) type Match = (f64, f64);

impl Scene<'_> {
    /// Turns a run of matches into 3D points at equal arc lengths.
    ///
    /// Between the matches, u2 follows a monotone cubic of u1. It is sampled every `step_px` along
    /// view 1 and triangulated; then as many places are put at equal steps of the 3D arc length
    /// found, moved to the curve's own crossing with the epipolar line where one is near, and
    /// triangulated again. So every point is a true meeting of two rays, none an interpolation in
    /// space.
    ///
    /// `matches` strictly increases in u1 and does not fall in u2.
    pub(crate) fn points_along(
        &self,
        method: &'static str,
        matches: &[Match],
        step_px: f64,
    ) -> Result<CurveReconstruction, MatchError> {
        let map = Pchip::new(matches)?;
        let (start, end) = map.range();
        let steps = ((end - start) / step_px).round().max(1.0) as usize;
        let steps = if end > start { steps } else { 0 };
        let even = |k: usize| start + (end - start) * (k as f64 / steps.max(1) as f64);
        let places: Vec<Match> = (0..=steps).map(|k| (even(k), map.value(even(k)))).collect();
        let first = self.triangulate(method, &self.on_lines(places))?;

        let at: Vec<f64> = first.1;
        let arc = arc_lengths(&first.0);
        let total = arc[arc.len() - 1];
        let mut left = 0;
        let mut equal = Vec::with_capacity(at.len());
        for k in 0..at.len() {
            let s = total * (k as f64 / (at.len() - 1).max(1) as f64);
            while left + 2 < arc.len() && arc[left + 1] <= s {
                left += 1;
            }
            let u1 = if k == 0 {
                at[0]
            } else if k + 1 == at.len() {
                at[k]
            } else if arc[left + 1] <= arc[left] {
                at[left + 1]
            } else {
                let share = ((s - arc[left]) / (arc[left + 1] - arc[left])).clamp(0.0, 1.0);
                at[left] + (at[left + 1] - at[left]) * share
            };
            equal.push((u1, map.value(u1)));
        }
        Ok(self.triangulate(method, &self.on_lines(equal))?.0)
    }

    /// Moves u2 to the crossing of the epipolar line with track 2, if one is within half a pixel:
    /// the monotone cubic is right to a fraction of that between neighbouring matches. Elsewhere, in
    /// filled gaps, u2 stays. The order is kept.
    fn on_lines(&self, mut places: Vec<Match>) -> Vec<Match> {
        const NEAR_PX: f64 = 0.5;
        let line_of = self.rig.fundamental().transpose();
        let mut before = f64::NEG_INFINITY;
        for (u1, u2) in &mut places {
            if let Ok(line) = line_of.line(self.track1.pixel(*u1)) {
                let crossings = self.track2.crossings(&line);
                let nearest = crossings
                    .into_iter()
                    .min_by(|a, b| (a - *u2).abs().total_cmp(&(b - *u2).abs()))
                    .filter(|root| (root - *u2).abs() <= NEAR_PX);
                *u2 = nearest.unwrap_or(*u2).max(before);
            }
            before = *u2;
        }
        places
    }

    /// The points, and the u1 of each.
    fn triangulate(
        &self,
        method: &'static str,
        places: &[Match],
    ) -> Result<(CurveReconstruction, Vec<f64>), MatchError> {
        let pairs: Vec<PixelPair> = places
            .iter()
            .enumerate()
            .map(|(k, &(u1, u2))| {
                let pixel1: Pixel<View1> = self.track1.pixel(u1);
                // The cell carries the position in `places` through: pairs may be dropped.
                PixelPair { cell: (k, k), pixel1, pixel2: self.track2.pixel(u2) }
            })
            .collect();
        let mut curve =
            triangulate_pairs(method, self.rig, Triangulation::LindstromNiter2, &pairs)?;
        let mut kept = Vec::with_capacity(curve.pairs.len());
        for cell in &mut curve.pairs {
            let (u1, u2) = places[cell.0];
            kept.push(u1);
            *cell = (self.track1.nearest_input(u1), self.track2.nearest_input(u2));
        }
        Ok((curve, kept))
    }
}

fn arc_lengths(curve: &CurveReconstruction) -> Vec<f64> {
    let mut sum = 0.0;
    let mut before: Option<Point3> = None;
    curve
        .points
        .iter()
        .map(|p| {
            sum += before.map_or(0.0, |b| (p.position - b).norm());
            before = Some(p.position);
            sum
        })
        .collect()
}
