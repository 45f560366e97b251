use accurate_geom::{Pixel, View};

use super::{PointFlags, Walk, WalkEnd};
use crate::TraverseError;

/// Where a walk turns back on itself without a node of the graph to show for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fold<V: View> {
    /// Its middle, or the tip that it hides.
    pub at: Pixel<V>,
    /// How far the walk runs back, px.
    pub length_px: f64,
    /// Whether the walk ends behind its visible tip instead of turning twice.
    pub at_tip: bool,
}

/// Which folds [`fold_variants`] proposes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoldParams {
    /// Lengths of the folds, px.
    pub lengths_px: [f64; 3],
    /// A position belongs to every passage of the walk this near, px.
    pub reach_px: f64,
    /// Price of each turn; a fold inside has two, a fold at a tip one.
    pub turn: f64,
}

impl FoldParams {
    /// The default: longer folds part the outline of the mask and need no guess.
    pub const DEFAULT: Self = Self { lengths_px: [8.0, 16.0, 28.0], reach_px: 6.0, turn: 0.8 };

    fn validate(&self) -> Result<(), TraverseError> {
        for (name, value) in self
            .lengths_px
            .map(|length| ("lengths_px", length))
            .into_iter()
            .chain([("reach_px", self.reach_px), ("turn", self.turn)])
        {
            if !(value.is_finite() && value >= 0.0) {
                let expected = "finite and not negative";
                return Err(TraverseError::InvalidParameter { name, value, expected });
            }
        }
        Ok(())
    }
}

impl Default for FoldParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The walk with a hidden fold near one of the positions, one fold per variant: for each position,
/// each passage of the walk by it and each length, the walk runs on by half the length, back by the
/// length, and on again; near a visible tip it may also end behind it by each length.
///
/// Where the body points along the line of sight, its image may run back on itself inside the mask
/// and the skeleton shows nothing. The positions come from elsewhere: from the other view, or from
/// outline that a fit left unexplained. The variants keep the order of positions, passages, lengths.
///
/// # Errors
/// [`TraverseError::InvalidParameter`] for a bad field of `params` or a position that is not finite.
///
/// # Cost
/// O(positions · length of the walk) and as much per variant.
pub fn fold_variants<V: View>(
    walk: &Walk<V>,
    positions: &[Pixel<V>],
    params: &FoldParams,
) -> Result<Vec<Walk<V>>, TraverseError> {
    params.validate()?;
    let mut variants = Vec::new();
    let last = walk.points.len() - 1;
    let step = if last > 0 { walk.length_px() / last as f64 } else { 0.0 };
    let longest = params.lengths_px.into_iter().fold(0.0, f64::max);
    for &at in positions {
        if !at.is_finite() {
            let (name, value) = ("positions", if at.x.is_finite() { at.y } else { at.x });
            return Err(TraverseError::InvalidParameter { name, value, expected: "finite" });
        }
        for index in passages(walk, at, params.reach_px, longest) {
            for length in params.lengths_px {
                let samples = if step > 0.0 { (length / step).round() as usize } else { 0 };
                if samples < 2 {
                    continue;
                }
                let (from, to) = (index.checked_sub(samples / 2), index + samples.div_ceil(2));
                if let Some(from) = from
                    && to <= last
                {
                    variants.push(fold_inside(walk, index, from, to, step, params));
                }
                for (side, away) in [(0, index), (1, last - index)] {
                    // One variant per tip and length: from the passage that holds the tip.
                    if away as f64 * step <= params.reach_px
                        && samples <= last
                        && walk.ends[side] == WalkEnd::Tip
                    {
                        variants.push(fold_at_tip(walk, side, samples, step, params));
                    }
                }
            }
        }
    }
    Ok(variants)
}

/// The nearest point of each passage of the walk by `at`; passages are at least `apart` px apart.
fn passages<V: View>(walk: &Walk<V>, at: Pixel<V>, reach: f64, apart: f64) -> Vec<usize> {
    let mut found: Vec<usize> = Vec::new();
    for (index, point) in walk.points.iter().enumerate() {
        let distance = point.distance(at);
        if distance > reach {
            continue;
        }
        match found.last_mut() {
            Some(best) if ((index - *best) as f64) < apart => {
                if distance < walk.points[*best].distance(at) {
                    *best = index;
                }
            }
            _ => found.push(index),
        }
    }
    found
}

fn fold_inside<V: View>(
    walk: &Walk<V>,
    middle: usize,
    from: usize,
    to: usize,
    step: f64,
    params: &FoldParams,
) -> Walk<V> {
    let mut variant = walk.clone();
    let order = (0..=to).chain((from..to).rev()).chain(from + 1..walk.points.len());
    (variant.points, variant.flags) = order
        .map(|k| {
            let reused = walk.flags[k].reused || (from..=to).contains(&k);
            (walk.points[k], PointFlags { reused, ..walk.flags[k] })
        })
        .unzip();
    variant.cost.u_turns += 2.0 * params.turn;
    let length_px = (to - from) as f64 * step;
    variant.folds.push(Fold { at: walk.points[middle], length_px, at_tip: false });
    variant
}

fn fold_at_tip<V: View>(
    walk: &Walk<V>,
    side: usize,
    samples: usize,
    step: f64,
    params: &FoldParams,
) -> Walk<V> {
    let mut variant = walk.clone();
    let last = walk.points.len() - 1;
    let folded = |k: usize| if side == 0 { k <= samples } else { last - k <= samples };
    let order: Vec<usize> = if side == 0 {
        (1..=samples).rev().chain(0..=last).collect()
    } else {
        (0..=last).chain((last - samples..last).rev()).collect()
    };
    (variant.points, variant.flags) = order
        .into_iter()
        .map(|k| {
            let reused = walk.flags[k].reused || folded(k);
            (walk.points[k], PointFlags { reused, ..walk.flags[k] })
        })
        .unzip();
    variant.cost.u_turns += params.turn;
    variant.ends[side] = WalkEnd::OnReusedEdge;
    let at = walk.points[if side == 0 { 0 } else { last }];
    variant.folds.push(Fold { at, length_px: samples as f64 * step, at_tip: true });
    variant
}
