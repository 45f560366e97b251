use std::collections::VecDeque;

use crate::{Mask, SegError, Skeleton, distance_to_background};

/// The mask without side branches that stick out of their strand by at most `max_spur_px`.
///
/// A side branch is a run of skeleton pixels from an endpoint to a junction; how far it sticks out is
/// its length less the radius of the strand at the junction. What is cut are the pixels of the mask
/// that are nearer (in steps through the mask) to the branch than to the rest of the skeleton, beyond
/// the strand's radius. A strand that ends in two short branches keeps the longer one, unless their
/// junction is so wide that each leaves its own pixel of it (an upright T): then both go. Pieces without a
/// junction stay as they are.
///
/// # Errors
/// [`SegError::TooLarge`] as in [`distance_to_background`].
///
/// # Cost
/// One thinning, one distance transform, one flood.
pub(crate) fn without_spurs(mask: &Mask, max_spur_px: usize) -> Result<Mask, SegError> {
    if max_spur_px == 0 || mask.is_empty() {
        return Ok(mask.clone());
    }
    let skeleton = Skeleton::of(mask)?;
    // A mask without background has no strand to stick out of.
    let Ok(radii) = distance_to_background(mask) else { return Ok(mask.clone()) };
    let mut spurs: Vec<Spur> = skeleton
        .endpoints()
        .into_iter()
        .filter_map(|end| Spur::from_end(skeleton.mask(), end))
        .filter(|spur| spur.sticks_out(radii[spur.junction]) <= max_spur_px as f64)
        .collect();
    // Shorter ones first: of two branches that make a fork at a tip, the longer is the tip.
    spurs.sort_by_key(|spur| (spur.pixels.len(), spur.pixels[0]));
    let mut left = skeleton.mask().clone();
    let mut cut = vec![false; mask.height() * mask.width()];
    for spur in &spurs {
        // Without the branches that are already gone this may be no junction any more.
        if neighbours(&left, spur.junction).count() < 3 {
            continue;
        }
        for &at in &spur.pixels {
            left.set(at.0, at.1, false);
            if distance(at, spur.junction) > radii[spur.junction] {
                cut[at.0 * mask.width() + at.1] = true;
            }
        }
    }
    if !cut.contains(&true) {
        return Ok(mask.clone());
    }
    let nearest = nearest_seed(mask, skeleton.pixels());
    let width = mask.width();
    let owner = |index: usize| nearest[index].map(|(row, col)| row * width + col);
    Ok(mask.clone().retain(|index| owner(index).is_none_or(|seed| !cut[seed])))
}

struct Spur {
    /// From the endpoint on, without the junction.
    pixels: Vec<(usize, usize)>,
    junction: (usize, usize),
}

impl Spur {
    /// Follows the skeleton from an endpoint; `None` if it comes to another end.
    fn from_end(skeleton: &Mask, end: (usize, usize)) -> Option<Self> {
        let mut pixels = vec![end];
        let mut at = end;
        let mut before = end;
        loop {
            let mut next = neighbours(skeleton, at).filter(|&n| n != before && n != end);
            let step = next.next()?;
            if neighbours(skeleton, step).count() >= 3 {
                return Some(Self { pixels, junction: step });
            }
            (before, at) = (at, step);
            pixels.push(at);
            if pixels.len() > skeleton.height() * skeleton.width() {
                return None;
            }
        }
    }

    fn sticks_out(&self, radius: f64) -> f64 {
        self.pixels.len() as f64 - radius
    }
}

fn neighbours(mask: &Mask, at: (usize, usize)) -> impl Iterator<Item = (usize, usize)> + '_ {
    let around = (at.0.saturating_sub(1)..=at.0 + 1)
        .flat_map(move |row| (at.1.saturating_sub(1)..=at.1 + 1).map(move |col| (row, col)));
    around.filter(move |&n| n != at && mask.get(n.0, n.1))
}

fn distance(a: (usize, usize), b: (usize, usize)) -> f64 {
    (a.0.abs_diff(b.0) as f64).hypot(a.1.abs_diff(b.1) as f64)
}

/// For each pixel of the mask the seed it is reached from first, breadth first.
pub(crate) fn nearest_seed(mask: &Mask, seeds: &[(usize, usize)]) -> Vec<Option<(usize, usize)>> {
    let width = mask.width();
    let mut nearest = vec![None; mask.height() * width];
    let mut open: VecDeque<(usize, usize)> = seeds.iter().copied().collect();
    for &seed in seeds {
        nearest[seed.0 * width + seed.1] = Some(seed);
    }
    while let Some(at) = open.pop_front() {
        let seed = nearest[at.0 * width + at.1];
        for n in neighbours(mask, at) {
            let slot = &mut nearest[n.0 * width + n.1];
            if slot.is_none() {
                *slot = seed;
                open.push_back(n);
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    /// A strand 3 px thick with a branch upwards of the given length above its upper edge.
    fn with_branch(length: usize) -> Mask {
        Mask::from_array(Array2::from_shape_fn((40, 60), |(row, col)| {
            let strand = (20..23).contains(&row) && (5..55).contains(&col);
            let branch = (30..33).contains(&col) && row < 20 && row + length >= 20;
            strand || branch
        }))
        .unwrap()
    }

    #[test]
    fn a_short_branch_goes_and_the_strand_stays_whole() {
        let strand = with_branch(0);
        let cleaned = without_spurs(&with_branch(4), 6).unwrap();
        let junctions = |mask: &Mask| Skeleton::of(mask).unwrap().junctions().unwrap().len();
        assert_eq!(junctions(&with_branch(4)), 1);
        assert_eq!(junctions(&cleaned), 0);
        assert!(strand.foreground().all(|(row, col)| cleaned.get(row, col)), "{cleaned}");
        // What may be left is within the radius of the junction: 2 px above the middle row.
        assert!(cleaned.foreground().all(|(row, _)| row >= 18), "{cleaned}");
    }

    #[test]
    fn a_long_branch_and_a_branchless_strand_stay_as_they_are() {
        assert_eq!(without_spurs(&with_branch(15), 6).unwrap(), with_branch(15));
        assert_eq!(without_spurs(&with_branch(0), 6).unwrap(), with_branch(0));
        assert_eq!(without_spurs(&with_branch(4), 0).unwrap(), with_branch(4));
    }

    #[test]
    fn an_empty_and_a_full_mask_pass() {
        for value in [false, true] {
            let mask = Mask::from_array(Array2::from_elem((5, 6), value)).unwrap();
            assert_eq!(without_spurs(&mask, 3).unwrap(), mask);
        }
    }
}
