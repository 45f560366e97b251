use std::cell::Cell;

/// Exact nearest distances to a set of points, fastest when points and queries run along a curve.
pub(crate) struct PointIndex {
    pieces: Pieces<3, [f64; 3]>,
}

impl PointIndex {
    /// `points` is not empty and finite.
    pub(crate) fn new(points: impl Iterator<Item = [f64; 3]>) -> Self {
        Self { pieces: Pieces::new(points.collect()) }
    }

    /// Distance to the nearest point.
    pub(crate) fn distance(&self, query: [f64; 3]) -> f64 {
        self.pieces.distance(&query)
    }
}

/// Exact nearest distances to a polyline, in the plane or in space.
pub(crate) struct PolylineIndex<const N: usize> {
    pieces: Pieces<N, Segment<N>>,
}

impl<const N: usize> PolylineIndex<N> {
    /// The polyline through `vertices`, which are finite and at least one; one vertex is a point.
    pub(crate) fn new(vertices: &[[f64; N]]) -> Self {
        Self::of_pieces(std::iter::once(vertices))
    }

    /// All of several polylines.
    pub(crate) fn of_pieces<'a>(pieces: impl Iterator<Item = &'a [[f64; N]]>) -> Self {
        let mut segments = Vec::new();
        for vertices in pieces {
            segments.extend(vertices.windows(2).map(|pair| Segment { from: pair[0], to: pair[1] }));
            if let [only] = vertices {
                segments.push(Segment { from: *only, to: *only });
            }
        }
        Self { pieces: Pieces::new(segments) }
    }

    /// Distance to the nearest point of the polyline.
    pub(crate) fn distance(&self, query: [f64; N]) -> f64 {
        self.pieces.distance(&query)
    }
}

/// Pieces in one leaf.
const LEAF: usize = 4;

/// A tree of boxes over pieces *in the order given*. Neighbours on a curve are neighbours in space,
/// so nothing needs sorting, and the leaf that held the last answer nearly always holds the next:
/// a search starts there and climbs, looking only into boxes that are nearer than what it has.
///
/// A set in no order is searched as exactly, only slower.
///
/// # Cost
/// O(n) to build. O(log n) per query for curves, O(n) at worst.
struct Pieces<const N: usize, T> {
    pieces: Vec<T>,
    /// A complete binary tree: node 1 is the root, node `k` has the children `2k` and `2k + 1`, the
    /// last half are the leaves.
    boxes: Vec<Aabb<N>>,
    /// The leaf of the last answer.
    hint: Cell<usize>,
}

impl<const N: usize, T: Piece<N>> Pieces<N, T> {
    fn new(pieces: Vec<T>) -> Self {
        let leaves = pieces.len().div_ceil(LEAF).next_power_of_two();
        let mut boxes = vec![Aabb::EMPTY; 2 * leaves];
        for (slot, chunk) in boxes[leaves..].iter_mut().zip(pieces.chunks(LEAF)) {
            *slot = chunk.iter().map(Piece::bounds).fold(Aabb::EMPTY, Aabb::joined);
        }
        for node in (1..leaves).rev() {
            boxes[node] = boxes[2 * node].joined(boxes[2 * node + 1]);
        }
        Self { pieces, boxes, hint: Cell::new(leaves) }
    }

    fn distance(&self, query: &[f64; N]) -> f64 {
        let mut best = Best { squared: f64::INFINITY, leaf: self.hint.get() };
        let mut node = best.leaf;
        self.search(node, query, &mut best);
        while node > 1 {
            self.search(node ^ 1, query, &mut best);
            node /= 2;
        }
        self.hint.set(best.leaf);
        best.squared.sqrt()
    }

    /// Improves `best` by what is below `node`. The depth is that of the tree.
    fn search(&self, node: usize, query: &[f64; N], best: &mut Best) {
        // A box is never farther than a given point in it, rounding included: every operation is
        // monotone. Points inside a segment are rounded at the size of the coordinates.
        if self.boxes[node].distance_2(query) >= best.squared {
            return;
        }
        let leaves = self.boxes.len() / 2;
        if node < leaves {
            // The last half of a curve's box is as likely as the first: no order is worth a test.
            self.search(2 * node, query, best);
            self.search(2 * node + 1, query, best);
            return;
        }
        let first = (node - leaves) * LEAF;
        let last = (first + LEAF).min(self.pieces.len());
        for piece in self.pieces.get(first..last).unwrap_or_default() {
            let squared = piece.distance_2(query);
            if squared < best.squared {
                *best = Best { squared, leaf: node };
            }
        }
    }
}

struct Best {
    squared: f64,
    leaf: usize,
}

/// Something with a distance and a bounding box.
trait Piece<const N: usize> {
    fn bounds(&self) -> Aabb<N>;
    fn distance_2(&self, query: &[f64; N]) -> f64;
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
struct Aabb<const N: usize> {
    low: [f64; N],
    high: [f64; N],
}

impl<const N: usize> Aabb<N> {
    /// Infinitely far from everything.
    const EMPTY: Self = Self { low: [f64::INFINITY; N], high: [f64::NEG_INFINITY; N] };

    fn joined(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }

    fn distance_2(&self, query: &[f64; N]) -> f64 {
        let outside: [f64; N] =
            std::array::from_fn(|k| (self.low[k] - query[k]).max(query[k] - self.high[k]).max(0.0));
        dot(&outside, &outside)
    }
}

impl Piece<3> for [f64; 3] {
    fn bounds(&self) -> Aabb<3> {
        Aabb { low: *self, high: *self }
    }

    fn distance_2(&self, query: &[f64; 3]) -> f64 {
        let offset = difference(query, self);
        dot(&offset, &offset)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Segment<const N: usize> {
    from: [f64; N],
    to: [f64; N],
}

impl<const N: usize> Piece<N> for Segment<N> {
    fn bounds(&self) -> Aabb<N> {
        let end = |p: [f64; N]| Aabb { low: p, high: p };
        end(self.from).joined(end(self.to))
    }

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
        fn the_nearest_point_equals_brute_force_whatever_was_asked_before(
            points in prop::collection::vec(point(), 1..60),
            queries in prop::collection::vec(point(), 1..8),
        ) {
            let index = PointIndex::new(points.iter().copied());
            for query in queries {
                let brute = points.iter().map(|p| {
                    let d = difference(&query, p);
                    dot(&d, &d).sqrt()
                }).fold(f64::INFINITY, f64::min);
                // The same three products in the same order.
                prop_assert_eq!(index.distance(query), brute);
            }
        }

        #[test]
        fn the_nearest_segment_is_that_of_a_scan_of_all_whatever_was_asked_before(
            vertices in prop::collection::vec(point(), 2..60),
            queries in prop::collection::vec(point(), 1..8),
        ) {
            let index = PolylineIndex::new(&vertices);
            for query in queries {
                let all = vertices.windows(2).map(|pair| {
                    Segment { from: pair[0], to: pair[1] }.distance_2(&query).sqrt()
                });
                let brute = all.fold(f64::INFINITY, f64::min);
                let found = index.distance(query);
                // A segment's inner distance is rounded at the size of the coordinates, below 100
                // here: a box may be left out that holds as little less.
                prop_assert!(found >= brute && found - brute <= 8.0 * f64::EPSILON * 100.0,
                    "{found} {brute}");
            }
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
