use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

use ndarray::Array2;

use crate::{Mask, SegError, Skeleton, zhang_suen};

/// What counts as a trace of the body between two pieces of its mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GapParams {
    /// Pixels below this probability are no trace; 0 to 1.
    pub least: f32,
    /// Longest gap, px.
    pub longest_px: f64,
    /// Mean probability of a gap's pixels at least; `least` to 1.
    pub least_mean: f32,
    /// Part of the body behind a tip that the tip cannot be led back to, px.
    pub blind_px: f64,
}

impl GapParams {
    /// Where a network sees nothing, its probability is below 0.01.
    pub const DEFAULT: Self =
        Self { least: 0.04, longest_px: 120.0, least_mean: 0.08, blind_px: 20.0 };
}

/// Width of the rim of small probability around a body, px.
const HALO_PX: usize = 3;

/// A way from a tip of the mask to another part of it along which the probability stays up, though
/// below the threshold.
#[derive(Debug, Clone, PartialEq)]
pub struct GapHint {
    /// Pixels, `(row, column)`, 8-connected, from the tip to the pixel of the mask that is met, both
    /// included.
    pub path: Vec<(usize, usize)>,
    /// Mean probability of the path outside of the mask.
    pub mean_probability: f32,
}

/// By how much rounding may carry a probability beyond 0 or 1.
const ROUNDING: f32 = 1e-5;

/// Where the body may go on between two pieces of its mask: for each tip of the mask's skeleton the
/// way of the greatest probability to another part of the mask, if there is one. A gap that is found
/// from both of its tips is given once.
///
/// `probability` and the mask have the same shape, `(height, width)`.
///
/// # Errors
/// [`SegError::WrongShape`], [`SegError::NotFinite`], [`SegError::NotAProbability`] for a value that is not
/// in 0 to 1.
///
/// # Cost
/// Thinning once; then Dijkstra's algorithm over the pixels around each tip that show a trace.
pub fn gap_hints(
    probability: &Array2<f32>,
    mask: &Mask,
    params: &GapParams,
) -> Result<Vec<GapHint>, SegError> {
    mask.require_map(probability)?;
    for ((row, column), &value) in probability.indexed_iter() {
        // Beyond 1 a way would pay, and a round trip the more; rounding is made good where it is priced.
        if !(-ROUNDING..=1.0 + ROUNDING).contains(&value) {
            return Err(SegError::NotAProbability { row, column, value });
        }
    }
    if mask.is_empty() {
        return Ok(Vec::new());
    }
    let tips = Skeleton::of(&zhang_suen(mask))?.endpoints();
    let mut hints: Vec<GapHint> = Vec::new();
    for tip in tips {
        let Some(hint) = search(probability, mask, tip, params) else { continue };
        let ends = |h: &GapHint| [h.path.first().copied(), h.path.last().copied()];
        let [from, to] = ends(&hint);
        let near = |a: Option<(usize, usize)>, b: Option<(usize, usize)>| match (a, b) {
            (Some(a), Some(b)) => distance(a, b) <= params.blind_px,
            _ => false,
        };
        let known = hints.iter().map(ends).any(|[a, b]| near(a, to) && near(b, from));
        if !known {
            hints.push(hint);
        }
    }
    Ok(hints)
}

/// Price of the way to a pixel, its length outside of the mask, px, and the pixel before it.
type Reached = BTreeMap<(usize, usize), (f64, f64, (usize, usize))>;

fn distance(a: (usize, usize), b: (usize, usize)) -> f64 {
    (a.0 as f64 - b.0 as f64).hypot(a.1 as f64 - b.1 as f64)
}

/// A pixel on the rim of the search; the cheapest comes first out of the heap.
struct Open {
    cost: f64,
    at: (usize, usize),
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Open {}
impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        // The greatest comes first: the order of costs reversed, and of places, for equal costs.
        other.cost.total_cmp(&self.cost).then_with(|| other.at.cmp(&self.at))
    }
}

fn search(
    probability: &Array2<f32>,
    mask: &Mask,
    tip: (usize, usize),
    params: &GapParams,
) -> Option<GapHint> {
    let own = own_part(mask, tip, params.blind_px);
    // Only the cap of the tip is left for the trace; it may neither slip out at the body's side nor
    // run back through the halo that networks leave around a body.
    let cap_px = own_half_width(mask, tip) + 2.5;
    let halo = |at: (usize, usize)| {
        own.iter().any(|own| {
            at.0.abs_diff(own.0) <= HALO_PX
                && at.1.abs_diff(own.1) <= HALO_PX
                && distance(*own, tip) > cap_px + HALO_PX as f64
        })
    };
    let free =
        |at: (usize, usize)| !mask.get(at.0, at.1) && probability[at] >= params.least && !halo(at);
    let mut best = Reached::new();
    let mut heap = BinaryHeap::from([Open { cost: 0.0, at: tip }]);
    best.insert(tip, (0.0, 0.0, tip));
    while let Some(Open { cost, at }) = heap.pop() {
        let (known, length, _) = *best.get(&at)?;
        if cost > known {
            continue;
        }
        if mask.get(at.0, at.1) && !own.contains(&at) {
            return hint(probability, mask, &best, tip, at, params);
        }
        for next in neighbours(at, mask.shape()) {
            let in_mask = mask.get(next.0, next.1);
            let is_own = own.contains(&next);
            let from_own = own.contains(&at);
            let allowed = match (is_own, in_mask) {
                // Within the cap only.
                (true, _) => from_own && distance(next, tip) <= cap_px,
                (false, true) => true,
                (false, false) => free(next),
            };
            let step = distance(at, next);
            let walked = length + if is_own { 0.0 } else { step };
            if !allowed || walked > params.longest_px {
                continue;
            }
            // Through the own cap for nothing; else the less probable, the dearer.
            let price = if is_own {
                0.0
            } else {
                0.05 - f64::from(probability[next].max(params.least).min(1.0)).ln()
            };
            let cost = cost + step * price;
            if best.get(&next).is_none_or(|(known, ..)| cost < *known) {
                best.insert(next, (cost, walked, at));
                heap.push(Open { cost, at: next });
            }
        }
    }
    None
}

/// The way back from the pixel that was met, if it is a gap and probable enough.
fn hint(
    probability: &Array2<f32>,
    mask: &Mask,
    best: &Reached,
    tip: (usize, usize),
    met: (usize, usize),
    params: &GapParams,
) -> Option<GapHint> {
    let mut path = vec![met];
    let mut at = met;
    while at != tip {
        at = best.get(&at)?.2;
        path.push(at);
    }
    path.reverse();
    let unseen: Vec<f32> =
        path.iter().filter(|at| !mask.get(at.0, at.1)).map(|at| probability[*at]).collect();
    if unseen.is_empty() {
        return None;
    }
    let mean_probability = unseen.iter().sum::<f32>() / unseen.len() as f32;
    (mean_probability >= params.least_mean).then_some(GapHint { path, mean_probability })
}

/// The pixels of the mask that hang together with `tip` within a disc of radius `px` around it.
fn own_part(mask: &Mask, tip: (usize, usize), px: f64) -> BTreeSet<(usize, usize)> {
    let mut own = BTreeSet::from([tip]);
    let mut open = vec![tip];
    while let Some(at) = open.pop() {
        for next in neighbours(at, mask.shape()) {
            if mask.get(next.0, next.1) && distance(next, tip) <= px && own.insert(next) {
                open.push(next);
            }
        }
    }
    own
}

/// Distance from a pixel of the mask to the nearest background along rows and columns, px.
fn own_half_width(mask: &Mask, at: (usize, usize)) -> f64 {
    let (height, width) = mask.shape();
    let run = |step: &dyn Fn(usize) -> Option<(usize, usize)>| {
        (1..).take_while(|k| step(*k).is_some_and(|(r, c)| mask.get(r, c))).count()
    };
    let ways: [usize; 4] = [
        run(&|k| Some((at.0.checked_sub(k)?, at.1))),
        run(&|k| (at.0 + k < height).then_some((at.0 + k, at.1))),
        run(&|k| Some((at.0, at.1.checked_sub(k)?))),
        run(&|k| (at.1 + k < width).then_some((at.0, at.1 + k))),
    ];
    ways.into_iter().min().unwrap_or(0) as f64
}

fn neighbours(
    at: (usize, usize),
    (height, width): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    let rows = at.0.saturating_sub(1)..=(at.0 + 1).min(height - 1);
    rows.flat_map(move |r| {
        (at.1.saturating_sub(1)..=(at.1 + 1).min(width - 1)).map(move |c| (r, c))
    })
    .filter(move |next| *next != at)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two strands 3 px wide in one line, columns 5..40 and 60..95, with `between` in the gap.
    fn strands(between: impl Fn(usize, usize) -> f32) -> (Array2<f32>, Mask) {
        let probability = Array2::from_shape_fn((40, 100), |(row, col)| match (row, col) {
            (19..=21, 5..40 | 60..95) => 0.9,
            (_, 40..60) => between(row, col),
            _ => 0.001,
        });
        let mask = Mask::from_array(probability.mapv(|p| p > 0.5)).unwrap();
        (probability, mask)
    }

    #[test]
    fn a_map_of_grey_values_is_refused() {
        let (probability, mask) = strands(|row, _| if row.abs_diff(20) <= 1 { 0.2 } else { 0.001 });
        let (row, column, value) = (19, 5, 0.9 * 255.0);
        assert_eq!(
            gap_hints(&(probability * 255.0), &mask, &GapParams::DEFAULT).unwrap_err(),
            SegError::NotAProbability { row, column, value }
        );
    }

    #[test]
    fn a_faint_stretch_between_two_tips_is_one_hint_along_it() {
        // The trace sags by up to 5 px.
        let sag = |col: usize| {
            20 + (5.0 * (std::f64::consts::PI * (col as f64 - 40.0) / 20.0).sin()) as usize
        };
        let (probability, mask) =
            strands(|row, col| if row.abs_diff(sag(col)) <= 1 { 0.2 } else { 0.001 });
        let hints = gap_hints(&probability, &mask, &GapParams::DEFAULT).unwrap();
        assert_eq!(hints.len(), 1);
        let path = &hints[0].path;
        assert!(
            path.iter().all(|&(row, col)| row.abs_diff(sag(col.clamp(40, 59))) <= 2),
            "{path:?}"
        );
        assert!(path.first().unwrap().1 < 40 && path.last().unwrap().1 >= 60);
        assert!((hints[0].mean_probability - 0.2).abs() < 1e-6);
    }

    #[test]
    fn nothing_between_two_tips_is_no_hint() {
        let (probability, mask) = strands(|_, _| 0.01);
        assert!(gap_hints(&probability, &mask, &GapParams::DEFAULT).unwrap().is_empty());
        let params = GapParams { longest_px: 15.0, ..GapParams::DEFAULT };
        let (probability, mask) = strands(|_, _| 0.2);
        assert!(gap_hints(&probability, &mask, &params).unwrap().is_empty());
    }

    #[test]
    fn a_halo_beside_one_strand_leads_nowhere() {
        let probability = Array2::from_shape_fn((40, 100), |(row, col)| match (row, col) {
            (19..=21, 5..95) => 0.9,
            (17..=23, 3..97) => 0.2,
            _ => 0.001,
        });
        let mask = Mask::from_array(probability.mapv(|p| p > 0.5)).unwrap();
        assert!(gap_hints(&probability, &mask, &GapParams::DEFAULT).unwrap().is_empty());
    }

    #[test]
    fn other_shapes_and_nan_are_refused() {
        let (mut probability, mask) = strands(|_, _| 0.2);
        let other = Array2::zeros((3, 3));
        assert!(matches!(
            gap_hints(&other, &mask, &GapParams::DEFAULT),
            Err(SegError::WrongShape { .. })
        ));
        probability[[7, 9]] = f32::NAN;
        assert!(matches!(
            gap_hints(&probability, &mask, &GapParams::DEFAULT),
            Err(SegError::NotFinite { row: 7, column: 9, .. })
        ));
    }
}
