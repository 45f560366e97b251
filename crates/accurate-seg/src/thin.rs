use crate::Mask;
use crate::bit_image::{Around, BitImage};
use crate::thin_rules::{guo_hall_east, guo_hall_west, zhang_suen_first, zhang_suen_second};

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
/// One scan of the image, then O(foreground): 64 pixels at a time are decided by some eighty
/// operations on words, and only words near a change are looked at again. A quarter of a byte of
/// memory per pixel, besides the result.
pub fn zhang_suen(mask: &Mask) -> Mask {
    thin(mask, zhang_suen_first, zhang_suen_second)
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
    thin(mask, guo_hall_west, guo_hall_east)
}

/// Alternates the two half-steps until neither deletes a pixel. Within a half-step all decisions
/// see the image as it was at its beginning.
///
/// A rule tells which pixels of a word go if they are foreground. A half-step looks only at its
/// list, which holds every word that may have such a pixel: at first all with foreground, then
/// those that hold or touch a pixel deleted since it last looked at them.
fn thin(mask: &Mask, first: impl Fn(&Around) -> u64, second: impl Fn(&Around) -> u64) -> Mask {
    let mut image = BitImage::of(mask);
    let mut waiting = [image.used(), image.used()];
    // Bit `half` of a word's entry: it is in the list of that half-step.
    let mut listed = vec![0_u8; image.len()];
    waiting[0].iter().for_each(|&at| listed[at] = 0b11);
    let mut deleted = Vec::new();
    let mut half = 0;
    while waiting.iter().any(|list| !list.is_empty()) {
        // First all decisions, then all deletions.
        for at in waiting[half].drain(..) {
            listed[at] &= !(1 << half);
            let around = image.around(at);
            let goes = if half == 0 { first(&around) } else { second(&around) };
            let pixels = goes & image.word(at);
            if pixels != 0 {
                deleted.push((at, pixels));
            }
        }
        for (at, pixels) in deleted.drain(..) {
            image.delete(at, pixels, |near| {
                for (half, list) in waiting.iter_mut().enumerate() {
                    if listed[near] >> half & 1 == 0 {
                        listed[near] |= 1 << half;
                        list.push(near);
                    }
                }
            });
        }
        half = 1 - half;
    }
    let mut thinned = mask.cleared();
    image.unpack_into(&mut thinned);
    thinned
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;
    use crate::Components;
    use crate::thin_tables::{GUO_HALL, Rule, ZHANG_SUEN, ZHANG_SUEN_1984};

    /// The rule of a table for 64 pixels at a time: all its neighbourhoods, one by one.
    fn in_words(table: &'static Rule) -> impl Fn(&Around) -> u64 {
        move |&Around { n, ne, e, se, s, sw, w, nw }| {
            let neighbours = [n, ne, e, se, s, sw, w, nw];
            let is = |code: usize| {
                let bits = neighbours.iter().enumerate();
                bits.fold(!0, |all, (k, &word)| all & if code >> k & 1 == 1 { word } else { !word })
            };
            (0..256).filter(|&code| table[code]).map(is).fold(0, |any, word| any | word)
        }
    }

    fn thin_by_tables(mask: &Mask, [first, second]: &'static [Rule; 2]) -> Mask {
        thin(mask, in_words(first), in_words(second))
    }

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
            assert_eq!(
                thin_by_tables(&mask, &ZHANG_SUEN_1984),
                expected,
                "Zhang-Suen, mask {bits}"
            );
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
            let printed = thin_by_tables(&mask, &ZHANG_SUEN_1984);
            changed += usize::from(components(&mask) != components(&printed));
            vanished += usize::from(!mask.is_empty() && printed.is_empty());
            differ += usize::from(printed != zhang_suen(&mask));
        }
        assert_eq!((changed, vanished, differ), (637, 69, 51_989));
    }

    proptest! {
        #[test]
        fn lists_give_what_full_scans_give_on_larger_masks(
            // Up to four words wide, so that deletions meet across words.
            (height, width) in (1..30usize, 1..200usize),
            density in 0.3..1.0f64,
            seed in prop::collection::vec(0.0..1.0f64, 6000),
        ) {
            let pixels = Array2::from_shape_fn((height, width), |(r, c)| seed[r * 200 + c] < density);
            let mask = Mask::from_array(pixels).unwrap();
            let code = |p: [bool; 8]| (0..8).map(|k| usize::from(p[k]) << k).sum::<usize>();
            for (tables, thinned) in [
                (&ZHANG_SUEN, zhang_suen(&mask)),
                (&GUO_HALL, guo_hall(&mask)),
                (&ZHANG_SUEN_1984, thin_by_tables(&mask, &ZHANG_SUEN_1984)),
            ] {
                let expected = by_full_scans(&mask, |p, half| tables[half][code(p)]);
                prop_assert_eq!(thinned, expected);
            }
        }
    }
}
