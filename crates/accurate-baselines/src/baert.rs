use accurate_geom::{Pixel, Rig, View1, View2};
use accurate_match::{CurveMatcher, CurveReconstruction, MatchError, validate_curve};

use crate::range::positive;
use crate::resample::{Match, Scene};
use crate::track::Track;

/// Baert's method in a fair reading: `baert`.
///
/// Both curves become smoothing splines. Going along view 1 from the tip, each sample's epipolar
/// line is cut exactly with the spline of view 2. Of the crossings that do not lie before the last
/// match, the one nearest to where the running ratio of arc lengths expects it is taken; if none is
/// within the limit the sample stays open. Open samples between matches are filled by a monotone
/// cubic, and the curve is triangulated at equal steps of its 3D arc length.
///
/// # Source
/// Baert et al., IEEE TMI 22(10), 2003: B-splines in both planes, correspondence along epipolar
/// lines, starting at the tip. The order along view 2, the limit and the monotone fill are known
/// from the method's use on Guide3D (Jianu et al., 2024). Our choices:
/// - **The first correspondence.** Ordered curves start at the same physical tip, so both starts
///   correspond; but one view may see a piece more than the other. Then the start of one curve
///   corresponds to a crossing of its epipolar line with the other curve. All these starts are
///   followed, and the one that matches the most samples wins, the two tips before the others. A
///   start is only where the search begins, no match by itself.
/// - **The expected place** advances from the last match at the ratio of the arc lengths from the
///   start to it; before 30 px, at the ratio of the whole curves, of which it never differs by more
///   than a factor of 3. (A more local ratio runs off to 0 or infinity at a stretch along the
///   epipolar lines, just where it is needed.)
/// - Smoothing, exact crossings, Lindstrom's triangulation and resampling.
///
/// Before the first and after the last match nothing is filled.
///
/// # Cost
/// O(starts · samples · spline spans); there are rarely more than five starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Baert {
    /// Noise of the input points per coordinate, px: how closely the splines follow them; 0 for
    /// splines through them.
    pub sigma_px: f64,
    /// Distance of the samples along view 1, px.
    pub step_px: f64,
    /// Farthest a match may lie from where it is expected along view 2, px.
    pub limit_px: f64,
}

impl Baert {
    /// Name of the method.
    pub const NAME: &'static str = "baert";
}

impl Default for Baert {
    /// A sample per px, and the limit of 100 px known from Guide3D.
    fn default() -> Self {
        Self { sigma_px: 0.3, step_px: 1.0, limit_px: 100.0 }
    }
}

impl CurveMatcher for Baert {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn reconstruct(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CurveReconstruction, MatchError> {
        positive("step_px", self.step_px)?;
        positive("limit_px", self.limit_px)?;
        validate_curve(curve1)?;
        validate_curve(curve2)?;
        let track1 = Track::new(curve1, self.sigma_px)?;
        let track2 = Track::new(curve2, self.sigma_px)?;
        let scene = Scene { rig, track1: &track1, track2: &track2 };
        let samples = track1.samples(self.step_px, usize::MAX);
        let (matches, candidates) = best_of_starts(&scene, &samples, self.limit_px);
        if matches.is_empty() {
            return Err(MatchError::NoCorrespondence { method: Self::NAME, candidates });
        }
        scene.points_along(Self::NAME, &matches, samples[1])
    }
}

/// The longest list of matches over all starts, the first of equals, and the number of crossings
/// seen on the way.
fn best_of_starts(scene: &Scene<'_>, samples: &[f64], limit_px: f64) -> (Vec<Match>, usize) {
    let f = scene.rig.fundamental();
    let mut starts: Vec<Match> = vec![(0.0, 0.0)];
    if let Ok(line) = f.transpose().line(scene.track1.pixel(0.0)) {
        starts.extend(scene.track2.crossings(&line).into_iter().map(|u2| (0.0, u2)));
    }
    if let Ok(line) = f.line(scene.track2.pixel(0.0)) {
        starts.extend(scene.track1.crossings(&line).into_iter().map(|u1| (u1, 0.0)));
    }
    let mut best = Vec::new();
    let mut candidates = 0;
    for start in starts {
        let (matches, seen) = follow(scene, samples, start, limit_px);
        candidates += seen;
        if matches.len() > best.len() {
            best = matches;
        }
    }
    (best, candidates)
}

/// Matches in the order of the samples, and the number of crossings seen.
fn follow(scene: &Scene<'_>, samples: &[f64], start: Match, limit_px: f64) -> (Vec<Match>, usize) {
    let whole = scene.track2.length_px() / scene.track1.length_px();
    let line_of = scene.rig.fundamental().transpose();
    let mut last = start;
    let mut matches: Vec<Match> = Vec::new();
    let mut candidates = 0;
    for &u1 in samples.iter().filter(|u1| **u1 >= start.0) {
        // At the epipole there is no line: the sample stays open.
        let Ok(line) = line_of.line(scene.track1.pixel(u1)) else { continue };
        let ratio = running_ratio((last.0 - start.0, last.1 - start.1), whole);
        let expected = last.1 + ratio * (u1 - last.0);
        let crossings = scene.track2.crossings(&line);
        candidates += crossings.len();
        let off = |u2: f64| (u2 - expected).abs();
        let best = crossings
            .into_iter()
            .filter(|&u2| u2 >= last.1 && off(u2) <= limit_px)
            .min_by(|a, b| off(*a).total_cmp(&off(*b)));
        if let Some(u2) = best {
            last = (u1, u2);
            matches.push(last);
        }
    }
    (matches, candidates)
}

/// How far view 2 has advanced per px of view 1, from the start to the last match.
fn running_ratio((advance1, advance2): Match, whole: f64) -> f64 {
    const SETTLED_PX: f64 = 30.0;
    const FACTOR: f64 = 3.0;
    if advance1 < SETTLED_PX {
        return whole;
    }
    (advance2 / advance1).clamp(whole / FACTOR, whole * FACTOR)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_running_ratio_stays_near_the_whole_one(
            u1 in 0.0..5e3f64, u2 in 0.0..5e3f64, whole in 0.1..10.0f64,
        ) {
            let ratio = running_ratio((u1, u2), whole);
            prop_assert!(ratio >= whole / 3.0 && ratio <= whole * 3.0);
        }
    }

    #[test]
    fn the_running_ratio_is_that_of_the_matches_once_they_have_settled() {
        assert_eq!(running_ratio((100.0, 150.0), 1.0), 1.5);
        assert_eq!(running_ratio((10.0, 15.0), 1.0), 1.0);
    }
}
