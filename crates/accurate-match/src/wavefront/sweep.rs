use std::ops::Range;

use super::costs::{Columns, MARGIN, VectorCost, Windowed};
use super::lanes::Lanes;
use crate::TieOrder;

/// Vectors of rows in flight: enough independent work to hide the latency of one.
const VECTORS: usize = 4;

/// How many columns pass between two looks at whether anything is still alive.
const LOOK_EVERY: usize = 16;

/// Where the sweep stands: the last finished row.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    /// The next row.
    pub row: usize,
    /// `C` of the row above it; infinite outside of `live`. Longer than the row by a margin.
    pub values: Vec<f64>,
    /// Columns outside of which nothing in the row above is at or below the bound.
    pub live: Range<usize>,
}

impl Edge {
    pub fn before_the_first_row(n2: usize) -> Self {
        let values = vec![f64::INFINITY; n2 + MARGIN];
        Self { row: 0, values, live: 0..0 }
    }
}

/// The back-pointers of some bands, as two bits per cell: is the first, is the second predecessor
/// of the tie order as cheap as the cheapest.
#[derive(Debug, Default)]
pub(super) struct Record {
    bits: Vec<u8>,
    bands: Vec<Band>,
}

impl Record {
    /// Room for all cells of `rows` rows. Memory that stays untouched costs nothing.
    pub fn of_rows(rows: usize, n2: usize) -> Self {
        let bands = rows.div_ceil(MARGIN);
        let bits = Vec::with_capacity(bands * (n2 + MARGIN) * (MARGIN / 4));
        Self { bits, bands: Vec::new() }
    }

    /// Forgets the bands and keeps their memory.
    pub fn clear(&mut self) {
        self.bits.clear();
        self.bands.clear();
    }
}

#[derive(Debug, Clone, Copy)]
struct Band {
    row: usize,
    first_column: usize,
    /// Where its bits begin.
    offset: usize,
}

/// The recurrence `C_ij = D_ij + min(C_{i-1,j}, C_{i,j-1}, C_{i-1,j-1})` over bands of rows.
///
/// A band's rows are the lanes of a few vectors; at step `t` row `r` of the band is at column
/// `first + t - r`, so that all its cells of a step are independent. `C` is computed by the very
/// operations of the plain kernel, in their order: the same bits.
///
/// Cells above `bound` are left out where a whole step of the band is. Costs are not negative and
/// rounding is monotone, so `C` never falls along a path: if the optimum is at or below `bound`,
/// then so is every cell on the path to it, none of them is left out, and nothing that is left out
/// would have been taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sweep<'a, S> {
    pub simd: S,
    pub columns: &'a Columns,
    pub ties: TieOrder,
    pub bound: f64,
}

impl<S: Lanes> Sweep<'_, S> {
    /// Rows in a band.
    pub const ROWS: usize = VECTORS * S::F64_LANES;

    /// Advances `edge` to row `end`, which is a multiple of [`ROWS`](Self::ROWS) or `n1`. Returns
    /// the cost of the last column of row `end - 1`, infinite if that was left out.
    #[inline(always)]
    pub fn advance<C: VectorCost<S>>(
        &self,
        edge: &mut Edge,
        end: usize,
        mut record: Option<&mut Record>,
    ) -> f64 {
        let mut last = f64::INFINITY;
        while edge.row < end {
            last = match (record.as_deref_mut(), self.ties) {
                (None, _) => self.band::<C, false, false>(edge, &mut Record::default()),
                (Some(record), TieOrder::UpLeftDiagonal) => {
                    self.band::<C, true, false>(edge, record)
                }
                (Some(record), TieOrder::DiagonalFirst) => self.band::<C, true, true>(edge, record),
            };
            if edge.live.is_empty() {
                return f64::INFINITY;
            }
        }
        last
    }

    #[inline(always)]
    fn band<C: VectorCost<S>, const RECORD: bool, const DIAGONAL_FIRST: bool>(
        &self,
        edge: &mut Edge,
        record: &mut Record,
    ) -> f64 {
        let Self { simd, columns, bound, .. } = *self;
        let (n1, n2) = (columns.n1, columns.n2);
        let rows_here = (n1 - edge.row).min(Self::ROWS);
        let first = edge.live.start;
        // The last step at which the band's last row is inside.
        let most_steps = n2 - first + rows_here - 1;
        let step_bytes = Self::ROWS / 4;
        let offset = record.bits.len();
        if RECORD {
            record.bands.push(Band { row: edge.row, first_column: first, offset });
            record.bits.resize(offset + most_steps * step_bytes, 0);
        }

        let mut rows = [C::rows(simd, columns, edge.row); VECTORS];
        for v in 1..VECTORS {
            rows[v] = C::rows(simd, columns, edge.row + v * S::F64_LANES);
        }
        // Before its first column a row is infinite, and stays so: what it sees is infinite.
        let infinite = simd.splat_f64s(f64::INFINITY);
        let mut now = [infinite; VECTORS];
        let mut above_before = now;
        let corner = match (edge.row, first) {
            (0, _) => 0.0, // C_00 = D_00
            (_, 0) => f64::INFINITY,
            _ => edge.values[first - 1],
        };
        above_before[0] = simd.shifted_down(simd.splat_f64s(corner), infinite);
        let mut taken = most_steps;
        let mut at = columns.position(first);
        let needed = C::needed(columns);
        let bits = if RECORD { &mut record.bits[offset..] } else { &mut [] };
        let values = &mut edge.values[first..];
        for t in 0..most_steps {
            let mut neighbour = simd.splat_f64s(values[t]);
            let out = if RECORD { &mut bits[t * step_bytes..][..step_bytes] } else { &mut [] };
            let seen = needed.seen(at);
            for v in 0..VECTORS {
                let left = now[v];
                let up = simd.shifted_down(neighbour, left);
                neighbour = left;
                let diagonal = above_before[v];
                above_before[v] = up;
                let least = simd.min_f64s(simd.min_f64s(up, diagonal), left);
                let cost = C::cost(simd, seen, &rows[v], v * S::F64_LANES);
                now[v] = simd.add_f64s(cost, least);
                if RECORD {
                    let (one, two) = if DIAGONAL_FIRST { (diagonal, up) } else { (up, left) };
                    let (one, two) = (simd.equal_bits(one, least), simd.equal_bits(two, least));
                    if S::F64_LANES == 8 {
                        out[2 * v] = one;
                        out[2 * v + 1] = two;
                    } else {
                        out[v] = one | two << 4;
                    }
                }
            }
            at -= 1;
            if t + 1 >= Self::ROWS {
                values[t + 1 - Self::ROWS] = simd.last(now[VECTORS - 1]);
            }
            if t.is_multiple_of(LOOK_EVERY) && first + t >= edge.live.end && first + t < n2 && t > 0
            {
                let mut all = infinite;
                for v in 0..VECTORS {
                    all = simd.min_f64s(all, simd.min_f64s(now[v], above_before[v]));
                }
                if simd.reduce_min_f64s(all) > bound {
                    taken = t + 1;
                    break;
                }
            }
        }
        if RECORD {
            record.bits.truncate(offset + taken * step_bytes);
        }
        let reached_the_end = taken == most_steps;
        let last_vector = (rows_here - 1) / S::F64_LANES;
        let lanes = pulp::bytemuck::cast_slice::<S::f64s, f64>(&now[last_vector..=last_vector]);
        let last =
            if reached_the_end { lanes[(rows_here - 1) % S::F64_LANES] } else { f64::INFINITY };
        // What the last row has not reached is above the bound.
        let written = (first + (taken + 1).saturating_sub(Self::ROWS)).min(n2);
        let old_end = edge.live.end.max(written);
        edge.values[written..old_end].fill(f64::INFINITY);
        let alive = |c: &f64| *c <= bound;
        let row = &edge.values[first..written];
        let (start, end) = match (row.iter().position(alive), row.iter().rposition(alive)) {
            (Some(start), Some(end)) => (first + start, first + end + 1),
            _ => (first, first),
        };
        if rows_here == Self::ROWS {
            edge.values[first..start].fill(f64::INFINITY);
            edge.values[end..written].fill(f64::INFINITY);
            edge.live = start..end;
        } else {
            // The last band of all: no row follows.
            edge.live = 0..1;
        }
        edge.row += rows_here;
        last
    }

    /// Follows the path backwards from `cell` to the first row on record, pushing every further
    /// cell. Returns the last one, which is above the record or `(0, 0)`.
    pub fn trace(
        &self,
        record: &Record,
        mut cell: (usize, usize),
        path: &mut Vec<(usize, usize)>,
    ) -> (usize, usize) {
        for band in record.bands.iter().rev() {
            while cell.0 >= band.row && cell != (0, 0) {
                let (i, j) = cell;
                let r = i - band.row;
                let t = j + r - band.first_column;
                let (vector, lane) = (r / S::F64_LANES, r % S::F64_LANES);
                let bit = |at: usize| {
                    record.bits[band.offset + t * (Self::ROWS / 4) + at / 8] >> (at % 8) & 1 == 1
                };
                let at = vector * 2 * S::F64_LANES + lane;
                let (one, two) = (bit(at), bit(at + S::F64_LANES));
                cell = match (self.ties, one, two) {
                    (TieOrder::UpLeftDiagonal, true, _)
                    | (TieOrder::DiagonalFirst, false, true) => (i - 1, j),
                    (TieOrder::UpLeftDiagonal, false, true)
                    | (TieOrder::DiagonalFirst, false, false) => (i, j - 1),
                    _ => (i - 1, j - 1),
                };
                path.push(cell);
            }
        }
        cell
    }
}
