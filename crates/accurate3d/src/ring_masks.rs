use accurate_geom::{Pixel, View, View1, View2};
use accurate_seg::{Mask, Skeleton, distance_to_background, median_width_px, zhang_suen};
use accurate_traverse::{
    GraphParams, SkeletonGraph, WalkParams, endpoints, k_best_walks, recentre,
};
use ndarray::Array2;

use crate::ordered_points::{Ring, closed_points};
use crate::{Closure, Error, Params, Reconstruction, ViewPair};

/// Our own method on masks of a ring: the walk around each mask, moved to the middle of the strand,
/// then as ordered points of a closed curve. `None` if this is no ring: a view shows a tip.
///
/// # Errors
/// [`Error::NotClosed`] if a ring was asked for and a view shows none; [`Error::MissingInput`],
/// [`Error::Segmentation`], [`Error::Traversal`]; as closed points.
pub(crate) fn ring_masks(
    pair: &ViewPair,
    params: &Params,
) -> Result<Option<Reconstruction>, Error> {
    if params.closure != Closure::Closed {
        return Ok(None);
    }
    let masks = pair
        .masks
        .as_ref()
        .ok_or_else(|| Error::MissingInput { case: pair.id.clone(), input: params.input })?;
    let forced = params.closure == Closure::Closed;
    let Some((points1, coverage1)) = walk_around::<View1>(&masks[0], forced, &pair.id)? else {
        return Ok(None);
    };
    let Some((points2, coverage2)) = walk_around::<View2>(&masks[1], forced, &pair.id)? else {
        return Ok(None);
    };
    let ring = Ring { points1: &points1, points2: &points2, coverage: [coverage1, coverage2] };
    closed_points(pair, params, &ring).map(Some)
}

type Walked<V> = Option<(Vec<Pixel<V>>, f64)>;

/// The sub-pixel walk around a mask and its coverage; `None` if the mask shows a tip, an error if
/// that must not be (`forced`).
fn walk_around<V: View>(
    array: &Array2<bool>,
    forced: bool,
    case: &str,
) -> Result<Walked<V>, Error> {
    let segmentation =
        |source| Error::Segmentation { case: case.to_owned(), view: V::NUMBER, source };
    let traversal = |source| Error::Traversal { case: case.to_owned(), source };
    let mask = Mask::from_array(array.clone()).map_err(segmentation)?;
    mask.require_foreground().map_err(segmentation)?;
    let thin = zhang_suen(&mask);
    let pixels = Skeleton::of(&thin).map_err(segmentation)?.pixels_as::<V>();
    let tips = endpoints(&pixels).map_err(traversal)?.len();
    if tips > 0 && !forced {
        return Ok(None);
    }
    let radii = distance_to_background(&mask).map_err(segmentation)?;
    let thickness = median_width_px(&mask).map_err(segmentation)?;
    let graph = SkeletonGraph::<V>::new(thin.as_array(), &radii, thickness, &GraphParams::DEFAULT)
        .map_err(traversal)?;
    let cheapest = WalkParams { walks: 1, ..WalkParams::DEFAULT };
    let walk = k_best_walks(&graph, &cheapest).map_err(traversal)?.into_iter().next();
    match walk.filter(|walk| walk.is_closed()) {
        Some(walk) => {
            // The skeleton of a thick mask wavers; its middle does not.
            let points = recentre(&walk.points, &radii, thickness.max(1.0)).map_err(traversal)?;
            Ok(Some((points, walk.coverage)))
        }
        None if forced => Err(Error::NotClosed { case: case.to_owned(), view: V::NUMBER, tips }),
        None => Ok(None),
    }
}
