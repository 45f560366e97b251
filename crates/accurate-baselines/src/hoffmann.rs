use accurate_geom::{Pixel, Rig, View1, View2};
use accurate_match::{CurveMatcher, CurveReconstruction, MatchError, validate_curve};

use crate::chain::longest_cheapest_chain;
use crate::range::{not_negative, positive};
use crate::resample::{Match, Scene};
use crate::room::check_room;
use crate::track::Track;

/// A candidate, its place, its row, its link, its share of the tree, of the levels and of their costs in
/// the search for the longest chain.
const CANDIDATE_BYTES: u64 = 128;

/// Hoffmann's method in a fair reading: `hoffmann`.
///
/// Both curves become smoothing splines. Every crossing of a view-1 sample's epipolar line with the
/// spline of view 2 is a candidate. Correspondence is the path over candidates that strictly
/// advances in both views and skips the fewest samples.
///
/// # Source
/// Hoffmann et al., MICCAI 2012, Fig. 3: nodes are candidates `(t_i, t_ij)`, edges keep the order
/// in both views, an edge costs the number of points it skips; evaluated in SPIE 8671 (2013) and
/// IEEE TMI 35(2), 2016. Not published, and our choice:
/// - The ends of the path cost the samples skipped before and after it, like any edge. The cheapest
///   path is then the longest chain.
/// - Of equally long chains (frequent: the publication's cost is blind to which candidate is taken)
///   the one with the least sum of `(Δt2 - ρ Δt1)²`, where ρ is the ratio of the curves' lengths.
/// - Where the spline turns back before it reaches the line, but nearer than `tangent_px`, the
///   turning point is a candidate too.
/// - Skipped stretches between matches are filled by a monotone cubic, or left open.
/// - Smoothing, Lindstrom's triangulation and resampling at equal steps of the 3D arc length.
///
/// # Cost
/// O(samples · spline spans) for the candidates; for M of them O(M log M) and the pairs of
/// neighbouring chain lengths, a few M unless crossings come in clouds. What would need more than
/// [`MAX_ALIGNMENT_BYTES`](accurate_match::MAX_ALIGNMENT_BYTES) is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hoffmann {
    /// Noise of the input points per coordinate, px: how closely the splines follow them; 0 for
    /// splines through them.
    pub sigma_px: f64,
    /// Distance of the samples along view 1, px.
    pub step_px: f64,
    /// A turning point no farther from the line than this is a candidate, px; 0 for none.
    pub tangent_px: f64,
    /// Whether skipped stretches between matches are filled.
    pub fill: bool,
}

impl Hoffmann {
    /// Name of the method.
    pub const NAME: &'static str = "hoffmann";
}

impl Default for Hoffmann {
    /// A sample per px, turning points within half a px, gaps filled.
    fn default() -> Self {
        Self { sigma_px: 0.3, step_px: 1.0, tangent_px: 0.5, fill: true }
    }
}

impl CurveMatcher for Hoffmann {
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
        not_negative("tangent_px", self.tangent_px)?;
        validate_curve(curve1)?;
        validate_curve(curve2)?;
        let track1 = Track::new(curve1, self.sigma_px)?;
        let track2 = Track::new(curve2, self.sigma_px)?;
        let scene = Scene { rig, track1: &track1, track2: &track2 };

        let samples = track1.samples(self.step_px, usize::MAX);
        let room =
            |candidates| check_room(candidates, CANDIDATE_BYTES, samples.len(), curve2.len());
        let nodes = self.candidates(&scene, &samples, room)?;
        let ratio = track2.length_px() / track1.length_px();
        let unevenness = |from: (usize, f64), to: (usize, f64)| {
            let off = (to.1 - from.1) - ratio * (samples[to.0] - samples[from.0]);
            off * off
        };
        let chain: Vec<(usize, f64)> =
            longest_cheapest_chain(&nodes, unevenness).into_iter().map(|k| nodes[k]).collect();
        if chain.is_empty() {
            return Err(MatchError::NoCorrespondence { method: Self::NAME, candidates: 0 });
        }
        let runs: Vec<Vec<Match>> = chain
            .chunk_by(|a, b| self.fill || b.0 == a.0 + 1)
            .map(|run| run.iter().map(|&(i, u2)| (samples[i], u2)).collect())
            .collect();
        join(runs.iter().map(|run| scene.points_along(Self::NAME, run, samples[1])))
    }
}

impl Hoffmann {
    /// `(sample, place along view 2)`, sorted by sample, then place.
    /// Refused as soon as `check` refuses their number.
    fn candidates(
        &self,
        scene: &Scene<'_>,
        samples: &[f64],
        check: impl Fn(u64) -> Result<(), MatchError>,
    ) -> Result<Vec<(usize, f64)>, MatchError> {
        let line_of = scene.rig.fundamental().transpose();
        let mut nodes = Vec::new();
        for (i, &u1) in samples.iter().enumerate() {
            // At the epipole there is no line: the sample has no candidate.
            let Ok(line) = line_of.line(scene.track1.pixel(u1)) else { continue };
            let mut places = scene.track2.crossings(&line);
            if self.tangent_px > 0.0 {
                places.extend(scene.track2.near_touches(self.tangent_px, &line));
                places.sort_unstable_by(f64::total_cmp);
                places.dedup();
            }
            check((nodes.len() + places.len()) as u64)?;
            nodes.extend(places.into_iter().map(|u2| (i, u2)));
        }
        Ok(nodes)
    }
}

/// One curve of several pieces; a piece that cannot be triangulated only counts as dropped.
fn join(
    pieces: impl Iterator<Item = Result<CurveReconstruction, MatchError>>,
) -> Result<CurveReconstruction, MatchError> {
    let mut whole: Option<CurveReconstruction> = None;
    let mut dropped = 0;
    let mut failure = MatchError::NoCorrespondence { method: Hoffmann::NAME, candidates: 0 };
    for piece in pieces {
        match (piece, &mut whole) {
            (Ok(piece), Some(whole)) => {
                whole.points.extend(piece.points);
                whole.pairs.extend(piece.pairs);
                dropped += piece.dropped;
            }
            (Ok(piece), None) => {
                dropped += piece.dropped;
                whole = Some(piece);
            }
            (Err(MatchError::NothingTriangulated { method, pairs, first }), _) => {
                dropped += pairs;
                failure = MatchError::NothingTriangulated { method, pairs: dropped, first };
            }
            (Err(error), _) => return Err(error),
        }
    }
    let mut whole = whole.ok_or(failure)?;
    whole.dropped = dropped;
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::{Matrix3, Vector3};
    use accurate_geom::{Camera, ImageSize, LengthUnit};

    use super::*;

    #[test]
    fn no_candidate_is_kept_beyond_the_room_there_is() {
        let k = Matrix3::new(1000.0, 0.0, 256.0, 0.0, 1000.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        let camera = |x: f64| {
            Camera::new(k, Matrix3::identity(), Vector3::new(x, 0.0, 100.0), size).unwrap()
        };
        // Rectified: a column meets the line of each of its points once.
        let rig = Rig::new(camera(0.0), camera(-10.0), LengthUnit::Unit).unwrap();
        let column = |x: f64| (0..40).map(move |y| (x, f64::from(y)));
        let curve1: Vec<_> = column(200.0).map(|(x, y)| Pixel::new(x, y)).collect();
        let curve2: Vec<_> = column(100.0).map(|(x, y)| Pixel::new(x, y)).collect();
        let (track1, track2) =
            (Track::new(&curve1, 0.0).unwrap(), Track::new(&curve2, 0.0).unwrap());
        let scene = Scene { rig: &rig, track1: &track1, track2: &track2 };
        let samples = track1.samples(1.0, usize::MAX);
        let at_most = |most: u64| {
            let check = move |count| {
                let refusal = MatchError::NoCorrespondence { method: "full", candidates: 0 };
                if count <= most { Ok(()) } else { Err(refusal) }
            };
            Hoffmann::default().candidates(&scene, &samples, check)
        };
        let all = at_most(u64::MAX).unwrap().len() as u64;
        assert!(all >= 38, "{all}");
        assert!(at_most(all).is_ok() && at_most(all - 1).is_err());
    }
}
