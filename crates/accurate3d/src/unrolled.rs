use std::ops::Range;

use accurate_geom::{EpipolarAngle, Pixel, Rig, View, View1, View2};
use accurate_match::{FreeMatch, FreeMatcher, MatchError, tangency_sines1, tangency_sines2};

/// Two matched closed curves cut open: once around and somewhat more on both sides, running the same
/// way from partners to partners.
pub(crate) struct Unrolled {
    pub(crate) points1: Vec<Pixel<View1>>,
    pub(crate) points2: Vec<Pixel<View2>>,
    /// Of the closed curves, around once.
    pub(crate) matched: FreeMatch,
    once1: Range<usize>,
    once2: Range<usize>,
}

/// How far the curves go on beyond once around, on each side, px: several times the reach of a knot,
/// which is about 20 px.
const OVERLAP_PX: f64 = 80.0;
/// And at most this fraction of once around.
const MOST_OVERLAP: f64 = 0.45;

impl Unrolled {
    /// Two closed curves in the directions of [`FreeMatcher::match_closed`], all cut at the same point
    /// of curve 1. The first point of a curve may be repeated at its end. Only every `stride`th point is matched, which leaves less than a `stride²`th of the cost.
    ///
    /// # Errors
    /// As [`FreeMatcher::match_closed`].
    pub(crate) fn in_both_directions(
        points1: &[Pixel<View1>],
        points2: &[Pixel<View2>],
        stride: usize,
        matcher: &FreeMatcher,
        rig: &Rig,
    ) -> Result<Vec<Self>, MatchError> {
        let curves = (without_repeat(points1), without_repeat(points2));
        let points1: Vec<_> = curves.0.iter().copied().step_by(stride).collect();
        let points2: Vec<_> = curves.1.iter().copied().step_by(stride).collect();
        let around = matcher.match_closed(&points1, &points2, rig)?;
        let seam = seam(&points1, &points2, &around, matcher.params.tangency.window_px, rig)?;
        Ok(around.into_iter().map(|matched| Self::at(seam, curves, stride, matched)).collect())
    }

    /// Once around and no more: as many points in every direction.
    pub(crate) fn once(&self) -> (&[Pixel<View1>], &[Pixel<View2>]) {
        (&self.points1[self.once1.clone()], &self.points2[self.once2.clone()])
    }

    /// Cuts at matched point `seam` of curve 1 and its partner.
    fn at(
        seam: usize,
        (points1, points2): (&[Pixel<View1>], &[Pixel<View2>]),
        stride: usize,
        matched: FreeMatch,
    ) -> Self {
        let (n1, n2) = (points1.len().div_ceil(stride), points2.len().div_ceil(stride));
        let along = |j: usize| if matched.reversed { n2 - 1 - j } else { j };
        let once = growing(matched.pairs.iter().map(|&(i, j)| (i, along(j))), n1, n2);
        let turns: Vec<_> = (0..4)
            .flat_map(|turn| once.iter().map(move |&(i, j)| (i + turn * n1, j + turn * n2)))
            .collect();
        let length_px = ring_length(points1).max(ring_length(points2));
        let overlap = (OVERLAP_PX / length_px).min(MOST_OVERLAP);
        let extra = (overlap * n1 as f64).ceil() as usize;
        // The pairs cover four turns from the first of them on; once around begins in the second, and
        // with what it goes on it ends in the fourth at most.
        let first = once.first().map_or(0, |pair| pair.0);
        let begin = if seam < first { seam + 2 * n1 } else { seam + n1 };
        let (from, to) = (begin - extra, begin + n1 + extra);
        let partner = |i: usize| {
            let after = turns.partition_point(|pair| pair.0 < i).min(turns.len() - 1);
            let before = after.saturating_sub(1);
            let nearer = turns[after].0.abs_diff(i) <= turns[before].0.abs_diff(i);
            turns[if nearer { after } else { before }].1
        };
        let (from2, begin2, to2) = (partner(from), partner(begin), partner(to));
        // From matched points, counted on from turn to turn, to those given.
        let (all1, all2) = (points1.len(), points2.len());
        let given1 = |i: usize| i / n1 * all1 + i % n1 * stride;
        let given2 = |j: usize| j / n2 * all2 + j % n2 * stride;
        let last2 = (all2 - 1) / stride * stride;
        let directed2 = |j: usize| {
            // Read backwards, the first matched point is the last one that was taken.
            if matched.reversed {
                points2[(last2 + all2 - j % all2) % all2]
            } else {
                points2[j % all2]
            }
        };
        let (from, to) = (given1(from), given1(to));
        let begin1 = given1(begin) - from;
        let (from2, begin2, to2) = (given2(from2), given2(begin2), given2(to2));
        Self {
            once1: begin1..begin1 + all1 + 1,
            once2: begin2 - from2..begin2 - from2 + all2 + 1,
            points1: (from..=to).map(|i| points1[i % all1]).collect(),
            points2: (from2..=to2.max(begin2 + all2)).map(directed2).collect(),
            matched,
        }
    }
}

/// Pairs once around, with indices that go on growing where a curve begins anew. The last pair may
/// be the first again; it is left out.
fn growing(
    pairs: impl Iterator<Item = (usize, usize)>,
    n1: usize,
    n2: usize,
) -> Vec<(usize, usize)> {
    let mut once: Vec<(usize, usize)> = Vec::new();
    let (mut turns1, mut turns2) = (0, 0);
    for (i, j) in pairs {
        let (mut i, mut j) = (i + turns1 * n1, j + turns2 * n2);
        if let Some(&(i0, j0)) = once.last() {
            // A step back of more than half a turn is a step over the cut.
            if i + n1 / 2 < i0 {
                (i, turns1) = (i + n1, turns1 + 1);
            }
            if j + n2 / 2 < j0 {
                (j, turns2) = (j + n2, turns2 + 1);
            }
            (i, j) = (i.max(i0), j.max(j0));
        }
        once.push((i, j));
    }
    if let Some(&first) = once.first() {
        once.retain(|&(i, j)| i < first.0 + n1 && j < first.1 + n2 || (i, j) == first);
    }
    once
}

/// The point of curve 1 at which it and, in every match, its partner cross the epipolar lines most
/// steeply: there the partner is known best.
fn seam(
    points1: &[Pixel<View1>],
    points2: &[Pixel<View2>],
    around: &[FreeMatch],
    window_px: f64,
    rig: &Rig,
) -> Result<usize, MatchError> {
    let angles = EpipolarAngle::new(rig);
    let mut steepness = tangency_sines1(&angles, points1, window_px)?;
    let sines2 = tangency_sines2(&angles, points2, window_px)?;
    for matched in around {
        let mut partner = vec![0.0_f64; steepness.len()];
        for &(i, j) in &matched.pairs {
            partner[i] = partner[i].max(sines2[j]);
        }
        for (steep, partner) in steepness.iter_mut().zip(partner) {
            *steep = steep.min(partner);
        }
    }
    // The first of equals.
    let places = (0..steepness.len()).rev();
    Ok(places.max_by(|a, b| steepness[*a].total_cmp(&steepness[*b])).unwrap_or(0))
}

pub(crate) fn without_repeat<V: View>(points: &[Pixel<V>]) -> &[Pixel<V>] {
    match points {
        [first, rest @ .., last] if !rest.is_empty() && first == last => {
            &points[..points.len() - 1]
        }
        _ => points,
    }
}

fn ring_length<V: View>(points: &[Pixel<V>]) -> f64 {
    (0..points.len()).map(|k| points[k].distance(points[(k + 1) % points.len()])).sum()
}
