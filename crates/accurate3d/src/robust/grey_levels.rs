use accurate_fit::{
    CalibrationEstimate, CalibrationPriors, FitError, IntensityFit, IntensityFitParams,
    IntensityPair, fit_intensities, side_by_side,
};
use accurate_geom::{Curve3, Rig};
use ndarray::Array2;

use super::RobustParams;
use super::finalists::SAME_PX;
use super::joint::JointResult;
use super::look::Seen;
use super::score::Candidate;
use super::suspicion::Suspicion;
use super::tails::{DOUBTED_LACKING_PX, Pictures};
use crate::IntensityDiagnostics;

/// A curve of the maps is right to a few pixels or is another curve: what is carried farther than this,
/// px, was carried off by something else in the picture.
const MOST_MOVED_PX: f64 = 8.0;
/// Bodies thicker than this, px, are drawn by a segmentation as they are, hooks and all, and their edges
/// say more than blots of one width; thinner ones it draws thicker.
const MOST_RADIUS_PX: f64 = 1.35;
/// A picture made by photons has noise. Where the body is darker than so many of its standard
/// deviations it is a drawing, and the edges are exact.
const MOST_CONTRAST_TO_NOISE: f64 = 1000.0;

/// Half squares of a fit to grey levels for one of a score.
const COST_PER_SCORE: f64 = 6.0;
/// What the pictures must speak for another curve by, as a score: neighbouring pixels repeat each other.
const LEAD: f64 = 4.0;
/// What the fits that are compared may still gain by a step, half squares: little beside what the lead is
/// made of.
const ASKED_TO: f64 = 0.5;
/// Most curves that are asked after, the one of the maps among them.
const MOST_ASKED: usize = 5;

/// Takes another one of the curves that came into question where the pictures, in which strands that lie
/// upon each other are darker, speak for it; by how much, if so.
pub(crate) fn choose_by_grey_levels(
    seen: &mut Seen,
    images: &[Array2<f32>; 2],
    given_rig: &Rig,
    params: &RobustParams,
) -> Option<f64> {
    let contenders = seen.contenders();
    let asked = differing(&contenders);
    if asked.len() < 2 {
        return None;
    }
    let curve = |k: usize| &contenders[k].0.fit.curve;
    let curves: Vec<_> = asked.iter().map(|&k| curve(k)).collect();
    let calibration = start_of_calibration(params, seen.calibration());
    let settings = IntensityFitParams { tolerance: ASKED_TO, ..IntensityFitParams::DEFAULT };
    let pair = IntensityPair::around(&curves, images, given_rig, &settings, calibration).ok()?;
    let best = pair.fit(curves[0]).ok()?;
    // What the cost of one must fall below for it to lead.
    let to_beat = |k: usize| best.cost - COST_PER_SCORE * (LEAD + contenders[k].1);
    let fits = side_by_side(&asked[1..], |&k| pair.fit_to_beat(curve(k), to_beat(k)).ok()?);
    let fitted_last = seen.fitted_last();
    // One that had no last fit is placed by the pictures or not at all; alone, where the other curves are
    // background.
    let stands = |k: usize| {
        k < fitted_last
            || fit_intensities(
                curve(k),
                images,
                given_rig,
                &IntensityFitParams::DEFAULT,
                calibration,
            )
            .is_ok_and(|fit| reason_against(&fit).is_none())
    };
    let mut behind = Vec::new();
    for (&k, fit) in asked[1..].iter().zip(&fits) {
        // What is carried off is no longer the curve that the maps spoke for.
        let fit = fit.as_ref().filter(|fit| fit.moved_px <= MOST_MOVED_PX);
        let Some(fit) = fit else { continue };
        behind.push((contenders[k].1 + (fit.cost - best.cost) / COST_PER_SCORE, k));
    }
    behind.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (behind, chosen) =
        behind.into_iter().take_while(|(behind, _)| *behind < -LEAD).find(|&(_, k)| stands(k))?;
    seen.prefer(chosen, given_rig);
    Some(-behind)
}

/// The nearest few of the contenders that are different curves, the first among them.
fn differing(contenders: &[(&Candidate, f64)]) -> Vec<usize> {
    let shape = |k: usize| &contenders[k].0.shape;
    let mut order: Vec<_> = (1..contenders.len()).collect();
    order.sort_by(|&a, &b| contenders[a].1.total_cmp(&contenders[b].1));
    let mut kept = vec![0];
    for k in order {
        let is_new = |&j: &usize| !shape(j).is_like(shape(k), SAME_PX);
        if kept.len() < MOST_ASKED && kept.iter().all(is_new) {
            kept.push(k);
        }
    }
    kept
}

/// Fits the curve on to the grey levels of the images that its `maps` were made of, without ends that those do
/// not show, and says what came of it. Where that fails, or is carried off, or the body is no thin one, the
/// curve stays as it was.
pub(crate) fn on_grey_levels(
    result: &mut JointResult,
    images: &[Array2<f32>; 2],
    maps: Option<&[Array2<f32>; 2]>,
    given_rig: &Rig,
    params: &RobustParams,
    overruled_by: Option<f64>,
) -> IntensityDiagnostics {
    let fit = |start: &Curve3, calibration| {
        fit_intensities(start, images, given_rig, &IntensityFitParams::DEFAULT, calibration)
    };
    let start = &result.fit.curve;
    let calibration = start_of_calibration(params, result.calibration.as_ref());
    let mut fitted = fit(start, calibration);
    let (mut cut_px, mut lacking_px) = ([0.0; 2], None);
    if let (Ok(thin), Some(maps)) = (&fitted, maps)
        && not_thin(thin).is_none()
    {
        // An end that is none of the body may be what the curve was carried off by.
        let (curve, calibration) = match reason_against(thin) {
            None => (&thin.curve, start_of_calibration(params, thin.calibration.as_ref())),
            Some(_) => (start, calibration),
        };
        let pictures = Pictures { images, maps, rig: given_rig, calibration };
        let ends = pictures.ends(curve);
        lacking_px = Some(ends.lacking_px);
        if let Some(shorter) = &ends.shorter {
            let again = fit(shorter, calibration);
            if again.as_ref().is_ok_and(|fit| reason_against(fit).is_none()) {
                (fitted, cut_px) = (again, ends.cut_px);
            }
        }
    }
    let diagnostics = IntensityDiagnostics {
        overruled_by,
        lacking_px,
        cut_px,
        ..IntensityDiagnostics::of(&fitted)
    };
    if let (None, Ok(IntensityFit { curve, covariance, calibration, .. })) =
        (&diagnostics.refusal, fitted)
    {
        result.fit.curve = curve;
        result.fit.covariance = Some(covariance);
        result.calibration = calibration;
    }
    if lacking_px.is_some_and(|px| px > DOUBTED_LACKING_PX) {
        result.suspicions.push(Suspicion::EndNotShown);
        result.suspicions.sort_unstable();
    }
    diagnostics
}

/// Under the cameras that the curve was fitted under, and no others.
fn start_of_calibration<'a>(
    params: &'a RobustParams,
    found: Option<&CalibrationEstimate>,
) -> Option<(&'a CalibrationPriors, [f64; 3])> {
    let (priors, found) = params.calibration.as_ref().zip(found)?;
    Some((priors, [found.shift_px[0], found.shift_px[1], found.roll_rad]))
}

impl IntensityDiagnostics {
    fn of(fitted: &Result<IntensityFit, FitError>) -> Self {
        let fit = fitted.as_ref().ok();
        Self {
            refusal: match fitted {
                Err(error) => Some(error.to_string()),
                Ok(fit) => reason_against(fit),
            },
            overruled_by: None,
            lacking_px: None,
            cut_px: [0.0; 2],
            moved_px: fit.map(|fit| fit.moved_px),
            contrast_to_noise: fit.map(|fit| fit.contrast_to_noise),
            radius_px: fit.map(|fit| fit.radius_px),
        }
    }
}

fn reason_against(fit: &IntensityFit) -> Option<String> {
    if fit.moved_px > MOST_MOVED_PX {
        return Some(format!("carried off by {:.1} px, {MOST_MOVED_PX} at most", fit.moved_px));
    }
    not_thin(fit)
}

/// Why a body is placed better by its edges, if so.
fn not_thin(fit: &IntensityFit) -> Option<String> {
    let radius_px = 0.5 * (fit.radius_px[0] + fit.radius_px[1]);
    let contrast = fit.contrast_to_noise[0].min(fit.contrast_to_noise[1]);
    if radius_px > MOST_RADIUS_PX {
        Some(format!(
            "a body of radius {radius_px:.2} px is drawn as it is, {MOST_RADIUS_PX} at most"
        ))
    } else if contrast > MOST_CONTRAST_TO_NOISE {
        Some(format!("a body {contrast:.0} times as dark as the noise is placed by its edges"))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use accurate_eval::curve_scores;
    use accurate_synth::{CaseOptions, Family, SynthCase, XrayOptions, generate, render_xray};

    use crate::{InputKind, Method, Params, Reconstruction, ViewPair, reconstruct};

    /// A map that ends `missing_px` before the body does, beside the picture.
    fn pair(case: &SynthCase, missing_px: f64, options: &XrayOptions) -> ViewPair {
        let mut pair = ViewPair::from(case.clone());
        let tips = [0, case.truth.len() - 1].map(|k| case.rig.project(&case.truth[k]).unwrap());
        let near = |x: usize, y: usize, at: [f64; 2]| {
            (x as f64 - at[0]).hypot(y as f64 - at[1]) < missing_px
        };
        let [mut mask1, mut mask2] = case.masks.clone();
        for (p1, p2) in tips {
            let cut1 = |((y, x), b): ((usize, usize), &mut bool)| *b &= !near(x, y, [p1.x, p1.y]);
            mask1.indexed_iter_mut().for_each(cut1);
            let cut2 = |((y, x), b): ((usize, usize), &mut bool)| *b &= !near(x, y, [p2.x, p2.y]);
            mask2.indexed_iter_mut().for_each(cut2);
        }
        let masks = [mask1, mask2];
        pair.probabilities = Some(masks.clone().map(|m| m.mapv(|b| if b { 0.99 } else { 0.01 })));
        pair.masks = Some(masks);
        pair.images = Some(render_xray(case, options).map(|image| image.mapv(f32::from)));
        pair
    }

    fn curve(pair: &ViewPair, by_grey_levels: bool) -> Reconstruction {
        let mut params = Params::new(InputKind::Image, Method::Accurate);
        params.robust.by_grey_levels = by_grey_levels;
        reconstruct(pair, &params).unwrap()
    }

    #[test]
    fn a_thin_body_ends_where_its_darkness_does() {
        let clear = XrayOptions { dose_photons_per_px: 1e5, background: 0.0, ..Default::default() };
        for index in [0, 2, 3] {
            let case = generate(Family::Carm, 1904, index, &CaseOptions::default()).unwrap();
            let pair = pair(&case, 5.0, &clear);
            let off = |r: &Reconstruction| {
                curve_scores(&r.positions(), &case.truth, 0.1).unwrap().hausdorff
            };
            let (by_map, by_picture) = (curve(&pair, false), curve(&pair, true));
            assert!(by_map.diagnostics.grey_levels.is_none());
            let found = by_picture.diagnostics.grey_levels.as_ref().unwrap();
            assert_eq!(found.refusal, None, "{index} {found:?}");
            assert_eq!(
                by_picture.covariances.as_ref().map(Vec::len),
                Some(by_picture.points.len())
            );
            let (before, after) = (off(&by_map), off(&by_picture));
            assert!(after < 0.5 * before, "{index}: {before} -> {after} mm");
        }
    }

    #[test]
    fn thick_bodies_and_curves_that_are_carried_off_stay_as_they_are() {
        let case = generate(Family::Medium, 1904, 0, &CaseOptions::default()).unwrap();
        let mut pair = pair(&case, 0.0, &XrayOptions::default());
        let by_map = curve(&pair, false);
        let kept = curve(&pair, true);
        assert_eq!(kept.points, by_map.points);
        let refusal =
            |r: &Reconstruction| r.diagnostics.grey_levels.clone().unwrap().refusal.unwrap();
        assert!(refusal(&kept).contains("radius"), "{}", refusal(&kept));
        if let Some(images) = &mut pair.images {
            images[1].fill(1000.0);
        }
        let blank = curve(&pair, true);
        assert_eq!(blank.points, by_map.points);
        assert!(refusal(&blank).contains("view 2"), "{}", refusal(&blank));
    }

    #[test]
    fn the_pictures_overrule_the_maps_where_those_leave_a_doubt() {
        // Two of its strands cross where both outlines leave open which goes on as which.
        let case = generate(Family::Hard, 1904, 26, &CaseOptions::default()).unwrap();
        let clear = XrayOptions { dose_photons_per_px: 1e5, background: 0.0, ..Default::default() };
        let pair = pair(&case, 0.0, &clear);
        let off =
            |r: &Reconstruction| curve_scores(&r.positions(), &case.truth, 0.1).unwrap().overall;
        let (by_map, by_picture) = (curve(&pair, false), curve(&pair, true));
        let lead = by_picture.diagnostics.grey_levels.as_ref().unwrap().overruled_by.unwrap();
        assert!(lead > 10.0, "{lead}");
        assert!(off(&by_picture) < 0.8 * off(&by_map), "{} {}", off(&by_map), off(&by_picture));
        // The first of the curves that came into question is the one that was taken, the next is not; 200
        // points stand for each.
        let distance = |k: usize| {
            let points = &by_picture.explanation.candidates[k].points;
            curve_scores(points, &by_picture.positions(), 0.1).unwrap().hausdorff
        };
        assert!(3.0 * distance(0) < distance(1), "{} {}", distance(0), distance(1));
    }

    #[test]
    fn where_no_picture_is_asked_none_overrules() {
        let case = generate(Family::Easy, 1904, 0, &CaseOptions::default()).unwrap();
        let sure = curve(&pair(&case, 0.0, &XrayOptions::default()), true);
        assert_eq!(sure.diagnostics.suspicions, []);
        assert_eq!(sure.diagnostics.grey_levels.unwrap().overruled_by, None);
    }
}
