//! The fast kernel of the corner-to-corner alignment: vectors of rows, packed back-pointers, cells
//! that cannot matter left out. The same path and the same total cost as
//! [`align_rows`](crate::align_rows), bit by bit.

mod costs;
mod lanes;
mod sweep;

use pulp::{NullaryFnOnce, Scalar256b};

use crate::dp::align_rows;
use crate::{Alignment, CostModel, DistanceKind, MAX_ALIGNMENT_BYTES, MatchError, TieOrder};
use costs::{Columns, InBothViews, InView1, InView2, Sampson, VectorCost};
use lanes::Lanes;
use sweep::{Edge, Record, Sweep};

/// Up to this many bytes of back-pointers are kept at once (16 384 x 16 384 points take 64 MiB).
const RECORD_BYTES: usize = 72 << 20;

/// From this many cells on, a look at every few points first pays.
const PRUNE_CELLS: usize = 1 << 16;

/// The look takes at least every 8th point of both curves, and at most about this many.
const COARSE_POINTS: usize = 1024;

/// A bound that proved too low is raised so much, so many times; then there is none.
const RAISE: f64 = 4.0;
const RAISES: usize = 2;

/// The cheapest monotone path through a cost model, corner to corner: what
/// [`align_rows`](crate::align_rows) gives for the rows of `costs`, bit by bit, in a fraction of the
/// time.
///
/// The vectors are those of the machine at hand (AVX-512, AVX2, else portable); the answer does not
/// depend on them. Cells that cost more than the optimum are left out as far as they are whole
/// stretches of a row, so curves that belong together take far less than the full table. A model
/// with a ray seen end on, or with numbers beyond 1e120, goes to `align_rows`.
///
/// # Errors
/// As [`align_rows`](crate::align_rows); the memory limit is reached later.
///
/// # Cost
/// O(n1·n2) time at worst; 2 bits per visited cell of memory up to 72 MiB, beyond that
/// O(sqrt(n1)·n2) memory and up to twice the time: rows in between are kept, and the table between
/// two of them is computed again for the path.
pub fn align_curves(costs: &CostModel, ties: TieOrder) -> Result<Alignment, MatchError> {
    align_within(costs, ties, Machine::detect(), RECORD_BYTES, Prune::Yes)
}

/// Whether cells may be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Prune {
    Yes,
    #[cfg(test)]
    No,
}

/// The instruction sets there are kernels for.
#[derive(Debug, Clone, Copy)]
enum Machine {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    Portable,
}

impl Machine {
    fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if let Some(simd) = pulp::x86::V4::try_new() {
                return Self::Avx512(simd);
            }
            if let Some(simd) = pulp::x86::V3::try_new() {
                return Self::Avx2(simd);
            }
        }
        Self::Portable
    }
}

fn align_within(
    costs: &CostModel,
    ties: TieOrder,
    machine: Machine,
    record_bytes: usize,
    prune: Prune,
) -> Result<Alignment, MatchError> {
    let (n1, n2) = (costs.n1(), costs.n2());
    let Some(columns) = Columns::of(costs, 1) else {
        return align_rows(n1, n2, |i, row| costs.fill_row(i, row), ties);
    };
    let plan = Plan::new(n1, n2, record_bytes)?;
    let mut bound = f64::INFINITY;
    if prune == Prune::Yes && n1.saturating_mul(n2) > PRUNE_CELLS {
        let stride = n1.max(n2).div_ceil(COARSE_POINTS).max(8);
        if let Some(coarse) = Columns::of(costs, stride) {
            let plan = Plan { block_rows: coarse.n1.next_multiple_of(BAND) };
            let sweep = Job { columns: &coarse, ties, bound, plan, path: false };
            if let Some(found) = machine.run(sweep) {
                // A path of every few points costs about that part of the whole: a good guess that
                // need not be right. Plus a thousandth of a pixel per step, for exact data.
                bound = found.total_cost * stride as f64 + 1e-3 * (n1 + n2) as f64;
            }
        }
    }
    for raise in 0..=RAISES {
        if raise == RAISES {
            bound = f64::INFINITY;
        }
        let job = Job { columns: &columns, ties, bound, plan, path: true };
        match machine.run(job) {
            Some(found) if found.total_cost <= bound => return Ok(found),
            _ => bound *= RAISE,
        }
    }
    Err(MatchError::NoFinitePath { n1, n2 })
}

/// Rows of the widest band: blocks are whole bands on every machine.
const BAND: usize = costs::MARGIN;

/// How the table is cut to fit the memory.
#[derive(Debug, Clone, Copy)]
struct Plan {
    /// Rows whose back-pointers are kept at once.
    block_rows: usize,
}

impl Plan {
    fn new(n1: usize, n2: usize, record_bytes: usize) -> Result<Self, MatchError> {
        let row_bytes = (n2 as u64 + BAND as u64).div_ceil(4);
        let all_rows = (n1 as u64).next_multiple_of(BAND as u64);
        let whole = all_rows.saturating_mul(row_bytes);
        // Costs take 14 numbers per point, a row of C one per column.
        let fixed = 112 * (n1 as u64).saturating_add(n2 as u64);
        let mut rows = all_rows;
        let mut bytes = whole;
        if whole > record_bytes as u64 {
            // b rows on record and n1/b rows kept: b·n2/4 = n1/b·8·n2 bytes.
            let balanced = (32.0 * n1 as f64).sqrt() as u64;
            rows = balanced.next_multiple_of(BAND as u64).min(all_rows);
            let kept = (n1 as u64).div_ceil(rows).saturating_mul((n2 as u64).saturating_mul(8));
            bytes = rows.saturating_mul(row_bytes).saturating_add(kept);
        }
        let bytes = bytes.saturating_add(fixed);
        if bytes > MAX_ALIGNMENT_BYTES {
            return Err(MatchError::TooLarge { n1, n2, bytes, limit_bytes: MAX_ALIGNMENT_BYTES });
        }
        Ok(Self { block_rows: rows as usize })
    }
}

/// One alignment to run on some machine.
#[derive(Debug, Clone, Copy)]
struct Job<'a> {
    columns: &'a Columns,
    ties: TieOrder,
    bound: f64,
    plan: Plan,
    /// Whether the path is wanted; else it is left empty.
    path: bool,
}

impl Machine {
    /// `None` if nothing at or below the bound reaches the corner.
    fn run(self, job: Job<'_>) -> Option<Alignment> {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => simd.vectorize(On { simd, job }),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => simd.vectorize(On { simd, job }),
            Self::Portable => On { simd: Scalar256b, job }.call(),
        }
    }
}

struct On<'a, S> {
    simd: S,
    job: Job<'a>,
}

impl<S: Lanes> NullaryFnOnce for On<'_, S> {
    type Output = Option<Alignment>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        match self.job.columns.kind {
            DistanceKind::View1 => self.align::<InView1>(),
            DistanceKind::View2 => self.align::<InView2>(),
            DistanceKind::Symmetric => self.align::<InBothViews>(),
            DistanceKind::Sampson => self.align::<Sampson>(),
        }
    }
}

impl<S: Lanes> On<'_, S> {
    #[inline(always)]
    fn align<C: VectorCost<S>>(self) -> Option<Alignment> {
        let Self { simd, job: Job { columns, ties, bound, plan, path: wanted } } = self;
        let (n1, n2) = (columns.n1, columns.n2);
        let sweep = Sweep { simd, columns, ties, bound };
        let mut edge = Edge::before_the_first_row(n2);
        let mut record =
            if wanted { Record::of_rows(plan.block_rows.min(n1), n2) } else { Record::default() };
        let mut kept = Vec::new();
        let mut total_cost = f64::INFINITY;
        while edge.row < n1 {
            let end = (edge.row + plan.block_rows).min(n1);
            let recorded = wanted && end == n1;
            if wanted && !recorded {
                let live = edge.values.get(edge.live.clone()).unwrap_or_default().to_vec();
                kept.push((edge.row, edge.live.clone(), live));
            }
            let on_record = if recorded { Some(&mut record) } else { None };
            total_cost = sweep.advance::<C>(&mut edge, end, on_record);
            if edge.live.is_empty() {
                return None;
            }
        }
        if !total_cost.is_finite() {
            return None;
        }
        let mut path = Vec::new();
        if wanted {
            path.reserve_exact(n1 + n2 - 1);
            let mut cell = (n1 - 1, n2 - 1);
            path.push(cell);
            cell = sweep.trace(&record, cell, &mut path);
            for (row, live, values) in kept.into_iter().rev() {
                record.clear();
                edge = Edge::before_the_first_row(n2);
                edge.row = row;
                edge.values[live.clone()].copy_from_slice(&values);
                edge.live = live;
                sweep.advance::<C>(&mut edge, row + plan.block_rows, Some(&mut record));
                cell = sweep.trace(&record, cell, &mut path);
            }
            path.reverse();
        }
        Some(Alignment { path, total_cost })
    }
}

#[cfg(test)]
mod tests;
