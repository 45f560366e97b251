use accurate_geom::nalgebra::{Matrix3, Vector3};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{
    LltRegularization, cholesky_in_place, cholesky_in_place_scratch,
};
use faer::linalg::cholesky::llt::inverse::{inverse, inverse_scratch};
use faer::linalg::cholesky::llt::solve::{solve_in_place, solve_in_place_scratch};
use faer::{Mat, MatMut, MatRef, Par};
use pulp::{Arch, Simd, WithSimd};

use crate::FitError;
use crate::normal::{THIRD_DIFFERENCE, to_be_damped};

/// Normal equations of a spline whose residuals see control points anywhere along it (a pixel at a
/// crossing sees both strands), and a few global unknowns behind them. Dense, by faer, one thread:
/// the same bytes for any number of threads.
pub(crate) struct DenseNormal {
    controls: usize,
    /// Lower triangle, column by column.
    values: Vec<f64>,
    gradient: Vec<f64>,
    /// Scratch: the derivatives of one residual, and where runs of consecutive unknowns begin and end among
    /// them.
    derivatives: Vec<f64>,
    runs: Vec<Run>,
}

/// Derivatives from number `from` to `to` are those of consecutive unknowns from `unknown` on.
struct Run {
    unknown: usize,
    from: usize,
    to: usize,
}

impl DenseNormal {
    pub(crate) fn new(controls: usize, globals: usize) -> Self {
        let n = 3 * controls + globals;
        Self {
            controls,
            values: vec![0.0; n * n],
            gradient: vec![0.0; n],
            derivatives: Vec::new(),
            runs: Vec::new(),
        }
    }

    fn unknowns(&self) -> usize {
        self.gradient.len()
    }

    /// Adds `weight / 2 * residual²` with the residual's derivatives: unknowns and values, by
    /// ascending unknown.
    pub(crate) fn add(&mut self, derivatives: &[(usize, f64)], residual: f64, weight: f64) {
        self.derivatives.clear();
        self.runs.clear();
        for (k, &(unknown, value)) in derivatives.iter().enumerate() {
            self.derivatives.push(value);
            match self.runs.last_mut() {
                Some(run) if run.unknown + k - run.from == unknown => run.to = k + 1,
                _ => self.runs.push(Run { unknown, from: k, to: k + 1 }),
            }
        }
        // No operation is fused: the same sums on every machine.
        Arch::new().dispatch(Add { normal: self, residual, weight });
    }

    /// Adds equations of the same unknowns.
    pub(crate) fn add_all(&mut self, other: &Self) {
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(a, b)| *a += b);
        add(&mut self.values, &other.values);
        add(&mut self.gradient, &other.gradient);
    }

    /// Adds half of `lambda3` times the squared third differences of the control points.
    pub(crate) fn add_smoothness(&mut self, control: &[Vector3<f64>], lambda3: f64) {
        for (first, window) in control.windows(4).enumerate() {
            for axis in 0..3 {
                let mut difference = 0.0;
                let mut derivatives = [(0, 0.0); 4];
                for (k, weight) in THIRD_DIFFERENCE.iter().enumerate() {
                    difference += window[k][axis] * weight;
                    derivatives[k] = (3 * (first + k) + axis, *weight);
                }
                self.add(&derivatives, difference, lambda3);
            }
        }
    }

    /// The step of `(H + damping · diag(H)) step = -gradient`, the diagonal averaged over the
    /// coordinates of each control point: the same in every frame of the world.
    pub(crate) fn step(&self, damping: f64) -> Result<Vec<f64>, FitError> {
        let n = self.unknowns();
        let factor = self.factor(damping)?;
        let mut step: Vec<f64> = self.gradient.iter().map(|g| -g).collect();
        let mut memory = self.memory(solve_in_place_scratch::<f64>(n, 1, Par::Seq))?;
        let right = MatMut::from_column_major_slice_mut(&mut step, n, 1);
        solve_in_place(factor.as_ref(), right, Par::Seq, MemStack::new(&mut memory));
        if step.iter().all(|s| s.is_finite()) { Ok(step) } else { Err(self.singular()) }
    }

    /// The inverse of the undamped matrix.
    pub(crate) fn inverse(&self) -> Result<DenseInverse, FitError> {
        let n = self.unknowns();
        let factor = self.factor(0.0)?;
        let mut memory = self.memory(inverse_scratch::<f64>(n, Par::Seq))?;
        let mut lower = Mat::<f64>::zeros(n, n);
        inverse(lower.as_mut(), factor.as_ref(), Par::Seq, MemStack::new(&mut memory));
        Ok(DenseInverse { lower })
    }

    fn factor(&self, damping: f64) -> Result<Mat<f64>, FitError> {
        let n = self.unknowns();
        let mut factor = MatRef::from_column_major_slice(&self.values, n, n).to_owned();
        let diagonal = |k: usize| self.values[n * k + k];
        for k in 0..n {
            factor[(k, k)] += damping * to_be_damped(k, self.controls, diagonal);
        }
        let params = Default::default();
        let mut memory = self.memory(cholesky_in_place_scratch::<f64>(n, Par::Seq, params))?;
        let stack = MemStack::new(&mut memory);
        cholesky_in_place(factor.as_mut(), LltRegularization::default(), Par::Seq, stack, params)
            .map_err(|_| self.singular())?;
        Ok(factor)
    }

    fn memory(&self, scratch: faer::dyn_stack::StackReq) -> Result<MemBuffer, FitError> {
        MemBuffer::try_new(scratch).map_err(|_| self.singular())
    }

    fn singular(&self) -> FitError {
        FitError::Singular { unknowns: self.unknowns() }
    }
}

/// Adds the residual whose derivatives are laid out.
struct Add<'n> {
    normal: &'n mut DenseNormal,
    residual: f64,
    weight: f64,
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let DenseNormal { values, gradient, derivatives, runs, .. } = self.normal;
        let n = gradient.len();
        for (r, run) in runs.iter().enumerate() {
            for k in run.from..run.to {
                let column = run.unknown + k - run.from;
                let scaled = self.weight * derivatives[k];
                gradient[column] += scaled * self.residual;
                let entries = &mut values[n * column..n * (column + 1)];
                add_scaled(&mut entries[column..], scaled, &derivatives[k..run.to]);
                for other in &runs[r + 1..] {
                    let others = &derivatives[other.from..other.to];
                    add_scaled(&mut entries[other.unknown..], scaled, others);
                }
            }
        }
    }
}

#[inline(always)]
fn add_scaled(entries: &mut [f64], factor: f64, values: &[f64]) {
    entries.iter_mut().zip(values).for_each(|(entry, value)| *entry += factor * value);
}

/// The inverse of a symmetric matrix, of which the lower triangle is there.
pub(crate) struct DenseInverse {
    lower: Mat<f64>,
}

impl DenseInverse {
    pub(crate) fn get(&self, row: usize, column: usize) -> f64 {
        self.lower[(row.max(column), row.min(column))]
    }

    /// The 3 x 3 block of control points `i` and `j`.
    pub(crate) fn block(&self, i: usize, j: usize) -> Matrix3<f64> {
        Matrix3::from_fn(|a, b| self.get(3 * i + a, 3 * j + b))
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;

    const CONTROLS: usize = 5;
    const N: usize = 3 * CONTROLS + 7;

    proptest! {
        #[test]
        fn step_and_covariance_are_those_of_the_written_out_equations(
            rows in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, N + 2), 2 * N),
            points in prop::collection::vec(-1.0..1.0f64, 3 * CONTROLS),
        ) {
            let control: Vec<_> =
                points.chunks_exact(3).map(|p| Vector3::new(p[0], p[1], p[2])).collect();
            let mut normal = DenseNormal::new(CONTROLS, 7);
            let (mut h, mut g) = (DMatrix::<f64>::identity(N, N), DVector::<f64>::zeros(N));
            // Well conditioned: what is compared is the bookkeeping.
            (0..N).for_each(|k| normal.add(&[(k, 1.0)], 0.0, 1.0));
            for row in &rows {
                let (weight, residual) = (row[N].abs(), row[N + 1]);
                let derivatives: Vec<_> = row[..N].iter().copied().enumerate().collect();
                normal.add(&derivatives, residual, weight);
                let a = DVector::from_row_slice(&row[..N]);
                h += &a * a.transpose() * weight;
                g += a * (weight * residual);
            }
            normal.add_smoothness(&control, 0.7);
            for first in 0..CONTROLS - 3 {
                for axis in 0..3 {
                    let mut a = DVector::<f64>::zeros(N);
                    for (k, w) in [-1.0, 3.0, -3.0, 1.0].into_iter().enumerate() {
                        a[3 * (first + k) + axis] = w;
                    }
                    let value: f64 = (0..CONTROLS).map(|c| a[3 * c + axis] * control[c][axis]).sum();
                    h += &a * a.transpose() * 0.7;
                    g += a * (0.7 * value);
                }
            }
            let inverse = h.clone().try_inverse().unwrap();
            let expected = -(&inverse * &g);
            let step = normal.step(0.0).unwrap();
            for k in 0..N {
                // Eigenvalues from 1 to some hundreds.
                prop_assert!((step[k] - expected[k]).abs() < 1e-10 * (1.0 + g.norm()));
            }
            let found = normal.inverse().unwrap();
            for i in 0..CONTROLS {
                for j in i..CONTROLS.min(i + 4) {
                    let there = inverse.fixed_view::<3, 3>(3 * i, 3 * j);
                    prop_assert!((found.block(i, j) - there).norm() < 1e-10);
                }
            }
            let last = Matrix3::from_fn(|a, b| found.get(N - 3 + a, N - 3 + b));
            prop_assert!((last - inverse.fixed_view::<3, 3>(N - 3, N - 3)).norm() < 1e-10);
        }
    }
}
