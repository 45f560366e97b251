use std::ops::Range;

use accurate_geom::{EpipolarAngle, Pixel, Rig, Triangulation, View, View1, View2};

use crate::angle_signal::cumulative_lengths;
use crate::cyclic_dp::cyclic_track;
use crate::ends::not_negative;
use crate::free_dp::align_free_near;
use crate::tangency::{Course, bridge};
use crate::{
    CostModel, CurveMatcher, CurvePoint, CurveReconstruction, DistanceKind, FreeEnds, MatchError,
    MovePrices, OpenEnds, PixelPair, PointFlag, TangencyParams, align_free, tangency_sines1,
    tangency_sines2, triangulate_pairs, zero_crossings,
};

/// What [`FreeMatcher`] leaves to choose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeMatchParams {
    /// The distance that the path adds up. [`DistanceKind::Sampson`]: with noise of standard
    /// deviation σ in every pixel coordinate of both views, so is its error.
    pub distance: DistanceKind,
    /// Prices, px. All skips cost 3 σ with σ = 0.3 px, about that of whole pixels (1/√12).
    pub prices: MovePrices,
    /// How much of the curve of view 1 may be unseen in view 2.
    pub free1: FreeEnds,
    /// How much of the curve of view 2 may be unseen in view 1; begin and end as the curve is given.
    pub free2: FreeEnds,
    /// At a free end where one view stands still at its last point while the other goes on, points
    /// whose distance exceeds the least by more than this, px, are left out, also beyond the free
    /// length. 0.3: one σ.
    pub end_run_px: f64,
    /// Whether only the neighbourhood of a first, coarse path is looked at: many times as fast, and most
    /// often the same. Not for closed curves. No.
    pub near_coarse_path: bool,
    /// Which stretches are not trusted.
    pub tangency: TangencyParams,
    /// How each pair becomes a 3D point.
    pub triangulation: Triangulation,
}

impl FreeMatchParams {
    /// The values above, all ends free.
    pub const DEFAULT: Self = Self {
        distance: DistanceKind::Sampson,
        prices: MovePrices {
            diagonal_weight: 2.0,
            step: 0.02,
            end_skip: 0.9,
            gap_open: 3.0,
            gap_skip: 0.9,
        },
        free1: FreeEnds::ANY,
        free2: FreeEnds::ANY,
        end_run_px: 0.3,
        near_coarse_path: false,
        tangency: TangencyParams::DEFAULT,
        triangulation: Triangulation::LindstromNiter2,
    };
}

impl Default for FreeMatchParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Matches two ordered curves of which either view may see more: at the ends, and in gaps along the
/// way. The direction of curve 2 is found, or given.
///
/// 1. The cheapest monotone path with open ends and gaps ([`align_free`]).
/// 2. Positions between the points ([`zero_crossings`]).
/// 3. Stretches along epipolar lines are bridged by arc length and flagged ([`TangencyParams`]).
/// 4. Triangulation.
///
/// # Source
/// ACCURATE, section 2.3, extended; see the stages.
///
/// # Cost
/// O(n1·n2) time per direction, 1 byte per pair of points of memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeMatcher {
    /// The choices.
    pub params: FreeMatchParams,
}

/// What [`FreeMatcher`] found. All lists run along curve 1.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeMatch {
    /// Points in order along the body, at least one.
    pub points: Vec<CurvePoint>,
    /// How each point was found; as long as `points`.
    pub flags: Vec<PointFlag>,
    /// Fractional indices `(curve 1, curve 2)` of each point, of the curves as given.
    pub positions: Vec<(f64, f64)>,
    /// Nearest indices of each point.
    pub pairs: Vec<(usize, usize)>,
    /// The part of curve 1 from the first to the last match.
    pub matched1: Range<usize>,
    /// The part of curve 2 from the first to the last match.
    pub matched2: Range<usize>,
    /// Stretches of curve 1 within `matched1` that view 2 does not see.
    pub gaps1: Vec<Range<usize>>,
    /// Stretches of curve 2 within `matched2` that view 1 does not see.
    pub gaps2: Vec<Range<usize>>,
    /// Whether curve 2 runs against curve 1.
    pub reversed: bool,
    /// Cost of the path with all prices per point of either curve, px: 0 for a perfect match, at most
    /// about [`MovePrices::end_skip`].
    pub mean_cost_px: f64,
    /// By how much `mean_cost_px` of the other direction is higher: the confidence in `reversed`;
    /// below 0 if it is lower ([`FreeMatcher::match_closed`] gives both). Infinite if the other
    /// direction is impossible, `None` if it was not asked for.
    pub margin_px: Option<f64>,
    /// Mean distance in view 1, px, of matched points to the epipolar lines of their partners,
    /// before they were moved to the exact crossings: how well the curves agree. (After that,
    /// [`CurvePoint::epipolar_distance_px`] is 0 where the flag is [`PointFlag::Exact`].)
    pub mean_epipolar_distance_px: f64,
    /// Pairs left out because their rays do not meet in front of both cameras.
    pub dropped: usize,
}

impl FreeMatcher {
    /// A matcher with `params`.
    pub const fn new(params: FreeMatchParams) -> Self {
        Self { params }
    }

    /// Matches curves whose direction is known: curve 2 is read backwards if `reversed`.
    ///
    /// # Errors
    /// As [`CostModel::new`], [`align_free`] and [`triangulate_pairs`]; [`MatchError::Geometry`] for
    /// parameters that are negative or NaN.
    pub fn match_directed(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        reversed: bool,
        rig: &Rig,
    ) -> Result<FreeMatch, MatchError> {
        self.finish(self.open(curve1, curve2, reversed, rig)?, curve2, rig, None)
    }

    /// Matches curves in both directions and returns the better with its margin; curve 2 as given if
    /// both cost the same.
    ///
    /// # Errors
    /// As [`match_directed`](Self::match_directed).
    pub fn match_best_direction(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<FreeMatch, MatchError> {
        let (best, margin) =
            better(self.open(curve1, curve2, false, rig), self.open(curve1, curve2, true, rig))?;
        self.finish(best, curve2, rig, Some(margin))
    }

    /// Matches two closed curves, each cut anywhere, in both directions of the second: as it was given
    /// first, then backwards; one of them if the other is impossible. The first point is not repeated
    /// at the end. There are no free ends and no gaps. [`FreeMatch::margin_px`] is how much dearer the
    /// other direction is, below 0 for the dearer one: a ring that faces both cameras matches in both
    /// directions, each of its halves with either of the other view, and which one it is only bending
    /// can tell.
    ///
    /// # Errors
    /// As [`match_directed`](Self::match_directed).
    ///
    /// # Cost
    /// O(n1·n2·log n2) time per direction, 9 bytes per pair of points of memory.
    pub fn match_closed(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<Vec<FreeMatch>, MatchError> {
        let around =
            |reversed| self.finish(self.closed(curve1, curve2, reversed, rig)?, curve2, rig, None);
        let (mut one, other) = possible(around(false), around(true))?;
        let Some(mut other) = other else {
            one.margin_px = Some(f64::INFINITY);
            return Ok(vec![one]);
        };
        let margin_px = other.mean_cost_px - one.mean_cost_px;
        (one.margin_px, other.margin_px) = (Some(margin_px), Some(-margin_px));
        Ok(vec![one, other])
    }

    fn open(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        reversed: bool,
        rig: &Rig,
    ) -> Result<Candidate, MatchError> {
        let params = &self.params;
        let (free1, free2) = (params.free1.validate()?, params.free2.validate()?);
        let free2 = if reversed { free2.reversed() } else { free2 };
        let curve2 = oriented(curve2, reversed);
        let costs = CostModel::new(rig.fundamental(), curve1, &curve2, params.distance)?;
        let (begin1, end1) = samples_within(curve1, free1);
        let (begin2, end2) = samples_within(&curve2, free2);
        let ends = OpenEnds { begin1, end1, begin2, end2 };
        let (n1, n2) = (costs.n1(), costs.n2());
        let found = if params.near_coarse_path {
            align_free_near(&costs, &params.prices, &ends)?
        } else {
            let fill = |i: usize, row: &mut [f64]| costs.fill_row(i, row);
            align_free(n1, n2, fill, &params.prices, &ends)?
        };
        let path = trim_end_runs(&found.path, &costs, [free1, free2], params.end_run_px);
        let mean_cost_px = found.total_cost / (n1 + n2) as f64;
        Ok(Candidate { costs, path, reversed, first2: 0, closed: false, mean_cost_px })
    }

    fn closed(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        reversed: bool,
        rig: &Rig,
    ) -> Result<Candidate, MatchError> {
        let distance = self.params.distance;
        let curve2 = oriented(curve2, reversed);
        let costs = CostModel::new(rig.fundamental(), curve1, &curve2, distance)?;
        let (n1, n2) = (costs.n1(), costs.n2());
        let track = cyclic_track(n1, n2, |i, j| costs.cost(i, j), &self.params.prices)?;
        // Cut both where the path begins, and repeat the first point at the end.
        let first2 = track.cells.first().map_or(0, |cell| cell.1);
        let around = |n: usize, first: usize| (first..=first + n).map(move |k| k % n);
        let curve1: Vec<_> = around(n1, 0).map(|i| curve1[i]).collect();
        let curve2: Vec<_> = around(n2, first2).map(|j| curve2[j]).collect();
        let path = track.cells.iter().map(|&(i, j)| (i, j - first2)).collect();
        let costs = CostModel::new(rig.fundamental(), &curve1, &curve2, distance)?;
        let mean_cost_px = track.total / (n1 + n2) as f64;
        Ok(Candidate { costs, path, reversed, first2, closed: true, mean_cost_px })
    }

    fn finish(
        &self,
        found: Candidate,
        given2: &[Pixel<View2>],
        rig: &Rig,
        margin_px: Option<f64>,
    ) -> Result<FreeMatch, MatchError> {
        let params = &self.params;
        params.tangency.validate()?;
        not_negative("end_run_px", params.end_run_px)?;
        let Candidate { costs, path, .. } = &found;
        let (curve1, curve2) = (costs.curve1(), costs.curve2());
        let angles = EpipolarAngle::new(rig);
        let window_px = params.tangency.window_px;
        let course1 = Course::new(curve1, tangency_sines1(&angles, curve1, window_px)?);
        let course2 = Course::new(curve2, tangency_sines2(&angles, curve2, window_px)?);
        let distance: f64 = path.iter().map(|&(i, j)| costs.distance_in_view1(i, j)).sum();

        let mut pairs = Vec::new();
        let mut flags = Vec::new();
        let mut positions = Vec::new();
        let mut gaps1 = Vec::new();
        let mut gaps2 = Vec::new();
        let n2 = given2.len();
        let connected = |a: &(usize, usize), b: &(usize, usize)| b.0 - a.0 <= 1 && b.1 - a.1 <= 1;
        let mut before: Option<(usize, usize)> = None;
        for stretch in path.chunk_by(connected) {
            if let (Some((i, j)), Some(next)) = (before, stretch.first()) {
                let gap2 = found.given_range(j + 1, next.1, n2);
                gaps1.extend((i + 1 < next.0).then_some(i + 1..next.0));
                gaps2.extend((j + 1 < next.1).then_some(gap2));
            }
            before = stretch.last().copied();
            let matched = zero_crossings(stretch, costs);
            for (position, flag) in bridge(&matched, &course1, &course2, &params.tangency) {
                let (at1, at2) = (position.at1, position.at2);
                let cell = (nearest(at1, curve1.len()), nearest(at2, curve2.len()));
                pairs.push(PixelPair {
                    cell: found.given(cell, curve1.len(), n2),
                    pixel1: pixel_at(curve1, at1),
                    pixel2: pixel_at(curve2, at2),
                });
                // A ring's last sample is its first again.
                let at1 = if found.closed { at1 % (curve1.len() - 1) as f64 } else { at1 };
                positions.push((at1, found.given_position(at2, n2)));
                flags.push(flag);
            }
        }
        let method = self.name();
        let reconstruction = triangulate_pairs(method, rig, params.triangulation, &pairs)?;
        if reconstruction.dropped > 0 {
            // Rare; the survivors are found by asking again.
            let survives = |pair: &PixelPair| {
                triangulate_pairs(method, rig, params.triangulation, std::slice::from_ref(pair))
                    .is_ok()
            };
            let survivors: Vec<bool> = pairs.iter().map(survives).collect();
            let mut flag_survives = survivors.iter();
            flags.retain(|_| flag_survives.next().is_some_and(|s| *s));
            let mut position_survives = survivors.iter();
            positions.retain(|_| position_survives.next().is_some_and(|s| *s));
        }
        let (first, last) = match (path.first(), path.last()) {
            (Some(first), Some(last)) if !found.closed => (*first, *last),
            _ => ((0, 0), (curve1.len() - 1 - usize::from(found.closed), n2 - 1)),
        };
        Ok(FreeMatch {
            points: reconstruction.points,
            flags,
            positions,
            pairs: reconstruction.pairs,
            matched1: first.0..last.0 + 1,
            matched2: found.given_range(first.1, last.1 + 1, n2),
            gaps1,
            gaps2,
            reversed: found.reversed,
            mean_cost_px: found.mean_cost_px,
            margin_px,
            mean_epipolar_distance_px: distance / path.len() as f64,
            dropped: reconstruction.dropped,
        })
    }
}

impl Default for FreeMatcher {
    /// [`FreeMatchParams::DEFAULT`].
    fn default() -> Self {
        Self::new(FreeMatchParams::DEFAULT)
    }
}

impl CurveMatcher for FreeMatcher {
    fn name(&self) -> &'static str {
        "free-ends"
    }

    /// [`match_best_direction`](FreeMatcher::match_best_direction), without the flags.
    fn reconstruct(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CurveReconstruction, MatchError> {
        let FreeMatch { points, pairs, dropped, .. } =
            self.match_best_direction(curve1, curve2, rig)?;
        Ok(CurveReconstruction { points, pairs, dropped })
    }
}

/// A path through one direction, and how its curve 2 came from the given one.
struct Candidate {
    costs: CostModel,
    path: Vec<(usize, usize)>,
    reversed: bool,
    /// Where the closed curve 2 was cut, after it was reversed.
    first2: usize,
    closed: bool,
    mean_cost_px: f64,
}

impl Candidate {
    /// The given indices of a cell.
    fn given(&self, (i, j): (usize, usize), count1: usize, n2: usize) -> (usize, usize) {
        // A closed curve 1 carries its first point again.
        let i = if self.closed && i + 1 == count1 { 0 } else { i };
        let j = (j + self.first2) % n2;
        (i, if self.reversed { n2 - 1 - j } else { j })
    }

    /// The given fractional index of a position on curve 2.
    fn given_position(&self, at2: f64, n2: usize) -> f64 {
        let at2 = at2 + self.first2 as f64;
        let at2 = if self.closed { at2 % n2 as f64 } else { at2 };
        let at2 = if self.reversed { (n2 - 1) as f64 - at2 } else { at2 };
        // Between the last point and the first of a reversed closed curve.
        if at2 < 0.0 { at2 + n2 as f64 } else { at2 }
    }

    /// The given indices of the range `from..to` of an open curve 2.
    fn given_range(&self, from: usize, to: usize, n2: usize) -> Range<usize> {
        if self.reversed { n2 - to..n2 - from } else { from..to }
    }
}

fn better(
    forwards: Result<Candidate, MatchError>,
    backwards: Result<Candidate, MatchError>,
) -> Result<(Candidate, f64), MatchError> {
    let (one, other) = possible(forwards, backwards)?;
    Ok(match other {
        None => (one, f64::INFINITY),
        Some(other) if other.mean_cost_px < one.mean_cost_px => {
            let margin = one.mean_cost_px - other.mean_cost_px;
            (other, margin)
        }
        Some(other) => {
            let margin = other.mean_cost_px - one.mean_cost_px;
            (one, margin)
        }
    })
}

/// What was found in both directions, or in the only one that has a path.
fn possible<T>(
    forwards: Result<T, MatchError>,
    backwards: Result<T, MatchError>,
) -> Result<(T, Option<T>), MatchError> {
    match (forwards, backwards) {
        (Ok(one), Ok(other)) => Ok((one, Some(other))),
        (Ok(only), Err(MatchError::NoFinitePath { .. }))
        | (Err(MatchError::NoFinitePath { .. }), Ok(only)) => Ok((only, None)),
        (Err(error), _) | (_, Err(error)) => Err(error),
    }
}

fn oriented<V: View>(curve: &[Pixel<V>], reversed: bool) -> Vec<Pixel<V>> {
    let mut curve = curve.to_vec();
    if reversed {
        curve.reverse();
    }
    curve
}

/// Points that the free ends may leave out, at begin and end.
fn samples_within<V: View>(curve: &[Pixel<V>], free: FreeEnds) -> (usize, usize) {
    if curve.is_empty() {
        return (0, 0); // refused by the cost model
    }
    // Of an end that is seen no point is left out, not even one that stands twice.
    let at_most = |px: f64, samples: usize| if px > 0.0 { samples } else { 0 };
    let lengths = cumulative_lengths(curve);
    let whole = lengths[lengths.len() - 1];
    let begin = lengths.partition_point(|l| *l <= free.begin_px);
    let end = lengths.len() - lengths.partition_point(|l| whole - *l > free.end_px);
    (at_most(free.begin_px, begin.saturating_sub(1)), at_most(free.end_px, end.saturating_sub(1)))
}

/// Where a path that may end earlier ends with one view standing still, at most one of those pairs
/// is right: leaves out what lies beyond the pairs that are as good as the best, within `slack_px`.
///
/// Of the freedom of both views' ends it only asks whether the view that goes on is free there at all: a run
/// may be left out on top of, and far longer than, what the alignment was allowed to skip.
fn trim_end_runs(
    path: &[(usize, usize)],
    costs: &CostModel,
    [free1, free2]: [FreeEnds; 2],
    slack_px: f64,
) -> Vec<(usize, usize)> {
    let beyond = |cells: &mut dyn Iterator<Item = (usize, usize)>, free1: bool, free2: bool| {
        let mut cells = cells.peekable();
        let (Some(last), Some(&next)) = (cells.next(), cells.peek()) else { return 0 };
        let still1 = last.0 == next.0 && free2;
        let still2 = last.1 == next.1 && free1;
        let in_run =
            |cell: &(usize, usize)| still1 && cell.0 == last.0 || still2 && cell.1 == last.1;
        let run: Vec<f64> = std::iter::once(last)
            .chain(cells.take_while(in_run))
            .map(|(i, j)| costs.cost(i, j))
            .collect();
        let least = run.iter().copied().fold(f64::INFINITY, f64::min);
        run.iter().position(|d| *d <= least + slack_px).unwrap_or(0)
    };
    let back = beyond(&mut path.iter().rev().copied(), free1.end_px > 0.0, free2.end_px > 0.0);
    let path = &path[..path.len() - back];
    let front = beyond(&mut path.iter().copied(), free1.begin_px > 0.0, free2.begin_px > 0.0);
    path[front..].to_vec()
}

fn nearest(at: f64, count: usize) -> usize {
    (at.round() as usize).min(count - 1)
}

fn pixel_at<V: View>(curve: &[Pixel<V>], at: f64) -> Pixel<V> {
    let k = (at as usize).min(curve.len() - 1);
    let (a, t) = (curve[k], at - k as f64);
    match curve.get(k + 1) {
        Some(b) if t > 0.0 => Pixel::new(a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)),
        _ => a,
    }
}
