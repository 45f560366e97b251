mod adjusted;
mod closed;
mod part;
mod starts;

use accurate_fit::{FitError, PointFit, PointFitParams, fit_points};
use accurate_geom::{Pixel, Rig, View, View1, View2};
use accurate_match::{FreeMatch, FreeMatchParams, FreeMatcher, TangencyParams};

use adjusted::Adjusted;
pub(crate) use closed::{Ring, closed_points};
use part::{End, MatchedPart};
use starts::smoothed_pairs;

use crate::diagnostics::Adjustment;
use crate::sampled_curve::{SampledCurve, sampled};
use crate::{Closure, Error, Params, Reconstruction, ViewPair};

/// Our own method on ordered points: matched in the better direction with free ends and gaps, then
/// one 3D spline adjusted to both views. Curves whose ends meet in both views are closed ones.
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
    if params.closure == Closure::Closed {
        let ring = Ring { points1, points2, coverage: [1.0; 2] };
        return closed_points(pair, params, &ring);
    }
    let fit_params =
        PointFitParams { calibration: params.robust.calibration, ..PointFitParams::DEFAULT };
    let mut found = matched_and_fitted(points1, points2, &pair.rig, &fit_params, &pair.rig, &case)?;
    let calibrated = |fit: &PointFit| fit.calibration.and_then(|c| c.correct(&pair.rig).ok());
    let mut rig = pair.rig.clone();
    if let Ok(first) = &found.fit
        && let Some(corrected) = calibrated(first)
    {
        // Matched once more under the better calibration; what is estimated stays relative to the
        // given one.
        found = matched_and_fitted(points1, points2, &corrected, &fit_params, &pair.rig, &case)?;
        rig = found.fit.as_ref().ok().and_then(calibrated).unwrap_or(rig);
    }
    let Found { matched, fit } = found;
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

/// A match and the likeliest fit that starts from it.
struct Found {
    matched: FreeMatch,
    fit: Result<PointFit, FitError>,
}

/// Sines of the angle to the epipolar line below which a start bridges the match, if not the
/// matcher's own: stretches that run along epipolar lines are better bridged if they are short, and
/// better taken as matched if they are long. The fits tell which.
const OTHER_SINES: [f64; 2] = [0.1, 0.0];

/// Matches under `rig` and fits from several starts under `given_rig`.
fn matched_and_fitted(
    points1: &[Pixel<View1>],
    points2: &[Pixel<View2>],
    rig: &Rig,
    fit_params: &PointFitParams,
    given_rig: &Rig,
    case: &dyn Fn() -> String,
) -> Result<Found, Error> {
    let matching = |source| Error::Matching { case: case(), source };
    let whole = whole_pixels(points1) && whole_pixels(points2);
    let tangency = if whole { TangencyParams::WHOLE_PIXELS } else { TangencyParams::DEFAULT };
    let with = |max_sine: f64| {
        let tangency = TangencyParams { max_sine, ..tangency };
        FreeMatcher::new(FreeMatchParams { tangency, ..FreeMatchParams::DEFAULT })
    };
    let matched =
        with(tangency.max_sine).match_best_direction(points1, points2, rig).map_err(matching)?;
    let mut directed2 = points2.to_vec();
    if matched.reversed {
        directed2.reverse();
    }
    let part = MatchedPart::of(&matched, points1.len(), &directed2);
    let curve1 = &points1[part.range1.clone()];
    let curve2 = &directed2[part.range2.clone()];
    let mut parts = vec![MatchedPart::of(&matched, points1.len(), &directed2)];
    for max_sine in OTHER_SINES.into_iter().filter(|sine| *sine < tangency.max_sine) {
        if let Ok(other) = with(max_sine).match_directed(points1, points2, matched.reversed, rig) {
            // The path is the same, and so is the part.
            parts.push(MatchedPart::of(&other, points1.len(), &directed2));
        }
    }
    let doubtful = part.ends.iter().filter(|end| **end == End::Doubtful).count();
    let mut fits = Vec::new();
    for tips in [true, false] {
        if !tips && doubtful == 0 {
            continue;
        }
        let mut starts: Vec<_> = parts.iter().map(|part| part.pairs(tips)).collect();
        if whole && tips {
            starts.extend(smoothed_pairs(curve1, curve2, rig));
        }
        let hidden = part.hidden();
        let fit_params = PointFitParams {
            free_ends: part.free_ends(tips),
            // What the other view does not see needs no partner; more than a third is no match.
            min_coverage: fit_params.min_coverage - if hidden < 0.34 { hidden } else { 0.0 },
            ..*fit_params
        };
        let price = if tips { 0.0 } else { FREE_END * doubtful as f64 };
        fits.extend(starts.iter().map(|pairs| {
            let fit = fit_points(curve1, curve2, pairs, given_rig, &fit_params)?;
            Ok(PointFit { surprise: fit.surprise + price, ..fit })
        }));
    }
    Ok(Found { matched, fit: likeliest(fits.into_iter()) })
}

/// What a free end costs in surprise, beside a tip: in each view a tip says one coordinate more,
/// whose density would else be that of a place within about 20 px, -2 ln(1/20) = 6.
const FREE_END: f64 = 12.0;

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
