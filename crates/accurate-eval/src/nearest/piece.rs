use pulp::Simd;

/// What distances are measured to.
pub(super) trait Piece<const N: usize>: Copy {
    /// The smaller of `best` and the squared distance to the piece, in every lane.
    fn nearer<S: Simd>(&self, simd: S, queries: &[S::f64s; N], best: S::f64s) -> S::f64s;
}

impl<const N: usize> Piece<N> for [f64; N] {
    #[inline(always)]
    fn nearer<S: Simd>(&self, simd: S, queries: &[S::f64s; N], best: S::f64s) -> S::f64s {
        let offset = offset_from(simd, self, queries);
        simd.min_f64s(dot(simd, &offset, &offset), best)
    }
}

/// A vertex of a polyline and the inside of the segment that begins there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge<const N: usize> {
    vertex: [f64; N],
    /// To the next vertex; zero for the last.
    direction: [f64; N],
    /// Squared length of `direction`.
    length_2: f64,
}

impl<const N: usize> Edge<N> {
    pub(super) fn new(vertex: [f64; N], next: [f64; N]) -> Self {
        let mut direction = [0.0; N];
        let mut length_2 = 0.0;
        for k in 0..N {
            direction[k] = next[k] - vertex[k];
            length_2 += direction[k] * direction[k];
        }
        Self { vertex, direction, length_2 }
    }
}

impl<const N: usize> Piece<N> for Edge<N> {
    #[inline(always)]
    fn nearer<S: Simd>(&self, simd: S, queries: &[S::f64s; N], best: S::f64s) -> S::f64s {
        let mut offset = offset_from(simd, &self.vertex, queries);
        let best = simd.min_f64s(dot(simd, &offset, &offset), best);
        let mut direction = offset;
        for k in 0..N {
            direction[k] = simd.splat_f64s(self.direction[k]);
        }
        let along = dot(simd, &offset, &direction);
        let length_2 = simd.splat_f64s(self.length_2);
        let after_vertex = simd.greater_than_f64s(along, simd.splat_f64s(0.0));
        let inside = simd.and_m64s(after_vertex, simd.less_than_f64s(along, length_2));
        // Along a curve most feet lie beyond most edges.
        if !any(simd, inside) {
            return best;
        }
        let part = simd.div_f64s(along, length_2);
        for k in 0..N {
            offset[k] = simd.sub_f64s(offset[k], simd.mul_f64s(part, direction[k]));
        }
        let squared = dot(simd, &offset, &offset);
        // Not the minimum: a lane that is not inside may hold NaN.
        let nearer = simd.and_m64s(inside, simd.less_than_f64s(squared, best));
        simd.select_f64s(nearer, squared, best)
    }
}

#[inline(always)]
fn offset_from<S: Simd, const N: usize>(
    simd: S,
    point: &[f64; N],
    queries: &[S::f64s; N],
) -> [S::f64s; N] {
    let mut offset = *queries;
    for k in 0..N {
        offset[k] = simd.sub_f64s(queries[k], simd.splat_f64s(point[k]));
    }
    offset
}

/// `a · b`, summed in order and never fused: the same bits on every machine.
#[inline(always)]
pub(super) fn dot<S: Simd, const N: usize>(simd: S, a: &[S::f64s; N], b: &[S::f64s; N]) -> S::f64s {
    let mut sum = simd.mul_f64s(a[0], b[0]);
    for k in 1..N {
        sum = simd.add_f64s(sum, simd.mul_f64s(a[k], b[k]));
    }
    sum
}

/// Whether any lane is true.
#[inline(always)]
pub(super) fn any<S: Simd>(simd: S, mask: S::m64s) -> bool {
    // The number of lanes, or of bits of the mask, if there is none.
    simd.first_true_m64s(mask) < S::F64_LANES
}
