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

/// One vector per control point of a span: its three coordinates, and one that stays zero.
type Controls = [[f64; 4]; 4];

#[derive(Clone)]
pub(crate) struct Block {
    used: bool,
    /// Second derivatives: per pair of control points of [`PAIRS`] the products numbered in
    /// [`PRODUCT`], and two that stay zero.
    pub(crate) second: [[f64; 8]; 10],
    /// First derivatives.
    pub(crate) first: Controls,
}

const EMPTY: Block = Block { used: false, second: [[0.0; 8]; 10], first: [[0.0; 4]; 4] };

pub(crate) const PAIRS: [(usize, usize); 10] =
    [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
/// Number of the product of two coordinates.
pub(crate) const PRODUCT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

impl SpanBlocks {
    pub(crate) fn new(spans: usize, globals: usize) -> Self {
        Self { globals, blocks: vec![EMPTY; spans], mixed: vec![[[0.0; 4]; 4]; spans * globals] }
    }

    pub(crate) fn clear(&mut self) {
        self.blocks.fill(EMPTY);
        self.mixed.fill([[0.0; 4]; 4]);
    }

    /// See [`NormalEquations::add_with_globals`](crate::normal::NormalEquations::add_with_globals);
    /// what concerns global unknowns alone is left to the caller.
    #[inline(always)]
    pub(crate) fn add(
        &mut self,
        span: usize,
        basis: &[f64; 4],
        gradient: &[f64; 3],
        global: &[f64],
        residual: f64,
        weight: f64,
    ) {
        let block = &mut self.blocks[span];
        block.used = true;
        let [x, y, z] = *gradient;
        let products = [x * x, x * y, x * z, y * y, y * z, z * z, 0.0, 0.0];
        let weighted = basis.map(|b| weight * b);
        for (sums, (k, l)) in block.second.iter_mut().zip(PAIRS) {
            add_scaled(sums, &products, weighted[k] * basis[l]);
        }
        let gradient = [x, y, z, 0.0];
        for (sums, b) in block.first.iter_mut().zip(weighted) {
            add_scaled(sums, &gradient, b * residual);
        }
        for (g, &value) in global.iter().enumerate() {
            if value != 0.0 {
                let mixed = &mut self.mixed[span * self.globals + g];
                for (sums, b) in mixed.iter_mut().zip(weighted) {
                    add_scaled(sums, &gradient, b * value);
                }
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
            mixed.fill([[0.0; 4]; 4]);
        }
    }
}

#[inline(always)]
fn add_scaled<const N: usize>(sums: &mut [f64; N], values: &[f64; N], scale: f64) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += scale * value;
    }
}
