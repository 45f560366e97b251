use accurate_fit::{FitError, PointFitParams, fit_points};
use accurate_geom::{Pixel, View, View2};
use accurate_match::{FreeMatch, FreeMatchParams, FreeMatcher, TangencyParams};

use crate::sampled_curve::{SampledCurve, along_epipolar_lines, sampled};
use crate::{Diagnostics, Error, Explanation, Params, Reconstruction, Traces, ViewPair};

/// Our own method on ordered points: matched in the better direction with free ends and gaps, then
/// one 3D spline adjusted to both views.
///
/// The adjustment refuses a match that is no basis for it; the match is then returned as it is, and
/// the diagnostics say why.
pub(crate) fn adjusted_points(pair: &ViewPair, params: &Params) -> Result<Reconstruction, Error> {
    let case = || pair.id.clone();
    let matching = |source| Error::Matching { case: case(), source };
    let (points1, points2) = pair
        .points
        .as_ref()
        .ok_or_else(|| Error::MissingInput { case: case(), input: params.input })?;
    let whole = whole_pixels(points1) && whole_pixels(points2);
    let tangency = if whole { TangencyParams::WHOLE_PIXELS } else { TangencyParams::DEFAULT };
    let matcher = FreeMatcher::new(FreeMatchParams { tangency, ..FreeMatchParams::DEFAULT });
    let matched = matcher.match_best_direction(points1, points2, &pair.rig).map_err(matching)?;

    let mut directed2 = points2.clone();
    if matched.reversed {
        directed2.reverse();
    }
    let fit = {
        let part = MatchedPart::of(&matched, points1.len(), &directed2);
        let fit_params = PointFitParams { free_ends: part.free_ends, ..PointFitParams::DEFAULT };
        let curve1 = &points1[part.range1.clone()];
        let curve2 = &directed2[part.range2.clone()];
        fit_points(curve1, curve2, &part.pairs, &pair.rig, &fit_params)
    };
    let (points, covariances, refusal) = match fit {
        Ok(fit) => {
            let SampledCurve { points, covariances } =
                sampled(&fit.curve, Some(&fit.covariance), &pair.rig);
            (points, covariances, None)
        }
        Err(refusal @ (FitError::BadMatch { .. } | FitError::TooFewPoints { .. })) => {
            (matched.points.clone(), None, Some(refusal.to_string()))
        }
        Err(source) => return Err(Error::Fitting { case: case(), source }),
    };
    let along_epipolar_line = along_epipolar_lines(&points, &pair.rig).map_err(matching)?;
    let counts = [points1.len(), points2.len()];
    let diagnostics = Diagnostics::of_free_match(&matched, counts, &along_epipolar_line, refusal);
    Ok(Reconstruction {
        id: case(),
        method: params.method,
        input: params.input,
        unit: pair.rig.unit(),
        points,
        covariances,
        along_epipolar_line,
        traces: Traces::given(points1.clone(), points2.clone(), matched.reversed),
        diagnostics,
        explanation: Explanation::default(),
    })
}

fn whole_pixels<V: View>(points: &[Pixel<V>]) -> bool {
    points.iter().all(|p| p.x.fract() == 0.0 && p.y.fract() == 0.0)
}

/// The part of both curves that both views see, and which of its ends are not the body's.
struct MatchedPart {
    range1: std::ops::Range<usize>,
    range2: std::ops::Range<usize>,
    /// Matched indices within the ranges.
    pairs: Vec<(usize, usize)>,
    free_ends: [[bool; 2]; 2],
}

/// Unmatched points at an end up to this count are no hidden tail: annotators and pixels differ by
/// that much at a tip.
const TIP_POINTS: usize = 3;

impl MatchedPart {
    /// `directed2` runs along curve 1; the match speaks of curve 2 as it was given.
    fn of(matched: &FreeMatch, count1: usize, directed2: &[Pixel<View2>]) -> Self {
        let count2 = directed2.len();
        let along = |j: usize| if matched.reversed { count2 - 1 - j } else { j };
        let range1 = matched.matched1.clone();
        let range2 = if matched.reversed {
            count2 - matched.matched2.end..count2 - matched.matched2.start
        } else {
            matched.matched2.clone()
        };
        let pairs: Vec<_> = matched
            .pairs
            .iter()
            .map(|&(i, j)| (i, along(j)))
            .filter(|(i, j)| range1.contains(i) && range2.contains(j))
            .map(|(i, j)| (i - range1.start, j - range2.start))
            .collect();
        // A bridged stretch has few pairs of its own; its points still belong to the body. Where a
        // view is blind, they have no partner.
        let gaps = !(matched.gaps1.is_empty() && matched.gaps2.is_empty());
        let pairs = if gaps { pairs } else { filled(&pairs) };
        // Where either view's tail is left out, the seam is no tip in any view.
        let begins = range1.start > TIP_POINTS || range2.start > TIP_POINTS;
        let ends = count1 - range1.end > TIP_POINTS || count2 - range2.end > TIP_POINTS;
        Self { range1, range2, pairs, free_ends: [[begins, ends]; 2] }
    }
}

/// Every index between two pairs gets a partner, evenly.
fn filled(pairs: &[(usize, usize)]) -> Vec<(usize, usize)> {
    let mut all: Vec<(usize, usize)> = pairs.first().copied().into_iter().collect();
    for w in pairs.windows(2) {
        let ((i0, j0), (i1, j1)) = (w[0], w[1]);
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
        let all = filled(&[(0, 0), (4, 1), (5, 1), (6, 7)]);
        for index in 0..=6 {
            assert!(all.iter().any(|p| p.0 == index), "view 1, {index}");
        }
        for index in 0..=7 {
            assert!(all.iter().any(|p| p.1 == index), "view 2, {index}");
        }
        assert!(all.windows(2).all(|w| w[0].0 <= w[1].0 && w[0].1 <= w[1].1));
    }

    #[test]
    fn whole_pixels_are_told_from_sub_pixel_points() {
        let p = |x, y| Pixel::<View2>::new(x, y);
        assert!(whole_pixels(&[p(1.0, 2.0), p(-3.0, 0.0)]));
        assert!(!whole_pixels(&[p(1.0, 2.0), p(0.5, 0.0)]));
    }
}
