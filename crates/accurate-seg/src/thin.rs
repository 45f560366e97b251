use crate::Mask;
use crate::thin_rules::{GUO_HALL, Rule, ZHANG_SUEN};

/// Thins a mask to lines one pixel wide, equal pixel for pixel to `skeletonize` of scikit-image
/// 0.26 (its default method for 2D images).
///
/// The result is a subset of the mask with the same 8-connected components and the same holes;
/// thinning it again changes nothing. What "one pixel wide" means: a 2 x 2 block is left only
/// where four strands meet in it, and a few pixels stay that could go without breaking a line
/// (in 2 970 of the 65 536 masks of 4 x 4 pixels), among them ends two pixels wide.
///
/// # Source
/// Zhang and Suen, "A fast parallel algorithm for thinning digital patterns", CACM 1984.
/// Deviation: the 30 neighbourhoods (of 2 x 256) in which scikit-image departs from the printed
/// conditions. As printed, the algorithm erases 2 x 2 blocks: of the 65 536 masks of 4 x 4 pixels
/// 637 change their number of components and 69 vanish.
///
/// # Cost
/// One scan of the image, then O(foreground): only pixels whose neighbourhood has changed are
/// looked at again. One byte of memory per pixel.
pub fn zhang_suen(mask: &Mask) -> Mask {
    thin(mask, &ZHANG_SUEN)
}

/// Thins a mask to lines one pixel wide, equal pixel for pixel to OpenCV's `ximgproc.thinning`
/// with `THINNING_GUOHALL` on an image with a margin of background.
///
/// Keeps components and holes and is idempotent like [`zhang_suen`]; diagonal lines come out
/// thinner (no staircases). Deviation from OpenCV: the outermost rows and columns are thinned like
/// any other, with background outside; OpenCV leaves them out.
///
/// # Source
/// Guo and Hall, "Parallel thinning with two-subiteration algorithms", CACM 1989, algorithm A1.
///
/// # Cost
/// As [`zhang_suen`].
pub fn guo_hall(mask: &Mask) -> Mask {
    thin(mask, &GUO_HALL)
}

/// A foreground cell has this bit; a deleted cell is 0.
const FOREGROUND: u8 = 1;
/// The cell waits in the list of half-step 0, 1.
const WAITS: [u8; 2] = [2, 4];

/// Alternates the two half-steps until neither deletes a pixel. Within a half-step all decisions
/// see the image as it was at its beginning.
///
/// Instead of the whole image a half-step looks only at its own list: the pixels whose
/// neighbourhood has changed since it last looked at them. The others were kept with the
/// neighbourhood they still have, and would be kept again.
fn thin(mask: &Mask, rules: &[Rule; 2]) -> Mask {
    let (height, width) = mask.shape();
    // A margin of background spares every test of the border.
    let stride = width + 2;
    let mut cells = vec![0u8; stride * (height + 2)];
    for (cells, row) in cells[stride..].chunks_exact_mut(stride).zip(mask.raster().chunks(width)) {
        for (cell, &pixel) in cells[1..].iter_mut().zip(row) {
            *cell = u8::from(pixel);
        }
    }

    let inner = u8::MAX;
    let border: Vec<usize> = mask
        .foreground()
        .map(|(row, col)| (row + 1) * stride + col + 1)
        .filter(|&at| neighbourhood(&cells, at, stride) != inner)
        .collect();
    for &at in &border {
        cells[at] |= WAITS[0] | WAITS[1];
    }

    let mut thinned = mask.clone();
    let mut waiting = [border.clone(), border];
    let mut doomed = Vec::new();
    let mut half = 0;
    while waiting.iter().any(|list| !list.is_empty()) {
        for at in waiting[half].drain(..) {
            cells[at] &= !WAITS[half];
            let code = neighbourhood(&cells, at, stride);
            if cells[at] & FOREGROUND != 0 && rules[half][usize::from(code)] {
                doomed.push(at);
            }
        }
        for &at in &doomed {
            cells[at] = 0;
            thinned.set(at / stride - 1, at % stride - 1, false);
        }
        for at in doomed.drain(..) {
            for from in [at - stride - 1, at - 1, at + stride - 1] {
                for near in [from, from + 1, from + 2] {
                    if cells[near] & FOREGROUND == 0 {
                        continue;
                    }
                    for (list, bit) in waiting.iter_mut().zip(WAITS) {
                        if cells[near] & bit == 0 {
                            cells[near] |= bit;
                            list.push(near);
                        }
                    }
                }
            }
        }
        half = 1 - half;
    }
    thinned
}

/// The eight neighbours as a code of [`Rule`]: bit 0 is north, then clockwise.
fn neighbourhood(cells: &[u8], at: usize, stride: usize) -> u8 {
    let (up, down) = (&cells[at - stride - 1..at - stride + 2], &cells[at + stride - 1..][..3]);
    let (west, east) = (cells[at - 1], cells[at + 1]);
    (up[1] & 1)
        | (up[2] & 1) << 1
        | (east & 1) << 2
        | (down[2] & 1) << 3
        | (down[1] & 1) << 4
        | (down[0] & 1) << 5
        | (west & 1) << 6
        | (up[0] & 1) << 7
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;
    use crate::Components;
    use crate::thin_rules::ZHANG_SUEN_1984;

    /// P2..P9 of Zhang and Suen: clockwise from north.
    fn p2_to_p9(mask: &Mask, row: usize, col: usize) -> [bool; 8] {
        let at = |r: isize, c: isize| {
            let (row, col) = (row.checked_add_signed(r), col.checked_add_signed(c));
            row.zip(col).is_some_and(|(row, col)| mask.get(row, col))
        };
        [at(-1, 0), at(-1, 1), at(0, 1), at(1, 1), at(1, 0), at(1, -1), at(0, -1), at(-1, -1)]
    }

    /// The definition, word by word: rescan everything, mark, delete the marked.
    fn by_full_scans(mask: &Mask, deletes: impl Fn([bool; 8], usize) -> bool) -> Mask {
        let mut image = mask.clone();
        loop {
            let before = image.count();
            for half in 0..2 {
                let marked: Vec<_> = image
                    .foreground()
                    .filter(|&(row, col)| deletes(p2_to_p9(&image, row, col), half))
                    .collect();
                for (row, col) in marked {
                    image.set(row, col, false);
                }
            }
            if image.count() == before {
                return image;
            }
        }
    }

    fn zhang_suen_as_printed(p: [bool; 8], half: usize) -> bool {
        let b = p.iter().filter(|&&n| n).count();
        let a = (0..8).filter(|&k| !p[k] && p[(k + 1) % 8]).count();
        let [p2, _, p4, _, p6, _, p8, _] = p;
        let (c, d) = if half == 0 {
            (p2 && p4 && p6, p4 && p6 && p8)
        } else {
            (p2 && p4 && p8, p2 && p6 && p8)
        };
        (2..=6).contains(&b) && a == 1 && !c && !d
    }

    fn guo_hall_as_printed(p: [bool; 8], half: usize) -> bool {
        let [p2, p3, p4, p5, p6, p7, p8, p9] = p;
        let n = |flags: [bool; 4]| flags.into_iter().filter(|&f| f).count();
        let c = n([!p2 && (p3 || p4), !p4 && (p5 || p6), !p6 && (p7 || p8), !p8 && (p9 || p2)]);
        let n1 = n([p9 || p2, p3 || p4, p5 || p6, p7 || p8]);
        let n2 = n([p2 || p3, p4 || p5, p6 || p7, p8 || p9]);
        let m = if half == 0 { (p6 || p7 || !p9) && p8 } else { (p2 || p3 || !p5) && p4 };
        c == 1 && (2..=3).contains(&n1.min(n2)) && !m
    }

    fn four_by_four(bits: u32) -> Mask {
        Mask::from_array(Array2::from_shape_fn((4, 4), |(r, c)| bits >> (4 * r + c) & 1 == 1))
            .unwrap()
    }

    #[test]
    fn lists_give_what_full_scans_of_the_printed_rules_give_on_every_4_by_4_mask() {
        for bits in 0..1 << 16 {
            let mask = four_by_four(bits);
            let expected = by_full_scans(&mask, zhang_suen_as_printed);
            assert_eq!(thin(&mask, &ZHANG_SUEN_1984), expected, "Zhang-Suen, mask {bits}");
            let expected = by_full_scans(&mask, guo_hall_as_printed);
            assert_eq!(guo_hall(&mask), expected, "Guo-Hall, mask {bits}");
        }
    }

    #[test]
    fn as_printed_637_masks_change_components_and_69_vanish() {
        let components = |mask: &Mask| Components::of(mask).unwrap().sizes().len();
        let (mut changed, mut vanished, mut differ) = (0, 0, 0);
        for bits in 0..1 << 16 {
            let mask = four_by_four(bits);
            let printed = thin(&mask, &ZHANG_SUEN_1984);
            changed += usize::from(components(&mask) != components(&printed));
            vanished += usize::from(!mask.is_empty() && printed.is_empty());
            differ += usize::from(printed != zhang_suen(&mask));
        }
        assert_eq!((changed, vanished, differ), (637, 69, 51_989));
    }

    proptest! {
        #[test]
        fn lists_give_what_full_scans_give_on_larger_masks(
            (height, width) in (1..40usize, 1..40usize),
            density in 0.3..1.0f64,
            seed in prop::collection::vec(0.0..1.0f64, 1600),
        ) {
            let pixels = Array2::from_shape_fn((height, width), |(r, c)| seed[r * 40 + c] < density);
            let mask = Mask::from_array(pixels).unwrap();
            let code = |p: [bool; 8]| (0..8).map(|k| usize::from(p[k]) << k).sum::<usize>();
            for rules in [&ZHANG_SUEN, &ZHANG_SUEN_1984, &GUO_HALL] {
                let expected = by_full_scans(&mask, |p, half| rules[half][code(p)]);
                prop_assert_eq!(thin(&mask, rules), expected);
            }
        }
    }
}
