/// A symmetric positive definite matrix that is zero beyond `half` diagonals from the main one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Banded {
    half: usize,
    /// Row `i` holds columns `i - half ..= i`; what lies left of column 0 stays zero.
    rows: Vec<f64>,
    size: usize,
}

impl Banded {
    pub(crate) fn zeros(size: usize, half: usize) -> Self {
        Self { half, rows: vec![0.0; size * (half + 1)], size }
    }

    /// Adds to entry `(i, j)` with `j <= i <= j + half`; its mirror image follows.
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        debug_assert!(j <= i && i - j <= self.half);
        self.rows[i * (self.half + 1) + self.half + j - i] += value;
    }

    pub(crate) fn diagonal(&self, i: usize) -> f64 {
        self.rows[i * (self.half + 1) + self.half]
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.rows[i * (self.half + 1) + self.half + j - i]
    }

    /// The Cholesky factor, or `None` if the matrix is not (numerically) positive definite.
    ///
    /// O(n half²).
    pub(crate) fn factor(mut self) -> Option<BandedFactor> {
        for i in 0..self.size {
            let left = i.saturating_sub(self.half);
            for j in left..=i {
                let mut sum = self.at(i, j);
                for k in left.max(j.saturating_sub(self.half))..j {
                    sum -= self.at(i, k) * self.at(j, k);
                }
                let value = if i == j {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return None;
                    }
                    sum.sqrt()
                } else {
                    sum / self.at(j, j)
                };
                self.rows[i * (self.half + 1) + self.half + j - i] = value;
            }
        }
        Some(BandedFactor(self))
    }
}

/// `L` of `A = L Lᵀ`.
pub(crate) struct BandedFactor(Banded);

impl BandedFactor {
    /// Solves `A x = b`. O(n half).
    pub(crate) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let l = &self.0;
        let mut x = b.to_vec();
        for i in 0..l.size {
            for k in i.saturating_sub(l.half)..i {
                x[i] -= l.at(i, k) * x[k];
            }
            x[i] /= l.at(i, i);
        }
        for i in (0..l.size).rev() {
            for k in i + 1..(i + l.half + 1).min(l.size) {
                x[i] -= l.at(k, i) * x[k];
            }
            x[i] /= l.at(i, i);
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use accurate_geom::nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_banded_solution_equals_the_dense_one(
            size in 1usize..20, half in 0usize..6,
            entries in prop::collection::vec(-1.0..1.0f64, 400),
            b in prop::collection::vec(-1.0..1.0f64, 20),
        ) {
            let mut banded = Banded::zeros(size, half);
            let mut dense = DMatrix::zeros(size, size);
            for i in 0..size {
                for j in i.saturating_sub(half)..=i {
                    // Diagonally dominant: at most 10 neighbours of magnitude 1.
                    let value = if i == j { 12.0 } else { entries[i * 20 + j] };
                    banded.add(i, j, value);
                    dense[(i, j)] = value;
                    dense[(j, i)] = value;
                }
            }
            let x = banded.factor().unwrap().solve(&b[..size]);
            let expected = dense.cholesky().unwrap().solve(&DVector::from_row_slice(&b[..size]));
            // Condition at most 22 / 2; about 20 roundings per entry.
            for i in 0..size {
                prop_assert!((x[i] - expected[i]).abs() < 11.0 * 40.0 * f64::EPSILON);
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut m = Banded::zeros(2, 1);
        m.add(0, 0, 1.0);
        m.add(1, 0, 2.0);
        m.add(1, 1, 1.0);
        assert!(m.factor().is_none());
    }
}
