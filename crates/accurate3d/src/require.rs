//! What a pair must be before any method looks at it.

use accurate_geom::{Camera, ImageSize, Pixel, Point2, View};

use crate::{Error, InputKind, ViewPair};

/// Images have probability maps.
pub(crate) fn require_segmented(pair: &ViewPair) -> Result<(), Error> {
    match (&pair.images, &pair.probabilities) {
        (_, Some(_)) => Ok(()),
        (Some(_), None) => Err(Error::NotSegmented { case: pair.id.clone() }),
        (None, None) => Err(Error::MissingInput { case: pair.id.clone(), input: InputKind::Image }),
    }
}

/// What belongs to a view has the size of its camera's image.
pub(crate) fn require_one_size(pair: &ViewPair) -> Result<(), Error> {
    let cameras = [pair.rig.camera1(), pair.rig.camera2()];
    for (view, camera) in cameras.into_iter().enumerate() {
        let size = camera.size();
        let expected = (size.height as usize, size.width as usize);
        let found = [
            ("mask", pair.masks.as_ref().map(|both| both[view].dim())),
            ("image", pair.images.as_ref().map(|both| both[view].dim())),
            ("probability map", pair.probabilities.as_ref().map(|both| both[view].dim())),
        ];
        for (what, found) in found {
            if let Some(found) = found.filter(|found| *found != expected) {
                let (case, view) = (pair.id.clone(), view as u8 + 1);
                return Err(Error::OtherSize { case, view, what, found, expected });
            }
        }
    }
    Ok(())
}

/// By how much of the picture's longer side a point may lie beyond its edge: what a body that leaves
/// the picture is drawn on to by hand, or a lens model is off there. Points of a picture of another
/// size lie further out.
const BEYOND_THE_EDGE: f64 = 0.05;

/// Ordered points were seen in their camera's picture.
pub(crate) fn require_points_inside(pair: &ViewPair) -> Result<(), Error> {
    let Some((points1, points2)) = &pair.points else { return Ok(()) };
    let outside = [
        (1, first_outside(points1, pair.rig.camera1())),
        (2, first_outside(points2, pair.rig.camera2())),
    ];
    for (view, found) in outside {
        if let Some((index, point, size)) = found {
            let point = [point.x, point.y];
            return Err(Error::PointOutside { case: pair.id.clone(), view, index, point, size });
        }
    }
    Ok(())
}

fn first_outside<V: View>(
    points: &[Pixel<V>],
    camera: &Camera,
) -> Option<(usize, Point2, ImageSize)> {
    let size = camera.size();
    let [width, height] = [size.width, size.height].map(f64::from);
    let beyond = BEYOND_THE_EDGE * width.max(height);
    let inside = |value: f64, side: f64| (-beyond..=side - 1.0 + beyond).contains(&value);
    points.iter().enumerate().map(|(index, pixel)| (index, pixel.point())).find_map(|(index, p)| {
        // Points are free of the lens; the picture is not.
        let recorded = camera.distort(&p).unwrap_or(p);
        let seen = inside(recorded.x, width) && inside(recorded.y, height);
        (!seen).then_some((index, p, size))
    })
}
