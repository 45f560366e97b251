use crate::MatchError;

/// Most bytes of working memory an alignment may ask for: 4 GiB, about 130 000 x 130 000 points.
pub const MAX_ALIGNMENT_BYTES: u64 = 4 << 30;

/// Which predecessor wins when several cost the same. Any order gives the same total cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum TieOrder {
    /// `(i-1, j)`, then `(i, j-1)`, then `(i-1, j-1)`: the order behind the published numbers (the
    /// paper's text leaves it open). Ties lengthen the path.
    UpLeftDiagonal,
    /// `(i-1, j-1)`, then `(i-1, j)`, then `(i, j-1)`: ties shorten the path.
    #[default]
    DiagonalFirst,
}

/// The cheapest monotone path through a cost matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// Cells `(i, j)` from `(0, 0)` to `(n1 - 1, n2 - 1)`; every step advances one index or both
    /// by 1.
    pub path: Vec<(usize, usize)>,
    /// Sum of the costs along `path`, added up in its order.
    pub total_cost: f64,
}

impl Alignment {
    /// Mean cost of a cell of the path: well below a pixel for curves that belong together, large
    /// when one of them runs the wrong way or along another branch.
    pub fn mean_cost(&self) -> f64 {
        self.total_cost / self.path.len() as f64
    }
}

/// Aligns two sequences of `n1` and `n2` elements at the least total cost, corner to corner.
///
/// `cost(i, j)` is the cost of matching element `i` of the first with element `j` of the second,
/// rows and columns from 0; it is asked once per cell. Plus infinity forbids a cell. See
/// [`align_rows`] for errors, source and cost.
///
/// # Errors
/// As [`align_rows`].
///
/// # Examples
/// ```
/// use accurate_match::{TieOrder, align};
///
/// let (a, b) = ([0.0_f64, 1.0, 2.0], [0.0_f64, 2.0]);
/// let alignment = align(3, 2, |i, j| (a[i] - b[j]).abs(), TieOrder::DiagonalFirst)?;
/// assert_eq!(alignment.path, [(0, 0), (1, 0), (2, 1)]);
/// assert_eq!(alignment.total_cost, 1.0);
/// # Ok::<(), accurate_match::MatchError>(())
/// ```
pub fn align(
    n1: usize,
    n2: usize,
    cost: impl Fn(usize, usize) -> f64,
    ties: TieOrder,
) -> Result<Alignment, MatchError> {
    let fill_row = |i: usize, row: &mut [f64]| {
        for (j, d) in row.iter_mut().enumerate() {
            *d = cost(i, j);
        }
    };
    align_rows(n1, n2, fill_row, ties)
}

/// As [`align`], with the costs handed over row by row: `fill_row(i, row)` writes the `n2` costs
/// of row `i`, and is called once for each row in order. This is the fast way when a row can be
/// computed in one sweep.
///
/// `C_00 = D_00`; first row and column are cumulative sums; elsewhere
/// `C_ij = D_ij + min(C_{i-1,j}, C_{i,j-1}, C_{i-1,j-1})`. Neither `D` nor `C` is stored.
///
/// # Errors
/// - [`MatchError::Empty`] if `n1` or `n2` is 0.
/// - [`MatchError::TooLarge`] beyond [`MAX_ALIGNMENT_BYTES`], [`MatchError::OutOfMemory`] if the
///   system has less; both before the first cost is asked for.
/// - [`MatchError::InvalidCost`] if a cost is NaN or minus infinity.
/// - [`MatchError::NoFinitePath`] if every path is forbidden, or the sum overflows.
///
/// # Source
/// ACCURATE, section 2.3, recurrence of C_ij. The paper does not say where the path ends: here, as
/// in its published results, in the far corner.
///
/// # Cost
/// O(n1·n2) time; 2 bits per cell and 25 bytes per column of memory. Iterative: long curves cannot
/// overflow the stack.
pub fn align_rows(
    n1: usize,
    n2: usize,
    mut fill_row: impl FnMut(usize, &mut [f64]),
    ties: TieOrder,
) -> Result<Alignment, MatchError> {
    for (view, n) in [(1, n1), (2, n2)] {
        if n == 0 {
            return Err(MatchError::Empty { view });
        }
    }
    let mut back = BackPointers::with_room_for(n1, n2)?;
    let accumulate = match ties {
        TieOrder::UpLeftDiagonal => accumulate_row::<false>,
        TieOrder::DiagonalFirst => accumulate_row::<true>,
    };
    let mut costs = vec![0.0; n2];
    let mut codes = vec![LEFT; n2];
    let mut above = vec![0.0; n2];
    let mut current = vec![0.0; n2];
    for i in 0..n1 {
        fill_row(i, &mut costs);
        refuse_invalid(i, &costs)?;
        if i == 0 {
            let mut sum = 0.0;
            for (c, d) in current.iter_mut().zip(&costs) {
                sum += d;
                *c = sum;
            }
        } else {
            accumulate(&costs, &above, &mut current, &mut codes);
        }
        back.push_row(&codes);
        std::mem::swap(&mut above, &mut current);
    }
    // The last finished row was swapped into `above`.
    let total_cost = above[n2 - 1];
    if !total_cost.is_finite() {
        return Err(MatchError::NoFinitePath { n1, n2 });
    }
    Ok(Alignment { path: back.trace(n1, n2), total_cost })
}

const UP: u8 = 0;
const LEFT: u8 = 1;
const DIAGONAL: u8 = 2;

/// One row of the recurrence. All slices have the length of the row.
fn accumulate_row<const DIAGONAL_FIRST: bool>(
    costs: &[f64],
    above: &[f64],
    current: &mut [f64],
    codes: &mut [u8],
) {
    let mut diagonal = above[0];
    let mut left = costs[0] + above[0];
    current[0] = left;
    codes[0] = UP;
    let cells = costs[1..].iter().zip(&above[1..]);
    for ((&d, &up), (c, code)) in cells.zip(current[1..].iter_mut().zip(&mut codes[1..])) {
        // Only `left` depends on the cell before: the choice between the other two is made first,
        // off the critical path, and `left` is compared with its winner alone.
        let (other, other_code, left_wins);
        if DIAGONAL_FIRST {
            (other, other_code) = if up < diagonal { (up, UP) } else { (diagonal, DIAGONAL) };
            left_wins = left < other;
        } else {
            let diagonal_wins = diagonal < up;
            (other, other_code) = if diagonal_wins { (diagonal, DIAGONAL) } else { (up, UP) };
            left_wins = (left < other) | (diagonal_wins & (left == other));
        }
        *code = if left_wins { LEFT } else { other_code };
        left = d + if left < other { left } else { other };
        *c = left;
        diagonal = up;
    }
}

fn refuse_invalid(i: usize, costs: &[f64]) -> Result<(), MatchError> {
    let valid = |d: &f64| *d > f64::NEG_INFINITY;
    // One branch per row, not per cell.
    if costs.iter().fold(true, |all, d| all & valid(d)) {
        return Ok(());
    }
    match costs.iter().enumerate().find(|(_, d)| !valid(d)) {
        Some((j, &value)) => Err(MatchError::InvalidCost { i, j, value }),
        None => Ok(()),
    }
}

/// The predecessor of every cell in 2 bits, four cells to a byte, rows padded to whole bytes.
struct BackPointers {
    bytes: Vec<u8>,
    row_bytes: usize,
}

impl BackPointers {
    fn with_room_for(n1: usize, n2: usize) -> Result<Self, MatchError> {
        let row_bytes = n2.div_ceil(4);
        let table = (n1 as u64).saturating_mul(row_bytes as u64);
        // Costs and two rows of C in 8 bytes, unpacked codes in 1.
        let bytes = table.saturating_add((n2 as u64).saturating_mul(25));
        if bytes > MAX_ALIGNMENT_BYTES {
            return Err(MatchError::TooLarge { n1, n2, bytes, limit_bytes: MAX_ALIGNMENT_BYTES });
        }
        let refused = MatchError::OutOfMemory { n1, n2, bytes };
        let Ok(room) = usize::try_from(table) else { return Err(refused) };
        let mut table = Vec::new();
        table.try_reserve_exact(room).map_err(|_| refused)?;
        Ok(Self { bytes: table, row_bytes })
    }

    fn push_row(&mut self, codes: &[u8]) {
        let pack = |four: &[u8]| four.iter().rev().fold(0, |byte, code| byte << 2 | code);
        self.bytes.extend(codes.chunks(4).map(pack));
    }

    fn get(&self, i: usize, j: usize) -> u8 {
        self.bytes[i * self.row_bytes + j / 4] >> (2 * (j % 4)) & 3
    }

    fn trace(&self, n1: usize, n2: usize) -> Vec<(usize, usize)> {
        let (mut i, mut j) = (n1 - 1, n2 - 1);
        let mut path = Vec::with_capacity(n1 + n2 - 1);
        path.push((i, j));
        // Row 0 points left and column 0 up, so neither index can pass 0.
        while (i, j) != (0, 0) {
            match self.get(i, j) {
                UP => i -= 1,
                LEFT => j -= 1,
                _ => (i, j) = (i - 1, j - 1),
            }
            path.push((i, j));
        }
        path.reverse();
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_survive_packing_for_every_row_length() {
        for n2 in 1..=9 {
            let mut back = BackPointers::with_room_for(3, n2).unwrap();
            let rows: Vec<Vec<u8>> =
                (0..3).map(|i| (0..n2).map(|j| ((i + 2 * j) % 3) as u8).collect()).collect();
            for row in &rows {
                back.push_row(row);
            }
            assert_eq!(back.bytes.len(), 3 * n2.div_ceil(4));
            for (i, row) in rows.iter().enumerate() {
                for (j, &code) in row.iter().enumerate() {
                    assert_eq!(back.get(i, j), code);
                }
            }
        }
    }
}
