mod adjusted;
mod closed;
mod dense;
mod part;
mod starts;

use accurate_fit::{FitError, PointFit, PointFitParams, fit_points};
use accurate_geom::{Pixel, Rig, View, View1, View2};
use accurate_match::{FreeMatch, FreeMatchParams, FreeMatcher, MatchError, TangencyParams};

use adjusted::Adjusted;
use closed::closed_points;
use dense::densified;
use part::{DOUBTFUL_POINTS, End, MatchedPart};
use starts::smoothed_pairs;

use crate::diagnostics::Adjustment;
use crate::sampled_curve::{SampledCurve, sampled};
use crate::{Closure, Error, Params, Reconstruction, ViewPair};

/// Our own method on ordered points: matched in the better direction with free ends and gaps, then
/// one 3D spline adjusted to both views. Curves whose ends meet in both views are closed ones.
///
/// Vertices of a polyline that are farther apart than the matcher's steps stand for their chords.
///
/// The adjustment refuses a match that is no basis for it; the match is then returned as it is, and
/// the diagnostics say why.
pub(crate) fn adjusted_points(pair: &ViewPair, params: &Params) -> Result<Reconstruction, Error> {
    let case = || pair.id.clone();
    let fitting = |source| Error::Fitting { case: case(), source };
    let (points1, points2) = pair
        .points
        .as_ref()
        .ok_or_else(|| Error::MissingInput { case: case(), input: params.input })?;
    let dense = (densified(points1), densified(points2));
    let (points1, points2) =
        (dense.0.as_ref().unwrap_or(points1), dense.1.as_ref().unwrap_or(points2));
    if params.closure == Closure::Closed {
        return closed_points(pair, params, (points1, points2));
    }
    let fit_params =
        PointFitParams { calibration: params.robust.calibration, ..PointFitParams::DEFAULT };
    let whole = whole_pixels(points1) && whole_pixels(points2);
    let matched_and_fitted = |rig: &Rig| {
        Curves { points1, points2, whole, cut: false, rig, given_rig: &pair.rig, fit_params }
            .found()
            .map_err(|source| Error::Matching { case: case(), source })
    };
    let (Found { matched, fit, .. }, rig) =
        under_better_calibration(&pair.rig, matched_and_fitted, |found| found.fit.as_ref().ok())?;
    let adjustment = Adjustment::of(&fit);
    let (points, covariances) = match fit {
        Ok(fit) => {
            let SampledCurve { points, covariances } =
                sampled(&fit.curve, Some(&fit.covariance), &rig);
            (points, covariances)
        }
        Err(FitError::BadMatch { .. } | FitError::TooFewPoints { .. }) => {
            (matched.points.clone(), None)
        }
        Err(source) => return Err(fitting(source)),
    };
    Adjusted { points, covariances, rig: &rig, matched: &matched, adjustment }.into_reconstruction(
        pair,
        params,
        (points1, points2),
    )
}

/// What was found under the given calibration and the rig that it holds under: if the fit estimates
/// another calibration, it is found once more under that, unless nothing can be matched and fitted there. What is
/// estimated stays relative to the given one.
fn under_better_calibration<T, E>(
    given: &Rig,
    found_under: impl Fn(&Rig) -> Result<T, E>,
    fit: impl Fn(&T) -> Option<&PointFit>,
) -> Result<(T, Rig), E> {
    let corrected = |found: &T| fit(found)?.calibration?.correct(given).ok();
    let found = found_under(given)?;
    let Some(better) = corrected(&found) else { return Ok((found, given.clone())) };
    let again = found_under(&better).ok();
    Ok(match again.and_then(|again| corrected(&again).map(|rig| (again, rig))) {
        Some(again) => again,
        None => (found, better),
    })
}

/// A match and the likeliest fit that starts from it.
struct Found {
    matched: FreeMatch,
    fit: Result<PointFit, FitError>,
    /// Ends at which one view goes on where the other has stopped.
    seams: usize,
    /// Points that the match leaves out at the ends.
    left_out: usize,
}

impl Found {
    /// What tells two directions apart: a view that sees more of the wire than the other one is
    /// possible, but a match in the wrong direction buys its fit with points that it leaves out.
    fn surprise_of_direction(&self) -> f64 {
        self.fit.as_ref().map_or(f64::INFINITY, |fit| {
            let unseen = self.left_out + fit.beyond[0] + fit.beyond[1];
            fit.surprise + FREE_END * self.seams as f64 + UNSEEN_POINT * unseen as f64
        })
    }
}

/// Sines of the angle to the epipolar line below which a start bridges the match, if not the
/// matcher's own: stretches that run along epipolar lines are better bridged if they are short, and
/// better taken as matched if they are long. The fits tell which.
const OTHER_SINES: [f64; 2] = [0.1, 0.0];

/// A margin of one direction over the other, px a point, below which the match leaves the direction
/// to the fits. Of 1,100 tuning curves all five that the match turned the wrong way lie below 0.01.
const DOUBTFUL_DIRECTION_PX: f64 = 0.02;

/// Two ordered curves and what they are matched and fitted by.
struct Curves<'a> {
    points1: &'a [Pixel<View1>],
    points2: &'a [Pixel<View2>],
    /// Whether they are whole pixels.
    whole: bool,
    /// Whether the body goes on beyond both ends.
    cut: bool,
    /// Under which they are matched.
    rig: &'a Rig,
    /// Under which they are fitted.
    given_rig: &'a Rig,
    fit_params: PointFitParams,
}

impl Curves<'_> {
    /// Matched and fitted, in both directions where the match cannot tell them apart.
    fn found(&self) -> Result<Found, MatchError> {
        let Self { points1, points2, rig, .. } = *self;
        let matcher = matcher(tangency(self.whole));
        let found = self.fitted(matcher.match_best_direction(points1, points2, rig)?);
        let margin_px = found.matched.margin_px.unwrap_or(f64::INFINITY);
        if margin_px < DOUBTFUL_DIRECTION_PX {
            let other = matcher.match_directed(points1, points2, !found.matched.reversed, rig)?;
            let turned = self.fitted(FreeMatch { margin_px: Some(-margin_px), ..other });
            if turned.surprise_of_direction() < found.surprise_of_direction() {
                return Ok(turned);
            }
        }
        Ok(found)
    }

    /// The likeliest fit from several starts in the direction of `matched`.
    fn fitted(&self, matched: FreeMatch) -> Found {
        let Self { points1, points2, rig, given_rig, fit_params, .. } = self;
        let mut directed2 = points2.to_vec();
        if matched.reversed {
            directed2.reverse();
        }
        let mut parts = vec![MatchedPart::of(&matched, points1.len(), &directed2)];
        let tangency = tangency(self.whole);
        for max_sine in OTHER_SINES.into_iter().filter(|sine| *sine < tangency.max_sine) {
            let matcher = matcher(TangencyParams { max_sine, ..tangency });
            if let Ok(other) = matcher.match_directed(points1, points2, matched.reversed, rig) {
                // The path is the same, and so is the part.
                parts.push(MatchedPart::of(&other, points1.len(), &directed2));
            }
        }
        let part = &parts[0];
        let curve1 = &points1[part.range1.clone()];
        let curve2 = &directed2[part.range2.clone()];
        let doubtful = part.ends.iter().filter(|end| **end == End::Doubtful).count();
        let mut fits = Vec::new();
        for tips in [true, false] {
            if !tips && doubtful == 0 {
                continue;
            }
            let mut starts: Vec<_> = parts.iter().map(|part| part.pairs(tips)).collect();
            if self.whole && tips {
                starts.extend(smoothed_pairs(curve1, curve2, rig));
            }
            let hidden = part.hidden();
            let fit_params = PointFitParams {
                free_ends: if self.cut { [[true; 2]; 2] } else { part.free_ends(tips) },
                // What the other view does not see needs no partner; more than a third is no match.
                min_coverage: fit_params.min_coverage - if hidden < 0.34 { hidden } else { 0.0 },
                ..*fit_params
            };
            let price = if tips { 0.0 } else { FREE_END * doubtful as f64 };
            let free = fit_params.free_ends[0].iter().filter(|free| **free).count();
            fits.extend(starts.iter().map(|pairs| {
                let fit = fit_points(curve1, curve2, pairs, given_rig, &fit_params)?;
                let lost: usize =
                    fit.beyond.iter().map(|n| n.saturating_sub(free * DOUBTFUL_POINTS)).sum();
                let surprise = fit.surprise + price + LOST_POINT * lost as f64;
                Ok(PointFit { surprise, ..fit })
            }));
        }
        Found {
            fit: likeliest(fits.into_iter()),
            seams: part.ends.iter().filter(|end| **end == End::Seam).count(),
            left_out: points1.len() - curve1.len() + points2.len() - curve2.len(),
            matched,
        }
    }
}

fn tangency(whole: bool) -> TangencyParams {
    if whole { TangencyParams::WHOLE_PIXELS } else { TangencyParams::DEFAULT }
}

fn matcher(tangency: TangencyParams) -> FreeMatcher {
    FreeMatcher::new(FreeMatchParams { tangency, ..FreeMatchParams::DEFAULT })
}

/// What a free end costs in surprise, beside a tip: in each view a tip says one coordinate more,
/// whose density would else be that of a place within about 20 px, -2 ln(1/20) = 6.
const FREE_END: f64 = 12.0;

/// What a point costs in surprise that has a partner, but that the fit leaves beyond a free end, after so
/// many as an end may be in doubt: a square of 3 σ, of which three in a row count as one.
const LOST_POINT: f64 = 3.0;

/// What a point without a partner costs in surprise when directions are compared. On 43 tuning curves
/// whose direction the match leaves open, 1 (and 2) tells all rightly, 0.5 all but one.
const UNSEEN_POINT: f64 = 1.0;

/// The fit with the least surprise, or the first refusal.
fn likeliest(fits: impl Iterator<Item = Result<PointFit, FitError>>) -> Result<PointFit, FitError> {
    fits.reduce(|best, next| match (&best, &next) {
        (Ok(a), Ok(b)) if b.surprise < a.surprise => next,
        (Err(_), Ok(_)) => next,
        _ => best,
    })
    .unwrap_or(Err(FitError::TooFewPoints { what: "starts", found: 0, needed: 1 }))
}

fn whole_pixels<V: View>(points: &[Pixel<V>]) -> bool {
    points.iter().all(|p| p.x.fract() == 0.0 && p.y.fract() == 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_pixels_are_told_from_sub_pixel_points() {
        let p = |x, y| Pixel::<View2>::new(x, y);
        assert!(whole_pixels(&[p(1.0, 2.0), p(-3.0, 0.0)]));
        assert!(!whole_pixels(&[p(1.0, 2.0), p(0.5, 0.0)]));
    }
}
