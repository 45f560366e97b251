use std::ops::RangeInclusive;

use crate::{CostModel, longest_chain};

/// Two positions on the curves that lie on one epipolar plane, or as nearly as the curves allow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchedPosition {
    /// Index along the curve of view 1, fractional between two points.
    pub at1: f64,
    /// Index along the curve of view 2.
    pub at2: f64,
    /// Whether the planes are equal to rounding: a point of one curve and the crossing of its
    /// epipolar line with the other curve. Otherwise two points as matched, near which nothing
    /// crosses.
    pub exact: bool,
}

/// Closer than this, in samples, two positions are one: far below any use, far above rounding.
const SAME: f64 = 1e-6;

/// Sharpens a monotone path of cells to sub-pixel positions, in order along both curves.
///
/// The pairs of positions with distance zero form curves in the plane of (position in view 1,
/// position in view 2); the path follows one of them within a sample or two. For every point of
/// either curve this finds where its epipolar line crosses the other curve next to the path. Of
/// crossings that contradict each other's order, the longest consistent chain is kept. A cell none
/// of whose points has a crossing stays as it is. Nothing lies beyond the ends of the path.
///
/// `path` is connected: every step advances one index or both by 1; cells outside the curves are
/// ignored.
///
/// # Source
/// Ours; the exact counterpart of the operator R of ACCURATE, section 2.3, with signed distances.
///
/// # Cost
/// O(n log n) for a path of n cells.
pub fn zero_crossings(path: &[(usize, usize)], costs: &CostModel) -> Vec<MatchedPosition> {
    let path: Vec<_> =
        path.iter().copied().filter(|&(i, j)| i < costs.n1() && j < costs.n2()).collect();
    let (Some(&begin), Some(&end)) = (path.first(), path.last()) else { return Vec::new() };
    let mut crossings = Vec::with_capacity(2 * path.len());
    let mut crossed1 = vec![false; costs.n1()];
    let mut crossed2 = vec![false; costs.n2()];
    for run in path.chunk_by(|a, b| a.0 == b.0) {
        let (i, from, to) = (run[0].0, run[0].1, run[run.len() - 1].1);
        let signed = |j| costs.signed_distance_in_view2(i, j);
        if let Some(at2) = crossing(from, to, begin.1..=end.1, signed) {
            crossed1[i] = true;
            crossings.push(MatchedPosition { at1: i as f64, at2, exact: true });
        }
    }
    for run in path.chunk_by(|a, b| a.1 == b.1) {
        let (j, from, to) = (run[0].1, run[0].0, run[run.len() - 1].0);
        let signed = |i| costs.signed_distance_in_view1(i, j);
        if let Some(at1) = crossing(from, to, begin.0..=end.0, signed) {
            crossed2[j] = true;
            crossings.push(MatchedPosition { at1, at2: j as f64, exact: true });
        }
    }
    let chain = advancing(crossings);
    let left = path.iter().filter(|&&(i, j)| !crossed1[i] && !crossed2[j]);
    merge(chain, left.map(|&(i, j)| (i as f64, j as f64)))
}

/// Where a sampled function of one index changes sign, next to the indices `from..=to` but `within`
/// the path: of several places the nearest to its least absolute value among them, then the first.
fn crossing(
    from: usize,
    to: usize,
    within: RangeInclusive<usize>,
    signed: impl Fn(usize) -> Option<f64>,
) -> Option<f64> {
    let first = from.saturating_sub(1).max(*within.start());
    let last = (to + 1).min(*within.end());
    let values: Vec<Option<f64>> = (first..=last).map(signed).collect();
    let mut least = (f64::INFINITY, from as f64);
    let mut places = Vec::new();
    for (k, value) in values.iter().enumerate() {
        let Some(value) = *value else { continue };
        let index = first + k;
        if (from..=to).contains(&index) && value.abs() < least.0 {
            least = (value.abs(), index as f64);
        }
        if value == 0.0 {
            places.push(index as f64);
        } else if let Some(Some(next)) = values.get(k + 1).copied()
            && (value < 0.0) != (next < 0.0)
            && next != 0.0
        {
            // Of opposite sign: the difference is no smaller than either.
            let t = value / (value - next);
            if t.is_finite() {
                places.push(index as f64 + t);
            }
        }
    }
    let distance = |x: &f64| (x - least.1).abs();
    places.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.total_cmp(b)))
}

/// The longest subsequence that advances in both curves, without repeats.
fn advancing(mut crossings: Vec<MatchedPosition>) -> Vec<MatchedPosition> {
    crossings.sort_by(|a, b| a.at1.total_cmp(&b.at1).then(a.at2.total_cmp(&b.at2)));
    let mut chain = longest_chain(&crossings, |a, b| a.at2 <= b.at2);
    chain.dedup_by(|b, a| b.at1 - a.at1 <= SAME && b.at2 - a.at2 <= SAME);
    chain
}

/// Inserts the cells that keep the order.
fn merge(
    chain: Vec<MatchedPosition>,
    cells: impl Iterator<Item = (f64, f64)>,
) -> Vec<MatchedPosition> {
    let mut merged: Vec<MatchedPosition> = Vec::with_capacity(chain.len());
    let mut rest = chain.into_iter().peekable();
    for (at1, at2) in cells {
        while let Some(next) = rest.next_if(|next| next.at1 <= at1 && next.at2 <= at2) {
            merged.push(next);
        }
        let after = merged.last().is_none_or(|last| last.at1 <= at1 && last.at2 <= at2);
        let before = rest.peek().is_none_or(|next| at1 <= next.at1 && at2 <= next.at2);
        if after && before {
            merged.push(MatchedPosition { at1, at2, exact: false });
        }
    }
    merged.extend(rest);
    merged
}
