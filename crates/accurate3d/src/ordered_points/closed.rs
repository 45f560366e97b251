use accurate_fit::{FitError, PointFitParams};
use accurate_geom::{Pixel, Rig, View1, View2};
use accurate_match::{FreeMatch, MatchError};

use super::adjusted::Adjusted;
use super::{Curves, Found, matcher, tangency, under_better_calibration, whole_pixels};
use crate::diagnostics::Adjustment;
use crate::sampled_curve::{SampledCurve, sampled_ring};
use crate::unrolled::{Unrolled, without_repeat};
use crate::{Error, Params, Reconstruction, Suspicion, ViewPair};

/// Fewest points of a closed curve: with less there is no ring to speak of.
const FEWEST: usize = 12;

/// Ordered points of a closed curve in both views: matched around in both directions, cut open where
/// the match is surest, and fitted as an open curve that goes once around and somewhat more on both
/// sides: what is kept, in the middle, does not feel where it was cut. The likelier direction is kept.
/// The last point repeats the first.
///
/// # Errors
/// [`Error::Matching`]; [`Error::Fitting`], also for fewer than 12 points.
pub(crate) fn closed_points(
    pair: &ViewPair,
    params: &Params,
    given: (&[Pixel<View1>], &[Pixel<View2>]),
) -> Result<Reconstruction, Error> {
    let case = || pair.id.clone();
    let points1 = without_repeat(given.0);
    let points2 = without_repeat(given.1);
    let found = points1.len().min(points2.len());
    if found < FEWEST {
        let source =
            FitError::TooFewPoints { what: "points of a closed curve", found, needed: FEWEST };
        return Err(Error::Fitting { case: case(), source });
    }
    let fit_params =
        PointFitParams { calibration: params.robust.calibration, ..PointFitParams::DEFAULT };
    let whole = whole_pixels(points1) && whole_pixels(points2);
    let found_under = |rig: &Rig| {
        Directions { points1, points2, whole, rig, given_rig: &pair.rig, fit_params }.likelier()
    };
    let (direction, rig) =
        under_better_calibration(&pair.rig, found_under, |d: &Direction| d.found.fit.as_ref().ok())
            .map_err(|source| Error::Matching { case: case(), source })?;
    let Direction { matched, found, lead, .. } = &direction;
    let adjustment = Adjustment::of(&found.fit.as_ref().map_err(Clone::clone));
    let (points, covariances) = match &found.fit {
        Ok(fit) => {
            let SampledCurve { points, covariances } =
                sampled_ring(&fit.curve, Some(&fit.covariance), &rig);
            (points, covariances)
        }
        Err(FitError::BadMatch { .. }) => {
            let mut points = matched.points.clone();
            points.extend(points.first().copied());
            (points, None)
        }
        Err(source) => return Err(Error::Fitting { case: case(), source: source.clone() }),
    };
    let adjusted = Adjusted { points, covariances, rig: &rig, matched, adjustment };
    let mut result = adjusted.into_reconstruction(pair, params, (points1, points2))?;
    result.diagnostics.closed = true;
    // Which way round is told by the fits, not by what the match leaves out of a curve that has no ends.
    let reasons = &mut result.diagnostics.suspicions;
    reasons.retain(|reason| *reason != Suspicion::Ambiguous);
    reasons.extend((*lead < CLEAR_LEAD).then_some(Suspicion::Ambiguous));
    reasons.sort_unstable();
    Ok(result)
}

/// Two closed curves and what they are matched and fitted by.
struct Directions<'a> {
    points1: &'a [Pixel<View1>],
    points2: &'a [Pixel<View2>],
    whole: bool,
    rig: &'a Rig,
    given_rig: &'a Rig,
    fit_params: PointFitParams,
}

/// What one direction of curve 2 came to.
struct Direction {
    /// Around both curves.
    matched: FreeMatch,
    /// Of the unrolled curves.
    found: Found,
    /// How unlikely it is, beside the other direction, -2 ln of a probability.
    surprise: f64,
    /// How much less likely the other one is.
    lead: f64,
}

/// A lead below which either direction may be the right one, -2 ln of a probability.
const CLEAR_LEAD: f64 = 36.0;

/// Two directions are compared as if the points were no better than this, px: of points without noise
/// only what a spline cannot follow is left, and tells nothing.
const LEAST_NOISE_PX: f64 = 0.05;

impl Directions<'_> {
    /// The direction whose fit is the likelier; of two equal ones, curve 2 as it was given.
    fn likelier(&self) -> Result<Direction, MatchError> {
        let Self { points1, points2, rig, .. } = *self;
        let matcher = matcher(tangency(self.whole));
        let unrolled = Unrolled::in_both_directions(points1, points2, 1, &matcher, rig)?;
        let mut found = Vec::with_capacity(unrolled.len());
        for direction in &unrolled {
            let around = (&direction.points1[..], &direction.points2[..]);
            found.push(self.fitted(around, true, self.fit_params)?);
        }
        let noises = found.iter().filter_map(|found| Some(found.fit.as_ref().ok()?.noise_px));
        let noise_px = Some(noises.fold(LEAST_NOISE_PX, f64::max));
        let mut best: Option<Direction> = None;
        for (direction, found) in unrolled.into_iter().zip(found) {
            let alike = PointFitParams { noise_px, ..self.fit_params };
            // Begin and end are one point, in the right direction of both views at once.
            let fitted = self.fitted(direction.once(), false, alike)?;
            let surprise = fitted.surprise_of_direction();
            match &mut best {
                Some(best) if surprise >= best.surprise => {
                    // Neither leads where both are refused.
                    let lead = surprise - best.surprise;
                    best.lead = if lead.is_nan() { 0.0 } else { lead };
                }
                _ => {
                    let lead = best.map_or(f64::INFINITY, |best| best.surprise - surprise);
                    let matched = direction.matched;
                    best = Some(Direction { matched, found, surprise, lead });
                }
            }
        }
        best.ok_or(MatchError::NoFinitePath { n1: points1.len(), n2: points2.len() })
    }

    fn fitted(
        &self,
        (points1, points2): (&[Pixel<View1>], &[Pixel<View2>]),
        cut: bool,
        fit_params: PointFitParams,
    ) -> Result<Found, MatchError> {
        let Self { whole, rig, given_rig, .. } = *self;
        let matched = matcher(tangency(self.whole)).match_directed(points1, points2, false, rig)?;
        let curves = Curves { points1, points2, whole, cut, rig, given_rig, fit_params };
        Ok(curves.fitted(matched))
    }
}
