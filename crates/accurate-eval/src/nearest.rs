use std::cell::Cell;

use pulp::{Arch, Simd, WithSimd};

/// Exact nearest distances to a set of points, fastest when points and queries run along a curve.
pub(crate) struct PointIndex {
    pieces: Pieces<3, Points>,
}

impl PointIndex {
    /// `points` is not empty and finite.
    pub(crate) fn new(points: impl Iterator<Item = [f64; 3]>) -> Self {
        Self { pieces: Pieces::new(&points.collect::<Vec<_>>()) }
    }

    /// Distance to the nearest point.
    pub(crate) fn distance(&self, query: [f64; 3]) -> f64 {
        self.pieces.distance(&query)
    }
}

/// Exact nearest distances to a polyline, in the plane or in space.
pub(crate) struct PolylineIndex<const N: usize> {
    pieces: Pieces<N, Segments<N>>,
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
        Self { pieces: Pieces::new(&segments) }
    }

    /// Distance to the nearest point of the polyline.
    pub(crate) fn distance(&self, query: [f64; N]) -> f64 {
        self.pieces.distance(&query)
    }
}

/// Pieces in a block, blocks in a node, nodes in the node above.
const WIDTH: usize = 8;

/// One number for each of [`WIDTH`] neighbours: loops over it are compiled to vectors.
type Lanes = [f64; WIDTH];

/// A tree of boxes over pieces *in the order given*. Neighbours on a curve are neighbours in space,
/// so nothing needs sorting, and the block that held the last answer nearly always holds the next:
/// a search starts there and climbs, looking only into boxes that are nearer than what it has.
///
/// A set in no order is searched as exactly, only slower.
///
/// # Cost
/// O(n) to build. O(log n) per query for curves, O(n) at worst.
struct Pieces<const N: usize, B> {
    blocks: Vec<B>,
    /// `levels[0][k]` holds the boxes of the blocks `8 k` to `8 k + 7`, `levels[h][k]` those of the
    /// nodes `8 k` to `8 k + 7` of the level below. The last level is one node.
    levels: Vec<Vec<Node<N>>>,
    machine: Arch,
    /// The block of the last answer.
    hint: Cell<usize>,
    /// What a search has still to look into, kept for its memory.
    waiting: Cell<Vec<Waiting>>,
}

/// A box that may hold something nearer: a block at height 0, else a node of `levels[height - 1]`.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    height: usize,
    index: usize,
    distance_2: f64,
}

impl<const N: usize, B: Block<N>> Pieces<N, B> {
    /// `pieces` is not empty.
    fn new(pieces: &[B::Piece]) -> Self {
        let blocks: Vec<B> = pieces.chunks(WIDTH).map(B::of).collect();
        let mut boxes: Vec<Aabb<N>> = pieces
            .chunks(WIDTH)
            .map(|chunk| chunk.iter().map(B::bounds).fold(Aabb::EMPTY, Aabb::joined))
            .collect();
        let mut levels = Vec::new();
        loop {
            levels.push(boxes.chunks(WIDTH).map(Node::of).collect());
            boxes = boxes
                .chunks(WIDTH)
                .map(|chunk| chunk.iter().copied().fold(Aabb::EMPTY, Aabb::joined))
                .collect();
            if boxes.len() <= 1 {
                break;
            }
        }
        let (hint, waiting) = (Cell::new(0), Cell::new(Vec::new()));
        Self { blocks, levels, machine: Arch::new(), hint, waiting }
    }

    fn distance(&self, query: &[f64; N]) -> f64 {
        self.machine.dispatch(Search { pieces: self, query })
    }
}

struct Search<'a, const N: usize, B> {
    pieces: &'a Pieces<N, B>,
    query: &'a [f64; N],
}

impl<const N: usize, B: Block<N>> WithSimd for Search<'_, N, B> {
    type Output = f64;

    /// Compiled once for every instruction set: what it calls must be inlined into it.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Self { pieces, query } = self;
        let mut waiting = pieces.waiting.take();
        let mut best = Best { squared: f64::INFINITY, block: pieces.hint.get() };
        best.look_into(&pieces.blocks, best.block, query);
        let mut child = best.block;
        for (height, level) in pieces.levels.iter().enumerate() {
            let index = child / WIDTH;
            best.enter(&mut waiting, &level[index], height, index, Some(child), query);
            while let Some(next) = waiting.pop() {
                // A box is never farther than a given point in it, rounding included: every
                // operation is monotone. Points inside a segment are rounded at the size of the
                // coordinates.
                if next.distance_2 >= best.squared {
                    continue;
                }
                match next.height.checked_sub(1) {
                    None => best.look_into(&pieces.blocks, next.index, query),
                    Some(below) => {
                        let node = &pieces.levels[below][next.index];
                        best.enter(&mut waiting, node, below, next.index, None, query);
                    }
                }
            }
            child = index;
        }
        pieces.hint.set(best.block);
        pieces.waiting.set(waiting);
        best.squared.sqrt()
    }
}

struct Best {
    squared: f64,
    block: usize,
}

impl Best {
    #[inline(always)]
    fn look_into<const N: usize, B: Block<N>>(
        &mut self,
        blocks: &[B],
        index: usize,
        query: &[f64; N],
    ) {
        let squares = blocks[index].distances_2(query);
        let mut least = squares[0];
        for k in 1..WIDTH {
            least = if squares[k] < least { squares[k] } else { least };
        }
        if least < self.squared {
            *self = Self { squared: least, block: index };
        }
    }

    /// Puts the boxes of a node that may hold something nearer in the list, but for the box `done`.
    #[inline(always)]
    fn enter<const N: usize>(
        &self,
        waiting: &mut Vec<Waiting>,
        node: &Node<N>,
        height: usize,
        index: usize,
        done: Option<usize>,
        query: &[f64; N],
    ) {
        let squares = node.distances_2(query);
        let mut any = false;
        for k in 0..WIDTH {
            any |= squares[k] < self.squared;
        }
        if any {
            for (k, &distance_2) in squares.iter().enumerate() {
                let child = index * WIDTH + k;
                if distance_2 < self.squared && done != Some(child) {
                    waiting.push(Waiting { height, index: child, distance_2 });
                }
            }
        }
    }
}

/// The boxes of [`WIDTH`] children, coordinate by coordinate.
#[derive(Debug, Clone)]
struct Node<const N: usize> {
    low: [Lanes; N],
    high: [Lanes; N],
}

impl<const N: usize> Node<N> {
    fn of(boxes: &[Aabb<N>]) -> Self {
        let mut node =
            Self { low: [[f64::INFINITY; WIDTH]; N], high: [[f64::NEG_INFINITY; WIDTH]; N] };
        for (k, one) in boxes.iter().enumerate() {
            for axis in 0..N {
                node.low[axis][k] = one.low[axis];
                node.high[axis][k] = one.high[axis];
            }
        }
        node
    }

    #[inline(always)]
    fn distances_2(&self, query: &[f64; N]) -> Lanes {
        let mut squares = [0.0; WIDTH];
        for axis in 0..N {
            for k in 0..WIDTH {
                let below = self.low[axis][k] - query[axis];
                let above = query[axis] - self.high[axis][k];
                let outside = if below > above { below } else { above };
                let outside = if outside > 0.0 { outside } else { 0.0 };
                squares[k] += outside * outside;
            }
        }
        squares
    }
}

/// [`WIDTH`] pieces, coordinate by coordinate. One that is not full repeats its last piece.
trait Block<const N: usize>: Sized {
    type Piece;
    fn of(pieces: &[Self::Piece]) -> Self;
    fn bounds(piece: &Self::Piece) -> Aabb<N>;
    fn distances_2(&self, query: &[f64; N]) -> Lanes;
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
}

fn lanes<const N: usize, T>(pieces: &[T], point: impl Fn(&T) -> &[f64; N]) -> [Lanes; N] {
    let last = pieces.len() - 1;
    std::array::from_fn(|axis| std::array::from_fn(|k| point(&pieces[k.min(last)])[axis]))
}

struct Points {
    at: [Lanes; 3],
}

impl Block<3> for Points {
    type Piece = [f64; 3];

    fn of(points: &[[f64; 3]]) -> Self {
        Self { at: lanes(points, |point| point) }
    }

    fn bounds(point: &[f64; 3]) -> Aabb<3> {
        Aabb { low: *point, high: *point }
    }

    #[inline(always)]
    fn distances_2(&self, query: &[f64; 3]) -> Lanes {
        squared_offsets(query, &self.at)
    }
}

struct Segments<const N: usize> {
    from: [Lanes; N],
    to: [Lanes; N],
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Segment<const N: usize> {
    from: [f64; N],
    to: [f64; N],
}

impl<const N: usize> Block<N> for Segments<N> {
    type Piece = Segment<N>;

    fn of(segments: &[Segment<N>]) -> Self {
        Self { from: lanes(segments, |s| &s.from), to: lanes(segments, |s| &s.to) }
    }

    fn bounds(segment: &Segment<N>) -> Aabb<N> {
        let end = |p: [f64; N]| Aabb { low: p, high: p };
        end(segment.from).joined(end(segment.to))
    }

    #[inline(always)]
    fn distances_2(&self, query: &[f64; N]) -> Lanes {
        let (mut along, mut length_2) = ([0.0; WIDTH], [0.0; WIDTH]);
        for axis in 0..N {
            for k in 0..WIDTH {
                let direction = self.to[axis][k] - self.from[axis][k];
                along[k] += (query[axis] - self.from[axis][k]) * direction;
                length_2[k] += direction * direction;
            }
        }
        let mut inside = [0.0; WIDTH];
        for axis in 0..N {
            for k in 0..WIDTH {
                let direction = self.to[axis][k] - self.from[axis][k];
                // NaN for a segment without length, which is not inside.
                let t = along[k] / length_2[k];
                let offset = query[axis] - self.from[axis][k] - t * direction;
                inside[k] += offset * offset;
            }
        }
        // The ends are compared with as given, so that a vertex is at distance exactly zero. A
        // segment without length takes the first branch.
        let at_from = squared_offsets(query, &self.from);
        let at_to = squared_offsets(query, &self.to);
        let mut squares = inside;
        for k in 0..WIDTH {
            let beyond = if along[k] >= length_2[k] { at_to[k] } else { inside[k] };
            squares[k] = if along[k] <= 0.0 { at_from[k] } else { beyond };
        }
        squares
    }
}

#[inline(always)]
fn squared_offsets<const N: usize>(query: &[f64; N], points: &[Lanes; N]) -> Lanes {
    let mut squares = [0.0; WIDTH];
    for axis in 0..N {
        for k in 0..WIDTH {
            let offset = query[axis] - points[axis][k];
            squares[k] += offset * offset;
        }
    }
    squares
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
        std::array::from_fn(|k| a[k] - b[k])
    }

    fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
        (0..N).map(|k| a[k] * b[k]).sum()
    }

    /// One segment by the formula, branch by branch.
    fn to_segment<const N: usize>(segment: &Segment<N>, query: &[f64; N]) -> f64 {
        let direction = difference(&segment.to, &segment.from);
        let offset = difference(query, &segment.from);
        let (along, length_2) = (dot(&offset, &direction), dot(&direction, &direction));
        if along <= 0.0 {
            dot(&offset, &offset)
        } else if along >= length_2 {
            let offset = difference(query, &segment.to);
            dot(&offset, &offset)
        } else {
            let t = along / length_2;
            (0..N).map(|k| (offset[k] - t * direction[k]).powi(2)).sum()
        }
    }

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
            points in prop::collection::vec(point(), 1..700),
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
            vertices in prop::collection::vec(point(), 2..700),
            queries in prop::collection::vec(point(), 1..8),
        ) {
            let index = PolylineIndex::new(&vertices);
            for query in queries {
                let all = vertices.windows(2).map(|pair| {
                    to_segment(&Segment { from: pair[0], to: pair[1] }, &query).sqrt()
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
            vertices in prop::collection::vec(point(), 1..700), query in point(),
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
