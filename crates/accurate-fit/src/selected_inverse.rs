use accurate_geom::nalgebra::Matrix3;

/// The entries of an inverse that lie where its Cholesky factor has entries: for a spline's normal
/// equations, all that link control points which share a span.
///
/// # Source
/// Takahashi, Fagan and Chin 1973; Erisman and Tinney, Comm. ACM 18, 1975.
#[derive(Debug, Clone)]
pub(crate) struct SelectedInverse {
    column_start: Vec<usize>,
    /// Rows of each column of the lower triangle, ascending, the diagonal first.
    rows: Vec<usize>,
    values: Vec<f64>,
    log_determinant: f64,
}

impl SelectedInverse {
    /// From the lower Cholesky factor in compressed columns, rows ascending.
    ///
    /// Cost: the sum over columns of their squared counts, times the search in a column.
    pub(crate) fn new(column_start: &[usize], rows: &[usize], factor: &[f64]) -> Self {
        let mut inverse = Self {
            column_start: column_start.to_vec(),
            rows: rows.to_vec(),
            values: vec![0.0; factor.len()],
            log_determinant: 0.0,
        };
        let n = column_start.len() - 1;
        inverse.log_determinant = column_start[..n].iter().map(|&c| 2.0 * factor[c].ln()).sum();
        for column in (0..n).rev() {
            let (first, last) = (column_start[column], column_start[column + 1]);
            let pivot = factor[first];
            for entry in (first + 1..last).rev() {
                let row = rows[entry];
                let mut sum = 0.0;
                for other in first + 1..last {
                    sum += factor[other] * inverse.get(row, rows[other]);
                }
                inverse.values[entry] = -sum / pivot;
            }
            let mut sum = 0.0;
            for other in first + 1..last {
                sum += factor[other] * inverse.values[other];
            }
            inverse.values[first] = (1.0 / pivot - sum) / pivot;
        }
        inverse
    }

    /// Logarithm of the determinant of the matrix (not of its inverse).
    pub(crate) fn log_determinant(&self) -> f64 {
        self.log_determinant
    }

    /// One entry; 0 if it was not selected.
    pub(crate) fn get(&self, row: usize, column: usize) -> f64 {
        let (low, high) = if row < column { (row, column) } else { (column, row) };
        let (first, last) = (self.column_start[low], self.column_start[low + 1]);
        // Bands are contiguous: the entry is at its offset from the diagonal.
        let guess = first + (high - low);
        if guess < last && self.rows[guess] == high {
            return self.values[guess];
        }
        match self.rows[first..last].binary_search(&high) {
            Ok(offset) => self.values[first + offset],
            Err(_) => 0.0,
        }
    }

    /// The 3 x 3 block of control points `i` and `j`.
    pub(crate) fn block(&self, i: usize, j: usize) -> Matrix3<f64> {
        Matrix3::from_fn(|a, b| self.get(3 * i + a, 3 * j + b))
    }

    /// `B H⁻¹ Bᵀ` of a linear combination of neighbouring control points.
    pub(crate) fn combination(&self, first: usize, weights: &[f64]) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        for (i, wi) in weights.iter().enumerate() {
            for (j, wj) in weights.iter().enumerate() {
                sum += self.block(first + i, first + j) * (wi * wj);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use pulp::Scalar;

    use crate::normal::NormalEquations;
    use crate::span_blocks::LinearRow;

    proptest! {
        #[test]
        fn selected_entries_are_those_of_the_inverse_that_solves_give(
            rows in prop::collection::vec(
                (0usize..5, prop::array::uniform3(-1.0..1.0f64), prop::array::uniform2(-1.0..1.0f64),
                 prop::array::uniform4(0.0..1.0f64)),
                1..60,
            ),
        ) {
            let mut normal = NormalEquations::new(8, 2).unwrap();
            for (span, gradient, global, basis) in rows {
                let (basis, gradient, global) = (&basis, &gradient, &global);
                let row = LinearRow { span, basis, gradient, global, residual: 0.3, weight: 1.0 };
                normal.add(Scalar::new(), &row);
            }
            // Ties every unknown, so that the condition stays below 1e3.
            let controls = [accurate_geom::nalgebra::Vector3::zeros(); 8];
            normal.add_smoothness(&controls, 1.0, 1.0, &[]);
            for span in 0..5 {
                for axis in 0..3 {
                    let mut gradient = [0.0; 3];
                    gradient[axis] = 1.0;
                    let (basis, gradient) = (&[1.0, 0.0, 0.0, 0.5], &gradient);
                    let row =
                        LinearRow { span, basis, gradient, global: &[], residual: 0.0, weight: 1.0 };
                    normal.add(Scalar::new(), &row);
                }
            }
            normal.add_prior(0, 0.0, 1.0);
            normal.add_prior(1, 0.0, 1.0);
            let n = normal.unknowns();
            let mut factor = normal.factorise(0.0).unwrap();
            let inverse = factor.selected_inverse().unwrap();
            for column in 0..n {
                let mut solution = vec![0.0; n];
                solution[column] = 1.0;
                factor.solve_in_place(&mut solution, 1);
                for (row, value) in solution.iter().enumerate() {
                    let selected = inverse.get(row, column);
                    let near = row >= 24 || column >= 24 || (row / 3).abs_diff(column / 3) <= 3;
                    if near {
                        prop_assert!((selected - value).abs() < 1e-9, "{row} {column}");
                    }
                }
            }
        }
    }
}
