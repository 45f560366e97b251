use std::cmp::Ordering;
use std::collections::BinaryHeap;

use accurate_match::MatchError;

use crate::room::{all_pairs, check_room};

/// A cost and a step, without the queue.
const CELL_BYTES: u64 = 9;

/// The cheapest monotone path through a grid of cells.
#[derive(Debug, Clone, PartialEq)]
pub struct GridPath {
    /// Sum of the costs of [`GridPath::cells`].
    pub cost: f64,
    /// From `(0, 0)` to `(n1 - 1, n2 - 1)`; every step advances one index or both.
    pub cells: Vec<(usize, usize)>,
}

/// The cheapest path from `(0, 0)` to `(n1 - 1, n2 - 1)` over steps `(1, 0)`, `(0, 1)` and `(1, 1)`,
/// where entering cell `(i, j)` costs `cost(i, j)`, by Dijkstra's algorithm. An infinite cost forbids
/// the cell.
///
/// The optimum is that of the dynamic programme over the same cells; only the work differs. Ties:
/// the cell entered into the queue at the lesser cost, then the lesser `(i, j)`, is settled first,
/// and only a strictly cheaper way replaces an earlier one.
///
/// # Errors
/// [`MatchError::Empty`] without cells; [`MatchError::TooLarge`] if they need more than
/// [`MAX_ALIGNMENT_BYTES`](accurate_match::MAX_ALIGNMENT_BYTES); [`MatchError::InvalidCost`] at the
/// first visited cell whose cost is negative or NaN; [`MatchError::NoFinitePath`] if every path meets an
/// infinite cell or its sum overflows.
///
/// # Cost
/// O(n1 n2 log(n1 n2)) time, 9 bytes per cell plus the queue.
///
/// # Source
/// Baur et al., Int. J. CARS 2016, for the problem (least sum of distances over monotone
/// correspondences). Solving it on the explicit graph is our reading.
pub fn cheapest_grid_path(
    n1: usize,
    n2: usize,
    cost: impl Fn(usize, usize) -> f64,
) -> Result<GridPath, MatchError> {
    for (view, n) in [(1, n1), (2, n2)] {
        if n == 0 {
            return Err(MatchError::Empty { view });
        }
    }
    let checked = |i, j| {
        let value: f64 = cost(i, j);
        if value >= 0.0 { Ok(value) } else { Err(MatchError::InvalidCost { i, j, value }) }
    };
    let goal = (n1 - 1, n2 - 1);
    check_room(all_pairs(n1, n2), CELL_BYTES, n1, n2)?;
    let mut reached = vec![f64::INFINITY; n1 * n2];
    // The step by which a cell was reached: bit 0 advances j, bit 1 advances i; bit 2: settled.
    let mut came_by = vec![0u8; n1 * n2];
    reached[0] = checked(0, 0)?;
    let mut queue = BinaryHeap::from([Entry { cost: reached[0], cell: (0, 0) }]);
    while let Some(Entry { cost: so_far, cell: (i, j) }) = queue.pop() {
        let here = i * n2 + j;
        if came_by[here] & 4 != 0 {
            continue;
        }
        came_by[here] |= 4;
        if (i, j) == goal {
            break;
        }
        for step in [3u8, 2, 1] {
            let (to_i, to_j) = (i + usize::from(step >> 1), j + usize::from(step & 1));
            if to_i >= n1 || to_j >= n2 {
                continue;
            }
            let there = to_i * n2 + to_j;
            if came_by[there] & 4 != 0 {
                continue;
            }
            let total = so_far + checked(to_i, to_j)?;
            if total < reached[there] {
                reached[there] = total;
                came_by[there] = step;
                queue.push(Entry { cost: total, cell: (to_i, to_j) });
            }
        }
    }
    let total = reached[n1 * n2 - 1];
    if !total.is_finite() {
        return Err(MatchError::NoFinitePath { n1, n2 });
    }
    let mut cells = vec![goal];
    let (mut i, mut j) = goal;
    while (i, j) != (0, 0) {
        let step = came_by[i * n2 + j] & 3;
        i -= usize::from(step >> 1);
        j -= usize::from(step & 1);
        cells.push((i, j));
    }
    cells.reverse();
    Ok(GridPath { cost: total, cells })
}

/// One pair per run of a path that stays in one row or one column: the cheapest, and the first of
/// equals. What is returned strictly increases in both indices.
///
/// Runs are taken along the path, each as long as possible; where two neighbouring choices share an
/// index, the cheaper stays.
///
/// # Source
/// Baur et al. 2016 and ACCURATE, section 2.3, describe the one-to-many runs; keeping the least
/// distance is our choice.
pub fn cheapest_of_each_run(
    cells: &[(usize, usize)],
    cost: impl Fn(usize, usize) -> f64,
) -> Vec<(usize, usize)> {
    let mut kept: Vec<(usize, usize)> = Vec::new();
    let mut start = 0;
    while start < cells.len() {
        let (i, j) = cells[start];
        let same_row = cells[start..].iter().take_while(|c| c.0 == i).count();
        let same_column = cells[start..].iter().take_while(|c| c.1 == j).count();
        let end = start + same_row.max(same_column);
        let mut best = cells[start];
        for &cell in &cells[start + 1..end] {
            if cost(cell.0, cell.1) < cost(best.0, best.1) {
                best = cell;
            }
        }
        match kept.last_mut() {
            Some(last) if last.0 == best.0 || last.1 == best.1 => {
                if cost(best.0, best.1) < cost(last.0, last.1) {
                    *last = best;
                }
            }
            _ => kept.push(best),
        }
        start = end;
    }
    kept
}

#[derive(PartialEq)]
struct Entry {
    cost: f64,
    cell: (usize, usize),
}

impl Eq for Entry {}

impl Ord for Entry {
    /// Reversed: the standard heap gives its greatest entry first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then(other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grids(side: usize) -> impl Strategy<Value = (usize, usize, Vec<f64>)> {
        (1..=side, 1..=side).prop_flat_map(|(n1, n2)| {
            (Just(n1), Just(n2), prop::collection::vec(0.0..10.0f64, n1 * n2))
        })
    }

    fn steps_are_monotone(cells: &[(usize, usize)]) -> bool {
        cells.windows(2).all(|w| {
            let (di, dj) = (w[1].0.wrapping_sub(w[0].0), w[1].1.wrapping_sub(w[0].1));
            matches!((di, dj), (1, 0) | (0, 1) | (1, 1))
        })
    }

    fn least_over_all_paths(n1: usize, n2: usize, costs: &[f64], i: usize, j: usize) -> f64 {
        let own = costs[i * n2 + j];
        if (i, j) == (n1 - 1, n2 - 1) {
            return own;
        }
        let mut least = f64::INFINITY;
        for (di, dj) in [(1, 0), (0, 1), (1, 1)] {
            if i + di < n1 && j + dj < n2 {
                least = least.min(least_over_all_paths(n1, n2, costs, i + di, j + dj));
            }
        }
        own + least
    }

    proptest! {
        #[test]
        fn the_cheapest_path_equals_brute_force((n1, n2, costs) in grids(6)) {
            let path = cheapest_grid_path(n1, n2, |i, j| costs[i * n2 + j]).unwrap();
            let least = least_over_all_paths(n1, n2, &costs, 0, 0);
            // The same numbers summed from the other end: at most 12 roundings of 120.
            prop_assert!((path.cost - least).abs() <= 12.0 * f64::EPSILON * 120.0);
            prop_assert!(steps_are_monotone(&path.cells));
            prop_assert_eq!(path.cells[0], (0, 0));
        }

        #[test]
        fn one_pair_per_run_increases_strictly((n1, n2, costs) in grids(12)) {
            let cost = |i: usize, j: usize| costs[i * n2 + j];
            let path = cheapest_grid_path(n1, n2, cost).unwrap();
            let kept = cheapest_of_each_run(&path.cells, cost);
            prop_assert!(!kept.is_empty());
            prop_assert!(kept.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1));
            prop_assert!(kept.iter().all(|pair| path.cells.contains(pair)));
        }

        /// The cheapest of its run is kept, unless that of a run beside it shares an index and costs
        /// no more; and nothing else is. On any path: the cheapest has corners only where cells are
        /// free, and without a corner no two runs share an index.
        #[test]
        fn the_cheapest_of_every_run_is_kept(
            steps in prop::collection::vec(1..=3usize, 0..20),
            costs in prop::collection::vec(0.0..10.0f64, 20 * 20),
        ) {
            let cost = |&(i, j): &(usize, usize)| costs[i * 20 + j];
            let mut cells = vec![(0, 0)];
            for step in steps {
                let (i, j) = cells[cells.len() - 1];
                cells.push((i + (step >> 1), j + (step & 1)));
            }
            let kept = cheapest_of_each_run(&cells, |i, j| cost(&(i, j)));
            prop_assert!(kept.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1));
            let mut cheapest = Vec::new();
            let mut rest = &cells[..];
            while let Some(&(i, j)) = rest.first() {
                let row = rest.partition_point(|c| c.0 == i);
                let column = rest.partition_point(|c| c.1 == j);
                let (run, after) = rest.split_at(row.max(column));
                cheapest.extend(run.iter().copied().min_by(|a, b| cost(a).total_cmp(&cost(b))));
                rest = after;
            }
            prop_assert!(kept.iter().all(|pair| cheapest.contains(pair)));
            for (k, own) in cheapest.iter().enumerate() {
                let beside = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
                let settled = beside.filter_map(|n| cheapest.get(n)).any(|other| {
                    (other.0 == own.0 || other.1 == own.1) && cost(other) <= cost(own)
                });
                prop_assert!(settled || kept.contains(own), "{own:?} of {cheapest:?}: {kept:?}");
            }
        }
    }

    #[test]
    fn unusable_grids_and_costs_are_refused() {
        assert!(matches!(cheapest_grid_path(0, 3, |_, _| 1.0), Err(MatchError::Empty { view: 1 })));
        for bad in [-1.0, f64::NAN] {
            assert!(matches!(
                cheapest_grid_path(2, 2, |_, _| bad),
                Err(MatchError::InvalidCost { i: 0, j: 0, .. })
            ));
        }
        for many in [1 << 20, 1 << 40] {
            let found = cheapest_grid_path(many, many, |_, _| 1.0);
            assert!(
                matches!(found, Err(MatchError::TooLarge { n1, n2, .. }) if n1 == many && n2 == many)
            );
        }
        for huge in [f64::MAX, f64::INFINITY] {
            let none = Err(MatchError::NoFinitePath { n1: 9, n2: 9 });
            assert_eq!(cheapest_grid_path(9, 9, |_, _| huge), none);
        }
    }

    #[test]
    fn an_infinite_cost_forbids_its_cell() {
        let path =
            cheapest_grid_path(3, 3, |i, j| if i == 1 && j == 1 { f64::INFINITY } else { 1.0 });
        assert_eq!(path.unwrap().cost, 4.0);
    }
}
