use std::ops::Range;

use accurate_geom::{Pixel, View2};
use accurate_match::FreeMatch;

/// The part of both curves that both views see, and which of its ends are not the body's.
pub(super) struct MatchedPart {
    pub(super) range1: Range<usize>,
    pub(super) range2: Range<usize>,
    /// Matched indices within the ranges.
    matched: Vec<(usize, usize)>,
    /// Stretches within the ranges that the other view does not see.
    gaps: [Vec<Range<usize>>; 2],
    /// What is known of begin and end.
    pub(super) ends: [End; 2],
}

/// Where the part ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// At the body's tip in both views.
    Tip,
    /// Only a few points found no partner: it may be the tip, matched badly. The part holds them.
    Doubtful,
    /// Where a tail is left out: no tip in any view.
    Seam,
}

/// Unmatched points at an end up to this count are no hidden tail: annotators and pixels differ by
/// that much at a tip.
const TIP_POINTS: usize = 3;
/// Up to this count they may be none: along an epipolar line, rounding hides where the tip belongs.
pub(super) const DOUBTFUL_POINTS: usize = 15;

impl MatchedPart {
    /// `directed2` runs along curve 1; the match speaks of curve 2 as it was given.
    pub(super) fn of(matched: &FreeMatch, count1: usize, directed2: &[Pixel<View2>]) -> Self {
        let count2 = directed2.len();
        let along = |j: usize| if matched.reversed { count2 - 1 - j } else { j };
        let turned = |g: &Range<usize>| {
            if matched.reversed { count2 - g.end..count2 - g.start } else { g.clone() }
        };
        let (mut range1, mut range2) = (matched.matched1.clone(), turned(&matched.matched2));
        let end = |left1: usize, left2: usize| match left1.max(left2) {
            left if left <= TIP_POINTS => End::Tip,
            left if left <= DOUBTFUL_POINTS => End::Doubtful,
            _ => End::Seam,
        };
        let ends = [end(range1.start, range2.start), end(count1 - range1.end, count2 - range2.end)];
        let within = (range1.clone(), range2.clone());
        if ends[0] == End::Doubtful {
            (range1.start, range2.start) = (0, 0);
        }
        if ends[1] == End::Doubtful {
            (range1.end, range2.end) = (count1, count2);
        }
        let pairs = matched
            .pairs
            .iter()
            .map(|&(i, j)| (i, along(j)))
            .filter(|(i, j)| within.0.contains(i) && within.1.contains(j))
            .map(|(i, j)| (i - range1.start, j - range2.start))
            .collect();
        let gaps1 = matched.gaps1.iter().map(|g| shifted(g, range1.start)).collect();
        let gaps2 = matched.gaps2.iter().map(|g| shifted(&turned(g), range2.start)).collect();
        Self { range1, range2, matched: pairs, gaps: [gaps1, gaps2], ends }
    }

    /// Every index with its partner. Where an end is doubtful and `tips` says it is the tip, the last
    /// points are partners.
    pub(super) fn pairs(&self, tips: bool) -> Vec<(usize, usize)> {
        let mut pairs = self.matched.clone();
        if tips && self.ends[0] == End::Doubtful {
            pairs.insert(0, (0, 0));
        }
        if tips && self.ends[1] == End::Doubtful {
            pairs.push((self.range1.len() - 1, self.range2.len() - 1));
        }
        filled(&pairs, &self.gaps)
    }

    /// Which ends are free, alike in both views.
    pub(super) fn free_ends(&self, tips: bool) -> [[bool; 2]; 2] {
        [self.ends.map(|end| end == End::Seam || end == End::Doubtful && !tips); 2]
    }

    /// Fraction of the part that the other view does not see, of the view with more of it.
    pub(super) fn hidden(&self) -> f64 {
        let hidden = |gaps: &[Range<usize>], count: usize| {
            gaps.iter().map(Range::len).sum::<usize>() as f64 / count as f64
        };
        hidden(&self.gaps[0], self.range1.len()).max(hidden(&self.gaps[1], self.range2.len()))
    }
}

fn shifted(range: &Range<usize>, by: usize) -> Range<usize> {
    range.start.saturating_sub(by)..range.end.saturating_sub(by)
}

/// Every index between two pairs gets a partner, evenly: a bridged stretch has few pairs of its own,
/// its points still belong to the body. In the `gaps` of a view, where the other is blind, they get
/// none.
pub(super) fn filled(
    pairs: &[(usize, usize)],
    gaps: &[Vec<Range<usize>>; 2],
) -> Vec<(usize, usize)> {
    let blind = |gaps: &[Range<usize>], from: usize, to: usize| {
        gaps.iter().any(|gap| from < gap.end && gap.start < to)
    };
    let mut all: Vec<(usize, usize)> = pairs.first().copied().into_iter().collect();
    for w in pairs.windows(2) {
        let ((i0, j0), (i1, j1)) = (w[0], w[1]);
        if blind(&gaps[0], i0 + 1, i1) || blind(&gaps[1], j0 + 1, j1) {
            all.push(w[1]);
            continue;
        }
        let steps = i1.saturating_sub(i0).max(j1.saturating_sub(j0));
        for k in 1..=steps {
            let between = |from: usize, to: usize| from + (to - from) * k / steps;
            all.push((between(i0, i1.max(i0)), between(j0, j1.max(j0))));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filling_leaves_no_index_out_and_keeps_the_order() {
        let all = filled(&[(0, 0), (4, 1), (5, 1), (6, 7)], &[vec![], vec![]]);
        for index in 0..=6 {
            assert!(all.iter().any(|p| p.0 == index), "view 1, {index}");
        }
        for index in 0..=7 {
            assert!(all.iter().any(|p| p.1 == index), "view 2, {index}");
        }
        assert!(all.windows(2).all(|w| w[0].0 <= w[1].0 && w[0].1 <= w[1].1));
    }

    #[test]
    fn a_gap_is_not_filled() {
        let pairs = [(0, 0), (2, 2), (12, 3), (14, 5)];
        let gap = std::iter::once(3..12).collect();
        let all = filled(&pairs, &[gap, vec![]]);
        assert_eq!(all, [(0, 0), (1, 1), (2, 2), (12, 3), (13, 4), (14, 5)]);
    }
}
