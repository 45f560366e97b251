use pulp::Simd;

/// Sums of the normal equations, one dense block per span of the spline.
///
/// All residuals of a span see the same four control points. The second derivative with respect to the
/// control points `k` and `l` is `basis[k] basis[l]` times the products of the gradient's components, of
/// which six differ: per residual ten vectors of those are added, without a look at where the matrix
/// keeps them.
pub(crate) struct SpanBlocks {
    globals: usize,
    blocks: Vec<Block>,
    /// Of span `s` and global unknown `g`: element `s * globals + g`.
    mixed: Vec<Controls>,
}

/// The three coordinates of each control point of a span, and one number that stays zero.
type Controls = [f64; CONTROLS];

const CONTROLS: usize = 16;

#[derive(Clone)]
pub(crate) struct Block {
    used: bool,
    /// Second derivatives: per pair of control points of [`PAIRS`] the products numbered in
    /// [`PRODUCT`], and two that stay zero.
    pub(crate) second: [[f64; 8]; 10],
    /// First derivatives.
    pub(crate) first: Controls,
}

const EMPTY: Block = Block { used: false, second: [[0.0; 8]; 10], first: [0.0; CONTROLS] };

pub(crate) const PAIRS: [(usize, usize); 10] =
    [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
/// Number of the product of two coordinates.
pub(crate) const PRODUCT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

impl SpanBlocks {
    pub(crate) fn new(spans: usize, globals: usize) -> Self {
        Self { globals, blocks: vec![EMPTY; spans], mixed: vec![[0.0; CONTROLS]; spans * globals] }
    }

    pub(crate) fn clear(&mut self) {
        self.blocks.fill(EMPTY);
        self.mixed.fill([0.0; CONTROLS]);
    }

    /// Adds a residual; what concerns global unknowns alone is left to the caller.
    #[inline(always)]
    pub(crate) fn add<S: Simd>(&mut self, simd: S, row: &LinearRow<'_>) {
        let block = &mut self.blocks[row.span];
        block.used = true;
        let [x, y, z] = *row.gradient;
        let products = [x * x, x * y, x * z, y * y, y * z, z * z, 0.0, 0.0];
        let [a, b, c, d] = *row.basis;
        let weighted = [row.weight * a, row.weight * b, row.weight * c, row.weight * d];
        for (sums, (k, l)) in block.second.iter_mut().zip(PAIRS) {
            add_scaled(simd, sums, &products, weighted[k] * row.basis[l]);
        }
        let gradient = [x, y, z, 0.0];
        let mut first = [0.0; CONTROLS];
        for (k, value) in first.iter_mut().enumerate() {
            *value = weighted[k / 4] * gradient[k % 4];
        }
        add_scaled(simd, &mut block.first, &first, row.residual);
        for (g, &value) in row.global.iter().enumerate() {
            if value != 0.0 {
                let mixed = &mut self.mixed[row.span * self.globals + g];
                add_scaled(simd, mixed, &first, value);
            }
        }
    }

    /// Visits the sums of every span that has any, in order: span, block, and what is mixed with each
    /// global unknown. All are zero after that.
    pub(crate) fn drain(&mut self, mut visit: impl FnMut(usize, &Block, &[Controls])) {
        for (span, block) in self.blocks.iter_mut().enumerate().filter(|(_, block)| block.used) {
            let mixed = &mut self.mixed[span * self.globals..(span + 1) * self.globals];
            visit(span, block, mixed);
            *block = EMPTY;
            mixed.fill([0.0; CONTROLS]);
        }
    }
}

/// A residual with its derivatives.
pub(crate) struct LinearRow<'a> {
    pub(crate) span: usize,
    /// Of the four control points.
    pub(crate) basis: &'a [f64; 4],
    /// With respect to the curve point.
    pub(crate) gradient: &'a [f64; 3],
    /// With respect to the global unknowns; may be shorter than their number.
    pub(crate) global: &'a [f64],
    pub(crate) residual: f64,
    pub(crate) weight: f64,
}

/// `N` is a multiple of every vector's length.
#[inline(always)]
fn add_scaled<S: Simd, const N: usize>(
    simd: S,
    sums: &mut [f64; N],
    values: &[f64; N],
    scale: f64,
) {
    let scale = simd.splat_f64s(scale);
    let (sums, values) = (S::as_mut_simd_f64s(sums).0, S::as_simd_f64s(values).0);
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum = simd.add_f64s(*sum, simd.mul_f64s(scale, *value));
    }
}
