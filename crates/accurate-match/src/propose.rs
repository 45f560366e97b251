use accurate_geom::{EpipolarAngle, Pixel, View, View1, View2};

use crate::ends::{FreeEnds, finite, not_negative, positive};
use crate::interval_dp::{IntervalDp, Lane, energy};
use crate::{AngleProfile, AngleSignal, IntervalPrices, MatchError};

/// A candidate for the curve of one view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignalCurve<'a, V: View> {
    /// Ordered undistorted pixels, about 1 px apart.
    pub points: &'a [Pixel<V>],
    /// What speaks against the candidate within its own view, in the unit of
    /// [`Proposal::score`]; 0 is best.
    pub cost: f64,
    /// Ends that may be wrong: a tip that lies on the body, an end at a crossing.
    pub free: FreeEnds,
    /// Length that the candidate runs along itself, px.
    pub doubled_px: f64,
}

/// One pair of candidates and a direction, with what speaks against it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proposal {
    /// Candidate of view 1.
    pub i: usize,
    /// Candidate of view 2.
    pub j: usize,
    /// Whether candidate `j` runs against candidate `i`.
    pub reversed: bool,
    /// Costs of both candidates, plus the penalties for ends and for a doubled body, plus the weighted
    /// energy. Less is better.
    pub score: f64,
    /// [`interval_energy`](crate::interval_energy) at the fine step, px².
    pub energy_px2: f64,
    /// Penalty for ends that should be seen in both views and differ in epipolar angle.
    pub end_penalty: f64,
}

/// Steps, prices and numbers of [`propose_pairs`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProposeParams {
    /// Step of the first comparison, px. 9.
    pub coarse_step_px: f64,
    /// Step of the second comparison, px. 3.
    pub fine_step_px: f64,
    /// Prices of both comparisons.
    pub prices: IntervalPrices,
    /// Weight of the energy in the score, per px². 1/20.
    pub energy_weight: f64,
    /// Disagreement of both ends together that is not penalised, px. 4.
    pub end_tolerance_px: f64,
    /// Penalty per px of disagreement beyond that. 0.1.
    pub end_weight: f64,
    /// Each end counts at most this, px; a pair with both ends beyond it is dropped. 30.
    pub end_limit_px: f64,
    /// Length doubled in both views that is not penalised, px. 25.
    pub doubled_tolerance_px: f64,
    /// Penalty per px doubled in both views beyond that: a body may lie on itself in one view, but in
    /// both only where it does in space. 0.04.
    pub doubled_weight: f64,
    /// Pairs that enter the coarse comparison, best first by all but their angles. 2500.
    pub keep_screened: usize,
    /// Pairs that enter the fine comparison. 150.
    pub keep_coarse: usize,
    /// Pairs returned. 100.
    pub keep_fine: usize,
}

impl ProposeParams {
    /// The values above.
    pub const DEFAULT: Self = Self {
        coarse_step_px: 9.0,
        fine_step_px: 3.0,
        prices: IntervalPrices::DEFAULT,
        energy_weight: 1.0 / 20.0,
        end_tolerance_px: 4.0,
        end_weight: 0.1,
        end_limit_px: 30.0,
        doubled_tolerance_px: 25.0,
        doubled_weight: 0.04,
        keep_screened: 2500,
        keep_coarse: 150,
        keep_fine: 100,
    };
}

impl Default for ProposeParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Ranks all pairs of candidates and both directions by how well their epipolar angles agree, best
/// first; equal scores in order of `(i, j, reversed)`.
///
/// Three sieves: costs, ends and doubled lengths; interval alignment at the coarse step; at the fine step. A pair is
/// given up as soon as it cannot pass, which changes no result. The list is empty if there are no
/// candidates or if no pair has an end in common.
///
/// # Errors
/// As [`AngleProfile::of_view1`] for any candidate; [`MatchError::Geometry`] for parameters or costs
/// that are negative, NaN or, but for tolerances and prices, infinite.
///
/// # Cost
/// O(n1·n2) pairs, a few ns per cell of each alignment; about 5 ms for 64 x 64 candidates of 430 px.
pub fn propose_pairs(
    angles: &EpipolarAngle,
    curves1: &[SignalCurve<'_, View1>],
    curves2: &[SignalCurve<'_, View2>],
    params: &ProposeParams,
) -> Result<Vec<Proposal>, MatchError> {
    validate(params)?;
    let spacing = params.fine_step_px;
    let candidates1 =
        candidates(curves1, params, |points| AngleProfile::of_view1(angles, points, spacing))?;
    let candidates2 =
        candidates(curves2, params, |points| AngleProfile::of_view2(angles, points, spacing))?;
    let screened = screen(&candidates1, &candidates2, params);
    let coarse =
        sieve(&candidates1, &candidates2, screened, params.keep_coarse, params, |c| &c.coarse);
    Ok(sieve(&candidates1, &candidates2, coarse, params.keep_fine, params, |c| &c.fine))
}

fn validate(params: &ProposeParams) -> Result<(), MatchError> {
    params.prices.validate()?;
    positive("coarse_step_px", params.coarse_step_px)?;
    positive("fine_step_px", params.fine_step_px)?;
    finite("energy_weight", params.energy_weight)?;
    not_negative("end_tolerance_px", params.end_tolerance_px)?;
    finite("end_weight", params.end_weight)?;
    finite("end_limit_px", params.end_limit_px)?;
    not_negative("doubled_tolerance_px", params.doubled_tolerance_px)?;
    finite("doubled_weight", params.doubled_weight)
}

/// What is computed once per candidate.
struct Candidate {
    cost: f64,
    free: FreeEnds,
    doubled_px: f64,
    /// Angle and gradient of the first and the last point.
    ends: [(f64, f64); 2],
    coarse: AngleSignal,
    fine: AngleSignal,
}

fn candidates<V: View>(
    curves: &[SignalCurve<'_, V>],
    params: &ProposeParams,
    profile: impl Fn(&[Pixel<V>]) -> Result<AngleProfile, MatchError>,
) -> Result<Vec<Candidate>, MatchError> {
    let candidate = |curve: &SignalCurve<'_, V>| {
        finite("cost of a candidate", curve.cost)?;
        finite("doubled_px", curve.doubled_px)?;
        let profile = profile(curve.points)?;
        Ok(Candidate {
            cost: curve.cost,
            free: curve.free.validate()?,
            doubled_px: curve.doubled_px,
            ends: [profile.first(), profile.last()],
            coarse: profile.signal(params.coarse_step_px)?,
            fine: profile.signal(params.fine_step_px)?,
        })
    };
    curves.iter().map(candidate).collect()
}

/// Pairs by all but their angles, best first.
fn screen(
    candidates1: &[Candidate],
    candidates2: &[Candidate],
    params: &ProposeParams,
) -> Vec<Proposal> {
    let mut pairs = Vec::with_capacity(candidates1.len() * candidates2.len() * 2);
    for (i, c1) in candidates1.iter().enumerate() {
        for (j, c2) in candidates2.iter().enumerate() {
            for reversed in [false, true] {
                if let Some(end_penalty) = end_penalty(c1, c2, reversed, params) {
                    let score = unaligned_score(c1, c2, end_penalty, params);
                    pairs.push(Proposal { i, j, reversed, score, energy_px2: 0.0, end_penalty });
                }
            }
        }
    }
    keep_best(&mut pairs, params.keep_screened);
    pairs
}

/// `None` if both ends are beyond the limit.
fn end_penalty(
    c1: &Candidate,
    c2: &Candidate,
    reversed: bool,
    params: &ProposeParams,
) -> Option<f64> {
    let free2 = if reversed { c2.free.reversed() } else { c2.free };
    let free = [
        c1.free.begin_px > 0.0 || free2.begin_px > 0.0,
        c1.free.end_px > 0.0 || free2.end_px > 0.0,
    ];
    let mut sum = 0.0;
    let mut beyond = 0;
    for end in 0..2 {
        let (phi1, g1) = c1.ends[end];
        let (phi2, g2) = c2.ends[if reversed { 1 - end } else { end }];
        let turn = std::f64::consts::TAU;
        let difference = (phi1 - phi2) - turn * ((phi1 - phi2) / turn).round();
        let px = std::f64::consts::SQRT_2 * difference.abs() / (g1 * g1 + g2 * g2).sqrt();
        if !free[end] {
            sum += px.min(params.end_limit_px);
            beyond += usize::from(px > params.end_limit_px);
        }
    }
    (beyond < 2).then(|| params.end_weight * (sum - params.end_tolerance_px).max(0.0))
}

/// What speaks against a pair before its angles are compared.
fn unaligned_score(
    c1: &Candidate,
    c2: &Candidate,
    end_penalty: f64,
    params: &ProposeParams,
) -> f64 {
    let doubled_px = (c1.doubled_px.min(c2.doubled_px) - params.doubled_tolerance_px).max(0.0);
    c1.cost + c2.cost + end_penalty + params.doubled_weight * doubled_px
}

/// Pairs compared side by side.
const LANES: usize = 8;
/// Pairs between two looks at the score to beat, a multiple of `LANES`.
const CHUNK: usize = 64;

/// Scores `pairs` (best first) by the energy of the signals that `signal` selects and keeps the best.
fn sieve(
    candidates1: &[Candidate],
    candidates2: &[Candidate],
    pairs: Vec<Proposal>,
    keep: usize,
    params: &ProposeParams,
    signal: impl Fn(&Candidate) -> &AngleSignal,
) -> Vec<Proposal> {
    let mut dp = IntervalDp::<LANES>::new(params.prices);
    let mut kept: Vec<Proposal> = Vec::with_capacity(keep.min(pairs.len()) + CHUNK);
    let base =
        |p: &Proposal| unaligned_score(&candidates1[p.i], &candidates2[p.j], p.end_penalty, params);
    let lane = |p: &Proposal| {
        let (c1, c2) = (&candidates1[p.i], &candidates2[p.j]);
        Lane::new(signal(c1), c1.free, signal(c2), c2.free, p.reversed)
    };
    for chunk in pairs.chunks(CHUNK) {
        let score_to_beat = if kept.len() < keep {
            f64::INFINITY
        } else {
            kept.last().map_or(f64::NEG_INFINITY, |worst| worst.score)
        };
        // Alike in size, they waste the fewest cells.
        let mut chunk = chunk.to_vec();
        chunk.sort_by_key(|p| (lane(p).columns(), lane(p).rows(), p.i, p.j, p.reversed));
        for batch in chunk.chunks_mut(LANES) {
            let lanes: Vec<_> = batch.iter().map(lane).collect();
            let step_px = lanes.first().map_or(0.0, |lane| lane.step_px());
            let score = |p: &Proposal, cost| base(p) + params.energy_weight * energy(cost, step_px);
            let costs = dp.costs(&lanes, |k, bound| score(&batch[k], bound) <= score_to_beat);
            for (pair, cost) in batch.iter_mut().zip(costs) {
                pair.energy_px2 = energy(cost, step_px);
                pair.score = score(pair, cost);
            }
        }
        kept.extend(chunk.into_iter().filter(|p| p.score <= score_to_beat && p.score.is_finite()));
        keep_best(&mut kept, keep);
    }
    kept
}

fn keep_best(pairs: &mut Vec<Proposal>, keep: usize) {
    let order = |a: &Proposal, b: &Proposal| {
        let ids = |p: &Proposal| (p.i, p.j, p.reversed);
        a.score.total_cmp(&b.score).then_with(|| ids(a).cmp(&ids(b)))
    };
    if keep < pairs.len() {
        pairs.select_nth_unstable_by(keep, order);
        pairs.truncate(keep);
    }
    pairs.sort_unstable_by(order);
}
