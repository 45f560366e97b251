use ndarray::Array2;

/// `mask` without its holes of at most `max_area_px` pixels: the 4-connected pieces of background
/// that do not reach the border of the image.
///
/// Two strands that touch at a small angle leave a row of such holes between them; thinned as they
/// are, each becomes a loop of the skeleton. Fill them for the graph only: a fit to the outline
/// wants the mask as it is. A wire `w` px thick asks for `max_area_px` about `2 w²`
/// ([`GraphParams::hole_area_px`](crate::GraphParams::hole_area_px)).
///
/// `mask` has shape (height, width).
///
/// # Cost
/// One scan, plus `max_area_px` per background pixel to the right of the body at worst.
pub fn fill_small_holes(mask: &Array2<bool>, max_area_px: usize) -> Array2<bool> {
    let (height, width) = mask.dim();
    let mut filled = mask.clone();
    // Pixels known to belong to background that stays.
    let mut open = Array2::from_elem((height, width), false);
    let mut piece: Vec<(usize, usize)> = Vec::new();
    for row in 0..height {
        for col in 1..width {
            // Every hole has a pixel right of the body.
            if filled[[row, col]] || !filled[[row, col - 1]] || open[[row, col]] {
                continue;
            }
            piece.clear();
            piece.push((row, col));
            filled[[row, col]] = true;
            let mut next = 0;
            let mut closed = max_area_px > 0;
            while closed && next < piece.len() {
                let (r, c) = piece[next];
                next += 1;
                if r == 0 || c == 0 || r + 1 == height || c + 1 == width {
                    closed = false;
                    break;
                }
                for at in [(r - 1, c), (r, c - 1), (r, c + 1), (r + 1, c)] {
                    if open[at] {
                        closed = false;
                    } else if !filled[at] {
                        filled[at] = true;
                        piece.push(at);
                    }
                }
                closed &= piece.len() <= max_area_px;
            }
            if !closed {
                for &at in &piece {
                    filled[at] = false;
                    open[at] = true;
                }
            }
        }
    }
    filled
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Plain flood of every piece of background.
    fn oracle(mask: &Array2<bool>, max_area_px: usize) -> Array2<bool> {
        let (height, width) = mask.dim();
        let mut seen = mask.clone();
        let mut filled = mask.clone();
        for start in (0..height).flat_map(|r| (0..width).map(move |c| (r, c))) {
            if seen[start] {
                continue;
            }
            let mut piece = vec![start];
            seen[start] = true;
            let mut next = 0;
            let mut at_border = false;
            while next < piece.len() {
                let (r, c) = piece[next];
                next += 1;
                at_border |= r == 0 || c == 0 || r + 1 == height || c + 1 == width;
                let near = [(r.wrapping_sub(1), c), (r + 1, c), (r, c.wrapping_sub(1)), (r, c + 1)];
                for at in near.into_iter().filter(|at| at.0 < height && at.1 < width) {
                    if !seen[at] {
                        seen[at] = true;
                        piece.push(at);
                    }
                }
            }
            if !at_border && piece.len() <= max_area_px {
                piece.into_iter().for_each(|at| filled[at] = true);
            }
        }
        filled
    }

    proptest! {
        #[test]
        fn the_same_holes_are_filled_as_by_a_plain_flood(
            pixels in prop::collection::vec(prop::bool::weighted(0.6), 12 * 15), area in 0usize..9,
        ) {
            let mask = Array2::from_shape_vec((12, 15), pixels).unwrap();
            prop_assert_eq!(fill_small_holes(&mask, area), oracle(&mask, area));
        }
    }

    #[test]
    fn images_without_an_inside_stay_as_they_are() {
        for shape in [(0, 0), (1, 5), (5, 1), (2, 2)] {
            let mask = Array2::from_elem(shape, true);
            assert_eq!(fill_small_holes(&mask, 100), mask);
        }
    }
}
