use std::f32::consts::SQRT_2;

use accurate_geom::GeomError;
use pulp::{Arch, NullaryFnOnce};

use crate::ends::{FreeEnds, not_negative};
use crate::{AngleSignal, MatchError};

/// What [`interval_energy`] charges. All in px; a diagonal move counts the distance twice, so that
/// every sample of either curve is paid once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntervalPrices {
    /// Distance that is forgiven: noise of a centreline. 0.5.
    pub tolerance_px: f64,
    /// The most that one cell costs, so that a short wrong stretch cannot spoil a right pair. 6.
    pub cap_px: f64,
    /// Extra price of a move that advances one curve only. 0.02: enough to break ties.
    pub step_px: f64,
    /// Price of leaving out one sample at a free end. 0.06.
    pub trim_px: f64,
}

impl IntervalPrices {
    /// The values above.
    pub const DEFAULT: Self = Self { tolerance_px: 0.5, cap_px: 6.0, step_px: 0.02, trim_px: 0.06 };

    pub(crate) fn validate(&self) -> Result<(), MatchError> {
        not_negative("tolerance_px", self.tolerance_px)?;
        not_negative("cap_px", self.cap_px)?;
        not_negative("step_px", self.step_px)?;
        not_negative("trim_px", self.trim_px)
    }
}

/// How badly two curves disagree in epipolar angle under the best monotone correspondence, px².
///
/// Two samples differ by the gap between their intervals of angle, in px:
/// `D = √2 gap / √(g1² + g2²)` (symmetric in the views, with `g` the gradients of the angle per
/// px), less the tolerance, at most the cap. Moves `(1, 1)` cost `2 D`, moves `(1, 0)` and `(0, 1)`
/// cost `D` and the step price. At each end one of the curves may leave out samples within its free
/// length. The energy is `cost · step / 2`: the mean square is not taken, but it grows with the
/// length of the stretch that disagrees and not with the number of samples.
///
/// `signal2` is read backwards if `reversed`; `free2` belongs to it as it is stored. Both signals
/// have the same step.
///
/// # Errors
/// [`MatchError::Geometry`] for prices or free lengths that are negative or NaN, or different steps.
///
/// # Source
/// Symmetric dynamic time warping (Sakoe and Chiba 1978, symmetric form, slope condition 0) on
/// intervals; ours.
///
/// # Cost
/// O(n1·n2) time, O(n2) memory.
pub fn interval_energy(
    signal1: &AngleSignal,
    free1: FreeEnds,
    signal2: &AngleSignal,
    free2: FreeEnds,
    reversed: bool,
    prices: &IntervalPrices,
) -> Result<f64, MatchError> {
    prices.validate()?;
    if signal1.step_px != signal2.step_px {
        let (what, expected) = ("step of the second signal (px)", "the step of the first");
        return Err(GeomError::OutOfRange { what, value: signal2.step_px, expected }.into());
    }
    let lane = Lane::new(signal1, free1.validate()?, signal2, free2.validate()?, reversed);
    let cost = IntervalDp::<1>::new(*prices).costs(&[lane], |_, _| true);
    Ok(energy(cost[0], signal1.step_px))
}

pub(crate) fn energy(cost: f32, step_px: f64) -> f64 {
    f64::from(cost) * step_px * 0.5
}

/// One pair of signals to compare.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lane<'a> {
    signal1: &'a AngleSignal,
    signal2: &'a AngleSignal,
    reversed: bool,
    /// Samples that may be left out at begin and end of each curve, in the order of the path.
    trim1: (usize, usize),
    trim2: (usize, usize),
    /// Radians added to `signal2`: a multiple of 2π.
    shift: f32,
}

impl<'a> Lane<'a> {
    pub(crate) fn new(
        signal1: &'a AngleSignal,
        free1: FreeEnds,
        signal2: &'a AngleSignal,
        free2: FreeEnds,
        reversed: bool,
    ) -> Self {
        let free2 = if reversed { free2.reversed() } else { free2 };
        let trim =
            |s: &AngleSignal, f: FreeEnds| (s.samples_in(f.begin_px), s.samples_in(f.end_px));
        // Each signal is continuous, but may have started on either side of the cut at ±π.
        let middle = |s: &AngleSignal| s.low[s.samples() / 2];
        let turns = ((middle(signal1) - middle(signal2)) / std::f32::consts::TAU).round();
        Self {
            signal1,
            signal2,
            reversed,
            trim1: trim(signal1, free1),
            trim2: trim(signal2, free2),
            shift: turns * std::f32::consts::TAU,
        }
    }

    pub(crate) fn step_px(&self) -> f64 {
        self.signal1.step_px
    }

    pub(crate) fn rows(&self) -> usize {
        self.signal1.samples()
    }

    pub(crate) fn columns(&self) -> usize {
        self.signal2.samples()
    }
}

/// The dynamic program for `N` pairs at a time, side by side in vector registers. It keeps its
/// memory between calls.
pub(crate) struct IntervalDp<const N: usize> {
    /// The instructions of the machine at hand. No operation is fused: the costs are the same on all.
    arch: Arch,
    prices: IntervalPrices,
    low2: Vec<[f32; N]>,
    high2: Vec<[f32; N]>,
    squared2: Vec<[f32; N]>,
    /// Costs of the row above; element 0 is the column before the first.
    above: Vec<[f32; N]>,
    current: Vec<[f32; N]>,
}

/// Rows between two questions whether to go on.
const ROWS_PER_QUESTION: usize = 4;

impl<const N: usize> IntervalDp<N> {
    pub(crate) fn new(prices: IntervalPrices) -> Self {
        Self {
            arch: Arch::new(),
            prices,
            low2: Vec::new(),
            high2: Vec::new(),
            squared2: Vec::new(),
            above: Vec::new(),
            current: Vec::new(),
        }
    }

    /// Least cost of each lane. `worth(k, bound)` is asked now and then whether lane `k` is still
    /// of interest, given that it will cost `bound` or more; once none is, all costs are infinite.
    pub(crate) fn costs(
        &mut self,
        lanes: &[Lane<'_>],
        worth: impl Fn(usize, f32) -> bool,
    ) -> [f32; N] {
        let lanes = &lanes[..lanes.len().min(N)];
        let rows = lanes.iter().map(Lane::rows).max().unwrap_or(0);
        let columns = lanes.iter().map(Lane::columns).max().unwrap_or(0);
        let trim_px = self.prices.trim_px as f32;
        let skip = |samples: usize| if samples == 0 { 0.0 } else { samples as f32 * trim_px };
        self.load(lanes, columns);
        // The row before the first: where a path may start.
        for (j, cell) in self.above.iter_mut().enumerate() {
            for (k, lane) in lanes.iter().enumerate() {
                cell[k] = if j <= lane.trim2.0 { skip(j) } else { f32::INFINITY };
            }
        }
        let mut best = [f32::INFINITY; N];
        for i in 0..rows {
            let mut row = Row { low: [0.0; N], high: [0.0; N], squared: [1.0; N] };
            let mut before = [f32::INFINITY; N];
            for (k, lane) in lanes.iter().enumerate() {
                let i1 = i.min(lane.rows() - 1);
                row.low[k] = lane.signal1.low[i1];
                row.high[k] = lane.signal1.high[i1];
                row.squared[k] = lane.signal1.squared_gradient[i1];
                if i < lane.trim1.0 {
                    before[k] = skip(i + 1);
                }
            }
            self.current[0] = before;
            let arch = self.arch;
            arch.dispatch(Advance { dp: self, row: &row, first: i == 0 });
            for (k, lane) in lanes.iter().enumerate() {
                let (n1, n2) = (lane.rows(), lane.columns());
                if i < n1 && n1 - 1 - i <= lane.trim1.1 {
                    best[k] = best[k].min(self.current[n2][k] + skip(n1 - 1 - i));
                }
                if i + 1 == n1 {
                    for left_out in 1..=lane.trim2.1 {
                        best[k] = best[k].min(self.current[n2 - left_out][k] + skip(left_out));
                    }
                }
            }
            std::mem::swap(&mut self.above, &mut self.current);
            if i % ROWS_PER_QUESTION == ROWS_PER_QUESTION - 1 && i + 1 < rows {
                // A path has ended, passes through this row or starts below it. Costs only grow,
                // and rounding keeps their order.
                let mut bound = best;
                for cell in &self.above {
                    for k in 0..N {
                        bound[k] = if cell[k] < bound[k] { cell[k] } else { bound[k] };
                    }
                }
                let least = |k: usize| if i + 1 < lanes[k].rows() { bound[k] } else { best[k] };
                if !(0..lanes.len()).any(|k| worth(k, least(k))) {
                    return [f32::INFINITY; N];
                }
            }
        }
        best
    }

    /// Lays the signals of view 2 side by side; short ones are continued with their last sample.
    fn load(&mut self, lanes: &[Lane<'_>], columns: usize) {
        for column in [&mut self.low2, &mut self.high2] {
            column.clear();
            column.resize(columns, [0.0; N]);
        }
        self.squared2.clear();
        self.squared2.resize(columns, [1.0; N]);
        for row in [&mut self.above, &mut self.current] {
            row.clear();
            row.resize(columns + 1, [f32::INFINITY; N]);
        }
        for (k, lane) in lanes.iter().enumerate() {
            let n2 = lane.columns();
            for j in 0..columns {
                let j2 = if lane.reversed { n2 - 1 - j.min(n2 - 1) } else { j.min(n2 - 1) };
                self.low2[j][k] = lane.signal2.low[j2] + lane.shift;
                self.high2[j][k] = lane.signal2.high[j2] + lane.shift;
                self.squared2[j][k] = lane.signal2.squared_gradient[j2];
            }
        }
    }

    /// One row of the recurrence. In the first row `above` holds starting costs, which only a
    /// diagonal move may use.
    #[inline(always)]
    fn advance(&mut self, row: &Row<N>, first: bool) {
        let tolerance = self.prices.tolerance_px as f32;
        let cap = self.prices.cap_px as f32;
        let step_px = self.prices.step_px as f32;
        let signals = self.low2.iter().zip(&self.high2).zip(&self.squared2);
        let mut left = [f32::INFINITY; N];
        let mut diagonal = self.above[0];
        for (((low2, high2), squared2), (above, current)) in
            signals.zip(self.above[1..].iter().zip(&mut self.current[1..]))
        {
            let above = *above;
            let up = if first { [f32::INFINITY; N] } else { above };
            let mut cell = [0.0; N];
            // Comparisons instead of f32::min and max: no NaN can occur, and each is one instruction.
            for k in 0..N {
                let (under, over) = (row.low[k] - high2[k], low2[k] - row.high[k]);
                let gap = if under > over { under } else { over };
                let scale = SQRT_2 / (row.squared[k] + squared2[k]).sqrt();
                let d = gap * scale - tolerance;
                let d = if d > 0.0 { d } else { 0.0 };
                let d = if d < cap { d } else { cap };
                let (across, along) = (diagonal[k] + (d + d), up[k] + (d + step_px));
                let other = if across < along { across } else { along };
                let from_left = left[k] + (d + step_px);
                cell[k] = if from_left < other { from_left } else { other };
            }
            *current = cell;
            left = cell;
            diagonal = above;
        }
    }
}

struct Advance<'a, const N: usize> {
    dp: &'a mut IntervalDp<N>,
    row: &'a Row<N>,
    first: bool,
}

impl<const N: usize> NullaryFnOnce for Advance<'_, N> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.dp.advance(self.row, self.first);
    }
}

/// The samples of view 1 of one row, one per lane.
struct Row<const N: usize> {
    low: [f32; N],
    high: [f32; N],
    squared: [f32; N],
}
