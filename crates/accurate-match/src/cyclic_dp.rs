use crate::{MAX_ALIGNMENT_BYTES, MatchError, MovePrices};

/// The cheapest closed monotone path through the costs of two closed sequences.
#[derive(Debug, Clone, PartialEq)]
pub struct CyclicAlignment {
    /// Matched cells `(i, j)`, from a cell in row 0 once around both sequences. Every step, also the
    /// one from the last cell back to the first, advances one index or both by 1, with `n1 - 1`
    /// followed by 0 and `n2 - 1` by 0.
    pub path: Vec<(usize, usize)>,
    /// Sum over all steps, the closing one included.
    pub total_cost: f64,
}

/// Aligns two closed sequences of `n1` and `n2` elements: the least cost over all monotone paths
/// that go around both exactly once, wherever they begin.
///
/// Of `prices`, only `diagonal_weight` and `step` count. Cutting either sequence elsewhere changes
/// the cost by no more than the order of summation. `cost(i, j)` is asked once per cell.
///
/// # Errors
/// As [`align_free`](crate::align_free).
///
/// # Source
/// Two cheapest paths with different begins need not cross; so the path that begins half way
/// between two known ones lies between them (Maes 1990, for strings). The closing step makes the
/// cost independent of where both sequences are cut.
///
/// # Cost
/// O(n1·n2·log n2) time, 9 bytes per cell of memory; up to O(n1·n2²) time where infinite costs forbid
/// many beginnings.
pub fn align_cyclic(
    n1: usize,
    n2: usize,
    cost: impl Fn(usize, usize) -> f64,
    prices: &MovePrices,
) -> Result<CyclicAlignment, MatchError> {
    let track = cyclic_track(n1, n2, cost, prices)?;
    let mut path: Vec<_> = track.cells.iter().map(|&(i, j)| (i % n1, j % n2)).collect();
    path.pop(); // the first cell again
    Ok(CyclicAlignment { path, total_cost: track.total })
}

/// The path of [`align_cyclic`], unrolled.
pub(crate) fn cyclic_track(
    n1: usize,
    n2: usize,
    cost: impl Fn(usize, usize) -> f64,
    prices: &MovePrices,
) -> Result<Track, MatchError> {
    prices.validate()?;
    for (view, n) in [(1, n1), (2, n2)] {
        if n == 0 {
            return Err(MatchError::Empty { view });
        }
    }
    let grid = Grid::new(n1, n2, cost, prices)?;
    // From (0, 0) every path stays in columns 0..=n2.
    let first = grid.cheapest(0, &vec![0; n1 + 1], &vec![n2; n1 + 1]);
    let mut best = (0, first.clone());
    if let Some(first) = first {
        let shifted = first.shifted(n2);
        let mut between = vec![(0, first, n2, shifted)];
        while let Some((from, lower, to, upper)) = between.pop() {
            let begin = usize::midpoint(from, to);
            if begin == from {
                continue;
            }
            let Some(path) = grid.cheapest(begin, &lower.first, &upper.last) else {
                between.push((begin, lower.clone(), to, upper.clone()));
                between.push((from, lower, begin, upper));
                continue;
            };
            // The least begin wins among equals, in whatever order they are visited.
            let better = best
                .1
                .as_ref()
                .is_none_or(|b| path.total < b.total || path.total == b.total && begin < best.0);
            if better {
                best = (begin, Some(path.clone()));
            }
            between.push((begin, path.clone(), to, upper));
            between.push((from, lower, begin, path));
        }
    } else {
        // The begin 0 is forbidden: there is no path to divide by.
        for begin in 1..n2 {
            let (low, high) = (vec![begin; n1 + 1], vec![begin + n2; n1 + 1]);
            let path = grid.cheapest(begin, &low, &high);
            let total = |p: &Option<Track>| p.as_ref().map_or(f64::INFINITY, |p| p.total);
            if total(&path) < total(&best.1) {
                best = (begin, path);
            }
        }
    }
    best.1.ok_or(MatchError::NoFinitePath { n1, n2 })
}

/// Costs of the plane that both closed sequences unroll to: rows `0..=n1`, columns `0..=2 n2`.
struct Grid<'a> {
    n1: usize,
    n2: usize,
    costs: Vec<f64>,
    prices: &'a MovePrices,
}

/// A path from `(0, begin)` to `(n1, begin + n2)`.
#[derive(Debug, Clone)]
pub(crate) struct Track {
    pub(crate) cells: Vec<(usize, usize)>,
    /// First and last column of the path in each row.
    first: Vec<usize>,
    last: Vec<usize>,
    pub(crate) total: f64,
}

impl Track {
    fn shifted(&self, by: usize) -> Self {
        let shift = |columns: &[usize]| columns.iter().map(|j| j + by).collect();
        let cells = self.cells.iter().map(|&(i, j)| (i, j + by)).collect();
        Self { cells, first: shift(&self.first), last: shift(&self.last), total: self.total }
    }
}

const DIAGONAL: u8 = 0;
const UP: u8 = 1;
const LEFT: u8 = 2;

impl<'a> Grid<'a> {
    fn new(
        n1: usize,
        n2: usize,
        cost: impl Fn(usize, usize) -> f64,
        prices: &'a MovePrices,
    ) -> Result<Self, MatchError> {
        let cells = (n1 as u64).saturating_mul(n2 as u64);
        let bytes = cells.saturating_mul(9);
        if bytes > MAX_ALIGNMENT_BYTES {
            return Err(MatchError::TooLarge { n1, n2, bytes, limit_bytes: MAX_ALIGNMENT_BYTES });
        }
        let refused = MatchError::OutOfMemory { n1, n2, bytes };
        let Ok(room) = usize::try_from(cells) else { return Err(refused) };
        let mut costs = Vec::new();
        costs.try_reserve_exact(room).map_err(|_| refused)?;
        for i in 0..n1 {
            for j in 0..n2 {
                let value = cost(i, j);
                if !(value >= 0.0) {
                    return Err(MatchError::InvalidCost { i, j, value });
                }
                costs.push(value);
            }
        }
        Ok(Self { n1, n2, costs, prices })
    }

    /// The cheapest path that begins in column `begin` and keeps to columns `low[i]..=high[i]` in
    /// row `i`; `None` if all are forbidden.
    fn cheapest(&self, begin: usize, low: &[usize], high: &[usize]) -> Option<Track> {
        let (n1, n2) = (self.n1, self.n2);
        let range = |i: usize| (low[i].max(begin), high[i].min(begin + n2));
        let MovePrices { diagonal_weight, step, .. } = *self.prices;
        let mut codes: Vec<Vec<u8>> = Vec::with_capacity(n1 + 1);
        let mut above: (usize, Vec<f64>) = (0, Vec::new());
        for i in 0..=n1 {
            let (from, to) = range(i);
            let row = &self.costs[(i % n1) * n2..][..n2];
            let mut totals = Vec::with_capacity(to + 1 - from);
            let mut codes_of_row = Vec::with_capacity(to + 1 - from);
            let at_above = |j: usize| match j.checked_sub(above.0) {
                Some(k) => above.1.get(k).copied().unwrap_or(f64::INFINITY),
                None => f64::INFINITY,
            };
            let mut left = f64::INFINITY;
            let mut diagonal = if from > 0 { at_above(from - 1) } else { f64::INFINITY };
            for j in from..=to {
                let up = at_above(j);
                let d = row[if j >= 2 * n2 {
                    j - 2 * n2
                } else if j >= n2 {
                    j - n2
                } else {
                    j
                }];
                let mut total = 0.0;
                let mut code = UP;
                if (i, j) != (0, begin) {
                    let weighted = if d < f64::INFINITY { diagonal_weight * d } else { d };
                    (total, code) = (diagonal + weighted, DIAGONAL);
                    if up + (d + step) < total {
                        (total, code) = (up + (d + step), UP);
                    }
                    if left + (d + step) < total {
                        (total, code) = (left + (d + step), LEFT);
                    }
                }
                totals.push(total);
                codes_of_row.push(code);
                (left, diagonal) = (total, up);
            }
            codes.push(codes_of_row);
            above = (from, totals);
        }
        let total = above.1.last().copied().filter(|total| total.is_finite())?;
        let (mut i, mut j) = (n1, begin + n2);
        let mut cells = vec![(i, j)];
        let mut first = vec![usize::MAX; n1 + 1];
        let mut last = vec![0; n1 + 1];
        loop {
            first[i] = first[i].min(j);
            last[i] = last[i].max(j);
            if (i, j) == (0, begin) {
                break;
            }
            match codes[i][j - range(i).0] {
                UP => i -= 1,
                LEFT => j -= 1,
                _ => (i, j) = (i - 1, j - 1),
            }
            cells.push((i, j));
        }
        cells.reverse();
        Some(Track { cells, first, last, total })
    }
}
