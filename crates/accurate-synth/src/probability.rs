//! Probability maps as a network makes them of a body that it half sees: for trying out what comes
//! after a segmentation without having one.

use std::ops::RangeInclusive;

use accurate_geom::{Pixel, View};
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::{SynthCase, case_rng};

/// What is wrong with a probability map; counts are per view.
#[derive(Debug, Clone, PartialEq)]
pub struct ProbabilityDamage {
    /// Stretches of the body that fade below every threshold.
    pub breaks: RangeInclusive<u32>,
    /// Length of such a stretch, px.
    pub break_px: RangeInclusive<f64>,
    /// What is left of the probability in the middle of a break, part of 1.
    pub left_in_breaks: RangeInclusive<f64>,
    /// Share of tips that are missing.
    pub missing_tips: f64,
    /// Length that a missing tip is short by, px.
    pub tip_px: RangeInclusive<f64>,
    /// Pieces of something else.
    pub strays: RangeInclusive<u32>,
    /// Their length, px.
    pub stray_px: RangeInclusive<f64>,
    /// Their probability, part of 1.
    pub stray_probability: RangeInclusive<f64>,
    /// Share of crossings that are a blob.
    pub blobs: f64,
    /// Radius of a blob, px.
    pub blob_px: RangeInclusive<f64>,
    /// Standard deviation of how far the body's edge is misplaced, px; it changes along the body
    /// over about 6 px.
    pub edge_sigma_px: f64,
}

impl ProbabilityDamage {
    /// Nothing but the blur of an edge.
    pub const NONE: Self = Self {
        breaks: 0..=0,
        break_px: 10.0..=40.0,
        left_in_breaks: 0.05..=0.6,
        missing_tips: 0.0,
        tip_px: 4.0..=15.0,
        strays: 0..=0,
        stray_px: 15.0..=60.0,
        stray_probability: 0.4..=0.95,
        blobs: 0.0,
        blob_px: 3.0..=7.0,
        edge_sigma_px: 0.0,
    };
    /// What a network that is good but not perfect does.
    pub const USUAL: Self = Self {
        breaks: 0..=2,
        missing_tips: 0.2,
        strays: 0..=2,
        blobs: 0.3,
        edge_sigma_px: 0.3,
        ..Self::NONE
    };
}

/// Standard deviation of the blur of an edge, px.
const EDGE_BLUR_PX: f64 = 0.6;
/// Smoothness of the misplacement of edges, px.
const WANDER_PX: f64 = 6.0;

/// The probability maps, shape (height, width), values 0 to 1, of both views of a case. Only the
/// case, the options and `seed` count.
///
/// # Cost
/// A few milliseconds a view.
pub fn damaged_probabilities(
    case: &SynthCase,
    seed: u64,
    damage: &ProbabilityDamage,
) -> [Array2<f32>; 2] {
    let of = |view: usize| {
        let stream = format!("probability-{seed}-{}", view + 1);
        case_rng(case.family, case.seed, case.index, &stream)
    };
    [
        damaged(&case.masks[0], &positions(&case.exact_points.0), of(0), damage),
        damaged(&case.masks[1], &positions(&case.exact_points.1), of(1), damage),
    ]
}

fn positions<V: View>(points: &[Pixel<V>]) -> Vec<[f64; 2]> {
    points.iter().map(|p| [p.x, p.y]).collect()
}

/// `points`: the body, in order, about 1 px apart.
fn damaged(
    mask: &Array2<bool>,
    points: &[[f64; 2]],
    mut rng: ChaCha8Rng,
    damage: &ProbabilityDamage,
) -> Array2<f32> {
    let mut body = mask.mapv(|set| if set { 1.0 } else { 0.0 });
    blobs(&mut body, points, &mut rng, damage);
    if damage.edge_sigma_px > 0.0 {
        misplace_edges(&mut body, &mut rng, damage.edge_sigma_px);
    } else {
        blur(&mut body, EDGE_BLUR_PX);
    }
    let last = points.len().saturating_sub(1);
    for _ in 0..rng.random_range(damage.breaks.clone()) {
        let half = rng.random_range(damage.break_px.clone()) / 2.0;
        let left = rng.random_range(damage.left_in_breaks.clone());
        let at = rng.random_range(0..=last);
        fade(&mut body, points[at], half, left);
    }
    for tip in [points.first(), points.last()].into_iter().flatten() {
        let radius = rng.random_range(damage.tip_px.clone());
        if rng.random_bool(damage.missing_tips) {
            fade(&mut body, *tip, radius, 0.02);
        }
    }
    for _ in 0..rng.random_range(damage.strays.clone()) {
        stray(&mut body, &mut rng, damage);
    }
    body.mapv(|p| p.clamp(0.0, 1.0) as f32)
}

/// Discs of body where two strands meet.
fn blobs(
    body: &mut Array2<f64>,
    points: &[[f64; 2]],
    rng: &mut ChaCha8Rng,
    damage: &ProbabilityDamage,
) {
    /// Strands so far apart along the body, px, are two.
    const APART: usize = 30;
    const MEET_PX: f64 = 1.5;
    let mut skip_to = 0;
    for (i, p) in points.iter().enumerate() {
        let meets = |q: &[f64; 2]| (q[0] - p[0]).hypot(q[1] - p[1]) < MEET_PX;
        if i < skip_to || !points.iter().skip(i + APART).any(meets) {
            continue;
        }
        skip_to = i + APART;
        let radius = rng.random_range(damage.blob_px.clone());
        if rng.random_bool(damage.blobs) {
            for ((y, x), value) in body.indexed_iter_mut() {
                if (x as f64 - p[0]).hypot(y as f64 - p[1]) <= radius {
                    *value = 1.0;
                }
            }
        }
    }
}

/// Lowers the body around a point to the part `left`, over about `half_px` to each side.
fn fade(body: &mut Array2<f64>, at: [f64; 2], half_px: f64, left: f64) {
    for ((y, x), value) in body.indexed_iter_mut() {
        let distance = (x as f64 - at[0]).hypot(y as f64 - at[1]);
        // From `left` inside to 1 over 3 px at the rim.
        let inside = ((half_px + 1.5 - distance) / 3.0).clamp(0.0, 1.0);
        *value *= 1.0 - (1.0 - left) * inside;
    }
}

/// A bent stroke, 3 px wide.
fn stray(body: &mut Array2<f64>, rng: &mut ChaCha8Rng, damage: &ProbabilityDamage) {
    const HALF_PX: f64 = 1.5;
    let (height, width) = body.dim();
    let mut at = [rng.random_range(0.0..width as f64), rng.random_range(0.0..height as f64)];
    let mut heading = rng.random_range(0.0..std::f64::consts::TAU);
    let turn = rng.random_range(-0.03..0.03);
    let length = rng.random_range(damage.stray_px.clone());
    let probability = rng.random_range(damage.stray_probability.clone());
    for _ in 0..length as usize {
        for y in near(at[1], HALF_PX + 1.0, height) {
            for x in near(at[0], HALF_PX + 1.0, width) {
                let distance = (x as f64 - at[0]).hypot(y as f64 - at[1]);
                let p = probability * (HALF_PX + 0.5 - distance).clamp(0.0, 1.0);
                body[[y, x]] = body[[y, x]].max(p);
            }
        }
        at = [at[0] + heading.cos(), at[1] + heading.sin()];
        heading += turn;
    }
}

fn near(centre: f64, reach: f64, count: usize) -> std::ops::Range<usize> {
    let low = (centre - reach).ceil().clamp(0.0, count as f64) as usize;
    let high = ((centre + reach).floor() + 1.0).clamp(0.0, count as f64) as usize;
    low..high.max(low)
}

/// Blurs, and moves the edge to and fro: the level 0.5 of the result is off by a smooth random
/// distance.
fn misplace_edges(body: &mut Array2<f64>, rng: &mut ChaCha8Rng, sigma_px: f64) {
    let mut wander = Array2::from_shape_fn(body.dim(), |_| {
        // Sum of four uniforms: near enough to normal, variance 1/3.
        (0..4).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>()
    });
    blur(&mut wander, WANDER_PX);
    // White noise of variance 1/3, averaged with a Gaussian of standard deviation s: 1/(3 4 pi s²).
    let scale = sigma_px * (3.0 * 4.0 * std::f64::consts::PI).sqrt() * WANDER_PX;
    blur(body, EDGE_BLUR_PX);
    for (value, offset) in body.iter_mut().zip(&wander) {
        if *value > 1e-3 && *value < 1.0 - 1e-3 {
            // At an edge of this blur the logit grows by about 1.7 per standard deviation.
            let logit = (*value / (1.0 - *value)).ln() + 1.7 / EDGE_BLUR_PX * offset * scale;
            *value = 1.0 / (1.0 + (-logit).exp());
        }
    }
}

/// Gaussian blur; beyond the border the image goes on as 0.
fn blur(image: &mut Array2<f64>, sigma: f64) {
    let reach = (3.0 * sigma).ceil() as isize;
    let mut kernel: Vec<f64> =
        (-reach..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let sum: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= sum);
    let convolve = |line: &[f64]| -> Vec<f64> {
        (0..line.len() as isize)
            .map(|i| {
                (-reach..=reach)
                    .zip(&kernel)
                    .filter_map(|(k, weight)| {
                        Some(weight * line.get(usize::try_from(i + k).ok()?)?)
                    })
                    .sum()
            })
            .collect()
    };
    for mut lane in image.rows_mut() {
        let line = lane.to_vec();
        if line.iter().any(|v| *v != 0.0) {
            lane.assign(&ndarray::Array1::from(convolve(&line)));
        }
    }
    for mut lane in image.columns_mut() {
        let line = lane.to_vec();
        if line.iter().any(|v| *v != 0.0) {
            lane.assign(&ndarray::Array1::from(convolve(&line)));
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{CaseOptions, Family, generate};

    use super::*;

    fn case() -> SynthCase {
        generate(Family::Medium, 1000, 0, &CaseOptions::default()).unwrap()
    }

    #[test]
    fn without_damage_the_level_one_half_is_the_mask() {
        let case = case();
        let maps = damaged_probabilities(&case, 1, &ProbabilityDamage::NONE);
        for (map, mask) in maps.iter().zip(&case.masks) {
            let wrong = map.iter().zip(mask).filter(|(p, set)| (**p > 0.5) != **set).count();
            // A blur of 0.6 px can move the level past a pixel only at corners of the mask.
            let edge = mask.iter().filter(|set| **set).count();
            assert!(wrong * 5 < edge, "{wrong} of {edge}");
        }
    }

    #[test]
    fn every_damage_does_what_it_is_called() {
        let case = case();
        let count = |damage: ProbabilityDamage| {
            damaged_probabilities(&case, 1, &damage)[0].iter().filter(|p| **p > 0.5).count()
        };
        let none = ProbabilityDamage::NONE;
        let whole = count(none.clone());
        let low = 0.05..=0.1;
        assert!(
            count(ProbabilityDamage { breaks: 2..=2, left_in_breaks: low, ..none.clone() }) < whole
        );
        assert!(count(ProbabilityDamage { missing_tips: 1.0, ..none.clone() }) < whole);
        let sure = 0.9..=0.95;
        let stray = ProbabilityDamage { strays: 2..=2, stray_probability: sure, ..none.clone() };
        assert!(count(stray) > whole);
        // Not every view shows a crossing; six cases of this family do somewhere.
        let blobs = ProbabilityDamage { blobs: 1.0, ..none.clone() };
        let over_cases = |damage: &ProbabilityDamage| -> Vec<usize> {
            (0..6)
                .map(|index| {
                    generate(Family::Medium, 1000, index, &CaseOptions::default()).unwrap()
                })
                .flat_map(|case| damaged_probabilities(&case, 1, damage))
                .map(|map| map.iter().filter(|p| **p > 0.5).count())
                .collect()
        };
        let (with, without) = (over_cases(&blobs), over_cases(&none));
        assert!(with.iter().zip(&without).all(|(a, b)| a >= b), "{with:?} {without:?}");
        assert_ne!(with, without);
    }

    #[test]
    fn the_same_seed_gives_the_same_map_and_values_are_probabilities() {
        let case = case();
        let usual = ProbabilityDamage::USUAL;
        let [one, two] = [3, 4].map(|seed| damaged_probabilities(&case, seed, &usual));
        assert_eq!(one, damaged_probabilities(&case, 3, &usual));
        assert_ne!(one, two);
        assert!(one.iter().flatten().all(|p| (0.0..=1.0).contains(p)));
    }
}
