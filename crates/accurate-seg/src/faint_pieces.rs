use ndarray::Array2;

use crate::{Components, Mask, SegError, Skeleton, Surety};

/// Of pieces at least this long, as part of the longest, the surest says what is faint: where a body
/// lies upon itself it is darkest, and what is a small loop of it says little about the rest.
const LONG_PIECE: f64 = 0.25;
/// Longest gap over which a piece goes on from another, px.
const GAP_PX: f64 = 60.0;
/// Nearer ends belong together whichever way they point, px: there may be a crossing in the gap, or a
/// hairpin.
const NEAR_PX: f64 = 20.0;
/// Cosine of the angle between the way over a gap and either end, at least (45 degrees).
const COS_INTO_GAP: f64 = 0.7;
/// So much of a piece, from its end on, tells where the end points, px.
const END_PX: f64 = 12.0;

/// The mask without the pieces (8-connected) that are faint: whose median logit along the skeleton is
/// more than `max_faintness_logits` below that of the surest long piece.
///
/// A faint piece stays if it goes on where a surer one, or another that stays, ends: across a gap of at
/// most 60 px into which both ends point, or of less than 20 px. So a body that fades on its way keeps
/// its pieces, and what a network takes for the body elsewhere in the image, mostly less surely than the
/// body, goes.
///
/// # Errors
/// [`SegError::BadFaintness`], [`SegError::WrongShape`], [`SegError::NotFinite`],
/// [`SegError::TooLarge`] as in [`Components::of`].
///
/// # Cost
/// One thinning, and for every two ends of strands of different pieces at most one comparison.
pub fn without_faint_pieces(
    mask: &Mask,
    probability: &Array2<f32>,
    max_faintness_logits: f32,
) -> Result<Mask, SegError> {
    require_faintness(max_faintness_logits)?;
    mask.require_map(probability)?;
    if mask.is_empty() {
        return Ok(mask.clone());
    }
    let components = Components::of(mask)?;
    let (labels, count) = (components.labels(), components.sizes().len());
    let skeleton = Skeleton::of(mask)?;
    let pieces = Surety::of_parts(&skeleton, labels, count, probability);
    let longest = pieces.iter().map(|piece| piece.length_px).max().unwrap_or(0) as f64;
    let least = Surety::surest(&pieces, LONG_PIECE * longest) - f64::from(max_faintness_logits);
    let mut keep: Vec<bool> = pieces.iter().map(|piece| piece.logit >= least).collect();
    if keep.iter().all(|keep| *keep) {
        return Ok(mask.clone());
    }
    let ends = PieceEnd::all(&skeleton, labels);
    let (mut open, mut faint): (Vec<&PieceEnd>, Vec<&PieceEnd>) =
        ends.iter().partition(|end| keep[end.piece]);
    // A faint piece may go on from another that does.
    while let Some(from) = open.pop() {
        for to in &faint {
            keep[to.piece] |= to.leads_to(from);
        }
        open.extend(faint.extract_if(.., |end| keep[end.piece]));
    }
    Ok(components.select(mask, |label| keep[label as usize - 1]))
}

/// Refuses a difference of logits that is negative or no number.
pub(crate) fn require_faintness(max_faintness_logits: f32) -> Result<(), SegError> {
    if max_faintness_logits >= 0.0 {
        return Ok(());
    }
    Err(SegError::BadFaintness { value: max_faintness_logits })
}

/// An end of a strand of a piece.
struct PieceEnd {
    piece: usize,
    /// Row and column.
    at: [f64; 2],
    /// Out of the piece, of unit length; zero of a piece of one pixel.
    outwards: [f64; 2],
}

impl PieceEnd {
    fn all(skeleton: &Skeleton, labels: &Array2<u32>) -> Vec<Self> {
        let around = |at: usize| at.saturating_sub(END_PX as usize)..=at + END_PX as usize;
        let end = |(row, column)| {
            let at = [row as f64, column as f64];
            let mut back = [0.0; 2];
            for (y, x) in around(row).flat_map(|y| around(column).map(move |x| (y, x))) {
                let step = from([y as f64, x as f64], at);
                let of_piece = labels.get((y, x)) == labels.get((row, column));
                if of_piece && skeleton.mask().get(y, x) && length(step) <= END_PX {
                    back = [back[0] + step[0], back[1] + step[1]];
                }
            }
            let piece = labels[(row, column)] as usize - 1;
            Self { piece, at, outwards: back.map(|v| v / length(back).max(f64::MIN_POSITIVE)) }
        };
        skeleton.endpoints().into_iter().map(end).collect()
    }

    /// Whether the body may go on from one end to the other.
    fn leads_to(&self, other: &Self) -> bool {
        let way = from(self.at, other.at);
        let gap = length(way);
        let into = |outwards: [f64; 2], way: [f64; 2]| {
            outwards[0] * way[0] + outwards[1] * way[1] >= COS_INTO_GAP * gap
        };
        let facing = into(self.outwards, way) && into(other.outwards, way.map(|v| -v));
        gap <= GAP_PX && (gap < NEAR_PX || facing)
    }
}

fn from(start: [f64; 2], end: [f64; 2]) -> [f64; 2] {
    [end[0] - start[0], end[1] - start[1]]
}

fn length([row, column]: [f64; 2]) -> f64 {
    row.hypot(column)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Horizontal bars of 3 px: row of the axis, first and last column, probability.
    fn drawn(bars: &[(usize, usize, usize, f32)]) -> (Mask, Array2<f32>) {
        let mut map = Array2::from_elem((120, 260), 0.01_f32);
        for &(row, first, last, probability) in bars {
            for at in (row - 1..=row + 1).flat_map(|y| (first..=last).map(move |x| (y, x))) {
                map[at] = probability;
            }
        }
        (Mask::from_array(map.mapv(|p| p > 0.3)).unwrap(), map)
    }

    /// The rows of the bars that stay, by the middle of each.
    fn kept(bars: &[(usize, usize, usize, f32)], max_faintness_logits: f32) -> Vec<bool> {
        let (mask, map) = drawn(bars);
        let left = without_faint_pieces(&mask, &map, max_faintness_logits).unwrap();
        bars.iter().map(|(row, first, last, _)| left.get(*row, (first + last) / 2)).collect()
    }

    /// By the rule as it is told: pieces are added as long as one goes on from one that is kept.
    fn by_rounds(mask: &Mask, map: &Array2<f32>, max_faintness_logits: f64) -> Mask {
        let (components, skeleton) = (Components::of(mask).unwrap(), Skeleton::of(mask).unwrap());
        let (labels, count) = (components.labels(), components.sizes().len());
        let pieces = Surety::of_parts(&skeleton, labels, count, map);
        let longest = pieces.iter().map(|piece| piece.length_px).max().unwrap();
        let least = Surety::surest(&pieces, LONG_PIECE * longest as f64) - max_faintness_logits;
        let mut keep: Vec<bool> = pieces.iter().map(|piece| piece.logit >= least).collect();
        let ends = PieceEnd::all(&skeleton, labels);
        while let Some(next) = (0..count).find(|&k| {
            let goes_on = |end: &PieceEnd| ends.iter().any(|to| keep[to.piece] && end.leads_to(to));
            !keep[k] && ends.iter().filter(|end| end.piece == k).any(goes_on)
        }) {
            keep[next] = true;
        }
        Mask::from_array(labels.mapv(|label| label > 0 && keep[label as usize - 1])).unwrap()
    }

    proptest! {
        #[test]
        fn it_is_the_rule_and_who_allows_more_keeps_more(
            bars in prop::collection::vec((2_usize..118, 0_usize..200, 4_usize..60, 0.35_f32..0.9999), 1..9),
            allowed in 0.0_f32..6.0,
            more in 0.0_f32..3.0,
        ) {
            let bars: Vec<_> = bars.into_iter().map(|(row, x, n, p)| (row, x, x + n, p)).collect();
            let (mask, map) = drawn(&bars);
            let [few, many] = [allowed, allowed + more]
                .map(|logits| without_faint_pieces(&mask, &map, logits).unwrap());
            prop_assert_eq!(&few, &by_rounds(&mask, &map, f64::from(allowed)));
            prop_assert!(!few.is_empty());
            prop_assert!(few.foreground().all(|(row, column)| many.get(row, column)));
            prop_assert!(many.foreground().all(|(row, column)| mask.get(row, column)));
        }
    }

    const WIRE: (usize, usize, usize, f32) = (20, 10, 100, 0.999);

    #[test]
    fn a_fainter_piece_elsewhere_goes_and_one_as_sure_stays() {
        // Logits 6.9, 2.9 and 5.9.
        assert_eq!(
            kept(&[WIRE, (60, 10, 60, 0.95), (100, 10, 60, 0.9973)], 2.25),
            [true, false, true]
        );
        assert_eq!(kept(&[WIRE, (60, 10, 60, 0.95)], 4.5), [true, true]);
    }

    #[test]
    fn a_piece_that_goes_on_stays_and_the_one_behind_it_too() {
        let far = (20, 230, 255, 0.9);
        assert_eq!(kept(&[WIRE, (20, 140, 190, 0.9), far], 2.25), [true; 3]);
        // Alone it is 130 px away.
        assert_eq!(kept(&[WIRE, far], 2.25), [true, false]);
        // Beside the gap, not in it: the way there is 62 degrees off both ends.
        assert_eq!(kept(&[WIRE, (60, 120, 180, 0.9)], 2.25), [true, false]);
        // The ends do not face each other.
        assert_eq!(kept(&[WIRE, (46, 40, 98, 0.9)], 2.25), [true, false]);
        // Nor these, but they are near: a hairpin.
        assert_eq!(kept(&[WIRE, (34, 40, 98, 0.9)], 2.25), [true, true]);
    }

    #[test]
    fn a_short_piece_does_not_say_what_is_faint() {
        assert_eq!(kept(&[(20, 10, 100, 0.9), (60, 10, 20, 0.9999)], 2.25), [true, true]);
        assert_eq!(kept(&[(20, 10, 100, 0.9), (60, 10, 60, 0.9999)], 2.25), [false, true]);
    }

    #[test]
    fn nothing_is_still_nothing_and_nonsense_is_refused() {
        let (mask, map) = drawn(&[]);
        assert!(without_faint_pieces(&mask, &map, 2.25).unwrap().is_empty());
        let (mask, map) = drawn(&[WIRE]);
        assert_eq!(
            without_faint_pieces(&mask, &map, -1.0),
            Err(SegError::BadFaintness { value: -1.0 })
        );
        assert!(matches!(
            without_faint_pieces(&mask, &map, f32::NAN),
            Err(SegError::BadFaintness { value }) if value.is_nan()
        ));
        let smaller = Array2::zeros((5, 5));
        assert!(matches!(
            without_faint_pieces(&mask, &smaller, 2.25),
            Err(SegError::WrongShape { .. })
        ));
    }
}
