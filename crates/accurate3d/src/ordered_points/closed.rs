use accurate_fit::{FitError, PointFit, PointFitParams, fit_points};
use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Pixel, Point3, Rig, View, View1, View2};
use accurate_match::{CurvePoint, FreeMatch, FreeMatcher};

use super::adjusted::Adjusted;
use super::part::filled;
use crate::diagnostics::Adjustment;
use crate::{Error, Params, Reconstruction, ViewPair};

/// Ordered points of a closed curve in both views; the first is not repeated at the end.
pub(crate) struct Ring<'a> {
    pub(crate) points1: &'a [Pixel<View1>],
    pub(crate) points2: &'a [Pixel<View2>],
    /// Fraction of each view's skeleton that the points pass.
    pub(crate) coverage: [f64; 2],
}

/// Fewest points of a closed curve: with less there is no ring to speak of.
const FEWEST: usize = 12;

/// Matched around, and fitted as an open curve that goes once around and [`OVERLAP_PX`] more on both
/// sides: what is kept, in the middle, does not feel where it was cut. The last point repeats the
/// first.
///
/// # Errors
/// [`Error::Matching`], also for fewer than 12 points; [`Error::Fitting`].
pub(crate) fn closed_points(
    pair: &ViewPair,
    params: &Params,
    ring: &Ring<'_>,
) -> Result<Reconstruction, Error> {
    let case = || pair.id.clone();
    let matching = |source| Error::Matching { case: case(), source };
    let points1 = without_repeat(ring.points1);
    let points2 = without_repeat(ring.points2);
    let found = points1.len().min(points2.len());
    if found < FEWEST {
        let source =
            FitError::TooFewPoints { what: "points of a closed curve", found, needed: FEWEST };
        return Err(Error::Fitting { case: case(), source });
    }
    let matched =
        FreeMatcher::default().match_closed(points1, points2, &pair.rig).map_err(matching)?;
    let fit = fit_around(points1, points2, &matched, &pair.rig, params);
    let adjustment = Adjustment::of(&fit.as_ref().map(|around| &around.fit).map_err(Clone::clone));
    let (points, covariances, rig) = match fit {
        Ok(around) => {
            let corrected = around.fit.calibration.map(|c| c.correct(&pair.rig)).transpose();
            let rig = corrected
                .map_err(|source| Error::Fitting { case: case(), source })?
                .unwrap_or_else(|| pair.rig.clone());
            let (points, covariances) = around.sampled(&rig);
            (points, Some(covariances), rig)
        }
        Err(FitError::BadMatch { .. }) => {
            let mut points = matched.points.clone();
            points.extend(points.first().copied());
            (points, None, pair.rig.clone())
        }
        Err(source) => return Err(Error::Fitting { case: case(), source }),
    };
    let adjusted = Adjusted { points, covariances, rig: &rig, matched: &matched, adjustment };
    let mut found = adjusted.into_reconstruction(pair, params, (points1, points2))?;
    found.diagnostics.closed = true;
    found.diagnostics.trace_coverage = ring.coverage;
    Ok(found)
}

fn without_repeat<V: View>(points: &[Pixel<V>]) -> &[Pixel<V>] {
    match points {
        [first, rest @ .., last] if !rest.is_empty() && first == last => {
            &points[..points.len() - 1]
        }
        _ => points,
    }
}

/// How far the fit goes on beyond once around, on each side, px: several times the reach of a knot,
/// which is about 20 px.
const OVERLAP_PX: f64 = 80.0;
/// Over so much of a turn the end is blended into the begin.
const BLENDED: f64 = 0.05;

/// An open fit that goes around more than once.
struct Around {
    fit: PointFit,
    /// Parameters between which it goes around once.
    once: [f64; 2],
    length_px: f64,
}

fn fit_around(
    points1: &[Pixel<View1>],
    points2: &[Pixel<View2>],
    matched: &FreeMatch,
    rig: &Rig,
    params: &Params,
) -> Result<Around, FitError> {
    let (n1, n2) = (points1.len(), points2.len());
    let mut directed2 = points2.to_vec();
    if matched.reversed {
        directed2.reverse();
    }
    let along = |j: usize| if matched.reversed { n2 - 1 - j } else { j };
    // Around once, with indices that go on growing where the curves start anew.
    let mut once: Vec<(usize, usize)> = Vec::with_capacity(matched.pairs.len());
    let (mut turns1, mut turns2) = (0, 0);
    for &(i, j) in &matched.pairs {
        let (mut i, mut j) = (i + turns1 * n1, along(j) + turns2 * n2);
        if let Some(&(i0, j0)) = once.last() {
            // A step back of more than half a turn is a step over the seam.
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
    let needed = 4;
    let Some(&first) = once.first() else {
        return Err(FitError::TooFewPoints { what: "matched pairs", found: 0, needed });
    };
    // The last pairs may be the first again.
    once.retain(|&(i, j)| i < first.0 + n1 && j < first.1 + n2 || (i, j) == first);
    let around = |turn: usize| once.iter().map(move |&(i, j)| (i + turn * n1, j + turn * n2));
    let thrice: Vec<_> = (0..3).flat_map(around).collect();
    let length_px = ring_length(points1).max(ring_length(points2));
    let extra = ((OVERLAP_PX / length_px).min(0.45) * n1 as f64).ceil() as usize;
    let (from, to) = (first.0 + n1 - extra, first.0 + 2 * n1 + extra);
    let kept: Vec<_> = thrice.into_iter().filter(|p| (from..=to).contains(&p.0)).collect();
    let (Some(&(i0, j0)), Some(&(i1, j1))) = (kept.first(), kept.last()) else {
        return Err(FitError::TooFewPoints { what: "matched pairs", found: 0, needed });
    };
    let curve1: Vec<_> = (i0..=i1).map(|i| points1[i % n1]).collect();
    let curve2: Vec<_> = (j0..=j1).map(|j| directed2[j % n2]).collect();
    let pairs: Vec<_> = kept.iter().map(|&(i, j)| (i - i0, j - j0)).collect();
    let pairs = filled(&pairs, &[Vec::new(), Vec::new()]);
    let fit_params = PointFitParams {
        free_ends: [[true; 2]; 2],
        calibration: params.robust.calibration,
        ..PointFitParams::DEFAULT
    };
    let fit = fit_points(&curve1, &curve2, &pairs, rig, &fit_params)?;
    let seam = first.0 + n1 - i0;
    let once = [fit.parameters[0][seam], fit.parameters[0][seam + n1]];
    Ok(Around { fit, once, length_px })
}

fn ring_length<V: View>(points: &[Pixel<V>]) -> f64 {
    (0..points.len()).map(|k| points[k].distance(points[(k + 1) % points.len()])).sum()
}

impl Around {
    /// Points half a pixel apart with their covariances; the last repeats the first.
    fn sampled(&self, rig: &Rig) -> (Vec<CurvePoint>, Vec<Matrix3<f64>>) {
        let [from, to] = self.once;
        let curve = &self.fit.curve;
        let count = (2.0 * self.length_px).ceil().clamp(12.0, 65_536.0) as usize;
        let period = to - from;
        let (mut points, mut covariances) = (Vec::new(), Vec::new());
        for k in 0..=count {
            let share = k as f64 / count as f64;
            let t = from + share * period;
            // What goes on beyond the begin, to the left, is the same stretch of the body.
            let s = ((share - (1.0 - BLENDED)) / BLENDED).max(0.0);
            let weight = s * s * (3.0 - 2.0 * s);
            let position: Point3 = curve.at(t) + (curve.at(t - period) - curve.at(t)) * weight;
            let place = if weight > 0.5 { t - period } else { t };
            // A fit in front of both cameras was promised; a point that is not has no picture.
            let Ok((pixel1, pixel2)) = rig.project(&position) else { continue };
            points.push(CurvePoint { position, pixel1, pixel2, epipolar_distance_px: 0.0 });
            covariances.push(self.fit.covariance.at(place));
        }
        // The blend ends on the first point up to rounding; a closed curve ends on it exactly.
        if let Some(first) = points.first().cloned()
            && let Some(last) = points.last_mut()
        {
            *last = first;
        }
        (points, covariances)
    }
}
