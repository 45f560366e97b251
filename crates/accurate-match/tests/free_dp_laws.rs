//! Laws of the alignments with open ends, with gaps and of closed sequences; brute force is the
//! oracle.
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate_geom::GeomError;
use accurate_match::{
    FreeAlignment, MatchError, MovePrices, OpenEnds, TieOrder, align, align_cyclic, align_free,
};
use proptest::prelude::*;

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

    fn align(&self, prices: &MovePrices, ends: &OpenEnds) -> Result<FreeAlignment, MatchError> {
        let fill = |i: usize, row: &mut [f64]| {
            row.copy_from_slice(&self.cells[i * self.n2..][..self.n2]);
        };
        align_free(self.n1, self.n2, fill, prices, ends)
    }

    fn cyclic(&self, prices: &MovePrices) -> f64 {
        align_cyclic(self.n1, self.n2, |i, j| self.at(i, j), prices).unwrap().total_cost
    }
}

fn matrices(most: usize) -> impl Strategy<Value = Matrix> {
    // Small whole numbers make ties.
    let cell = prop_oneof![0.0..5.0_f64, (0..4_u8).prop_map(f64::from)];
    (1..=most, 1..=most).prop_flat_map(move |(n1, n2)| {
        prop::collection::vec(cell.clone(), n1 * n2).prop_map(move |cells| Matrix { n1, n2, cells })
    })
}

fn prices() -> impl Strategy<Value = MovePrices> {
    let price = || prop_oneof![0.0..2.0_f64, Just(f64::INFINITY)];
    (0.0..3.0_f64, 0.0..0.5_f64, price(), price(), price()).prop_map(
        |(diagonal_weight, step, end_skip, gap_open, gap_skip)| MovePrices {
            diagonal_weight,
            step,
            end_skip,
            gap_open,
            gap_skip,
        },
    )
}

fn open_ends() -> impl Strategy<Value = OpenEnds> {
    let free = || prop_oneof![0..4_usize, Just(usize::MAX)];
    (free(), free(), free(), free()).prop_map(|(begin1, end1, begin2, end2)| OpenEnds {
        begin1,
        end1,
        begin2,
        end2,
    })
}

fn times(n: usize, price: f64) -> f64 {
    if n == 0 { 0.0 } else { n as f64 * price }
}

/// What a path costs, as documented; `None` if it is not allowed.
fn price_of(
    m: &Matrix,
    path: &[(usize, usize)],
    prices: &MovePrices,
    ends: &OpenEnds,
) -> Option<f64> {
    let (first, last) = (*path.first()?, *path.last()?);
    let (out1, out2) = (m.n1 - 1 - last.0, m.n2 - 1 - last.1);
    let begin = first.0.min(first.1) == 0 && first.0 <= ends.begin1 && first.1 <= ends.begin2;
    let end = out1.min(out2) == 0 && out1 <= ends.end1 && out2 <= ends.end2;
    if !(begin && end) {
        return None;
    }
    let mut sum =
        times(first.0 + first.1, prices.end_skip) + prices.diagonal_weight * m.at(first.0, first.1);
    for step in path.windows(2) {
        let ((i0, j0), (i, j)) = (step[0], step[1]);
        let (di, dj) = (i.checked_sub(i0)?, j.checked_sub(j0)?);
        sum += match (di, dj) {
            (1, 0) | (0, 1) => m.at(i, j) + prices.step,
            (1, 1) => prices.diagonal_weight * m.at(i, j),
            (1, gap) | (gap, 1) if gap > 1 => {
                prices.gap_open
                    + (gap - 1) as f64 * prices.gap_skip
                    + prices.diagonal_weight * m.at(i, j)
            }
            _ => return None,
        };
    }
    Some(sum + times(out1 + out2, prices.end_skip))
}

/// The least price of all allowed paths, by visiting every one.
fn brute_force(m: &Matrix, prices: &MovePrices, ends: &OpenEnds) -> f64 {
    fn extend(
        m: &Matrix,
        path: &mut Vec<(usize, usize)>,
        visit: &mut impl FnMut(&[(usize, usize)]),
    ) {
        visit(path);
        let (i0, j0) = path[path.len() - 1];
        for i in i0..m.n1 {
            for j in j0..m.n2 {
                let (di, dj) = (i - i0, j - j0);
                if (di.max(dj) == 1) || di.min(dj) == 1 {
                    path.push((i, j));
                    extend(m, path, visit);
                    path.pop();
                }
            }
        }
    }
    let mut best = f64::INFINITY;
    for i in 0..m.n1 {
        for j in 0..m.n2 {
            if i.min(j) == 0 {
                extend(m, &mut vec![(i, j)], &mut |path| {
                    best = best.min(price_of(m, path, prices, ends).unwrap_or(f64::INFINITY));
                });
            }
        }
    }
    best
}

/// The least price of all closed paths, by visiting every one from every begin.
fn cyclic_brute_force(m: &Matrix, prices: &MovePrices) -> f64 {
    fn least(
        m: &Matrix,
        (i, j): (usize, usize),
        end: (usize, usize),
        sum: f64,
        prices: &MovePrices,
    ) -> f64 {
        if (i, j) == end {
            return sum;
        }
        let mut best = f64::INFINITY;
        for (di, dj) in [(1, 0), (0, 1), (1, 1)] {
            let (i, j) = (i + di, j + dj);
            if i <= end.0 && j <= end.1 {
                let d = m.at(i % m.n1, j % m.n2);
                let price = if di + dj == 2 { prices.diagonal_weight * d } else { d + prices.step };
                best = best.min(least(m, (i, j), end, sum + price, prices));
            }
        }
        best
    }
    (0..m.n2).map(|a| least(m, (0, a), (m.n1, a + m.n2), 0.0, prices)).fold(f64::INFINITY, f64::min)
}

/// Sums of at most some 30 numbers of at most some 100.
const ROUNDING: f64 = 30.0 * 100.0 * f64::EPSILON;

proptest! {
    #[test]
    fn closed_ends_and_no_gaps_are_ecdp(m in matrices(12)) {
        let free = m.align(&MovePrices::ECDP, &OpenEnds::ANY).unwrap();
        let corners = align(m.n1, m.n2, |i, j| m.at(i, j), TieOrder::DiagonalFirst).unwrap();
        prop_assert_eq!(free.path, corners.path);
        prop_assert_eq!(free.total_cost, corners.total_cost);
    }

    #[test]
    fn the_path_is_the_best_of_all(m in matrices(5), prices in prices(), ends in open_ends()) {
        let found = m.align(&prices, &ends).unwrap();
        let expected = brute_force(&m, &prices, &ends);
        prop_assert!((found.total_cost - expected).abs() <= ROUNDING, "{found:?} {expected}");
        let price = price_of(&m, &found.path, &prices, &ends).unwrap();
        prop_assert!((found.total_cost - price).abs() <= ROUNDING, "{found:?} {price}");
    }

    #[test]
    fn long_sequences_cost_what_their_path_says(m in matrices(40), prices in prices(), ends in open_ends()) {
        let found = m.align(&prices, &ends).unwrap();
        let price = price_of(&m, &found.path, &prices, &ends).unwrap();
        prop_assert!((found.total_cost - price).abs() <= 10.0 * ROUNDING);
    }

    #[test]
    fn more_freedom_never_costs_more(m in matrices(10), prices in prices(), ends in open_ends()) {
        let total = |prices: &MovePrices, ends: &OpenEnds| m.align(prices, ends).unwrap().total_cost;
        let found = total(&prices, &ends);
        prop_assert!(total(&prices, &OpenEnds::ANY) <= found);
        prop_assert!(found <= total(&prices, &OpenEnds::NONE));
        let opened = MovePrices { gap_open: 0.0, ..prices };
        prop_assert!(total(&opened, &ends) <= found + ROUNDING);
        let shut = MovePrices { gap_open: f64::INFINITY, ..prices };
        prop_assert!(found <= total(&shut, &ends));
    }

    #[test]
    fn exchanging_the_sequences_leaves_the_cost(m in matrices(10), prices in prices(), ends in open_ends()) {
        let transposed = m.map(m.n2, m.n1, |i, j| (j, i));
        let OpenEnds { begin1, end1, begin2, end2 } = ends;
        let exchanged = OpenEnds { begin1: begin2, end1: end2, begin2: begin1, end2: end1 };
        let (a, b) = (m.align(&prices, &ends).unwrap(), transposed.align(&prices, &exchanged).unwrap());
        prop_assert!((a.total_cost - b.total_cost).abs() <= ROUNDING);
    }

    #[test]
    fn reversing_both_leaves_the_cost_where_every_cell_counts_once(
        m in matrices(10), prices in prices(), ends in open_ends()
    ) {
        let prices = MovePrices { diagonal_weight: 1.0, ..prices };
        let reversed = m.map(m.n1, m.n2, |i, j| (m.n1 - 1 - i, m.n2 - 1 - j));
        let OpenEnds { begin1, end1, begin2, end2 } = ends;
        let turned = OpenEnds { begin1: end1, end1: begin1, begin2: end2, end2: begin2 };
        let (a, b) = (m.align(&prices, &ends).unwrap(), reversed.align(&prices, &turned).unwrap());
        prop_assert!((a.total_cost - b.total_cost).abs() <= ROUNDING);
    }

    #[test]
    fn a_forbidden_cell_is_never_matched(m in matrices(8), prices in prices(), at in 0..64_usize) {
        let mut m = m;
        let k = at % m.cells.len();
        m.cells[k] = f64::INFINITY;
        match m.align(&prices, &OpenEnds::ANY) {
            Ok(found) => {
                prop_assert!(found.total_cost.is_finite());
                prop_assert!(!found.path.contains(&(k / m.n2, k % m.n2)));
            }
            Err(error) => prop_assert_eq!(error, MatchError::NoFinitePath { n1: m.n1, n2: m.n2 }),
        }
    }

    #[test]
    fn a_closed_path_is_the_best_of_all(m in matrices(5), prices in prices()) {
        let found = align_cyclic(m.n1, m.n2, |i, j| m.at(i, j), &prices).unwrap();
        let expected = cyclic_brute_force(&m, &prices);
        prop_assert!((found.total_cost - expected).abs() <= ROUNDING, "{found:?} {expected}");
        // Once around both, and what it costs is what it says.
        let mut sum = 0.0;
        let mut advance = (0, 0);
        for (k, &(i, j)) in found.path.iter().enumerate() {
            let (i0, j0) = found.path[(k + found.path.len() - 1) % found.path.len()];
            if found.path.len() > 1 && m.n1 > 1 && m.n2 > 1 {
                let (di, dj) = ((i + m.n1 - i0) % m.n1, (j + m.n2 - j0) % m.n2);
                prop_assert!(di <= 1 && dj <= 1 && di + dj > 0);
                advance = (advance.0 + di, advance.1 + dj);
                let d = m.at(i, j);
                sum += if di + dj == 2 { prices.diagonal_weight * d } else { d + prices.step };
            }
        }
        if m.n1 > 1 && m.n2 > 1 {
            prop_assert_eq!(advance, (m.n1, m.n2));
            prop_assert!((found.total_cost - sum).abs() <= ROUNDING);
        }
    }

    #[test]
    fn a_closed_path_avoids_forbidden_cells(
        m in matrices(5), prices in prices(), forbidden in prop::collection::vec(0..25_usize, 0..8)
    ) {
        let mut m = m;
        for k in forbidden {
            let k = k % m.cells.len();
            m.cells[k] = f64::INFINITY;
        }
        let prices = MovePrices { diagonal_weight: prices.diagonal_weight + 0.1, ..prices };
        let expected = cyclic_brute_force(&m, &prices);
        match align_cyclic(m.n1, m.n2, |i, j| m.at(i, j), &prices) {
            Ok(found) => prop_assert!((found.total_cost - expected).abs() <= ROUNDING),
            Err(error) => {
                prop_assert_eq!(error, MatchError::NoFinitePath { n1: m.n1, n2: m.n2 });
                prop_assert_eq!(expected, f64::INFINITY);
            }
        }
    }

    #[test]
    fn where_closed_sequences_are_cut_does_not_matter(
        m in matrices(16), prices in prices(), cut1 in 0..16_usize, cut2 in 0..16_usize
    ) {
        let turned = m.map(m.n1, m.n2, |i, j| ((i + cut1) % m.n1, (j + cut2) % m.n2));
        prop_assert!((m.cyclic(&prices) - turned.cyclic(&prices)).abs() <= 2.0 * ROUNDING);
        let transposed = m.map(m.n2, m.n1, |i, j| (j, i));
        prop_assert!((m.cyclic(&prices) - transposed.cyclic(&prices)).abs() <= 2.0 * ROUNDING);
    }
}

#[test]
fn a_tail_that_one_sequence_lacks_is_left_out() {
    let (a, b) = ([5.0_f64, 6.0, 7.0, 8.0], [2.0_f64, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let prices = MovePrices { end_skip: 0.2, ..MovePrices::ECDP };
    let fill = |i: usize, row: &mut [f64]| {
        row.iter_mut().zip(b).for_each(|(cell, b)| *cell = (a[i] - b).abs());
    };
    let found = align_free(4, 6, fill, &prices, &OpenEnds::ANY).unwrap();
    assert_eq!(found.path, [(0, 3), (1, 4), (2, 5)]);
    assert!((found.total_cost - 4.0 * 0.2).abs() < ROUNDING);
}

#[test]
fn a_stretch_that_one_sequence_lacks_is_a_gap() {
    let (a, b) = ([0.0_f64, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [0.0_f64, 1.0, 5.0, 6.0]);
    let prices = MovePrices { gap_open: 0.5, gap_skip: 0.1, ..MovePrices::ECDP };
    let found = align(7, 4, |i, j| (a[i] - b[j]).abs(), TieOrder::DiagonalFirst).unwrap();
    assert!(found.total_cost > 3.0);
    let fill = |i: usize, row: &mut [f64]| {
        row.iter_mut().zip(b).for_each(|(cell, b)| *cell = (a[i] - b).abs());
    };
    let found = align_free(7, 4, fill, &prices, &OpenEnds::NONE).unwrap();
    assert_eq!(found.path, [(0, 0), (1, 1), (5, 2), (6, 3)]);
    assert!((found.total_cost - (0.5 + 3.0 * 0.1)).abs() < ROUNDING);
}

/// Everything is free, so that only the order of equals decides.
const TIED: MovePrices =
    MovePrices { diagonal_weight: 1.0, step: 0.0, end_skip: 0.0, gap_open: 0.0, gap_skip: 0.0 };

#[test]
fn of_equals_a_gap_comes_before_an_advance_of_one_view() {
    let m = Matrix { n1: 3, n2: 2, cells: vec![0.0, 0.0, 5.0, 0.0, 0.0, 0.0] };
    let found = m.align(&TIED, &OpenEnds::NONE).unwrap();
    assert_eq!((found.total_cost, found.path), (0.0, vec![(0, 0), (2, 1)]));
    let transposed = m.map(2, 3, |i, j| (j, i)).align(&TIED, &OpenEnds::NONE).unwrap();
    assert_eq!((transposed.total_cost, transposed.path), (0.0, vec![(0, 0), (1, 2)]));
    // Without gaps, both advance, then view 1.
    let shut = MovePrices { gap_open: f64::INFINITY, ..TIED };
    let found = m.align(&shut, &OpenEnds::NONE).unwrap();
    assert_eq!(found.path, [(0, 0), (1, 1), (2, 1)]);
}

#[test]
fn of_equals_an_advance_comes_before_a_later_begin_in_either_view() {
    let row = Matrix { n1: 1, n2: 3, cells: vec![0.0; 3] };
    let column = row.map(3, 1, |i, j| (j, i));
    let ends = OpenEnds { end1: 0, end2: 0, ..OpenEnds::ANY };
    assert_eq!(row.align(&TIED, &ends).unwrap().path, [(0, 0), (0, 1), (0, 2)]);
    assert_eq!(column.align(&TIED, &ends).unwrap().path, [(0, 0), (1, 0), (2, 0)]);
}

#[test]
fn of_equal_ends_the_topmost_in_the_last_column_comes_first() {
    let m = Matrix { n1: 2, n2: 2, cells: vec![0.0; 4] };
    assert_eq!(m.align(&TIED, &OpenEnds::ANY).unwrap().path, [(0, 0), (0, 1)]);
    let m = Matrix { n1: 2, n2: 3, cells: vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0] };
    assert_eq!(m.align(&TIED, &OpenEnds::ANY).unwrap().path.last(), Some(&(1, 0)));
}

#[test]
fn unusable_input_is_refused_by_name() {
    let run = |n1, n2, value: f64, prices: &MovePrices| {
        align_free(n1, n2, |_, row| row.fill(value), prices, &OpenEnds::ANY).unwrap_err()
    };
    let ecdp = MovePrices::ECDP;
    assert_eq!(run(0, 3, 1.0, &ecdp), MatchError::Empty { view: 1 });
    assert_eq!(run(3, 0, 1.0, &ecdp), MatchError::Empty { view: 2 });
    assert!(matches!(run(2, 2, f64::NAN, &ecdp), MatchError::InvalidCost { i: 0, j: 0, .. }));
    assert!(matches!(run(2, 2, -1.0, &ecdp), MatchError::InvalidCost { value: -1.0, .. }));
    assert_eq!(run(2, 2, f64::INFINITY, &ecdp), MatchError::NoFinitePath { n1: 2, n2: 2 });
    assert_eq!(run(2, 2, f64::MAX, &ecdp), MatchError::NoFinitePath { n1: 2, n2: 2 });
    let huge = 1 << 40;
    assert!(matches!(run(huge, huge, 1.0, &ecdp), MatchError::TooLarge { .. }));
    for prices in [
        MovePrices { diagonal_weight: f64::INFINITY, ..ecdp },
        MovePrices { step: -0.1, ..ecdp },
        MovePrices { end_skip: f64::NAN, ..ecdp },
        MovePrices { gap_open: -1.0, ..ecdp },
        MovePrices { gap_skip: f64::NAN, ..ecdp },
    ] {
        let error = run(2, 2, 1.0, &prices);
        assert!(matches!(error, MatchError::Geometry(GeomError::OutOfRange { .. })), "{error}");
    }
    let cyclic = |n1, n2, value: f64| align_cyclic(n1, n2, |_, _| value, &ecdp).unwrap_err();
    assert_eq!(cyclic(0, 1, 1.0), MatchError::Empty { view: 1 });
    assert!(matches!(cyclic(huge, huge, 1.0), MatchError::TooLarge { .. }));
    assert!(matches!(cyclic(2, 2, f64::NAN), MatchError::InvalidCost { .. }));
    assert_eq!(cyclic(2, 2, f64::INFINITY), MatchError::NoFinitePath { n1: 2, n2: 2 });
}
