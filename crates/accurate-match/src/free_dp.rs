use std::ops::Range;

use accurate_geom::GeomError;

use crate::cost::CostModel;
use crate::ends::not_negative;
use crate::{MAX_ALIGNMENT_BYTES, MatchError};

/// What a path pays besides the costs of its cells. Prices in the unit of the costs, usually px;
/// infinity forbids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovePrices {
    /// Factor on the cost of a cell entered by advancing both curves. 2 pays every sample of either
    /// curve once, whatever the path; 1 is ECDP.
    pub diagonal_weight: f64,
    /// Extra price of advancing one curve only.
    pub step: f64,
    /// Price of each sample left unmatched at an open end.
    pub end_skip: f64,
    /// Price of beginning a gap: a stretch inside the path that one view alone sees.
    pub gap_open: f64,
    /// Price of each sample in a gap.
    pub gap_skip: f64,
}

impl MovePrices {
    /// Corner to corner, every cell at its cost: the prices of ECDP.
    pub const ECDP: Self = Self {
        diagonal_weight: 1.0,
        step: 0.0,
        end_skip: f64::INFINITY,
        gap_open: f64::INFINITY,
        gap_skip: f64::INFINITY,
    };

    pub(crate) fn validate(&self) -> Result<(), MatchError> {
        if !(self.diagonal_weight >= 0.0 && self.diagonal_weight.is_finite()) {
            let (what, expected) = ("diagonal_weight", "0 or more, and finite");
            let value = self.diagonal_weight;
            return Err(GeomError::OutOfRange { what, value, expected }.into());
        }
        not_negative("step price", self.step)?;
        not_negative("end_skip price", self.end_skip)?;
        not_negative("gap_open price", self.gap_open)?;
        not_negative("gap_skip price", self.gap_skip)
    }
}

/// How many samples each end of each sequence may leave unmatched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpenEnds {
    /// Before the first match, in view 1.
    pub begin1: usize,
    /// After the last match, in view 1.
    pub end1: usize,
    /// Before the first match, in view 2.
    pub begin2: usize,
    /// After the last match, in view 2.
    pub end2: usize,
}

impl OpenEnds {
    /// Corner to corner.
    pub const NONE: Self = Self { begin1: 0, end1: 0, begin2: 0, end2: 0 };
    /// Any part of either sequence.
    pub const ANY: Self =
        Self { begin1: usize::MAX, end1: usize::MAX, begin2: usize::MAX, end2: usize::MAX };
}

/// The cheapest monotone path with open ends and gaps.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeAlignment {
    /// Matched cells `(i, j)` in order. A step advances one index or both by 1; across a gap one
    /// index advances by 1 and the other by more.
    pub path: Vec<(usize, usize)>,
    /// What the path costs with all prices, added up in its order.
    pub total_cost: f64,
}

/// Aligns two sequences as [`align_rows`](crate::align_rows) does, but a path may begin and end
/// inside one of them, and may leave out stretches of one of them on its way.
///
/// At each end one sequence at most is left out: the path begins in row 0 or column 0 and ends in
/// the last row or column. Inside, three states: matched, and a gap in either sequence (affine
/// price: `gap_open + gap_skip · samples`); a gap is entered from a match and left by advancing
/// both, so that two gaps never touch. `fill_row(i, row)` writes the costs of row `i`, each called
/// once, in order; costs may not be negative or NaN; infinity forbids a match.
///
/// Among equals the path prefers, going back: both advance from a match, out of a gap in view 1, out
/// of a gap in view 2; then view 1 advances, view 2 advances, the begin. Of gaps that cost the same it
/// takes the shortest, of ends the topmost in the last column, then the leftmost in the last row.
///
/// # Errors
/// As [`align_rows`](crate::align_rows), with [`MatchError::InvalidCost`] for negative costs too;
/// [`MatchError::Geometry`] for prices that are negative or NaN.
///
/// # Source
/// ACCURATE, section 2.3, recurrence of C_ij; gaps after Gotoh 1982; symmetric weights after Sakoe
/// and Chiba 1978.
///
/// # Cost
/// O(n1·n2) time, 1 byte per cell, 16 per row and 56 per column of memory.
pub fn align_free(
    n1: usize,
    n2: usize,
    mut fill_row: impl FnMut(usize, &mut [f64]),
    prices: &MovePrices,
    ends: &OpenEnds,
) -> Result<FreeAlignment, MatchError> {
    prices.validate()?;
    for (view, n) in [(1, n1), (2, n2)] {
        if n == 0 {
            return Err(MatchError::Empty { view });
        }
    }
    let fill = |i: usize, _: Range<usize>, row: &mut [f64]| fill_row(i, row);
    let cells = (n1 as u64).saturating_mul(n2 as u64);
    sweep(n1, n2, fill, prices, ends, cells, |_| 0..n2)?.ok_or(MatchError::NoFinitePath { n1, n2 })
}

/// As [`align_free`] on the table of `costs`, but only the part of it is looked at that lies near the
/// cheapest path through blocks of 8 x 8 cells: within 12 samples of it. Most often that is the cheapest
/// path.
///
/// # Errors
/// As [`align_free`]; also if no path lies there.
///
/// # Cost
/// O(n1·n2 / 64 + 32·n1) time, 1 byte of memory per cell that is looked at.
pub(crate) fn align_free_near(
    costs: &CostModel,
    prices: &MovePrices,
    ends: &OpenEnds,
) -> Result<FreeAlignment, MatchError> {
    prices.validate()?;
    let (n1, n2) = (costs.n1(), costs.n2());
    let (blocks1, blocks2) = (n1.div_ceil(BLOCK), n2.div_ceil(BLOCK));
    let [mut above, mut below] = [0, 0].map(|i| corners(costs, i));
    let fill_blocks = |i: usize, _: Range<usize>, row: &mut [f64]| {
        std::mem::swap(&mut above, &mut below);
        below = corners(costs, (i + 1) * BLOCK);
        for (j, cell) in row.iter_mut().enumerate() {
            let corners = [above[j], above[j + 1], below[j], below[j + 1]];
            let least = corners.into_iter().fold(f64::INFINITY, |least, d| least.min(d.abs()));
            let one_side = corners.iter().all(|d| *d > 0.0) || corners.iter().all(|d| *d < 0.0);
            *cell = if one_side { least } else { 0.0 };
        }
    };
    let block_ends = OpenEnds {
        begin1: ends.begin1.div_ceil(BLOCK),
        end1: ends.end1.div_ceil(BLOCK),
        begin2: ends.begin2.div_ceil(BLOCK),
        end2: ends.end2.div_ceil(BLOCK),
    };
    let no_path = MatchError::NoFinitePath { n1, n2 };
    let blocks = (blocks1 as u64).saturating_mul(blocks2 as u64);
    let coarse = sweep(blocks1, blocks2, fill_blocks, prices, &block_ends, blocks, |_| 0..blocks2)?;
    let mut near = near_path(&coarse.ok_or_else(|| no_path.clone())?.path, n1, n2);
    near[0] = 0..n2;
    let cells = near.iter().map(|columns| columns.len() as u64).sum();
    let fill = |i: usize, columns, part: &mut [f64]| costs.fill_part(i, columns, part);
    sweep(n1, n2, fill, prices, ends, cells, |i| near[i].clone())?.ok_or(no_path)
}

/// Signed costs of point `i` (the last if there are fewer) and the first point of every block, and the
/// last point.
fn corners(costs: &CostModel, i: usize) -> Vec<f64> {
    let i = i.min(costs.n1() - 1);
    let blocks = costs.n2().div_ceil(BLOCK);
    (0..=blocks).map(|j| costs.signed_cost(i, (j * BLOCK).min(costs.n2() - 1))).collect()
}

/// Side of a block, samples.
const BLOCK: usize = 8;
/// How far from its path the second look goes, samples.
const ASIDE: usize = 12;

/// By row, the columns near a path through every few samples.
fn near_path(path: &[(usize, usize)], n1: usize, n2: usize) -> Vec<Range<usize>> {
    let mut near = vec![n2..0; n1];
    let mut take = |rows: Range<usize>, columns: Range<usize>| {
        for row in &mut near[rows.start..rows.end.min(n1)] {
            let Range { start, end } = row;
            *row = columns.start.min(*start)..columns.end.min(n2).max(*end);
        }
    };
    for (k, &(i, j)) in path.iter().enumerate() {
        // To the next match, which may lie behind a gap.
        let (next_i, next_j) = path.get(k + 1).copied().unwrap_or((i, j));
        let rows = (i * BLOCK).saturating_sub(ASIDE)..next_i * BLOCK + ASIDE + 1;
        let columns = (j * BLOCK).saturating_sub(ASIDE)..next_j * BLOCK + ASIDE + 1;
        take(rows, columns);
    }
    // Ends that the path leaves out.
    if let (Some(&(i, j)), Some(&(last_i, last_j))) = (path.first(), path.last()) {
        take(0..i * BLOCK, 0..j * BLOCK + ASIDE + 1);
        take(last_i * BLOCK..n1, (last_j * BLOCK).saturating_sub(ASIDE)..n2);
    }
    near
}

/// The cheapest path through the given columns of each row, all of the first, `cells` together; if there
/// is one.
fn sweep(
    n1: usize,
    n2: usize,
    mut fill_row: impl FnMut(usize, Range<usize>, &mut [f64]),
    prices: &MovePrices,
    ends: &OpenEnds,
    cells: u64,
    columns_of: impl Fn(usize) -> Range<usize>,
) -> Result<Option<FreeAlignment>, MatchError> {
    let mut codes = Codes::with_room_for(cells, n1, n2)?;
    let gaps = (prices.gap_open + prices.gap_skip).is_finite();
    let skip = |samples: usize| if samples == 0 { 0.0 } else { samples as f64 * prices.end_skip };
    let begin = |samples: usize, free: usize| {
        if samples <= free { skip(samples) } else { f64::INFINITY }
    };
    let mut costs = vec![0.0; n2];
    // Infinite beside their columns.
    let mut above = States::new(n2);
    let mut current = States::new(n2);
    let mut best = f64::INFINITY;
    let mut last = None;
    for i in 0..n1 {
        let columns = columns_of(i);
        fill_row(i, columns.clone(), &mut costs[columns.clone()]);
        refuse_invalid(i, columns.start, &costs[columns.clone()])?;
        let row = codes.push_row(&columns);
        current.columns = columns;
        if i == 0 {
            first_row(&costs, &mut current, row, prices, gaps, |j| begin(j, ends.begin2));
        } else {
            let start = begin(i, ends.begin1);
            if gaps {
                next_row::<true>(&costs, &above, &mut current, row, prices, start);
            } else {
                next_row::<false>(&costs, &above, &mut current, row, prices, start);
            }
        }
        let mut consider = |j: usize, left_out: usize| {
            let total = current.matched[j] + skip(left_out);
            if total < best {
                (best, last) = (total, Some((i, j)));
            }
        };
        if n1 - 1 - i <= ends.end1 {
            consider(n2 - 1, n1 - 1 - i);
        }
        if i + 1 == n1 {
            let most = ends.end2.min(n2 - 1);
            (n2 - 1 - most..n2 - 1).for_each(|j| consider(j, n2 - 1 - j));
        }
        std::mem::swap(&mut above, &mut current);
        current.clear();
    }
    let found = last.filter(|_| best.is_finite());
    Ok(found.map(|last| FreeAlignment { path: codes.trace(last), total_cost: best }))
}

/// Accumulated costs of one row.
struct States {
    /// `(i, j)` is matched.
    matched: Vec<f64>,
    /// Sample `i` of view 1 lies in a gap that began after matching something with `j`.
    gap1: Vec<f64>,
    /// Sample `j` of view 2 lies in a gap that began after matching something with `i`.
    gap2: Vec<f64>,
    /// All costs are infinite elsewhere.
    columns: Range<usize>,
}

impl States {
    fn new(n2: usize) -> Self {
        let column = || vec![f64::INFINITY; n2];
        Self { matched: column(), gap1: column(), gap2: column(), columns: 0..0 }
    }

    fn clear(&mut self) {
        for costs in [&mut self.matched, &mut self.gap1, &mut self.gap2] {
            costs[self.columns.clone()].fill(f64::INFINITY);
        }
    }
}

// How a match was reached: the low 3 bits of a code.
const DIAGONAL: u8 = 0;
const UP: u8 = 1;
const LEFT: u8 = 2;
const FROM_GAP1: u8 = 3;
const FROM_GAP2: u8 = 4;
const START: u8 = 5;
const SOURCE: u8 = 7;
/// The gap in view 1 that holds this cell continues one from the row above.
const GAP1_GOES_ON: u8 = 8;
/// The gap in view 2 that holds this cell continues one from the column before.
const GAP2_GOES_ON: u8 = 16;

fn first_row(
    costs: &[f64],
    current: &mut States,
    codes: &mut [u8],
    prices: &MovePrices,
    gaps: bool,
    start: impl Fn(usize) -> f64,
) {
    for j in 0..costs.len() {
        let weighted = prices.diagonal_weight * costs[j];
        let begun = start(j) + if weighted.is_nan() { f64::INFINITY } else { weighted };
        let left = if j > 0 { current.matched[j - 1] } else { f64::INFINITY };
        let from_left = left + costs[j] + prices.step;
        (current.matched[j], codes[j]) =
            if from_left <= begun { (from_left, LEFT) } else { (begun, START) };
        if gaps && j > 0 {
            let opened = left + prices.gap_open + prices.gap_skip;
            let gone_on = current.gap2[j - 1] + prices.gap_skip;
            current.gap2[j] = if gone_on < opened {
                codes[j] |= GAP2_GOES_ON;
                gone_on
            } else {
                opened
            };
        }
    }
}

/// The columns of one row of the recurrence below the first, and their `codes`. `start` is the cost of
/// beginning in column 0.
fn next_row<const GAPS: bool>(
    costs: &[f64],
    above: &States,
    current: &mut States,
    codes: &mut [u8],
    prices: &MovePrices,
    start: f64,
) {
    let MovePrices { diagonal_weight, step, gap_open, gap_skip, .. } = *prices;
    let opening = gap_open + gap_skip;
    // 0 · inf is NaN: a forbidden cell stays forbidden at weight 0.
    let weigh = |d: f64| if d < f64::INFINITY { diagonal_weight * d } else { d };

    let Range { start: first, end } = current.columns;
    if first >= end {
        return;
    }
    let (mut left, mut left_gap2) = (f64::INFINITY, f64::INFINITY);
    // Column 0 has no column before it.
    if first == 0 {
        let begun = start + weigh(costs[0]);
        let from_up = above.matched[0] + (costs[0] + step);
        let mut code;
        (left, code) = if from_up <= begun { (from_up, UP) } else { (begun, START) };
        current.matched[0] = left;
        if GAPS {
            let (opened, gone_on) = (above.matched[0] + opening, above.gap1[0] + gap_skip);
            current.gap1[0] = if gone_on < opened { gone_on } else { opened };
            code |= if gone_on < opened { GAP1_GOES_ON } else { 0 };
            current.gap2[0] = left_gap2;
        }
        codes[0] = code;
    }
    let codes = &mut codes[first.max(1) - first..];
    let first = first.max(1);
    // Slices of one length: no bounds checks in the loop.
    let n = end - first;
    let (costs, codes) = (&costs[first..end], &mut codes[..n]);
    let (matched_before, matched_above) =
        (&above.matched[first - 1..][..n], &above.matched[first..end]);
    let (gap1_before, gap1_above) = (&above.gap1[first - 1..][..n], &above.gap1[first..end]);
    let gap2_before = &above.gap2[first - 1..][..n];
    let (matched, gap1) = (&mut current.matched[first..end], &mut current.gap1[first..end]);
    let gap2 = &mut current.gap2[first..end];
    for k in 0..n {
        let d = costs[k];
        let mut across = matched_before[k];
        let mut source = DIAGONAL;
        if GAPS {
            (across, source) = if gap1_before[k] < across {
                (gap1_before[k], FROM_GAP1)
            } else {
                (across, source)
            };
            (across, source) = if gap2_before[k] < across {
                (gap2_before[k], FROM_GAP2)
            } else {
                (across, source)
            };
        }
        across += weigh(d);
        let along = d + step;
        let from_up = matched_above[k] + along;
        let (other, other_source) = if from_up < across { (from_up, UP) } else { (across, source) };
        let from_left = left + along;
        let mut code = if from_left < other { LEFT } else { other_source };
        if GAPS {
            let (opened, gone_on) = (matched_above[k] + opening, gap1_above[k] + gap_skip);
            gap1[k] = if gone_on < opened { gone_on } else { opened };
            code |= if gone_on < opened { GAP1_GOES_ON } else { 0 };
            let (opened, gone_on) = (left + opening, left_gap2 + gap_skip);
            left_gap2 = if gone_on < opened { gone_on } else { opened };
            code |= if gone_on < opened { GAP2_GOES_ON } else { 0 };
            gap2[k] = left_gap2;
        }
        left = if from_left < other { from_left } else { other };
        matched[k] = left;
        codes[k] = code;
    }
}

/// Costs of row `i` from a column on.
fn refuse_invalid(i: usize, first: usize, costs: &[f64]) -> Result<(), MatchError> {
    let valid = |d: &f64| *d >= 0.0;
    if costs.iter().fold(true, |all, d| all & valid(d)) {
        return Ok(());
    }
    match costs.iter().enumerate().find(|(_, d)| !valid(d)) {
        Some((j, &value)) => Err(MatchError::InvalidCost { i, j: first + j, value }),
        None => Ok(()),
    }
}

/// How each cell that is looked at was reached, one byte per cell.
struct Codes {
    bytes: Vec<u8>,
    /// Of each row, where it begins among the bytes, and with which column.
    rows: Vec<(usize, usize)>,
}

impl Codes {
    fn with_room_for(cells: u64, n1: usize, n2: usize) -> Result<Self, MatchError> {
        let (rows, columns) = ((n1 as u64).saturating_mul(16), (n2 as u64).saturating_mul(56));
        let bytes = cells.saturating_add(rows).saturating_add(columns);
        if bytes > MAX_ALIGNMENT_BYTES {
            return Err(MatchError::TooLarge { n1, n2, bytes, limit_bytes: MAX_ALIGNMENT_BYTES });
        }
        let refused = MatchError::OutOfMemory { n1, n2, bytes };
        let Ok(room) = usize::try_from(cells) else { return Err(refused) };
        let mut table = Vec::new();
        table.try_reserve_exact(room).map_err(|_| refused)?;
        Ok(Self { bytes: table, rows: Vec::with_capacity(n1) })
    }

    fn push_row(&mut self, columns: &Range<usize>) -> &mut [u8] {
        let from = self.bytes.len();
        self.rows.push((from, columns.start));
        self.bytes.resize(from + columns.len(), START);
        &mut self.bytes[from..]
    }

    fn get(&self, i: usize, j: usize) -> u8 {
        let (from, first) = self.rows[i];
        self.bytes[from + j - first]
    }

    fn trace(&self, last: (usize, usize)) -> Vec<(usize, usize)> {
        let (mut i, mut j) = last;
        let mut path = Vec::new();
        // A source is written only where its cost was finite, hence reached: no index passes 0.
        loop {
            path.push((i, j));
            match self.get(i, j) & SOURCE {
                DIAGONAL => (i, j) = (i - 1, j - 1),
                UP => i -= 1,
                LEFT => j -= 1,
                FROM_GAP1 => {
                    (i, j) = (i - 1, j - 1);
                    while self.get(i, j) & GAP1_GOES_ON != 0 {
                        i -= 1;
                    }
                    i -= 1;
                }
                FROM_GAP2 => {
                    (i, j) = (i - 1, j - 1);
                    while self.get(i, j) & GAP2_GOES_ON != 0 {
                        j -= 1;
                    }
                    j -= 1;
                }
                _ => break,
            }
        }
        path.reverse();
        path
    }
}
