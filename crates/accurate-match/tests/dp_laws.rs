//! Laws of the dynamic program, with brute force as the oracle.
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate_match::{Alignment, MatchError, TieOrder, align, align_rows};
use proptest::prelude::*;

const ORDERS: [TieOrder; 2] = [TieOrder::UpLeftDiagonal, TieOrder::DiagonalFirst];

#[derive(Debug, Clone, PartialEq)]
struct Matrix {
    n1: usize,
    n2: usize,
    cells: Vec<f64>,
}

impl Matrix {
    fn at(&self, i: usize, j: usize) -> f64 {
        self.cells[i * self.n2 + j]
    }

    fn map(&self, n1: usize, n2: usize, f: impl Fn(usize, usize) -> (usize, usize)) -> Self {
        let source = |k: usize| f(k / n2, k % n2);
        let cells = (0..n1 * n2).map(|k| self.at(source(k).0, source(k).1)).collect();
        Self { n1, n2, cells }
    }

    fn transposed(&self) -> Self {
        self.map(self.n2, self.n1, |i, j| (j, i))
    }

    fn reversed(&self) -> Self {
        self.map(self.n1, self.n2, |i, j| (self.n1 - 1 - i, self.n2 - 1 - j))
    }

    fn align(&self, ties: TieOrder) -> Alignment {
        align(self.n1, self.n2, |i, j| self.at(i, j), ties).unwrap()
    }

    fn total(&self) -> f64 {
        self.align(TieOrder::DiagonalFirst).total_cost
    }

    /// The least sum over all monotone paths, by visiting every one of them.
    fn brute_force(&self) -> f64 {
        fn least(m: &Matrix, i: usize, j: usize, sum: f64) -> f64 {
            // Added in the order of the path: rounding is monotone, so the least of these sums is
            // exactly what the recurrence computes.
            let sum = sum + m.at(i, j);
            if (i, j) == (m.n1 - 1, m.n2 - 1) {
                return sum;
            }
            let steps = [(1, 0), (0, 1), (1, 1)].map(|(di, dj)| (i + di, j + dj));
            let inside = steps.into_iter().filter(|&(i, j)| i < m.n1 && j < m.n2);
            inside.map(|(i, j)| least(m, i, j, sum)).fold(f64::INFINITY, f64::min)
        }
        least(self, 0, 0, 0.0)
    }

    /// The accumulated matrix, written down plainly.
    fn accumulated(&self) -> Vec<Vec<f64>> {
        let mut c = vec![vec![0.0; self.n2]; self.n1];
        for i in 0..self.n1 {
            for j in 0..self.n2 {
                let before = predecessors(i, j).into_iter().map(|(a, b)| c[a][b]);
                let least = before.fold(f64::INFINITY, f64::min);
                c[i][j] = self.at(i, j) + if least.is_finite() { least } else { 0.0 };
            }
        }
        c
    }
}

/// Up, left, diagonal: those that exist.
fn predecessors(i: usize, j: usize) -> Vec<(usize, usize)> {
    let steps = [(1, 0), (0, 1), (1, 1)];
    steps.into_iter().filter_map(|(a, b)| Some((i.checked_sub(a)?, j.checked_sub(b)?))).collect()
}

fn matrices(n: std::ops::RangeInclusive<usize>) -> impl Strategy<Value = Matrix> {
    matrices_of(n, 0.0..10.0_f64)
}

/// Few distinct values: ties everywhere, and sums without rounding.
fn tied_matrices(n: std::ops::RangeInclusive<usize>) -> impl Strategy<Value = Matrix> {
    matrices_of(n, (0..4_u8).prop_map(f64::from))
}

fn matrices_of(
    n: std::ops::RangeInclusive<usize>,
    cell: impl Strategy<Value = f64> + Clone,
) -> impl Strategy<Value = Matrix> {
    (n.clone(), n).prop_flat_map(move |(n1, n2)| {
        prop::collection::vec(cell.clone(), n1 * n2).prop_map(move |cells| Matrix { n1, n2, cells })
    })
}

fn assert_monotone(path: &[(usize, usize)], n1: usize, n2: usize) {
    assert_eq!(path.first(), Some(&(0, 0)));
    assert_eq!(path.last(), Some(&(n1 - 1, n2 - 1)));
    for step in path.windows(2) {
        let ((a, b), (c, d)) = (step[0], step[1]);
        assert!(
            matches!((c.wrapping_sub(a), d.wrapping_sub(b)), (1, 0) | (0, 1) | (1, 1)),
            "{step:?}"
        );
    }
}

proptest! {
    #[test]
    fn the_total_equals_brute_force(m in matrices(1..=7)) {
        let least = m.brute_force();
        for ties in ORDERS {
            prop_assert_eq!(m.align(ties).total_cost, least);
        }
    }

    #[test]
    fn the_total_equals_brute_force_among_ties(m in tied_matrices(1..=7)) {
        let least = m.brute_force();
        for ties in ORDERS {
            prop_assert_eq!(m.align(ties).total_cost, least);
        }
    }

    #[test]
    fn the_path_is_monotone_from_corner_to_corner(m in tied_matrices(1..=40)) {
        for ties in ORDERS {
            assert_monotone(&m.align(ties).path, m.n1, m.n2);
        }
    }

    #[test]
    fn the_costs_along_the_path_add_up_to_the_total(m in matrices(1..=40)) {
        for ties in ORDERS {
            let alignment = m.align(ties);
            // Same additions in the same order: equal to the last bit.
            let sum = alignment.path.iter().fold(0.0, |sum, &(i, j)| m.at(i, j) + sum);
            prop_assert_eq!(sum, alignment.total_cost);
            prop_assert_eq!(alignment.mean_cost(), sum / alignment.path.len() as f64);
        }
    }

    #[test]
    fn exchanging_the_curves_leaves_the_total(m in matrices(1..=30)) {
        prop_assert_eq!(m.transposed().total(), m.total());
    }

    #[test]
    fn reversing_both_curves_leaves_the_total(m in tied_matrices(1..=30)) {
        prop_assert_eq!(m.reversed().total(), m.total());
    }

    #[test]
    fn reversing_both_curves_leaves_the_total_up_to_rounding(m in matrices(1..=30)) {
        // The same terms added from the other end: n additions of relative error ε/2 each way.
        let tolerance = (m.n1 + m.n2) as f64 * f64::EPSILON * m.total();
        prop_assert!((m.reversed().total() - m.total()).abs() <= tolerance);
    }

    #[test]
    fn a_point_given_twice_never_lowers_the_total(m in tied_matrices(1..=20), k in 0_usize..20) {
        let k = k % m.n1;
        let twice = m.map(m.n1 + 1, m.n2, |i, j| (i - usize::from(i > k), j));
        let (once, doubled) = (m.total(), twice.total());
        // A path through the doubled row folds back to one through the single row; and a path can
        // always stop for its copy at its cheapest cell of row k.
        let path = m.align(TieOrder::DiagonalFirst).path;
        let row_cells = path.iter().filter(|cell| cell.0 == k);
        let extra = row_cells.map(|&(i, j)| m.at(i, j)).fold(f64::INFINITY, f64::min);
        prop_assert!(once <= doubled && doubled <= once + extra);
        prop_assert!(m.transposed().total() <= twice.transposed().total());
    }

    #[test]
    fn the_total_lies_between_its_bounds(m in tied_matrices(1..=20)) {
        let total = m.total();
        let row_minima = |m: &Matrix| -> f64 {
            let least = |i| (0..m.n2).map(|j| m.at(i, j)).fold(f64::INFINITY, f64::min);
            (0..m.n1).map(least).sum()
        };
        prop_assert!(total >= row_minima(&m).max(row_minima(&m.transposed())));
        let along_the_border: f64 =
            (0..m.n2).map(|j| m.at(0, j)).sum::<f64>() + (1..m.n1).map(|i| m.at(i, m.n2 - 1)).sum::<f64>();
        prop_assert!(total <= along_the_border);
    }

    #[test]
    fn a_dearer_cell_never_lowers_the_total(m in tied_matrices(1..=20), k in 0_usize..400, rise in 0..5_u8) {
        let mut dearer = m.clone();
        let cell = k % dearer.cells.len();
        dearer.cells[cell] += f64::from(rise);
        prop_assert!(dearer.total() >= m.total());
        prop_assert!(dearer.total() <= m.total() + f64::from(rise));
    }

    #[test]
    fn every_step_comes_from_the_first_of_the_equal_predecessors(m in tied_matrices(1..=12)) {
        let c = m.accumulated();
        for ties in ORDERS {
            for step in m.align(ties).path.windows(2) {
                let (i, j) = step[1];
                let mut candidates = predecessors(i, j);
                if ties == TieOrder::DiagonalFirst {
                    candidates.rotate_right(1); // diagonal, up, left; unchanged if there is one
                }
                let least = candidates.iter().map(|&(a, b)| c[a][b]).fold(f64::INFINITY, f64::min);
                let first = candidates.into_iter().find(|&(a, b)| c[a][b] == least);
                prop_assert_eq!(first, Some(step[0]));
            }
        }
    }

    #[test]
    fn rows_and_cells_give_the_same_alignment(m in matrices(1..=20)) {
        for ties in ORDERS {
            let row = |i: usize, row: &mut [f64]| row.copy_from_slice(&m.cells[i * m.n2..][..m.n2]);
            prop_assert_eq!(align_rows(m.n1, m.n2, row, ties).unwrap(), m.align(ties));
        }
    }

    #[test]
    fn forbidden_cells_are_avoided_or_reported(
        m in tied_matrices(1..=12),
        walls in prop::collection::vec(0_usize..144, 0..40),
    ) {
        let mut m = m;
        for wall in walls {
            let cell = wall % m.cells.len();
            m.cells[cell] = f64::INFINITY;
        }
        for ties in ORDERS {
            match align(m.n1, m.n2, |i, j| m.at(i, j), ties) {
                Ok(found) => prop_assert!(found.path.iter().all(|&(i, j)| m.at(i, j).is_finite())),
                Err(error) => prop_assert_eq!(error, MatchError::NoFinitePath { n1: m.n1, n2: m.n2 }),
            }
        }
    }
}

/// Calls `f` with every `n` x `n` matrix over the values `0..values`.
fn for_every_matrix(n: usize, values: u8, mut f: impl FnMut(&Matrix)) {
    let mut m = Matrix { n1: n, n2: n, cells: vec![0.0; n * n] };
    loop {
        f(&m);
        let top = f64::from(values - 1);
        let Some(next) = m.cells.iter().position(|&v| v < top) else { return };
        m.cells[next] += 1.0;
        m.cells[..next].fill(0.0);
    }
}

#[test]
fn every_3_by_3_matrix_of_three_values_equals_brute_force() {
    let mut count = 0;
    for_every_matrix(3, 3, |m| {
        let least = m.brute_force();
        for ties in ORDERS {
            let alignment = m.align(ties);
            assert_eq!(alignment.total_cost, least, "{m:?}");
            assert_monotone(&alignment.path, 3, 3);
        }
        count += 1;
    });
    assert_eq!(count, 19_683);
}

#[test]
fn every_4_by_4_matrix_of_two_values_equals_brute_force() {
    let mut count = 0;
    for_every_matrix(4, 2, |m| {
        assert_eq!(m.total(), m.brute_force(), "{m:?}");
        count += 1;
    });
    assert_eq!(count, 65_536);
}

#[test]
fn the_tie_orders_walk_an_all_equal_matrix_as_documented() {
    let path = |ties| align(3, 3, |_, _| 0.0, ties).unwrap().path;
    // Read backwards from the corner: up while there is an up, then left.
    assert_eq!(path(TieOrder::UpLeftDiagonal), [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2)]);
    assert_eq!(path(TieOrder::DiagonalFirst), [(0, 0), (1, 1), (2, 2)]);
}

#[test]
fn left_beats_diagonal_in_the_published_order() {
    // Before (1, 1): up costs 2, left and diagonal cost 1 each.
    let costs = [[1.0, 1.0], [0.0, 0.0]];
    let path = |ties| align(2, 2, |i, j| costs[i][j], ties).unwrap().path;
    assert_eq!(path(TieOrder::UpLeftDiagonal), [(0, 0), (1, 0), (1, 1)]);
    assert_eq!(path(TieOrder::DiagonalFirst), [(0, 0), (1, 1)]);
}

#[test]
fn a_single_point_is_matched_with_everything() {
    let alignment = align(1, 4, |_, j| j as f64, TieOrder::DiagonalFirst).unwrap();
    assert_eq!(alignment.path, [(0, 0), (0, 1), (0, 2), (0, 3)]);
    assert_eq!(alignment.total_cost, 6.0);
    assert_eq!(align(1, 1, |_, _| 2.5, TieOrder::UpLeftDiagonal).unwrap().path, [(0, 0)]);
}

#[test]
fn unusable_input_is_refused_with_its_values() {
    let order = TieOrder::DiagonalFirst;
    assert_eq!(align(0, 3, |_, _| 0.0, order), Err(MatchError::Empty { view: 1 }));
    assert_eq!(align(3, 0, |_, _| 0.0, order), Err(MatchError::Empty { view: 2 }));
    let with = |value: f64| align(3, 5, |i, j| if (i, j) == (1, 3) { value } else { 0.0 }, order);
    assert_eq!(
        with(f64::NEG_INFINITY),
        Err(MatchError::InvalidCost { i: 1, j: 3, value: f64::NEG_INFINITY })
    );
    assert!(matches!(with(f64::NAN), Err(MatchError::InvalidCost { i: 1, j: 3, .. })));
    assert_eq!(align(2, 2, |_, _| f64::MAX, order), Err(MatchError::NoFinitePath { n1: 2, n2: 2 }));
}

#[test]
fn an_alignment_beyond_the_memory_limit_is_refused_before_it_starts() {
    for (n1, n2) in [(200_000, 200_000), (usize::MAX, usize::MAX), (1, usize::MAX), (usize::MAX, 1)]
    {
        let cost = |_, _| panic!("no cost may be asked for");
        match align(n1, n2, cost, TieOrder::DiagonalFirst) {
            Err(MatchError::TooLarge { bytes, limit_bytes, .. }) => assert!(bytes > limit_bytes),
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_very_long_curve_does_not_overflow_the_stack() {
    let n = 300_000;
    let alignment = align(n, 3, |_, _| 1.0, TieOrder::UpLeftDiagonal).unwrap();
    assert_monotone(&alignment.path, n, 3);
}
