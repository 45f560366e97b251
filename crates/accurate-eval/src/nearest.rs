use rstar::primitives::GeomWithData;
use rstar::{AABB, PointDistance, RTree, RTreeObject};

/// Exact nearest distances to a set of points.
pub(crate) struct PointIndex {
    tree: RTree<GeomWithData<[f64; 3], ()>>,
}

impl PointIndex {
    /// `points` is not empty and finite.
    pub(crate) fn new(points: impl Iterator<Item = [f64; 3]>) -> Self {
        Self { tree: RTree::bulk_load(points.map(|p| GeomWithData::new(p, ())).collect()) }
    }

    /// Distance to the nearest point.
    pub(crate) fn distance(&self, query: [f64; 3]) -> f64 {
        let nearest = self.tree.nearest_neighbor_with_distance_2(query);
        nearest.map_or(f64::INFINITY, |(_, squared)| squared.sqrt())
    }
}

/// Exact nearest distances to a polyline, in the plane or in space.
pub(crate) struct PolylineIndex<const N: usize> {
    tree: RTree<Segment<N>>,
}

impl<const N: usize> PolylineIndex<N> {
    /// The polyline through `vertices`, which are finite and at least one; one vertex is a point.
    pub(crate) fn new(vertices: &[[f64; N]]) -> Self {
        let mut segments: Vec<_> =
            vertices.windows(2).map(|pair| Segment { from: pair[0], to: pair[1] }).collect();
        if let [only] = vertices {
            segments.push(Segment { from: *only, to: *only });
        }
        Self { tree: RTree::bulk_load(segments) }
    }

    /// Distance to the nearest point of the polyline.
    pub(crate) fn distance(&self, query: [f64; N]) -> f64 {
        let nearest = self.tree.nearest_neighbor_with_distance_2(query);
        nearest.map_or(f64::INFINITY, |(_, squared)| squared.sqrt())
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Segment<const N: usize> {
    from: [f64; N],
    to: [f64; N],
}

impl<const N: usize> RTreeObject for Segment<N> {
    type Envelope = AABB<[f64; N]>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_corners(self.from, self.to)
    }
}

impl<const N: usize> PointDistance for Segment<N> {
    fn distance_2(&self, query: &[f64; N]) -> f64 {
        let direction = difference(&self.to, &self.from);
        let offset = difference(query, &self.from);
        let (along, length_2) = (dot(&offset, &direction), dot(&direction, &direction));
        // The ends are compared with as given, so that a vertex is at distance exactly zero. A
        // segment without length takes the first branch.
        if along <= 0.0 {
            dot(&offset, &offset)
        } else if along >= length_2 {
            let offset = difference(query, &self.to);
            dot(&offset, &offset)
        } else {
            let t = along / length_2;
            (0..N).map(|k| (offset[k] - t * direction[k]).powi(2)).sum()
        }
    }
}

fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    (0..N).map(|k| a[k] * b[k]).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = [f64; 3]> {
        // Whole numbers make ties and repeated points likely.
        prop_oneof![
            prop::array::uniform3(-5..5_i32).prop_map(|p| p.map(f64::from)),
            prop::array::uniform3(-50.0..50.0_f64),
        ]
    }

    proptest! {
        #[test]
        fn the_nearest_point_equals_brute_force(
            points in prop::collection::vec(point(), 1..60), query in point(),
        ) {
            let brute = points.iter().map(|p| {
                let d = difference(&query, p);
                dot(&d, &d).sqrt()
            }).fold(f64::INFINITY, f64::min);
            let found = PointIndex::new(points.into_iter()).distance(query);
            // The same three products in the same order, or one of equal distance.
            prop_assert!((found - brute).abs() <= 4.0 * f64::EPSILON * brute);
        }

        #[test]
        fn the_polyline_is_never_farther_than_its_vertices(
            vertices in prop::collection::vec(point(), 1..40), query in point(),
        ) {
            let to_line = PolylineIndex::new(&vertices).distance(query);
            let to_points = PointIndex::new(vertices.into_iter()).distance(query);
            // Inside a segment the offset is rounded once more, at coordinates below 100.
            prop_assert!(to_line <= to_points + 4.0 * f64::EPSILON * 100.0);
        }

        #[test]
        fn the_nearest_segment_equals_brute_force(
            vertices in prop::collection::vec(point(), 1..60), query in point(),
        ) {
            // By ternary search on every segment: it knows of no projection formula.
            let at = |a: &[f64; 3], b: &[f64; 3], t: f64| {
                let d: [f64; 3] = std::array::from_fn(|k| query[k] - (a[k] + t * (b[k] - a[k])));
                dot(&d, &d).sqrt()
            };
            let mut brute = at(&vertices[0], &vertices[0], 0.0);
            for pair in vertices.windows(2) {
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..100 {
                    let (l, h) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                    if at(&pair[0], &pair[1], l) <= at(&pair[0], &pair[1], h) {
                        high = h;
                    } else {
                        low = l;
                    }
                }
                for t in [0.0, low, 1.0] {
                    brute = brute.min(at(&pair[0], &pair[1], t));
                }
            }
            let found = PolylineIndex::new(&vertices).distance(query);
            // Differences of coordinates below 100 are wrong by 1e-14; near its minimum the distance
            // is flat, so that the search, which stops at sqrt(eps), is as good; a distance near 0
            // is the root of a square wrong by (1e-14)², and of t * length, 100 * eps * few.
            prop_assert!((found - brute).abs() <= 1e-6 * brute.max(1e-6), "{found} {brute}");
        }
    }

    #[test]
    fn a_vertex_is_at_distance_zero() {
        let vertices = [[0.1, 0.2, 0.3], [0.7, 0.1, 0.9], [0.7, 0.1, 0.9], [1e9, 0.3, -7.1]];
        let index = PolylineIndex::new(&vertices);
        assert!(vertices.iter().all(|&v| index.distance(v) == 0.0));
    }
}
