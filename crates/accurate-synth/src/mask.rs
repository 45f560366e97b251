use accurate_geom::{ImageSize, Point2};
use ndarray::Array2;

use crate::damage::Disc;

/// The mask of wire pieces: a pixel is set iff its centre is within `thickness_px / 2` of one of
/// them (round caps), and in none of the discs. Shape (height, width).
///
/// This is what an anti-aliased drawing thresholded at half coverage gives, up to the curvature of
/// the outline within one pixel, without its rounding. With a thickness of 1 px or more the image of
/// a continuous curve is 8-connected: a path that leaves one pixel's disc of radius 1/2 enters, at
/// once or through the hole between four of them, the disc of an 8-neighbour.
pub(crate) fn draw(
    size: ImageSize,
    pieces: &[Vec<Point2>],
    thickness_px: f64,
    discs: &[Disc],
) -> Array2<bool> {
    let mut mask = Array2::from_elem((size.height as usize, size.width as usize), false);
    let radius = thickness_px / 2.0;
    for piece in pieces {
        for ends in piece.windows(2) {
            let (a, b) = (ends[0], ends[1]);
            let columns = covered(a.x.min(b.x) - radius, a.x.max(b.x) + radius, size.width);
            for row in covered(a.y.min(b.y) - radius, a.y.max(b.y) + radius, size.height) {
                for column in columns.clone() {
                    let centre = Point2::new(column as f64, row as f64);
                    if squared_distance(&centre, &a, &b) <= radius * radius {
                        mask[[row, column]] = true;
                    }
                }
            }
        }
    }
    for disc in discs {
        for row in covered(disc.y - disc.radius_px, disc.y + disc.radius_px, size.height) {
            for column in covered(disc.x - disc.radius_px, disc.x + disc.radius_px, size.width) {
                if disc.covers(column as f64, row as f64) {
                    mask[[row, column]] = false;
                }
            }
        }
    }
    mask
}

/// The pixel indices in `[low, high]`, within `0..count`.
pub(crate) fn covered(low: f64, high: f64, count: u32) -> std::ops::Range<usize> {
    // Casts saturate: what lies outside the image becomes an empty range.
    let start = low.ceil().max(0.0) as usize;
    let end = (high.floor() + 1.0).clamp(0.0, f64::from(count)) as usize;
    start.min(end)..end
}

/// Squared distance of a point to a segment.
pub(crate) fn squared_distance(point: &Point2, a: &Point2, b: &Point2) -> f64 {
    let (along, from_a) = (b - a, point - a);
    let length2 = along.norm_squared();
    let t = if length2 > 0.0 { (from_a.dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (from_a - along * t).norm_squared()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn curves() -> impl Strategy<Value = Vec<Point2>> {
        prop::collection::vec((-4.0..20.0, -4.0..20.0), 1..6)
            .prop_map(|v| v.into_iter().map(|(x, y)| Point2::new(x, y)).collect())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn a_pixel_is_set_iff_its_centre_is_within_half_the_thickness(
            curve in curves(), thickness in 1.0..6.0,
        ) {
            let size = ImageSize { width: 16, height: 13 };
            let mask = draw(size, std::slice::from_ref(&curve), thickness, &[]);
            for ((row, column), &set) in mask.indexed_iter() {
                // Oracle: nearest of 1001 samples per segment, at most 24 sqrt 2 px long: a sample
                // is within 0.017 px of the foot point, so at a distance of 0.5 px or more the
                // sampled one is too large by less than 0.017² / (2 * 0.5) px.
                let nearest = curve.windows(2).flat_map(|w| (0..=1000).map(move |k| {
                    let p = w[0] + (w[1] - w[0]) * (f64::from(k) / 1000.0);
                    (p.x - column as f64).hypot(p.y - row as f64)
                })).fold(f64::INFINITY, f64::min);
                if set {
                    prop_assert!(nearest <= thickness / 2.0 + 0.0003, "{row} {column} {nearest}");
                } else {
                    prop_assert!(nearest > thickness / 2.0 - 1e-9, "{row} {column} {nearest}");
                }
            }
        }
    }

    #[test]
    fn an_outlying_or_empty_piece_sets_nothing() {
        let size = ImageSize { width: 8, height: 8 };
        let far = vec![Point2::new(-1e300, 5.0), Point2::new(-1e299, 5.0)];
        let mask = draw(size, &[far, vec![], vec![Point2::new(3.0, 3.0)]], 3.0, &[]);
        assert!(!mask.iter().any(|&set| set));
    }
}
