//! Thinning against the results of scikit-image and OpenCV in `fixtures/thinning.json`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_seg::{Components, Mask, guo_hall, zhang_suen};
use ndarray::Array2;
use serde_json::Value;

fn fixtures() -> Value {
    serde_json::from_str(include_str!("fixtures/thinning.json")).unwrap()
}

/// Bits row by row, the first pixel in the highest bit of a hexadecimal digit.
fn unpack(case: &Value, key: &str) -> Mask {
    let side = |key: &str| case[key].as_u64().unwrap() as usize;
    let digits = case[key].as_str().unwrap().as_bytes();
    let width = side("width");
    let bit = |at: usize| {
        let digit = char::from(digits[at / 4]).to_digit(16).unwrap();
        digit >> (3 - at % 4) & 1 == 1
    };
    let pixels = Array2::from_shape_fn((side("height"), width), |(r, c)| bit(r * width + c));
    Mask::from_array(pixels).unwrap()
}

fn assert_equal_on_all_cases(thin: impl Fn(&Mask) -> Mask, key: &str) {
    let document = fixtures();
    let cases = document["cases"].as_array().unwrap();
    assert!(cases.len() >= 25);
    for case in cases {
        let (mask, expected) = (unpack(case, "mask"), unpack(case, key));
        let found = thin(&mask);
        assert!(
            found == expected,
            "{}: mask\n{mask}expected\n{expected}found\n{found}",
            case["name"]
        );
    }
}

#[test]
fn zhang_suen_is_pixel_for_pixel_what_scikit_image_gives() {
    assert_equal_on_all_cases(zhang_suen, "skeletonize");
}

#[test]
fn guo_hall_is_pixel_for_pixel_what_opencv_gives_away_from_the_border() {
    assert_equal_on_all_cases(guo_hall, "guo_hall");
}

/// Mask `n` of 4 x 4 has pixel `(row, col)` where bit `4 row + col` of `n` is set.
fn mask_number(n: u32) -> Mask {
    Mask::from_array(Array2::from_shape_fn((4, 4), |(r, c)| n >> (4 * r + c) & 1 == 1)).unwrap()
}

fn number_of(mask: &Mask) -> u16 {
    mask.foreground().map(|(r, c)| 1 << (4 * r + c)).sum()
}

/// FNV-1a, 64 bits.
fn digest(bytes: impl Iterator<Item = u8>) -> String {
    let step = |hash: u64, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    format!("{:016x}", bytes.fold(0xcbf2_9ce4_8422_2325, step))
}

#[test]
fn both_agree_with_their_peers_on_every_4_by_4_mask() {
    let expected = &fixtures()["all_4_by_4_fnv1a64"];
    let of = |thin: fn(&Mask) -> Mask| {
        digest((0..1 << 16).flat_map(|n| number_of(&thin(&mask_number(n))).to_le_bytes()))
    };
    assert_eq!(of(zhang_suen), expected["skeletonize"]);
    assert_eq!(of(guo_hall), expected["guo_hall"]);
}

/// Components of the foreground (8-connected) and of the background with a margin (4-connected).
fn topology(mask: &Mask) -> (usize, usize) {
    let mut open: Vec<_> = (0..36).map(|at| (at / 6, at % 6)).collect();
    let background = |(r, c): (usize, usize)| r == 0 || c == 0 || !mask.get(r - 1, c - 1);
    open.retain(|&at| background(at));
    let mut holes = 0;
    while let Some(start) = open.pop() {
        holes += 1;
        let mut stack = vec![start];
        while let Some((r, c)) = stack.pop() {
            let beside = |&(r2, c2): &(usize, usize)| r.abs_diff(r2) + c.abs_diff(c2) == 1;
            stack.extend(open.iter().copied().filter(beside));
            open.retain(|at| !beside(at));
        }
    }
    (Components::of(mask).unwrap().sizes().len(), holes)
}

/// Pixels that are no end (two neighbours or more) and whose removal alone would break nothing.
fn spare_pixels(mask: &Mask) -> usize {
    let whole = topology(mask);
    let without = |at: (usize, usize)| {
        let mut pixels = mask.as_array().clone();
        pixels[at] = false;
        topology(&Mask::from_array(pixels).unwrap())
    };
    let neighbours = |(r, c): (usize, usize)| {
        let near = |&(r2, c2): &(usize, usize)| r.abs_diff(r2).max(c.abs_diff(c2)) == 1;
        mask.foreground().filter(near).count()
    };
    mask.foreground().filter(|&at| neighbours(at) >= 2 && without(at) == whole).count()
}

fn has_a_2_by_2_block(mask: &Mask) -> bool {
    (0..3).any(|r| {
        (0..3)
            .any(|c| [(0, 0), (0, 1), (1, 0), (1, 1)].iter().all(|&(i, j)| mask.get(r + i, c + j)))
    })
}

#[test]
fn what_holds_on_every_4_by_4_mask() {
    for (thin, blocks_expected, spare_expected) in
        [(zhang_suen as fn(&Mask) -> Mask, 24, 2_970), (guo_hall, 88, 8_905)]
    {
        let (mut with_block, mut with_spare) = (0, 0);
        for n in 0..1 << 16 {
            let mask = mask_number(n);
            let thinned = thin(&mask);
            assert_eq!(n as u16 & number_of(&thinned), number_of(&thinned), "a subset of {n}");
            assert_eq!(thin(&thinned), thinned, "idempotent on {n}");
            assert_eq!(topology(&thinned), topology(&mask), "components and holes of {n}");
            with_block += usize::from(has_a_2_by_2_block(&thinned));
            with_spare += usize::from(spare_pixels(&thinned) > 0);
        }
        // Known limits of both algorithms: crossings that fill a 2 x 2 block, and pixels that
        // could still go.
        assert_eq!((with_block, with_spare), (blocks_expected, spare_expected));
    }
}
