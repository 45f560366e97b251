use accurate_geom::nalgebra::Vector3;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use pulp::Simd;

use crate::FitError;
use crate::selected_inverse::SelectedInverse;
use crate::span_blocks::{LinearRow, PAIRS, PRODUCT, SpanBlocks};

/// Third difference of four control points.
pub(crate) const THIRD_DIFFERENCE: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// What of the diagonal is damped at an unknown: the mean over the coordinates of a control point, the
/// same in every frame of the world; of a global unknown its own.
pub(crate) fn to_be_damped(
    unknown: usize,
    controls: usize,
    diagonal: impl Fn(usize) -> f64,
) -> f64 {
    if unknown < 3 * controls {
        let first = unknown - unknown % 3;
        (diagonal(first) + diagonal(first + 1) + diagonal(first + 2)) / 3.0
    } else {
        diagonal(unknown)
    }
}

/// Normal equations of a uniform cubic spline (three unknowns per control point) and a few global
/// unknowns behind them: `(H + damping) step = -gradient`.
///
/// The upper triangle is kept in compressed columns. The spline's part is a band (a residual sees
/// four control points), the global columns are full and come last, where they cause no fill-in.
/// Symbolic factorisation once per size, by faer.
pub(crate) struct NormalEquations {
    controls: usize,
    globals: usize,
    pattern: SymbolicSparseColMat<usize>,
    /// Index of the entry `(row 0, column)` were it stored: entry `(row, column)` is at
    /// `base[column] + row` (wrapping).
    base: Vec<usize>,
    values: Vec<f64>,
    gradient: Vec<f64>,
    /// What was added since, span by span.
    blocks: SpanBlocks,
    /// Scratch of the solver.
    damped: Vec<f64>,
    step: Vec<f64>,
    factor: Vec<f64>,
    symbolic: SymbolicCholesky<usize>,
    memory: MemBuffer,
}

impl NormalEquations {
    /// Zero equations for `controls >= 4` control points and `globals` global unknowns.
    pub(crate) fn new(controls: usize, globals: usize) -> Result<Self, FitError> {
        let n = 3 * controls + globals;
        let mut column_start = Vec::with_capacity(n + 1);
        let mut rows = Vec::new();
        let mut base = Vec::with_capacity(n);
        column_start.push(0);
        for column in 0..n {
            let first = if column < 3 * controls { 3 * (column / 3).saturating_sub(3) } else { 0 };
            base.push(rows.len().wrapping_sub(first));
            rows.extend(first..=column);
            column_start.push(rows.len());
        }
        let nnz = rows.len();
        let pattern = SymbolicSparseColMat::new_checked(n, n, column_start, None, rows);
        let singular = || FitError::Singular { unknowns: n };
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(
            pattern.as_ref(),
            Side::Upper,
            SymmetricOrdering::Identity,
            params,
        )
        .map_err(|_| singular())?;
        let scratch = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(n, Par::Seq));
        let memory = MemBuffer::try_new(scratch).map_err(|_| singular())?;
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self {
            controls,
            globals,
            pattern,
            base,
            values: vec![0.0; nnz],
            gradient: vec![0.0; n],
            blocks: SpanBlocks::new(controls.saturating_sub(3), globals),
            damped: vec![0.0; nnz],
            step: vec![0.0; n],
            factor,
            symbolic,
            memory,
        })
    }

    /// Number of unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        self.gradient.len()
    }

    pub(crate) fn clear(&mut self) {
        self.values.fill(0.0);
        self.gradient.fill(0.0);
        self.blocks.clear();
    }

    #[inline]
    fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.values[self.base[column].wrapping_add(row)]
    }

    /// Adds `weight / 2 * residual²` whose gradient with respect to control point `span + k` is
    /// `basis[k] * gradient`, and with respect to the global unknowns `global`.
    #[inline(always)]
    pub(crate) fn add<S: Simd>(&mut self, simd: S, row: &LinearRow<'_>) {
        self.blocks.add(simd, row);
        let first_global = 3 * self.controls;
        for (b, &value) in row.global.iter().enumerate() {
            if value == 0.0 {
                continue;
            }
            let scaled = row.weight * value;
            let column = first_global + b;
            self.gradient[column] += scaled * row.residual;
            for (a, &other) in row.global[..=b].iter().enumerate() {
                *self.at(first_global + a, column) += scaled * other;
            }
        }
    }

    /// Moves what the blocks hold to where the factorisation reads it.
    fn gather(&mut self) {
        let Self { base, values, gradient, blocks, .. } = self;
        let first_global = 3 * self.controls;
        blocks.drain(|span, block, mixed| {
            let first = 3 * span;
            for (k, sums) in block.first.chunks_exact(4).enumerate() {
                let part = &mut gradient[first + 3 * k..][..3];
                part.iter_mut().zip(sums).for_each(|(entry, sum)| *entry += sum);
            }
            for ((k, l), sums) in PAIRS.into_iter().zip(&block.second) {
                for (b, products) in PRODUCT.iter().enumerate() {
                    let start = base[first + 3 * l + b].wrapping_add(first + 3 * k);
                    // Of the blocks on the diagonal the upper triangle only.
                    let rows = if k == l { b + 1 } else { 3 };
                    let part = &mut values[start..start + rows];
                    part.iter_mut().zip(products).for_each(|(entry, m)| *entry += sums[*m]);
                }
            }
            for (global, sums) in mixed.iter().enumerate() {
                for (k, sums) in sums.chunks_exact(4).enumerate() {
                    let start = base[first_global + global].wrapping_add(first + 3 * k);
                    let part = &mut values[start..start + 3];
                    part.iter_mut().zip(sums).for_each(|(entry, sum)| *entry += sum);
                }
            }
        });
    }

    /// Adds `weight / 2 * residual²` of a global unknown alone.
    pub(crate) fn add_prior(&mut self, global: usize, residual: f64, weight: f64) {
        let column = 3 * self.controls + global;
        self.gradient[column] += weight * residual;
        *self.at(column, column) += weight;
    }

    /// Adds half of `lambda2 |D2 c|² + lambda3 |D3 c|²`, second and third differences of the control
    /// points.
    ///
    /// `local[k]`, if there, multiplies `lambda3` at the differences of control points `k..k + 4`.
    pub(crate) fn add_smoothness(
        &mut self,
        control: &[Vector3<f64>],
        lambda2: f64,
        lambda3: f64,
        local: &[f64],
    ) {
        self.add_difference(control, &[1.0, -2.0, 1.0], lambda2, &[]);
        self.add_difference(control, &THIRD_DIFFERENCE, lambda3, local);
    }

    fn add_difference(
        &mut self,
        control: &[Vector3<f64>],
        stencil: &[f64],
        lambda: f64,
        local: &[f64],
    ) {
        if lambda == 0.0 {
            return;
        }
        for (first, window) in control.windows(stencil.len()).enumerate() {
            let lambda = lambda * local.get(first).copied().unwrap_or(1.0);
            let mut difference = Vector3::zeros();
            for (c, s) in window.iter().zip(stencil) {
                difference += c * *s;
            }
            for (j, sj) in stencil.iter().enumerate() {
                for axis in 0..3 {
                    let column = 3 * (first + j) + axis;
                    self.gradient[column] += lambda * sj * difference[axis];
                    for (i, si) in stencil[..=j].iter().enumerate() {
                        *self.at(3 * (first + i) + axis, column) += lambda * si * sj;
                    }
                }
            }
        }
    }

    /// Factorises `H + damping * diag(H)`, the diagonal averaged over each control point.
    pub(crate) fn factorise(&mut self, damping: f64) -> Result<Factor<'_>, FitError> {
        let unknowns = self.unknowns();
        let singular = FitError::Singular { unknowns };
        self.gather();
        self.damped.copy_from_slice(&self.values);
        let mut largest = 0.0f64;
        for column in 0..unknowns {
            largest = largest.max(self.values[self.base[column].wrapping_add(column)]);
        }
        if !(largest > 0.0 && largest.is_finite()) {
            return Err(singular);
        }
        for column in 0..unknowns {
            let diagonal = |c: usize| self.values[self.base[c].wrapping_add(c)];
            let size = to_be_damped(column, self.controls, diagonal);
            // An unknown that no residual sees must still have a pivot.
            self.damped[self.base[column].wrapping_add(column)] +=
                damping * size.max(1e-9 * largest);
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), self.damped.as_slice());
        let stack = MemStack::new(&mut self.memory);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Upper,
                LltRegularization::default(),
                Par::Seq,
                stack,
                Default::default(),
            )
            .map_err(|_| singular)?;
        Ok(Factor {
            symbolic: &self.symbolic,
            factor: &self.factor,
            memory: &mut self.memory,
            gradient: &self.gradient,
            step: &mut self.step,
        })
    }

    /// The damped step, one number per unknown.
    pub(crate) fn solve(&mut self, damping: f64) -> Result<&[f64], FitError> {
        let unknowns = self.unknowns();
        let step = self.factorise(damping)?.into_step();
        if step.iter().all(|v| v.is_finite()) {
            Ok(step)
        } else {
            Err(FitError::Singular { unknowns })
        }
    }

    /// Number of global unknowns.
    pub(crate) fn globals(&self) -> usize {
        self.globals
    }

    /// Gradient of the cost, one number per unknown.
    #[cfg(test)]
    pub(crate) fn gradient(&mut self) -> &[f64] {
        self.gather();
        &self.gradient
    }
}

impl std::fmt::Debug for NormalEquations {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "NormalEquations({} controls, {} globals)", self.controls, self.globals)
    }
}

/// A Cholesky factor of damped [`NormalEquations`].
pub(crate) struct Factor<'a> {
    symbolic: &'a SymbolicCholesky<usize>,
    factor: &'a [f64],
    memory: &'a mut MemBuffer,
    gradient: &'a [f64],
    step: &'a mut [f64],
}

impl<'a> Factor<'a> {
    /// Solves for `columns` right-hand sides, stored one after the other, in place.
    pub(crate) fn solve_in_place(&mut self, rhs: &mut [f64], columns: usize) {
        let n = self.gradient.len();
        let rhs = MatMut::from_column_major_slice_mut(rhs, n, columns);
        let stack = MemStack::new(self.memory);
        LltRef::<'_, usize, f64>::new(self.symbolic, self.factor).solve_in_place_with_conj(
            Conj::No,
            rhs,
            Par::Seq,
            stack,
        );
    }

    /// The inverse of the damped matrix, where the factor has entries.
    pub(crate) fn selected_inverse(&self) -> Result<SelectedInverse, FitError> {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(l) => {
                Ok(SelectedInverse::new(l.col_ptr(), l.row_idx(), self.factor))
            }
            // Never chosen: see the constructor.
            SymbolicCholeskyRaw::Supernodal(_) => {
                Err(FitError::Singular { unknowns: self.gradient.len() })
            }
        }
    }

    fn into_step(mut self) -> &'a [f64] {
        let step = std::mem::take(&mut self.step);
        for (s, g) in step.iter_mut().zip(self.gradient) {
            *s = -g;
        }
        self.solve_in_place(step, 1);
        step
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;
    use pulp::{Arch, Scalar, WithSimd};

    use super::*;

    type Drawn = (usize, [f64; 4], [f64; 3], [f64; 2], f64, f64);

    struct AddAll<'a>(&'a mut NormalEquations, &'a [Drawn]);

    impl WithSimd for AddAll<'_> {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            for (span, basis, gradient, global, residual, weight) in self.1 {
                let (span, residual, weight) = (*span, *residual, *weight);
                self.0.add(simd, &LinearRow { span, basis, gradient, global, residual, weight });
            }
        }
    }

    proptest! {
        /// The step solves the equations that a dense sum of the residuals gives, and is the same bit by
        /// bit with and without vectors.
        #[test]
        fn the_step_solves_the_dense_sum(
            rows in prop::collection::vec(
                (0usize..5, prop::array::uniform4(0.0..1.0f64), prop::array::uniform3(-1.0..1.0f64),
                 prop::array::uniform2(-1.0..1.0f64), -1.0..1.0f64, 0.1..2.0f64),
                1..80,
            ),
        ) {
            const CONTROLS: usize = 8;
            const N: usize = 3 * CONTROLS + 2;
            let (mut h, mut g) = (DMatrix::<f64>::zeros(N, N), DVector::<f64>::zeros(N));
            for (span, basis, gradient, global, residual, weight) in &rows {
                let mut j = DVector::<f64>::zeros(N);
                for k in 0..4 {
                    for axis in 0..3 {
                        j[3 * (span + k) + axis] = basis[k] * gradient[axis];
                    }
                }
                j[N - 2] = global[0];
                j[N - 1] = global[1];
                h += *weight * &j * j.transpose();
                g += *weight * *residual * &j;
            }
            // Every unknown is tied, so that the condition stays below 1e3.
            let tie = |normal: &mut NormalEquations| {
                for column in 0..N {
                    *normal.at(column, column) += 1.0;
                }
            };
            h += DMatrix::<f64>::identity(N, N);
            let mut vectors = NormalEquations::new(CONTROLS, 2).unwrap();
            Arch::new().dispatch(AddAll(&mut vectors, &rows));
            let mut one_by_one = NormalEquations::new(CONTROLS, 2).unwrap();
            AddAll(&mut one_by_one, &rows).with_simd(Scalar::new());
            tie(&mut vectors);
            tie(&mut one_by_one);
            let step = vectors.solve(0.0).unwrap().to_vec();
            prop_assert_eq!(one_by_one.solve(0.0).unwrap(), &step[..]);
            let left = &h * DVector::from_vec(step) + &g;
            // Sums of at most 80 terms below 2, solved at that condition.
            prop_assert!(left.amax() < 1e-9, "{}", left.amax());
        }
    }
}
