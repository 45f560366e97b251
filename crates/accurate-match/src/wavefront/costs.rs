use super::lanes::Lanes;
use crate::{CostModel, DistanceKind};

/// Numbers up to here keep every distance, its square and any sum over a path finite.
const LARGEST: f64 = 1e120;

/// A cost model as columns of numbers, laid out for the wavefront: rows padded to whole vectors,
/// columns in descending order, so that neighbouring rows, which are at ever smaller columns, read
/// neighbouring numbers.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    pub n1: usize,
    pub n2: usize,
    pub kind: DistanceKind,
    /// x, y of view 1; a, b, c of the line in view 2; squared gradient. Empty if `kind` needs none.
    rows: [Vec<f64>; 6],
    /// x, y of view 2; a, b, c of the line in view 1; squared gradient. As `rows`.
    columns: [Vec<f64>; 6],
}

/// More than the rows of any wavefront: the margin of `columns`, and what `rows` is padded by.
pub(super) const MARGIN: usize = 32;

impl Columns {
    /// Every `stride`-th point of both curves, and their last ones. `None` if a ray that matters
    /// has no line, or if a number is out of range: the plain kernel knows what to do.
    pub fn of(costs: &CostModel, stride: usize) -> Option<Self> {
        let thinned = |n: usize| {
            let last = !(n - 1).is_multiple_of(stride);
            (0..n).step_by(stride).chain(last.then_some(n - 1))
        };
        let needs = |own: DistanceKind, which: usize| match costs.kind() {
            // Own pixels, no lines; or own lines, no pixels.
            DistanceKind::View1 | DistanceKind::View2 => {
                if costs.kind() == own {
                    which < 2
                } else {
                    (2..5).contains(&which)
                }
            }
            DistanceKind::Symmetric => which < 5,
            // The line in view 1 and both gradients.
            DistanceKind::Sampson if own == DistanceKind::View1 => which < 2 || which == 5,
            DistanceKind::Sampson => (2..6).contains(&which),
        };
        let rows = |which: usize| {
            let mut row = Vec::new();
            if needs(DistanceKind::View1, which) {
                let value =
                    |i| value(which, &costs.curve1()[i], costs.line2(i), costs.gradient2(i));
                row = thinned(costs.n1()).map(value).collect::<Option<Vec<f64>>>()?;
                row.resize(row.len() + MARGIN, 0.0);
            }
            Some(row)
        };
        let columns = |which: usize| {
            let mut column = Vec::new();
            if needs(DistanceKind::View2, which) {
                let value =
                    |j| value(which, &costs.curve2()[j], costs.line1(j), costs.gradient1(j));
                column = vec![0.0; MARGIN];
                for j in thinned(costs.n2()) {
                    column.push(value(j)?);
                }
                column[MARGIN..].reverse();
                column.resize(column.len() + MARGIN, 0.0);
            }
            Some(column)
        };
        // A ray seen end on has no line; where lines do not enter, it still changes the cost.
        if !costs.all_lines() {
            return None;
        }
        Some(Self {
            n1: thinned(costs.n1()).count(),
            n2: thinned(costs.n2()).count(),
            kind: costs.kind(),
            rows: [rows(0)?, rows(1)?, rows(2)?, rows(3)?, rows(4)?, rows(5)?],
            columns: [columns(0)?, columns(1)?, columns(2)?, columns(3)?, columns(4)?, columns(5)?],
        })
    }

    /// Where column `j` (as lane 0, so that lane `l` is at column `j - l`) is in `columns`.
    #[inline(always)]
    pub fn position(&self, j: usize) -> usize {
        MARGIN + self.n2 - 1 - j
    }
}

fn value<V>(
    which: usize,
    pixel: &accurate_geom::Pixel<V>,
    line: Option<[f64; 3]>,
    gradient: f64,
) -> Option<f64> {
    let value = match which {
        0 => pixel.x,
        1 => pixel.y,
        5 => gradient,
        _ => line?[which - 2],
    };
    (value.abs() <= LARGEST).then_some(value)
}

/// What [`MARGIN`] neighbouring rows see of one of `columns`.
type Window<'a> = &'a [f64; MARGIN];

/// A [`DistanceKind`] in vectors: the operations of [`CostModel::cost`] in their order, hence its
/// bits.
pub(super) trait VectorCost<S: Lanes> {
    /// What a vector of rows keeps in registers.
    type Rows: Copy;

    /// The columns this cost needs, out of [`Columns`].
    type Needed<'a>: Windowed;

    fn rows(simd: S, columns: &Columns, row: usize) -> Self::Rows;

    fn needed(columns: &Columns) -> Self::Needed<'_>;

    /// The costs of these rows, whose first is row `row` of the band, which sees `seen`.
    fn cost(simd: S, seen: Seen<Self::Needed<'_>>, rows: &Self::Rows, row: usize) -> S::f64s;
}

/// Columns of which a band sees a window at every step: bounds are checked once for all its vectors.
pub(super) trait Windowed: Copy {
    type Seen: Copy;

    /// Of a band whose first row is at the column of position `at`.
    fn seen(self, at: usize) -> Self::Seen;
}

type Seen<N> = <N as Windowed>::Seen;

impl<'a, const K: usize> Windowed for [&'a [f64]; K] {
    type Seen = [Window<'a>; K];

    #[inline(always)]
    fn seen(self, at: usize) -> Self::Seen {
        let mut windows: Self::Seen = [&[0.0; MARGIN]; K];
        for k in 0..K {
            // The sweep stays within the margins on both sides.
            windows[k] = &self[k][at..].as_chunks().0[0];
        }
        windows
    }
}

impl<A: Windowed, B: Windowed> Windowed for (A, B) {
    type Seen = (A::Seen, B::Seen);

    #[inline(always)]
    fn seen(self, at: usize) -> Self::Seen {
        (self.0.seen(at), self.1.seen(at))
    }
}

#[inline(always)]
fn linear<S: Lanes>(simd: S, [a, b, c]: [S::f64s; 3], [x, y]: [S::f64s; 2]) -> S::f64s {
    let products = simd.add_f64s(simd.mul_f64s(a, x), simd.mul_f64s(b, y));
    simd.abs_f64s(simd.add_f64s(products, c))
}

// Loops, not `from_fn`: a closure would not be compiled for the vectors of `S`.

#[inline(always)]
fn slices<const K: usize>(from: &[Vec<f64>; 6], first: usize) -> [&[f64]; K] {
    let mut slices: [&[f64]; K] = [&[]; K];
    for k in 0..K {
        slices[k] = &from[first + k];
    }
    slices
}

/// Of whole columns or of what a band sees of them: the length of the latter is known, so that nothing
/// is checked.
#[inline(always)]
fn load<const K: usize, S: Lanes>(
    simd: S,
    from: [&(impl AsRef<[f64]> + ?Sized); K],
    at: usize,
) -> [S::f64s; K] {
    let mut loaded = [simd.splat_f64s(0.0); K];
    for k in 0..K {
        loaded[k] = simd.load(from[k].as_ref(), at);
    }
    loaded
}

#[derive(Debug, Clone, Copy)]
pub(super) struct InView1;

impl<S: Lanes> VectorCost<S> for InView1 {
    type Rows = [S::f64s; 2];
    type Needed<'a> = [&'a [f64]; 3];

    #[inline(always)]
    fn rows(simd: S, columns: &Columns, row: usize) -> Self::Rows {
        load(simd, slices(&columns.rows, 0), row)
    }

    #[inline(always)]
    fn needed(columns: &Columns) -> Self::Needed<'_> {
        slices(&columns.columns, 2)
    }

    #[inline(always)]
    fn cost(simd: S, seen: Seen<Self::Needed<'_>>, rows: &Self::Rows, row: usize) -> S::f64s {
        linear(simd, load(simd, seen, row), *rows)
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct InView2;

impl<S: Lanes> VectorCost<S> for InView2 {
    type Rows = [S::f64s; 3];
    type Needed<'a> = [&'a [f64]; 2];

    #[inline(always)]
    fn rows(simd: S, columns: &Columns, row: usize) -> Self::Rows {
        load(simd, slices(&columns.rows, 2), row)
    }

    #[inline(always)]
    fn needed(columns: &Columns) -> Self::Needed<'_> {
        slices(&columns.columns, 0)
    }

    #[inline(always)]
    fn cost(simd: S, seen: Seen<Self::Needed<'_>>, rows: &Self::Rows, row: usize) -> S::f64s {
        linear(simd, *rows, load(simd, seen, row))
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct InBothViews;

impl<S: Lanes> VectorCost<S> for InBothViews {
    type Rows = ([S::f64s; 2], [S::f64s; 3]);
    type Needed<'a> = ([&'a [f64]; 3], [&'a [f64]; 2]);

    #[inline(always)]
    fn rows(simd: S, columns: &Columns, row: usize) -> Self::Rows {
        (InView1::rows(simd, columns, row), InView2::rows(simd, columns, row))
    }

    #[inline(always)]
    fn needed(columns: &Columns) -> Self::Needed<'_> {
        (slices(&columns.columns, 2), slices(&columns.columns, 0))
    }

    #[inline(always)]
    fn cost(simd: S, seen: Seen<Self::Needed<'_>>, rows: &Self::Rows, row: usize) -> S::f64s {
        let d1 = InView1::cost(simd, seen.0, &rows.0, row);
        let d2 = InView2::cost(simd, seen.1, &rows.1, row);
        let sum = simd.add_f64s(simd.mul_f64s(d1, d1), simd.mul_f64s(d2, d2));
        simd.sqrt_f64s(simd.mul_f64s(sum, simd.splat_f64s(0.5)))
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Sampson;

impl<S: Lanes> VectorCost<S> for Sampson {
    type Rows = ([S::f64s; 2], [S::f64s; 1]);
    type Needed<'a> = ([&'a [f64]; 3], [&'a [f64]; 1]);

    #[inline(always)]
    fn rows(simd: S, columns: &Columns, row: usize) -> Self::Rows {
        (InView1::rows(simd, columns, row), load(simd, slices(&columns.rows, 5), row))
    }

    #[inline(always)]
    fn needed(columns: &Columns) -> Self::Needed<'_> {
        (slices(&columns.columns, 2), slices(&columns.columns, 5))
    }

    #[inline(always)]
    fn cost(simd: S, seen: Seen<Self::Needed<'_>>, rows: &Self::Rows, row: usize) -> S::f64s {
        let d1 = InView1::cost(simd, seen.0, &rows.0, row);
        let [gradient1]: [S::f64s; 1] = load(simd, seen.1, row);
        let sum = simd.add_f64s(gradient1, rows.1[0]);
        // In the margin both gradients are 0; NaN there would still be a number of no row.
        simd.mul_f64s(d1, simd.sqrt_f64s(simd.div_f64s(gradient1, sum)))
    }
}
