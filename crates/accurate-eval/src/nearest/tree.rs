use pulp::{Arch, Simd, WithSimd};

use super::Place;
use super::piece::{Piece, any, dot};

/// Pieces in one leaf.
const LEAF: usize = 8;

/// The most numbers in a vector of any machine.
const MOST_LANES: usize = 8;

/// What a squared distance to a box is multiplied by before a piece in it may be left out: above,
/// rounding could make the piece nearer than its box.
///
/// With u = ε/2, an offset from a point inside an edge is wrong by 3u of itself at most, and by 5u of
/// the edge, by which [`Aabb::widened`] is larger. Squares and their sums add 4u on either side, the
/// offset from the box u: 16u in all, taken twice. Distances to points need no allowance, each of
/// their operations being monotone. (Squares that underflow, of distances below 1e-154, aside.)
const ALLOWANCE: f64 = 1.0 - 16.0 * f64::EPSILON;

/// A tree of boxes over pieces *in the order given*. Neighbours on a curve are neighbours in space,
/// so nothing needs sorting, and the leaf that held the last answer nearly always is near the next:
/// a search starts there and climbs, looking only into boxes that are nearer than what it has.
///
/// As many queries as a vector holds are searched for together, each bounded by its own answer.
/// Those of a curve share nearly all of their way; a set in no order is searched as exactly, only
/// slower.
///
/// # Cost
/// O(n) to build. O(log n) per query for curves, O(n) at worst.
pub(super) struct Tree<const N: usize, T> {
    pieces: Vec<T>,
    /// A complete binary tree: node 1 is the root, node `k` has the children `2k` and `2k + 1`, the
    /// last half are the leaves.
    boxes: Vec<Aabb<N>>,
}

impl<const N: usize, T: Piece<N>> Tree<N, T> {
    /// At least one piece, each with a box around it; about `count` of them.
    pub(super) fn new(count: usize, items: impl Iterator<Item = (T, Aabb<N>)>) -> Self {
        let mut pieces = Vec::with_capacity(count);
        let mut of_leaves: Vec<Aabb<N>> = Vec::with_capacity(count.div_ceil(LEAF));
        // Chains and nests of iterators run well from inside only.
        items.for_each(|(piece, bounds)| {
            match of_leaves.last_mut() {
                Some(last) if pieces.len() % LEAF != 0 => *last = last.joined(bounds),
                _ => of_leaves.push(bounds),
            }
            pieces.push(piece);
        });
        let leaves = of_leaves.len().next_power_of_two();
        let mut boxes = vec![Aabb::EMPTY; 2 * leaves];
        for (slot, bounds) in boxes[leaves..].iter_mut().zip(of_leaves) {
            *slot = bounds.widened();
        }
        for node in (1..leaves).rev() {
            boxes[node] = boxes[2 * node].joined(boxes[2 * node + 1]);
        }
        Self { pieces, boxes }
    }

    /// The distance of every query to the nearest piece, in the order of the queries.
    pub(super) fn distances<Q: Place<N>>(&self, machine: Arch, queries: &[Q]) -> Vec<f64> {
        let mut distances = vec![0.0; queries.len()];
        machine.dispatch(Search { tree: self, queries, distances: &mut distances });
        distances
    }

    /// Squared distances of the queries of a vector. `hint` is the leaf to begin with, and becomes
    /// the one to begin the next with.
    #[inline(always)]
    fn nearest<S: Simd>(&self, simd: S, queries: &[S::f64s; N], hint: &mut usize) -> S::f64s {
        let leaves = self.boxes.len() / 2;
        let mut done = *hint;
        let mut best = self.scan(simd, done, queries, simd.splat_f64s(f64::INFINITY));
        while done > 1 {
            // All below the sibling of what is done, in preorder.
            let top = done ^ 1;
            let mut node = top;
            loop {
                if any(simd, self.boxes[node].is_nearer(simd, queries, best)) {
                    if node < leaves {
                        node *= 2;
                        continue;
                    }
                    let found = self.scan(simd, node, queries, best);
                    if any(simd, simd.less_than_f64s(found, best)) {
                        *hint = node;
                    }
                    best = found;
                }
                while node != top && node % 2 == 1 {
                    node /= 2;
                }
                if node == top {
                    break;
                }
                node += 1;
            }
            done /= 2;
        }
        best
    }

    /// `best`, or less, after the pieces of the leaf `node`.
    #[inline(always)]
    fn scan<S: Simd>(
        &self,
        simd: S,
        node: usize,
        queries: &[S::f64s; N],
        mut best: S::f64s,
    ) -> S::f64s {
        let first = (node - self.boxes.len() / 2) * LEAF;
        let last = (first + LEAF).min(self.pieces.len());
        for piece in self.pieces.get(first..last).unwrap_or_default() {
            best = piece.nearer(simd, queries, best);
        }
        best
    }
}

struct Search<'a, const N: usize, T, Q> {
    tree: &'a Tree<N, T>,
    queries: &'a [Q],
    distances: &'a mut [f64],
}

impl<const N: usize, T: Piece<N>, Q: Place<N>> WithSimd for Search<'_, N, T, Q> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lanes = S::F64_LANES;
        let mut hint = self.tree.boxes.len() / 2;
        let mut rows = [[0.0; MOST_LANES]; N];
        let mut vectors = [simd.splat_f64s(0.0); N];
        for (queries, distances) in self.queries.chunks(lanes).zip(self.distances.chunks_mut(lanes))
        {
            for (lane, query) in queries.iter().enumerate() {
                let query = query.coordinates();
                for k in 0..N {
                    rows[k][lane] = query[k];
                }
            }
            // What is left of the last block, or zeros, in lanes that nobody asks for.
            for k in 0..N {
                vectors[k] = simd.partial_load_f64s(&rows[k][..lanes]);
            }
            let squared = self.tree.nearest(simd, &vectors, &mut hint);
            simd.partial_store_f64s(distances, simd.sqrt_f64s(squared));
        }
    }
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aabb<const N: usize> {
    low: [f64; N],
    high: [f64; N],
}

impl<const N: usize> Aabb<N> {
    /// Infinitely far from everything.
    const EMPTY: Self = Self { low: [f64::INFINITY; N], high: [f64::NEG_INFINITY; N] };

    pub(super) fn of_point(point: [f64; N]) -> Self {
        Self { low: point, high: point }
    }

    /// So much larger that roundings of places inside edges stay within; see [`ALLOWANCE`].
    fn widened(self) -> Self {
        let mut wide = self;
        for k in 0..N {
            let margin = 4.0 * f64::EPSILON * (self.high[k] - self.low[k]);
            // A step further, for the rounding of the difference itself.
            wide.low[k] = (self.low[k] - margin).next_down();
            wide.high[k] = (self.high[k] + margin).next_up();
        }
        wide
    }

    pub(super) fn joined(self, other: Self) -> Self {
        // No number here is NaN; `f64::min` would look for it.
        let smaller = |a: f64, b: f64| if a < b { a } else { b };
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let mut joined = self;
        for k in 0..N {
            joined.low[k] = smaller(self.low[k], other.low[k]);
            joined.high[k] = larger(self.high[k], other.high[k]);
        }
        joined
    }

    /// Whether something in the box may be nearer than the square root of `best`.
    #[inline(always)]
    fn is_nearer<S: Simd>(&self, simd: S, queries: &[S::f64s; N], best: S::f64s) -> S::m64s {
        let mut outside = *queries;
        for k in 0..N {
            let below = simd.sub_f64s(simd.splat_f64s(self.low[k]), queries[k]);
            let above = simd.sub_f64s(queries[k], simd.splat_f64s(self.high[k]));
            outside[k] = simd.max_f64s(simd.max_f64s(below, above), simd.splat_f64s(0.0));
        }
        let squared = dot(simd, &outside, &outside);
        simd.less_than_f64s(simd.mul_f64s(squared, simd.splat_f64s(ALLOWANCE)), best)
    }
}
