use accurate_fit::{OutlineFitParams, side_by_side};
use accurate_geom::{Curve3, Point3, View1, View2};

use super::candidates::ViewCandidates;
use super::pairs::Tried;
use super::score::Candidate;
use super::search::Search;
use super::shape::{dense, is_shown_near, px_per_unit};
use super::start::through;
use crate::Error;

/// Rounds of repair at most.
const ROUNDS: usize = 5;
/// A move must lower the score by this to count.
const GAIN: f64 = 0.5;
/// By how much an end is moved, px: longer and shorter.
const LONGER_PX: [f64; 3] = [10.0, 25.0, 50.0];
const SHORTER_PX: [f64; 2] = [8.0, 20.0];

impl Search<'_> {
    /// Moves that repair what a fit cannot mend by itself: an end too short or too long, knots too
    /// far apart for a J tip, a stretch on the wrong strand. The best is taken until none helps.
    pub(crate) fn repaired(&self, candidate: &Candidate) -> Candidate {
        let mut best = candidate.clone();
        for _ in 0..ROUNDS {
            if best.mended || best.is_good(self.params) {
                break;
            }
            let next = self
                .moves(&best)
                .into_iter()
                .min_by(|a, b| a.score.total_cmp(&b.score))
                .filter(|next| next.score < best.score - GAIN);
            match next {
                Some(next) => best = self.converged(&next, f64::INFINITY),
                None => best.mended = true,
            }
        }
        best
    }

    fn moves(&self, from: &Candidate) -> Vec<Candidate> {
        let curve = &from.fit.curve;
        let plain = OutlineFitParams {
            knot_spacing_px: from.settings.knot_spacing_px,
            lambda3: from.settings.lambda3,
            lambda3_start: from.settings.lambda3,
            ..OutlineFitParams::DEFAULT
        };
        // With the same freedom as what it is compared with.
        let annealed = OutlineFitParams {
            knot_spacing_px: from.settings.knot_spacing_px,
            lambda3: from.settings.lambda3,
            ..OutlineFitParams::ANNEALED
        };
        let mut starts = vec![(curve.clone(), annealed)];
        let points = dense(curve, self.rig);
        let px_per_unit = px_per_unit(&points, self.rig);
        for at_end in [false, true] {
            // Nothing is won by a longer end where all is explained.
            let longer = if self.is_open(from, at_end) { &LONGER_PX[..] } else { &[] };
            for px in longer.iter().copied().chain(SHORTER_PX.map(|px| -px)) {
                let moved = with_end_moved(&points, px_per_unit, at_end, px);
                let start = moved.and_then(|points| through(&points, px_per_unit));
                starts.extend(start.map(|start| (start, plain)));
            }
        }
        let moved = |(start, params): &(Curve3, OutlineFitParams)| {
            self.anew(from, start, params, from.settings)
        };
        side_by_side(&starts, moved).into_iter().flatten().collect()
    }

    /// Whether there is unexplained outline within reach of an end.
    fn is_open(&self, candidate: &Candidate, at_end: bool) -> bool {
        const REACH_PX: f64 = LONGER_PX[LONGER_PX.len() - 1] + 10.0;
        let curve = &candidate.fit.curve;
        let (begin, end) = curve.domain();
        let point = curve.at(if at_end { end } else { begin });
        candidate.fit.unexplained.iter().any(|stretch| {
            let camera = if stretch.view == 1 { self.rig.camera1() } else { self.rig.camera2() };
            is_shown_near(camera, &point, &stretch.points, REACH_PX)
        })
    }

    /// New walks that want to pass twice where the best fit leaves outline unexplained, paired and
    /// fitted where they were not `tried`.
    pub(crate) fn rewarded(
        &self,
        best: &Candidate,
        view1: &mut ViewCandidates<View1>,
        view2: &mut ViewCandidates<View2>,
        max_fits: usize,
        tried: &mut Vec<Tried>,
        found: &mut Vec<Candidate>,
    ) -> Result<(), Error> {
        let rewards = |view: u8| -> Vec<([f64; 2], f64)> {
            const LEAST: f64 = 0.3;
            const EVERY: usize = 30;
            const WEIGHT: f64 = 1.0;
            best.fit
                .unexplained
                .iter()
                .filter(|stretch| stretch.view == view && stretch.unexplained > LEAST)
                .flat_map(|stretch| stretch.points.iter().step_by(EVERY).map(|p| (*p, WEIGHT)))
                .collect()
        };
        let (rewards1, rewards2) = (rewards(1), rewards(2));
        let before = [view1.walks.len(), view2.walks.len()];
        view1.walk(&self.params.walks, &rewards1, self.case)?;
        view2.walk(&self.params.walks, &rewards2, self.case)?;
        // New walks of one view with all of the other.
        for from in [[before[0], 0], [0, before[1]]] {
            if from[0] < view1.walks.len() && from[1] < view2.walks.len() && from != [0, 0] {
                self.propose_and_fit(view1, view2, from, max_fits, tried, found)?;
            }
        }
        Ok(())
    }
}

/// Points 1 px apart with one end moved along its tangent (`px` positive: outwards).
fn with_end_moved(
    points: &[Point3],
    px_per_unit: f64,
    at_end: bool,
    px: f64,
) -> Option<Vec<Point3>> {
    /// The tangent is taken over so many points.
    const TANGENT: usize = 8;
    let mut points = points.to_vec();
    if !at_end {
        points.reverse();
    }
    let n = points.len();
    if px < 0.0 {
        let cut = (-px) as usize;
        if n < cut + 30 {
            return None;
        }
        points.truncate(n - cut);
    } else {
        let (last, before) = (points[n - 1], points[n.checked_sub(TANGENT + 1)?]);
        let direction = (last - before).try_normalize(0.0)? / px_per_unit;
        points.extend((1..=px as usize).map(|k| last + direction * k as f64));
    }
    if !at_end {
        points.reverse();
    }
    Some(points)
}
