use accurate_geom::{GeomError, Pixel, Point3, Rig, Triangulation, Triangulator, View1, View2};

use crate::ray_image::RayImager;
use crate::{CurvePoint, CurveReconstruction, MatchError};

/// One correspondence: which points were matched, and the pixels to triangulate for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelPair {
    /// `(i of view 1, j of view 2)`.
    pub cell: (usize, usize),
    /// Pixel of view 1: point `i`, or a position near it on the curve.
    pub pixel1: Pixel<View1>,
    /// Pixel of view 2: point `j`, or a position near it on the curve.
    pub pixel2: Pixel<View2>,
}

/// Triangulates pairs, one 3D point for each, in their order.
///
/// A pair whose rays do not meet in front of both cameras is left out and counted in
/// [`CurveReconstruction::dropped`]: on sound input there is none, and one stray pair (a pixel at
/// the epipole, say) is no reason to lose the curve. `method` names the caller in errors.
///
/// # Errors
/// [`MatchError::NoCorrespondence`] if `pairs` is empty, [`MatchError::NothingTriangulated`] with
/// the first failure if every pair was dropped.
///
/// # Source
/// ACCURATE, section 2.3, last step; the paper does not name the triangulation, its published
/// results use [`Triangulation::Dlt`].
///
/// # Cost
/// O(number of pairs); see [`Triangulator::triangulate_all`].
pub fn triangulate_pairs(
    method: &'static str,
    rig: &Rig,
    triangulation: Triangulation,
    pairs: &[PixelPair],
) -> Result<CurveReconstruction, MatchError> {
    let triangulator = Triangulator::new(rig, triangulation);
    let imager = RayImager::new(rig.fundamental());
    let mut points = Vec::with_capacity(pairs.len());
    let mut cells = Vec::with_capacity(pairs.len());
    let mut first_failure = None;
    let found = triangulator.triangulate_all(pairs.iter().map(|p| (p.pixel1, p.pixel2)));
    for (pair, position) in pairs.iter().zip(found.results()) {
        let point = position.map_err(GeomError::clone);
        match point.and_then(|position| curve_point(rig, &imager, pair, position)) {
            Ok(point) => {
                points.push(point);
                cells.push(pair.cell);
            }
            Err(failure) => first_failure = first_failure.or(Some(failure)),
        }
    }
    match first_failure {
        Some(first) if points.is_empty() => {
            Err(MatchError::NothingTriangulated { method, pairs: pairs.len(), first })
        }
        None if points.is_empty() => Err(MatchError::NoCorrespondence { method, candidates: 0 }),
        _ => {
            let dropped = pairs.len() - points.len();
            Ok(CurveReconstruction { points, pairs: cells, dropped })
        }
    }
}

fn curve_point(
    rig: &Rig,
    imager: &RayImager<View1, View2>,
    pair: &PixelPair,
    position: Point3,
) -> Result<CurvePoint, GeomError> {
    let PixelPair { pixel1, pixel2, .. } = *pair;
    for camera in [rig.camera1(), rig.camera2()] {
        let depth = camera.depth(&position);
        if depth <= 0.0 {
            return Err(GeomError::NotInFront { depth });
        }
    }
    let epipolar_distance_px = imager.image(pixel2)?.distance(pixel1);
    if !epipolar_distance_px.is_finite() {
        let what = "epipolar distance".to_owned();
        return Err(GeomError::NotFinite { what, value: epipolar_distance_px });
    }
    Ok(CurvePoint { position, pixel1, pixel2, epipolar_distance_px })
}
