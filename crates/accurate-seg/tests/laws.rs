//! Laws that hold for every mask and every image, against brute force where there is one.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_seg::{
    Components, Mask, Skeleton, binarise_fixed, binarise_hysteresis, binarise_otsu,
    distance_to_background, guo_hall, keep_largest, otsu_level, remove_smaller_than, zhang_suen,
};
use ndarray::Array2;
use proptest::prelude::*;

const SIDE: usize = 36;

fn noise() -> impl Strategy<Value = Mask> {
    let cells = prop::collection::vec(0.0..1.0f64, SIDE * SIDE);
    (1..=SIDE, 1..=SIDE, 0.0..1.0f64, cells).prop_map(|(height, width, density, cells)| {
        let pixels = Array2::from_shape_fn((height, width), |(r, c)| cells[r * SIDE + c] < density);
        Mask::from_array(pixels).unwrap()
    })
}

/// Thick strands: everything within `radius` of a polyline, which may leave the image.
fn strands() -> impl Strategy<Value = Mask> {
    let corner = (-4.0..40.0f64, -4.0..40.0f64);
    (prop::collection::vec(corner, 2..6), 0.5..5.0f64).prop_map(|(corners, radius)| {
        let near = |row: f64, col: f64| {
            corners.windows(2).any(|ends| {
                let [(r0, c0), (r1, c1)] = [ends[0], ends[1]];
                let (dr, dc) = (r1 - r0, c1 - c0);
                let along = ((row - r0) * dr + (col - c0) * dc) / (dr * dr + dc * dc).max(1e-300);
                let t = along.clamp(0.0, 1.0);
                (row - r0 - t * dr).hypot(col - c0 - t * dc) <= radius
            })
        };
        let pixels = Array2::from_shape_fn((SIDE, SIDE), |(r, c)| near(r as f64, c as f64));
        Mask::from_array(pixels).unwrap()
    })
}

fn masks() -> impl Strategy<Value = Mask> {
    prop_oneof![noise(), strands()]
}

/// Small integers, so that ties and equal values are common.
fn images(top: i32) -> impl Strategy<Value = Array2<f32>> {
    (1..14usize, 1..14usize).prop_flat_map(move |(height, width)| {
        prop::collection::vec(0..=top, height * width).prop_map(move |values| {
            let values = values.into_iter().map(|v| v as f32).collect();
            Array2::from_shape_vec((height, width), values).unwrap()
        })
    })
}

fn components(mask: &Mask) -> usize {
    Components::of(mask).unwrap().sizes().len()
}

fn is_subset(small: &Mask, large: &Mask) -> bool {
    small.foreground().all(|(row, col)| large.get(row, col))
}

fn complement(mask: &Mask) -> Mask {
    Mask::from_array(mask.as_array().mapv(|pixel| !pixel)).unwrap()
}

/// Flood fill one pixel at a time until nothing changes.
fn grown(seed: &Mask, within: &Mask) -> Mask {
    let mut reached = seed.as_array().clone();
    loop {
        let before = reached.clone();
        for (row, col) in within.foreground() {
            let rows = row.saturating_sub(1)..=row + 1;
            let touches = rows
                .flat_map(|r| (col.saturating_sub(1)..=col + 1).map(move |c| (r, c)))
                .any(|at| reached.get(at).copied().unwrap_or(false));
            reached[[row, col]] |= touches;
        }
        if reached == before {
            return Mask::from_array(reached).unwrap();
        }
    }
}

proptest! {
    #[test]
    fn thinning_twice_is_thinning_once(mask in masks()) {
        let once = zhang_suen(&mask);
        prop_assert_eq!(zhang_suen(&once), once);
        let once = guo_hall(&mask);
        prop_assert_eq!(guo_hall(&once), once);
    }

    #[test]
    fn a_skeleton_is_a_subset_with_one_part_in_each_component(mask in masks()) {
        for thinned in [zhang_suen(&mask), guo_hall(&mask)] {
            prop_assert!(is_subset(&thinned, &mask));
            prop_assert_eq!(components(&thinned), components(&mask));
            // Equal in number, and none is lost: from the skeleton every component is reached.
            prop_assert_eq!(&grown(&thinned, &mask), &mask);
        }
    }

    #[test]
    fn thinning_does_not_see_the_border(mask in masks(), top in 0..3usize, left in 0..3usize) {
        let (height, width) = mask.shape();
        let inside = |r: usize, c: usize| r >= top && c >= left && mask.get(r - top, c - left);
        let wide = Array2::from_shape_fn((height + 4, width + 4), |(r, c)| inside(r, c));
        let wide = Mask::from_array(wide).unwrap();
        for thin in [zhang_suen, guo_hall] {
            let expected: Vec<_> =
                thin(&mask).foreground().map(|(r, c)| (r + top, c + left)).collect();
            prop_assert_eq!(thin(&wide).foreground().collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn distances_are_those_of_a_search_through_the_whole_background(mask in masks()) {
        let background: Vec<_> = complement(&mask).foreground().collect();
        prop_assume!(!background.is_empty());
        let distances = distance_to_background(&mask).unwrap();
        for ((row, col), &found) in distances.indexed_iter() {
            let squared = |&(r, c): &(usize, usize)| row.abs_diff(r).pow(2) + col.abs_diff(c).pow(2);
            let nearest = background.iter().map(squared).min().unwrap();
            // Squares of integers are exact in f64, and so is the rounded root.
            prop_assert_eq!(found, (nearest as f64).sqrt());
        }
    }

    #[test]
    fn otsu_maximises_the_between_class_variance(image in images(40)) {
        let values: Vec<f64> = image.iter().map(|&v| f64::from(v)).collect();
        let variance = |level: f64| {
            let (low, high): (Vec<f64>, Vec<f64>) = values.iter().partition(|&&v| v <= level);
            let mean = |class: &[f64]| class.iter().sum::<f64>() / class.len() as f64;
            let share = |class: &[f64]| class.len() as f64 / values.len() as f64;
            share(&low) * share(&high) * (mean(&low) - mean(&high)).powi(2)
        };
        let top = values.iter().copied().fold(0.0, f64::max);
        let splits: Vec<f64> = values.iter().copied().filter(|&v| v < top).collect();
        prop_assume!(!splits.is_empty());
        let best = splits.iter().map(|&level| variance(level)).fold(0.0, f64::max);
        let level = f64::from(otsu_level(&image).unwrap());
        prop_assert!(values.contains(&level) && level < top);
        // Either side takes about ten roundings of numbers up to 40^2.
        prop_assert!(variance(level) >= best - 20.0 * f64::EPSILON * 1600.0);
    }

    #[test]
    fn otsu_follows_a_change_of_brightness_and_contrast(
        image in images(255),
        exponent in -3..4i32,
        shift in -50..50i32,
    ) {
        prop_assume!(image.iter().any(|&v| v != image[[0, 0]]));
        // A power of two and a small integer: exact in f32.
        let changed = image.mapv(|v| (v + shift as f32) * 2.0f32.powi(exponent));
        prop_assert_eq!(binarise_otsu(&changed).unwrap(), binarise_otsu(&image).unwrap());
    }

    #[test]
    fn hysteresis_is_a_flood_from_the_strong_through_the_weak(
        image in images(9),
        low in 0..9i32,
        step in 0..9i32,
    ) {
        let (low, high) = (low as f32, (low + step) as f32);
        let strong = binarise_fixed(&image, high).unwrap();
        let weak = binarise_fixed(&image, low).unwrap();
        let found = binarise_hysteresis(&image, low, high).unwrap();
        prop_assert_eq!(&found, &grown(&strong, &weak));
        if step == 0 {
            prop_assert_eq!(found, strong);
        }
    }

    #[test]
    fn a_higher_level_keeps_a_subset(image in images(9), level in 0..9i32, step in 0..9i32) {
        let above = |level: i32| binarise_fixed(&image, level as f32).unwrap();
        prop_assert!(is_subset(&above(level + step), &above(level)));
    }

    #[test]
    fn components_do_not_depend_on_the_orientation(mask in masks()) {
        let sizes = |mask: &Mask| {
            let mut sizes = Components::of(mask).unwrap().sizes().to_vec();
            sizes.sort_unstable();
            sizes
        };
        let expected = sizes(&mask);
        prop_assert_eq!(expected.iter().sum::<usize>(), mask.count());
        for turned in [mask.transposed(), mask.flipped_left_right(), mask.flipped_top_bottom()] {
            prop_assert_eq!(&sizes(&turned), &expected);
        }
    }

    #[test]
    fn a_component_is_what_a_flood_from_its_first_pixel_reaches(mask in masks()) {
        let components = Components::of(&mask).unwrap();
        let mut next = 1;
        for (row, col) in mask.foreground() {
            let label = components.labels()[[row, col]];
            if label != next {
                // Numbers appear in raster order.
                prop_assert!((1..next).contains(&label));
                continue;
            }
            let mut seed = Array2::from_elem(mask.shape(), false);
            seed[[row, col]] = true;
            let flood = grown(&Mask::from_array(seed).unwrap(), &mask);
            prop_assert_eq!(components.sizes()[label as usize - 1], flood.count());
            prop_assert!(flood.foreground().all(|at| components.labels()[at] == label));
            next += 1;
            if next > 4 {
                break;
            }
        }
    }

    #[test]
    fn cleaning_keeps_exactly_the_components_that_are_large_enough(
        mask in masks(),
        min_area_px in 0..30usize,
    ) {
        let sizes = |mask: &Mask| Components::of(mask).unwrap().sizes().to_vec();
        let mut expected = sizes(&mask);
        expected.retain(|&size| size >= min_area_px);
        let cleaned = remove_smaller_than(&mask, min_area_px).unwrap();
        prop_assert!(is_subset(&cleaned, &mask));
        prop_assert_eq!(sizes(&cleaned), expected);
    }

    #[test]
    fn the_largest_component_is_one_and_the_largest(mask in masks()) {
        prop_assume!(!mask.is_empty());
        let largest = keep_largest(&mask).unwrap();
        let top = Components::of(&mask).unwrap().sizes().iter().copied().max().unwrap();
        prop_assert!(is_subset(&largest, &mask));
        let parts = Components::of(&largest).unwrap();
        prop_assert_eq!(parts.sizes(), [top]);
    }

    #[test]
    fn ends_and_junctions_do_not_depend_on_the_orientation(mask in masks()) {
        prop_assume!(!mask.is_empty());
        let thin = zhang_suen(&mask);
        let counts = |mask: Mask| {
            let skeleton = Skeleton::from_thin(mask).unwrap();
            let mut clusters: Vec<_> =
                skeleton.junctions().unwrap().iter().map(Vec::len).collect();
            clusters.sort_unstable();
            (skeleton.endpoints().len(), skeleton.isolated().len(), clusters)
        };
        let expected = counts(thin.clone());
        for turned in [thin.transposed(), thin.flipped_left_right(), thin.flipped_top_bottom()] {
            prop_assert_eq!(&counts(turned), &expected);
        }
    }

    #[test]
    fn neighbours_are_counted_from_both_sides(mask in masks()) {
        prop_assume!(!mask.is_empty());
        let skeleton = Skeleton::of(&mask).unwrap();
        let total: usize = skeleton.neighbour_counts().iter().map(|&n| usize::from(n)).sum();
        let touch = |a: &(usize, usize), b: &(usize, usize)| {
            a.0.abs_diff(b.0).max(a.1.abs_diff(b.1)) == 1
        };
        let pixels = skeleton.pixels();
        let pairs = pixels.iter().flat_map(|a| pixels.iter().filter(move |b| touch(a, b))).count();
        prop_assert_eq!(total, pairs);
        prop_assert_eq!(pixels.len(), skeleton.mask().count());
    }

    #[test]
    fn bridging_gaps_of_one_pixel_changes_nothing(mask in masks()) {
        prop_assume!(!mask.is_empty());
        let skeleton = Skeleton::of(&mask).unwrap();
        prop_assert_eq!(&skeleton.fix_gaps(0), &skeleton);
        prop_assert_eq!(&skeleton.fix_gaps(1), &skeleton);
    }

    #[test]
    fn bridging_gaps_joins_the_components_whose_ends_are_near(mask in masks(), gap in 2..9usize) {
        prop_assume!(!mask.is_empty());
        let skeleton = Skeleton::of(&mask).unwrap();
        let bridged = skeleton.fix_gaps(gap);
        prop_assert!(components(bridged.mask()) <= components(skeleton.mask()));
        // Thinning may shorten a bridge at a corner but never cuts it.
        let labels = Components::of(bridged.mask()).unwrap();
        for (k, a) in skeleton.endpoints().into_iter().enumerate() {
            for b in skeleton.endpoints().into_iter().skip(k + 1) {
                let far = a.0.abs_diff(b.0).max(a.1.abs_diff(b.1)) > gap;
                let (at_a, at_b) = (labels.labels()[a], labels.labels()[b]);
                prop_assert!(far || at_a == 0 || at_b == 0 || at_a == at_b);
            }
        }
    }

    #[test]
    fn a_mask_survives_its_conversions(mask in masks()) {
        prop_assert_eq!(Mask::from_u8(&mask.to_u8()).unwrap(), mask.clone());
        prop_assert_eq!(mask.transposed().transposed(), mask.clone());
        prop_assert_eq!(mask.flipped_left_right().flipped_left_right(), mask.clone());
        prop_assert_eq!(mask.flipped_top_bottom().flipped_top_bottom(), mask.clone());
        let listed: Vec<_> = mask.foreground().collect();
        prop_assert!(listed.is_sorted());
        prop_assert_eq!(listed.len(), mask.count());
        prop_assert!(listed.iter().all(|&(row, col)| mask.get(row, col)));
    }
}
