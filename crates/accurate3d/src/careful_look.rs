use accurate_eval::curve_scores;
use accurate_fit::FitError;
use accurate_geom::Point3;
use accurate_seg::{SegError, Segmenter, Watch};
use serde::Serialize;

use crate::joint_search::JointSearch;
use crate::robust::{SAME_PX, Suspicion, calls_for_a_careful_look, px_per_unit};
use crate::segment::segment_images_again;
use crate::{Error, InputKind, Method, Params, Reconstruction, ViewPair, reconstruct};

/// What came of a second, careful segmentation of both images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CarefulLook {
    /// Whether the curve is the one of the careful segmentation; else the other one explained its
    /// maps better.
    pub taken: bool,
    /// Hausdorff distance of the two curves, px; none if one segmentation gave no curve. Where it is at most
    /// 2 px by the maps, the pictures were asked about one of them, and this is the distance before that.
    pub apart_px: Option<f64>,
}

/// The curve of a pair of images and, where that is another one, the pair that it rests on.
///
/// `pair` holds what [`segment_images`](crate::segment_images) made of its images, and is reconstructed
/// as by [`reconstruct`]. Where it is not beyond doubt that [`Method::Accurate`] found the right curve,
/// or where it found none, the images are segmented once more with more care
/// ([`Segmenter::segment_again`]): another segmentation breaks the body elsewhere. Of the two curves
/// that one stays which leaves less unexplained and bends less. Whether they are the same decides
/// whether the order of the strands is ambiguous ([`Suspicion::Ambiguous`]). What calls for the second
/// segmentation are the maps; the pictures' grey levels are asked last, and about one curve where both
/// segmentations give it, unless they speak for another one.
///
/// # Errors
/// As [`reconstruct`]; [`Error::Segmentation`] if `watch` ends the second segmentation, or its engine
/// fails.
pub fn reconstruct_images(
    pair: &ViewPair,
    params: &Params,
    segmenter: &dyn Segmenter,
    watch: &Watch<'_>,
) -> Result<(Reconstruction, Option<ViewPair>), Error> {
    if params.method != Method::Accurate || params.input != InputKind::Image {
        return reconstruct(pair, params).map(|curve| (curve, None));
    }
    let first = JointSearch::of(pair, params);
    let as_it_is = |first: Result<JointSearch<'_>, Error>| Ok((first?.finished()?, None));
    if !is_worth_a_look(&first) {
        return as_it_is(first);
    }
    let again = match segment_images_again(pair, segmenter, watch) {
        Ok(Some(again)) => again,
        Err(error @ Error::Segmentation { source: SegError::Cancelled { .. }, .. }) => {
            return Err(error);
        }
        Err(error @ Error::Segmentation { source: SegError::Engine { .. }, .. }) => {
            return Err(error);
        }
        // No other way, or nothing found: the first look is all there is.
        Ok(None) | Err(_) => return as_it_is(first),
    };
    let (mut curve, look) = the_better(first, JointSearch::of(&again, params), pair)?;
    curve.diagnostics.careful_look = Some(look);
    Ok((curve, look.taken.then_some(again)))
}

fn is_worth_a_look(first: &Result<JointSearch<'_>, Error>) -> bool {
    match first {
        Ok(search) => calls_for_a_careful_look(&search.evidence()),
        // Another segmentation changes nothing of these.
        Err(
            Error::NotSegmented { .. }
            | Error::MissingInput { .. }
            | Error::OtherSize { .. }
            | Error::Fitting { source: FitError::BadParameter { .. }, .. },
        ) => false,
        Err(_) => true,
    }
}

/// Of two segmentations of a pair the curve that leaves less unexplained and bends less.
fn the_better(
    first: Result<JointSearch<'_>, Error>,
    second: Result<JointSearch<'_>, Error>,
    pair: &ViewPair,
) -> Result<(Reconstruction, CarefulLook), Error> {
    let [first, second] = match (first, second) {
        (Ok(first), Ok(second)) => {
            let apart_px = apart(&first.positions(), &second.positions(), pair);
            let agree = apart_px.is_some_and(|px| px <= SAME_PX);
            let taken = second.evidence().cost() < first.evidence().cost();
            let (kept, other) = if taken { (second, first) } else { (first, second) };
            let kept = kept.finished();
            // The pictures were asked about one, and have nothing against what both give.
            if agree && kept.as_ref().is_ok_and(|curve| !is_overruled(curve)) {
                let mut curve = kept?;
                doubt(&mut curve, apart_px);
                return Ok((curve, CarefulLook { taken, apart_px }));
            }
            let other = other.finished();
            if taken { [other, kept] } else { [kept, other] }
        }
        (first, second) => [first, second].map(|search| search?.finished()),
    };
    Ok(match (first, second) {
        (Ok(first), Ok(second)) => {
            let apart_px = apart(&first.positions(), &second.positions(), pair);
            let taken = cost(&second) < cost(&first);
            let mut curve = if taken { second } else { first };
            doubt(&mut curve, apart_px);
            (curve, CarefulLook { taken, apart_px })
        }
        (Ok(first), Err(_)) => (first, CarefulLook { taken: false, apart_px: None }),
        (Err(_), Ok(second)) => (second, CarefulLook { taken: true, apart_px: None }),
        (Err(error), Err(_)) => return Err(error),
    })
}

/// Whether the pictures took another curve than the maps.
fn is_overruled(curve: &Reconstruction) -> bool {
    let by_pictures = curve.diagnostics.grey_levels.as_ref();
    by_pictures.is_some_and(|grey_levels| grey_levels.overruled_by.is_some())
}

/// What speaks against a curve, of what can be compared between segmentations.
fn cost(curve: &Reconstruction) -> f64 {
    curve.diagnostics.outline.map_or(f64::INFINITY, |outline| outline.evidence.cost())
}

/// Hausdorff distance of two curves, px.
fn apart(a: &[Point3], b: &[Point3], pair: &ViewPair) -> Option<f64> {
    let per_unit = px_per_unit(a, &pair.rig);
    Some(curve_scores(a, b, 1.0 / per_unit).ok()?.hausdorff * per_unit)
}

/// The order of the strands is ambiguous if two segmentations give different curves, and is not if they
/// agree, however close a rival: where a map misleads is chance.
fn doubt(curve: &mut Reconstruction, apart_px: Option<f64>) {
    let reasons = &mut curve.diagnostics.suspicions;
    reasons.retain(|reason| *reason != Suspicion::Ambiguous);
    if apart_px.is_none_or(|px| px > SAME_PX) {
        reasons.push(Suspicion::Ambiguous);
        reasons.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use accurate_seg::{Mask, Progress, Segmentation, unwatched};
    use ndarray::Array2;

    use super::*;
    use crate::segment::tests::case;
    use crate::segment_images;

    /// Reads the body off an image that shows nothing else, but in view 1, which it is asked for first, some
    /// rows too high.
    #[derive(Debug)]
    struct Off {
        rows: usize,
        careful: Option<Box<Off>>,
        asked: AtomicUsize,
    }

    impl Off {
        fn new(rows: usize, careful: Option<Self>) -> Self {
            Self { rows, careful: careful.map(Box::new), asked: AtomicUsize::new(0) }
        }
    }

    impl Segmenter for Off {
        fn segment(
            &self,
            image: &Array2<f32>,
            watch: &Watch<'_>,
        ) -> Result<Segmentation, SegError> {
            let first = self.asked.fetch_add(1, Ordering::Relaxed).is_multiple_of(2);
            if watch(Progress { done: 0, total: 1 }).is_break() {
                return Err(SegError::Cancelled { done: 0, total: 1 });
            }
            let rows = if first { self.rows } else { 0 };
            let seen = |(row, column): (usize, usize)| {
                image.get([row + rows, column]).map_or(0.0, |grey| 1.0 - grey)
            };
            let probability = Array2::from_shape_fn(image.dim(), seen);
            let mask = Mask::from_array(probability.mapv(|p| p > 0.5))?;
            Ok(Segmentation { probability, mask })
        }

        fn segment_again(
            &self,
            image: &Array2<f32>,
            _before: &Array2<f32>,
            watch: &Watch<'_>,
        ) -> Result<Option<Segmentation>, SegError> {
            self.careful.as_ref().map(|careful| careful.segment(image, watch)).transpose()
        }

        fn describe(&self) -> String {
            format!("dark pixels, {} rows too high", self.rows)
        }
    }

    const FAR_ROWS: usize = 12;

    fn looked(
        pair: &ViewPair,
        segmenter: &Off,
    ) -> Result<(Reconstruction, Option<ViewPair>), Error> {
        let pair = segment_images(pair.clone(), segmenter, &unwatched).unwrap();
        let params = Params::new(InputKind::Image, Method::Accurate);
        reconstruct_images(&pair, &params, segmenter, &unwatched)
    }

    #[test]
    fn in_doubt_the_better_explained_of_two_segmentations_is_taken() {
        let (case, pair) = case();
        let segmenter = Off::new(FAR_ROWS, Some(Off::new(0, None)));
        let (curve, seen) = looked(&pair, &segmenter).unwrap();
        let look = curve.diagnostics.careful_look.unwrap();
        assert!(look.taken && look.apart_px.unwrap() > SAME_PX, "{look:?}");
        assert!(curve.diagnostics.suspicions.contains(&Suspicion::Ambiguous));
        assert_eq!(seen.unwrap().masks, Some(case.masks));

        // The other way round the first one stays, if it is doubted at all.
        let segmenter = Off::new(0, Some(Off::new(FAR_ROWS, None)));
        let (whole, seen) = looked(&pair, &segmenter).unwrap();
        assert!(seen.is_none() && whole.diagnostics.careful_look.is_none_or(|look| !look.taken));
        assert_eq!(whole.points, curve.points);
    }

    #[test]
    fn of_two_segmentations_that_agree_the_curve_is_the_one_that_either_gives() {
        let (_, pair) = case();
        let (alone, _) = looked(&pair, &Off::new(FAR_ROWS, None)).unwrap();
        let same = Off::new(FAR_ROWS, Some(Off::new(FAR_ROWS, None)));
        let (curve, seen) = looked(&pair, &same).unwrap();
        let look = curve.diagnostics.careful_look.unwrap();
        // Nearest points of the same curve are found to rounding.
        assert!(!look.taken && look.apart_px.unwrap() < 1e-9 && seen.is_none(), "{look:?}");
        assert_eq!(curve.points, alone.points);
        assert_eq!(curve.diagnostics.grey_levels, alone.diagnostics.grey_levels);
        assert!(!curve.diagnostics.suspicions.contains(&Suspicion::Ambiguous));
    }

    #[test]
    fn what_is_not_doubted_is_not_looked_at_again() {
        let (_, pair) = case();
        let segmenter = Off::new(0, Some(Off::new(0, None)));
        let (curve, seen) = looked(&pair, &segmenter).unwrap();
        assert!(curve.diagnostics.suspicions.is_empty() && seen.is_none());
        assert_eq!(curve.diagnostics.careful_look, None);
        assert_eq!(segmenter.careful.unwrap().asked.into_inner(), 0);
    }

    #[test]
    fn one_way_of_segmenting_is_all_there_is_and_the_second_can_be_ended() {
        let (_, pair) = case();
        let (curve, seen) = looked(&pair, &Off::new(FAR_ROWS, None)).unwrap();
        assert!(!curve.diagnostics.suspicions.is_empty() && seen.is_none());
        assert_eq!(curve.diagnostics.careful_look, None);

        let segmenter = Off::new(FAR_ROWS, Some(Off::new(0, None)));
        let pair = segment_images(pair, &segmenter, &unwatched).unwrap();
        let params = Params::new(InputKind::Image, Method::Accurate);
        let ended = |_| ControlFlow::Break(());
        let refused = reconstruct_images(&pair, &params, &segmenter, &ended);
        assert!(matches!(
            refused,
            Err(Error::Segmentation { source: SegError::Cancelled { .. }, .. })
        ));
        let paper = Params::new(InputKind::Image, Method::Paper);
        let (curve, _) = reconstruct_images(&pair, &paper, &segmenter, &ended).unwrap();
        assert_eq!(curve.diagnostics.careful_look, None);
    }

    #[test]
    fn two_segmentations_that_agree_settle_an_ambiguous_order_and_others_raise_it() {
        let (_, pair) = case();
        let (mut curve, _) = looked(&pair, &Off::new(0, None)).unwrap();
        let doubts = |curve: &Reconstruction| curve.diagnostics.suspicions.clone();
        assert_eq!(doubts(&curve), []);
        for apart_px in [Some(2.0 * SAME_PX), None] {
            doubt(&mut curve, apart_px);
            assert_eq!(doubts(&curve), [Suspicion::Ambiguous]);
        }
        curve.diagnostics.suspicions.push(Suspicion::Uncertain);
        doubt(&mut curve, Some(0.5 * SAME_PX));
        assert_eq!(doubts(&curve), [Suspicion::Uncertain]);
    }
}
