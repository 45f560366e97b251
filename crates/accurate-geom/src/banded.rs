//! Small banded solvers for spline fits: the two matrices of a cubic spline fit have bandwidth 3,
//! so that a fit of n control points costs O(n).

use nalgebra::SVector;

use crate::GeomError;

/// Half-bandwidth of the normal matrix of cubic B-splines.
pub(crate) const HALF: usize = 3;

/// A symmetric positive definite matrix with [`HALF`] diagonals on each side of the main one.
///
/// `rows[i][k]` is the entry `(i, i - HALF + k)`: the lower half with the diagonal last.
#[derive(Debug, Clone)]
pub(crate) struct SymmetricBanded {
    rows: Vec<[f64; HALF + 1]>,
}

impl SymmetricBanded {
    pub fn zeros(size: usize) -> Self {
        Self { rows: vec![[0.0; HALF + 1]; size] }
    }

    /// Adds `weight * v vᵀ` where `v` is zero but for four entries from `first` on.
    pub fn add_outer(&mut self, first: usize, v: &[f64; HALF + 1], weight: f64) {
        for i in 0..=HALF {
            for j in 0..=i {
                self.rows[first + i][HALF + j - i] += weight * v[i] * v[j];
            }
        }
    }

    pub fn trace(&self) -> f64 {
        self.rows.iter().map(|row| row[HALF]).sum()
    }

    /// `self + factor * other`.
    pub fn plus(&self, other: &Self, factor: f64) -> Self {
        let mut sum = self.clone();
        for (row, other_row) in sum.rows.iter_mut().zip(&other.rows) {
            for (value, other_value) in row.iter_mut().zip(other_row) {
                *value += factor * other_value;
            }
        }
        sum
    }

    /// Solves `self x = rhs` by Cholesky's decomposition inside the band.
    ///
    /// # Errors
    /// [`GeomError::Underdetermined`] if a pivot is lost to rounding (or is not finite).
    pub fn solve<const D: usize>(
        mut self,
        mut rhs: Vec<SVector<f64, D>>,
    ) -> Result<Vec<SVector<f64, D>>, GeomError> {
        let n = self.rows.len();
        for i in 0..n {
            let low = i.saturating_sub(HALF);
            let scale = self.rows[i][HALF];
            for j in low..=i {
                // Entry (i, j) of the factor; (i, k) and (j, k) with k from the common band.
                let mut sum = self.rows[i][HALF + j - i];
                for k in low.max(j.saturating_sub(HALF))..j {
                    sum -= self.rows[i][HALF + k - i] * self.rows[j][HALF + k - j];
                }
                self.rows[i][HALF + j - i] = if j < i {
                    sum / self.rows[j][HALF]
                } else if sum > 8.0 * f64::EPSILON * scale {
                    sum.sqrt()
                } else {
                    return Err(GeomError::Underdetermined { index: i });
                };
            }
            for j in low..i {
                let known = rhs[j] * self.rows[i][HALF + j - i];
                rhs[i] -= known;
            }
            rhs[i] /= self.rows[i][HALF];
        }
        for i in (0..n).rev() {
            for j in i + 1..n.min(i + HALF + 1) {
                let known = rhs[j] * self.rows[j][HALF + i - j];
                rhs[i] -= known;
            }
            rhs[i] /= self.rows[i][HALF];
        }
        Ok(rhs)
    }
}

/// Diagonals on each side of the main one in the collocation matrix of not-a-knot interpolation.
const SIDE: usize = 2;

/// A square matrix with [`SIDE`] diagonals on each side of the main one.
///
/// `rows[i][k]` is the entry `(i, i - SIDE + k)`.
#[derive(Debug, Clone)]
pub(crate) struct Banded {
    rows: Vec<[f64; 2 * SIDE + 1]>,
}

impl Banded {
    pub fn zeros(size: usize) -> Self {
        Self { rows: vec![[0.0; 2 * SIDE + 1]; size] }
    }

    /// Sets entry `(row, column)`; zeros outside the band are dropped.
    ///
    /// # Errors
    /// [`GeomError::Underdetermined`] for a non-zero entry outside the band: the knots do not
    /// interlace with the data.
    pub fn set(&mut self, row: usize, column: usize, value: f64) -> Result<(), GeomError> {
        if (row..=row + 2 * SIDE).contains(&(column + SIDE)) {
            self.rows[row][column + SIDE - row] = value;
            Ok(())
        } else if value == 0.0 {
            Ok(())
        } else {
            Err(GeomError::Underdetermined { index: column })
        }
    }

    /// Solves `self x = rhs` by elimination without pivoting, which is stable here: B-spline
    /// collocation matrices are totally positive.
    ///
    /// # Source
    /// de Boor and Pinkus, Backward error analysis for totally positive linear systems, Numer.
    /// Math. 27, 1977.
    ///
    /// # Errors
    /// [`GeomError::Underdetermined`] for a pivot that is not positive.
    pub fn solve<const D: usize>(
        mut self,
        mut rhs: Vec<SVector<f64, D>>,
    ) -> Result<Vec<SVector<f64, D>>, GeomError> {
        let n = self.rows.len();
        for pivot in 0..n {
            let pivot_row = self.rows[pivot];
            if !(pivot_row[SIDE] > 0.0) {
                return Err(GeomError::Underdetermined { index: pivot });
            }
            for below in pivot + 1..n.min(pivot + SIDE + 1) {
                let shift = below - pivot;
                let factor = self.rows[below][SIDE - shift] / pivot_row[SIDE];
                // The pivot row from its diagonal on, moved under itself.
                let (from, to) = (SIDE - shift, 2 * SIDE - shift);
                for (value, above) in self.rows[below][from..=to].iter_mut().zip(&pivot_row[SIDE..])
                {
                    *value -= factor * above;
                }
                let known = rhs[pivot] * factor;
                rhs[below] -= known;
            }
        }
        for i in (0..n).rev() {
            for j in i + 1..n.min(i + SIDE + 1) {
                let known = rhs[j] * self.rows[i][SIDE + j - i];
                rhs[i] -= known;
            }
            rhs[i] /= self.rows[i][SIDE];
        }
        Ok(rhs)
    }
}
