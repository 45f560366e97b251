use accurate_geom::Point2;
use ndarray::Array2;

use crate::mask::covered;

/// Radius of the tube around the centreline, px.
pub const TUBE_RADIUS_PX: f64 = 2.0;

/// A stretch of the target that can be seen: vertices (px) and the wire's radius at each (px).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct VisiblePiece {
    /// Vertices in the order of the wire.
    pub points: Vec<Point2>,
    /// Radius at each vertex.
    pub radius_px: Vec<f64>,
}

/// Cuts a centreline into the stretches whose vertices can be seen; one vertex alone is none.
pub(crate) fn visible_pieces(
    points: &[Point2],
    radius_px: impl Fn(f64) -> f64,
    visible: impl Fn(&Point2) -> bool,
) -> Vec<VisiblePiece> {
    let mut pieces = Vec::new();
    let mut piece = VisiblePiece::default();
    let mut arc = 0.0;
    for (k, point) in points.iter().enumerate() {
        if k > 0 {
            arc += (point - points[k - 1]).norm();
        }
        if visible(point) {
            piece.points.push(*point);
            piece.radius_px.push(radius_px(arc));
        } else if piece.points.len() > 1 {
            pieces.push(std::mem::take(&mut piece));
        } else {
            piece = VisiblePiece::default();
        }
    }
    if piece.points.len() > 1 {
        pieces.push(piece);
    }
    pieces
}

/// Pixels whose centre is within the wire (its radius from the centreline, at least 1/2 px) and can
/// be seen. Shape (side, side).
pub(crate) fn wire_mask(
    side: u32,
    pieces: &[VisiblePiece],
    visible: impl Fn(&Point2) -> bool,
) -> Array2<bool> {
    fill(side, pieces, |a, b, t| (a + (b - a) * t).max(0.5), visible)
}

/// Pixels whose centre is within [`TUBE_RADIUS_PX`] of the visible centreline. Shape (side, side).
pub(crate) fn tube_mask(side: u32, pieces: &[VisiblePiece]) -> Array2<bool> {
    fill(side, pieces, |_, _, _| TUBE_RADIUS_PX, |_| true)
}

fn fill(
    side: u32,
    pieces: &[VisiblePiece],
    radius: impl Fn(f64, f64, f64) -> f64,
    keep: impl Fn(&Point2) -> bool,
) -> Array2<bool> {
    let mut mask = Array2::from_elem((side as usize, side as usize), false);
    for piece in pieces {
        for (ends, radii) in piece.points.windows(2).zip(piece.radius_px.windows(2)) {
            let (a, b) = (ends[0], ends[1]);
            let along = b - a;
            let length2 = along.norm_squared();
            let reach = radius(radii[0], radii[1], 0.0).max(radius(radii[0], radii[1], 1.0));
            let columns = covered(a.x.min(b.x) - reach, a.x.max(b.x) + reach, side);
            for row in covered(a.y.min(b.y) - reach, a.y.max(b.y) + reach, side) {
                for column in columns.clone() {
                    if mask[[row, column]] {
                        continue;
                    }
                    let centre = Point2::new(column as f64, row as f64);
                    let from_a = centre - a;
                    let t = if length2 > 0.0 {
                        (from_a.dot(&along) / length2).clamp(0.0, 1.0)
                    } else {
                        0.0
                    };
                    let limit = radius(radii[0], radii[1], t);
                    if (from_a - along * t).norm_squared() <= limit * limit && keep(&centre) {
                        mask[[row, column]] = true;
                    }
                }
            }
        }
    }
    mask
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mask;

    fn pieces() -> impl Strategy<Value = Vec<VisiblePiece>> {
        let point = (-5.0..30.0, -5.0..30.0).prop_map(|(x, y)| Point2::new(x, y));
        let piece = prop::collection::vec(point, 2..6);
        (prop::collection::vec(piece, 0..3), 0.3..4.0_f64).prop_map(|(pieces, radius)| {
            pieces
                .into_iter()
                .map(|points| VisiblePiece { radius_px: vec![radius; points.len()], points })
                .collect()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn a_constant_width_gives_the_mask_of_the_pair_generator(pieces in pieces()) {
            let size = accurate_geom::ImageSize { width: 26, height: 26 };
            let points: Vec<_> = pieces.iter().map(|p| p.points.clone()).collect();
            let radius = pieces.first().map_or(1.0, |p| p.radius_px[0]).max(0.5);
            let ours = wire_mask(26, &pieces, |_| true);
            let theirs = mask::draw(size, &points, 2.0 * radius, &[]);
            // Interpolating equal radii may round; the two can differ only on the rim itself.
            for ((row, column), set) in ours.indexed_iter() {
                if *set != theirs[[row, column]] {
                    let centre = Point2::new(column as f64, row as f64);
                    let d2 = points.iter().flat_map(|p| p.windows(2))
                        .map(|w| mask::squared_distance(&centre, &w[0], &w[1]))
                        .fold(f64::INFINITY, f64::min);
                    prop_assert!((d2.sqrt() - radius).abs() < 1e-9, "{d2} {radius}");
                }
            }
        }

        #[test]
        fn the_tube_holds_every_pixel_that_the_centreline_passes(pieces in pieces()) {
            let tube = tube_mask(26, &pieces);
            for w in pieces.iter().flat_map(|p| p.points.windows(2)) {
                for k in 0..=20 {
                    let p = w[0] + (w[1] - w[0]) * (f64::from(k) / 20.0);
                    let (x, y) = (p.x.round(), p.y.round());
                    if (0.0..26.0).contains(&x) && (0.0..26.0).contains(&y) {
                        prop_assert!(tube[[y as usize, x as usize]]);
                    }
                }
            }
        }
    }

    #[test]
    fn hidden_vertices_split_the_wire() {
        let points: Vec<_> = (0..10).map(|k| Point2::new(f64::from(k), 0.0)).collect();
        let pieces = visible_pieces(&points, |s| s, |p| p.x != 4.0 && p.x != 8.0);
        let spans: Vec<_> = pieces.iter().map(|p| (p.points[0].x, p.points.len())).collect();
        assert_eq!(spans, [(0.0, 4), (5.0, 3)]);
        assert_eq!(pieces[1].radius_px, [5.0, 6.0, 7.0]);
    }
}
