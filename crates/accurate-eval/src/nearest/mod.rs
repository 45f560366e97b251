mod piece;
mod tree;

use accurate_geom::Point3;
use pulp::Arch;

use piece::Edge;
use tree::{Aabb, Tree};

/// What has coordinates.
pub(crate) trait Place<const N: usize>: Copy {
    fn coordinates(self) -> [f64; N];
}

impl<const N: usize> Place<N> for [f64; N] {
    fn coordinates(self) -> [f64; N] {
        self
    }
}

impl Place<3> for Point3 {
    fn coordinates(self) -> [f64; 3] {
        self.coords.into()
    }
}

/// Exact nearest distances to a set of points, fastest when points and queries run along a curve.
pub(crate) struct PointIndex {
    tree: Tree<3, [f64; 3]>,
}

impl PointIndex {
    /// `points` is not empty and finite.
    pub(crate) fn new(points: &[Point3]) -> Self {
        let with_box = |point: &Point3| (point.coordinates(), Aabb::of_point(point.coordinates()));
        Self { tree: Tree::new(points.len(), points.iter().map(with_box)) }
    }

    /// The distance of every query to the nearest point, in their order.
    pub(crate) fn distances(&self, queries: &[Point3]) -> Vec<f64> {
        self.tree.distances(Arch::new(), queries)
    }
}

/// Exact nearest distances to a polyline, in the plane or in space: the least of those to its
/// vertices, so that a vertex is at distance exactly zero, and of those to the feet of the
/// perpendiculars inside its segments.
pub(crate) struct PolylineIndex<const N: usize> {
    tree: Tree<N, Edge<N>>,
}

impl<const N: usize> PolylineIndex<N> {
    /// The polyline through `vertices`, which are finite and at least one; one vertex is a point.
    pub(crate) fn new<V: Place<N>>(vertices: &[V]) -> Self {
        Self::of_pieces(std::iter::once(vertices))
    }

    /// All of several polylines.
    pub(crate) fn of_pieces<'a, V: Place<N> + 'a>(
        pieces: impl Iterator<Item = &'a [V]> + Clone,
    ) -> Self {
        let count = pieces.clone().map(<[_]>::len).sum();
        let edge = |from: V, to: V| {
            let (from, to) = (from.coordinates(), to.coordinates());
            (Edge::new(from, to), Aabb::of_point(from).joined(Aabb::of_point(to)))
        };
        let edges = pieces.flat_map(|vertices| {
            let between = vertices.windows(2).map(move |pair| edge(pair[0], pair[1]));
            between.chain(vertices.last().map(|&last| edge(last, last)))
        });
        Self { tree: Tree::new(count, edges) }
    }

    /// The distance of every query to the nearest point of the polylines, in their order.
    pub(crate) fn distances<Q: Place<N>>(&self, queries: &[Q]) -> Vec<f64> {
        self.tree.distances(Arch::new(), queries)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = [f64; 3]> {
        // Whole numbers make ties and repeated points likely; the last are as far off as can be.
        prop_oneof![
            4 => prop::array::uniform3(-5..5_i32).prop_map(|p| p.map(f64::from)),
            4 => prop::array::uniform3(-50.0..50.0_f64),
            1 => prop::array::uniform3(-1e-9..1e-9_f64).prop_map(|p| p.map(|v| 1.0 + v)),
            1 => prop::array::uniform3(-1e150..1e150_f64),
        ]
    }

    /// Curves of short steps, far from the origin or not, and points beside them.
    fn curve_and_queries() -> impl Strategy<Value = (Vec<[f64; 3]>, Vec<[f64; 3]>)> {
        let step = prop::array::uniform3(-1.0..1.0_f64);
        let steps = prop::collection::vec((step.clone(), step), 1..300);
        (steps, 0..9_i32, 0..6_i32).prop_map(|(steps, far, beside)| {
            let mut at = [10.0_f64.powi(far); 3];
            let mut pairs = Vec::new();
            for (step, offset) in steps {
                let beside = 10.0_f64.powi(-beside);
                for k in 0..3 {
                    at[k] += step[k];
                }
                pairs.push((at, [0, 1, 2].map(|k| at[k] + beside * offset[k])));
            }
            pairs.into_iter().unzip()
        })
    }

    /// The formulas, without vectors or boxes.
    fn plain(vertices: &[[f64; 3]], segments: bool, query: &[f64; 3]) -> f64 {
        let minus = |a: &[f64; 3], b: &[f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let to_vertices = vertices.iter().map(|v| {
            let offset = minus(query, v);
            dot(&offset, &offset)
        });
        let to_feet = vertices.windows(2).filter_map(|pair| {
            let (offset, direction) = (minus(query, &pair[0]), minus(&pair[1], &pair[0]));
            let (along, length_2) = (dot(&offset, &direction), dot(&direction, &direction));
            (segments && along > 0.0 && along < length_2).then(|| {
                let part = along / length_2;
                let offset = minus(&offset, &direction.map(|d| part * d));
                dot(&offset, &offset)
            })
        });
        to_vertices.chain(to_feet).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// What this machine has, from the narrowest up.
    fn machines() -> Vec<Arch> {
        let mut machines = vec![Arch::Scalar];
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            machines.push(Arch::V3(simd));
        }
        machines.push(Arch::new());
        machines
    }

    fn check(vertices: &[[f64; 3]], queries: &[[f64; 3]]) -> Result<(), TestCaseError> {
        let points: Vec<Point3> = vertices.iter().map(|&v| v.into()).collect();
        let to_points = PointIndex::new(&points);
        let to_line = PolylineIndex::new(vertices);
        for machine in machines() {
            let points = to_points.tree.distances(machine, queries);
            let line = to_line.tree.distances(machine, queries);
            prop_assert_eq!((points.len(), line.len()), (queries.len(), queries.len()));
            for (k, query) in queries.iter().enumerate() {
                prop_assert_eq!(points[k], plain(vertices, false, query));
                prop_assert_eq!(line[k], plain(vertices, true, query));
                prop_assert!(line[k] <= points[k]);
            }
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn distances_are_those_of_a_scan_of_all_on_every_machine_bit_by_bit(
            vertices in prop::collection::vec(point(), 1..80),
            queries in prop::collection::vec(point(), 0..30),
        ) {
            check(&vertices, &queries)?;
        }

        #[test]
        fn distances_to_a_curve_are_those_of_a_scan_of_all_bit_by_bit(
            (curve, queries) in curve_and_queries(),
        ) {
            check(&curve, &queries)?;
        }

        #[test]
        fn several_polylines_are_as_near_as_the_nearest_of_them(
            pieces in prop::collection::vec(prop::collection::vec(point(), 1..12), 1..6),
            queries in prop::collection::vec(point(), 1..20),
        ) {
            let together = PolylineIndex::of_pieces(pieces.iter().map(Vec::as_slice));
            for (query, found) in queries.iter().zip(together.distances(&queries)) {
                let alone = pieces.iter().map(|piece| plain(piece, true, query));
                prop_assert_eq!(found, alone.fold(f64::INFINITY, f64::min));
            }
        }

        #[test]
        fn the_nearest_segment_equals_brute_force(
            vertices in prop::collection::vec(prop::array::uniform3(-50.0..50.0_f64), 1..60),
            query in prop::array::uniform3(-50.0..50.0_f64),
        ) {
            // By ternary search on every segment: it knows of no projection formula.
            let at = |a: &[f64; 3], b: &[f64; 3], t: f64| {
                let along = |k: usize| query[k] - (a[k] + t * (b[k] - a[k]));
                (0..3).map(|k| along(k).powi(2)).sum::<f64>().sqrt()
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
            let found = PolylineIndex::new(&vertices).distances(&[query])[0];
            // Differences of coordinates below 100 are wrong by 1e-14; near its minimum the distance
            // is flat, so that the search, which stops at sqrt(eps), is as good; a distance near 0
            // is the root of a square wrong by (1e-14)², and of t * length, 100 * eps * few.
            prop_assert!((found - brute).abs() <= 1e-6 * brute.max(1e-6), "{found} {brute}");
        }
    }

    #[test]
    fn a_vertex_is_at_distance_zero() {
        let vertices = [[0.1, 0.2, 0.3], [0.7, 0.1, 0.9], [0.7, 0.1, 0.9], [1e9, 0.3, -7.1]];
        assert_eq!(PolylineIndex::new(&vertices).distances(&vertices), [0.0; 4]);
    }
}
