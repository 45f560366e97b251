use crate::Mask;
use crate::thin_rules::{E, GUO_HALL, N, NE, NW, Rule, S, SE, SW, W, ZHANG_SUEN};

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
/// looked at again. One byte of memory per pixel and about 16 per foreground pixel.
pub fn zhang_suen(mask: &Mask) -> Mask {
    thin(mask, &ZHANG_SUEN)
}

/// Thins a mask to lines one pixel wide, equal pixel for pixel to OpenCV's `ximgproc.thinning`
/// with `THINNING_GUOHALL` on an image with a margin of background.
///
/// Keeps components and holes and is idempotent like [`zhang_suen`]; of the 65 536 masks of 4 x 4
/// pixels it leaves a 2 x 2 block in 88 and a pixel that could still go in 8 905. Deviation from
/// OpenCV: the outermost rows and columns are thinned like any other, with background outside;
/// OpenCV leaves them out.
///
/// # Source
/// Guo and Hall, "Parallel thinning with two-subiteration algorithms", CACM 1989, algorithm A1.
///
/// # Cost
/// As [`zhang_suen`].
pub fn guo_hall(mask: &Mask) -> Mask {
    thin(mask, &GUO_HALL)
}

/// Alternates the two half-steps until neither deletes a pixel. Within a half-step all decisions
/// see the image as it was at its beginning.
///
/// Each foreground pixel holds the code of its neighbourhood, kept up to date; background holds 0,
/// which no rule deletes. A half-step looks only at its list, which contains every pixel that its
/// rule deletes: pixels enter when their code changes to such a one. Entries whose code has
/// changed again, or that are doubled, are recognised when their turn comes.
fn thin(mask: &Mask, rules: &[Rule; 2]) -> Mask {
    // A margin of background spares every test of the border.
    let stride = mask.width() + 2;
    let mut codes = padded(mask, stride);
    let mut foreground = Vec::new();
    mask.foreground().for_each(|(row, col)| {
        let at = (row + 1) * stride + col + 1;
        foreground.push((at, code_of(&codes, at, stride)));
    });
    let mut waiting = [Vec::new(), Vec::new()];
    for (at, code) in foreground {
        codes[at] = code;
        enter(&mut waiting, rules, at, code);
    }

    let mut thinned = mask.clone();
    let mut deleted = Vec::new();
    let mut half = 0;
    while waiting.iter().any(|list| !list.is_empty()) {
        // First all decisions: only the code of the pixel itself changes, to that of background.
        for at in waiting[half].drain(..) {
            if rules[half][usize::from(codes[at])] {
                codes[at] = 0;
                deleted.push(at);
            }
        }
        // Then their neighbours learn of it.
        for at in deleted.drain(..) {
            thinned.set(at / stride - 1, at % stride - 1, false);
            for (near, seen_from_there) in around(at, stride) {
                let code = codes[near] & !seen_from_there;
                codes[near] = code;
                enter(&mut waiting, rules, near, code);
            }
        }
        half = 1 - half;
    }
    thinned
}

/// Enters a pixel in the lists of the half-steps that would delete it.
fn enter(waiting: &mut [Vec<usize>; 2], rules: &[Rule; 2], at: usize, code: u8) {
    for (list, rule) in waiting.iter_mut().zip(rules) {
        if rule[usize::from(code)] {
            list.push(at);
        }
    }
}

/// The mask as 0 and 1, row by row with a margin of one 0 on each side.
fn padded(mask: &Mask, stride: usize) -> Vec<u8> {
    let mut cells = vec![0; stride * (mask.height() + 2)];
    let rows = mask.raster().chunks(mask.width());
    for (cells, row) in cells[stride..].chunks_exact_mut(stride).zip(rows) {
        for (cell, &pixel) in cells[1..].iter_mut().zip(row) {
            *cell = u8::from(pixel);
        }
    }
    cells
}

/// The neighbours of `at`, each with the bit that `at` has in *its* code.
fn around(at: usize, stride: usize) -> [(usize, u8); 8] {
    let (up, down) = (at - stride, at + stride);
    [
        (up, S),
        (up + 1, SW),
        (at + 1, W),
        (down + 1, NW),
        (down, N),
        (down - 1, NE),
        (at - 1, E),
        (up - 1, SE),
    ]
}

/// The code of the cell `at` in an image of 0 and 1: bit 0 is north, then clockwise.
fn code_of(cells: &[u8], at: usize, stride: usize) -> u8 {
    let (up, down) = (&cells[at - stride - 1..][..3], &cells[at + stride - 1..][..3]);
    let bits = [up[1], up[2], cells[at + 1], down[2], down[1], down[0], cells[at - 1], up[0]];
    bits.into_iter().enumerate().fold(0, |code, (k, bit)| code | bit << k)
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
