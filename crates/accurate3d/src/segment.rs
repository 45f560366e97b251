use accurate_seg::{SegError, Segmentation, Segmenter, Watch};
use ndarray::Array2;

use crate::{Error, InputKind, ViewPair};

/// The pair with probabilities and masks made from its images, ready for
/// [`reconstruct`](crate::reconstruct) with [`InputKind::Image`].
///
/// Masks that the pair had are replaced: what was drawn by hand must not stand in for what was seen.
/// The views are segmented one after the other; `watch` hears of each.
///
/// # Errors
/// [`Error::MissingInput`] without images; [`Error::Segmentation`] naming the view, also where
/// nothing of the body was found in it.
pub fn segment_images(
    pair: ViewPair,
    segmenter: &dyn Segmenter,
    watch: &Watch<'_>,
) -> Result<ViewPair, Error> {
    let [image1, image2] = images(&pair)?;
    let one = |image: &Array2<f32>, view| {
        let found = segmenter.segment(image, watch);
        found.and_then(|found| checked(found, image)).map_err(|source| refused(&pair, view, source))
    };
    let both = [one(image1, 1)?, one(image2, 2)?];
    Ok(seen(pair, both))
}

/// The pair as [`segment_images`] made it, with probabilities and masks of a more careful segmentation
/// ([`Segmenter::segment_again`]); none where there is no such way.
///
/// # Errors
/// As [`segment_images`].
pub(crate) fn segment_images_again(
    pair: &ViewPair,
    segmenter: &dyn Segmenter,
    watch: &Watch<'_>,
) -> Result<Option<ViewPair>, Error> {
    let images = images(pair)?;
    let Some(before) = &pair.probabilities else { return Ok(None) };
    let again = |image: &Array2<f32>, before: &Array2<f32>, view| {
        let found = segmenter.segment_again(image, before, watch);
        found
            .and_then(|found| found.map(|found| checked(found, image)).transpose())
            .map_err(|source| refused(pair, view, source))
    };
    let Some(view1) = again(&images[0], &before[0], 1)? else { return Ok(None) };
    let Some(view2) = again(&images[1], &before[1], 2)? else { return Ok(None) };
    Ok(Some(seen(pair.clone(), [view1, view2])))
}

fn images(pair: &ViewPair) -> Result<&[Array2<f32>; 2], Error> {
    let missing = || Error::MissingInput { case: pair.id.clone(), input: InputKind::Image };
    pair.images.as_ref().ok_or_else(missing)
}

fn checked(found: Segmentation, image: &Array2<f32>) -> Result<Segmentation, SegError> {
    same_shape(image, &found)?;
    found.mask.require_foreground()?;
    Ok(found)
}

fn refused(pair: &ViewPair, view: u8, source: SegError) -> Error {
    Error::Segmentation { case: pair.id.clone(), view, source }
}

fn seen(mut pair: ViewPair, [view1, view2]: [Segmentation; 2]) -> ViewPair {
    pair.masks = Some([view1.mask.into_array(), view2.mask.into_array()]);
    pair.probabilities = Some([view1.probability, view2.probability]);
    pair
}

/// A segmenter of the caller's own may be wrong about its shapes; the stages after it rely on them.
fn same_shape(image: &Array2<f32>, found: &Segmentation) -> Result<(), SegError> {
    let expected = image.dim();
    for got in [found.probability.dim(), found.mask.shape()] {
        if got != expected {
            return Err(SegError::WrongShape { expected, found: got });
        }
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests {
    use std::ops::ControlFlow;

    use accurate_eval::curve_scores;
    use accurate_seg::{Mask, Progress, unwatched};
    use accurate_synth::{CaseOptions, Family, SynthCase, generate};

    use super::*;
    use crate::{Method, Params, reconstruct};

    /// Reads the body off an image that shows nothing else.
    #[derive(Debug)]
    struct Dark {
        cut: usize,
    }

    impl Segmenter for Dark {
        fn segment(
            &self,
            image: &Array2<f32>,
            watch: &Watch<'_>,
        ) -> Result<Segmentation, SegError> {
            if watch(Progress { done: 1, total: 1 }).is_break() {
                return Err(SegError::Cancelled { done: 1, total: 1 });
            }
            let shape = (image.nrows() - self.cut, image.ncols());
            let probability = Array2::from_shape_fn(shape, |at| 1.0 - image[at]);
            let mask = Mask::from_array(probability.mapv(|p| p > 0.5))?;
            Ok(Segmentation { probability, mask })
        }

        fn describe(&self) -> String {
            "dark pixels".to_owned()
        }
    }

    /// A case, and its pair with the masks as images in their place.
    pub(crate) fn case() -> (SynthCase, ViewPair) {
        let case = generate(Family::Easy, 1000, 0, &CaseOptions::default()).unwrap();
        let mut pair = ViewPair::from(case.clone());
        pair.images = Some(case.masks.clone().map(|m| m.mapv(|body| f32::from(u8::from(!body)))));
        pair.masks = None;
        (case, pair)
    }

    #[test]
    fn images_that_show_the_masks_give_the_curve_of_the_masks() {
        let (case, pair) = case();
        for method in [Method::Accurate, Method::Paper] {
            let pair = segment_images(pair.clone(), &Dark { cut: 0 }, &unwatched).unwrap();
            assert_eq!(pair.masks.as_ref(), Some(&case.masks));
            let mut params = Params::new(InputKind::Image, method);
            (params.robust.by_probability, params.robust.by_grey_levels) = (false, false);
            let image = reconstruct(&pair, &params).unwrap();
            let masks = ViewPair::from(case.clone());
            let mask = reconstruct(&masks, &Params::new(InputKind::Mask, method)).unwrap();
            assert_eq!(image.points, mask.points);
            assert_eq!((image.input, mask.input), (InputKind::Image, InputKind::Mask));
        }
    }

    #[test]
    fn maps_that_show_the_masks_give_nearly_the_curve_of_the_masks() {
        let (case, pair) = case();
        let pair = segment_images(pair, &Dark { cut: 0 }, &unwatched).unwrap();
        let mut params = Params::new(InputKind::Image, Method::Accurate);
        assert!(params.robust.by_probability);
        let by_map = reconstruct(&pair, &params).unwrap();
        params.input = InputKind::Mask;
        let by_mask = reconstruct(&ViewPair::from(case), &params).unwrap();
        // The map takes the directions of the edge from its gradient, not from pixel pairs, and
        // weighs all points alike: the same points, each off by a standard deviation of 0.24 px, of
        // which some ten decide on a place of the curve.
        let (a, b) = (by_map.positions(), by_mask.positions());
        let camera = pair.rig.camera1();
        let unit_per_px = camera.depth(&a[a.len() / 2]) / camera.k()[(0, 0)].abs();
        let apart = curve_scores(&a, &b, 0.5 * unit_per_px).unwrap().hausdorff / unit_per_px;
        assert!(apart < 0.5, "{apart} px");
    }

    #[test]
    fn images_that_were_not_segmented_are_refused_even_beside_masks() {
        let (case, mut pair) = case();
        pair.masks = Some(case.masks);
        let params = Params::new(InputKind::Image, Method::Accurate);
        assert!(matches!(reconstruct(&pair, &params), Err(Error::NotSegmented { .. })));
        pair.images = None;
        assert!(matches!(reconstruct(&pair, &params), Err(Error::MissingInput { .. })));
        let refused = segment_images(pair, &Dark { cut: 0 }, &unwatched);
        assert!(matches!(refused, Err(Error::MissingInput { input: InputKind::Image, .. })));
    }

    #[test]
    fn an_empty_result_a_wrong_shape_and_a_cancelled_run_name_the_view() {
        let (_, pair) = case();
        let refusal = |pair: ViewPair, cut, watch: &Watch<'_>| match segment_images(
            pair,
            &Dark { cut },
            watch,
        ) {
            Err(Error::Segmentation { view, source, .. }) => (view, source),
            other => panic!("{other:?}"),
        };
        let shape = pair.images.as_ref().unwrap()[0].dim();
        let (view, error) = refusal(pair.clone(), 1, &unwatched);
        assert_eq!(view, 1);
        let found = (shape.0 - 1, shape.1);
        assert_eq!(error, SegError::WrongShape { expected: shape, found });
        let (_, error) = refusal(pair.clone(), 0, &|_| ControlFlow::Break(()));
        assert_eq!(error, SegError::Cancelled { done: 1, total: 1 });
        let mut blank = pair;
        if let Some(images) = &mut blank.images {
            images[1].fill(1.0);
        }
        let (view, error) = refusal(blank, 0, &unwatched);
        assert_eq!((view, error), (2, SegError::EmptyMask { height: shape.0, width: shape.1 }));
    }
}
