use std::fmt;

use ndarray::Array2;

use crate::faint_pieces::require_faintness;
use crate::spurs::without_spurs;
use crate::{Components, Mask, SegError, binarise_hysteresis, without_faint_pieces, zhang_suen};

/// From the probability of the body to its mask.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "network",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct PostProcessing {
    /// Pixels above this belong to the body if they hang together with one above [`Self::high`]; 0
    /// to 1.
    pub low: f32,
    /// Pixels above this begin a body; `low` to 1.
    pub high: f32,
    /// Pieces whose skeleton has fewer pixels are dropped, unless there is no longer one, px.
    pub min_length_px: usize,
    /// Pieces are dropped that are fainter than the surest by more than this and go on from no other
    /// ([`without_faint_pieces`]), difference of median logits, 0 or more; `None` keeps all.
    pub max_faintness_logits: Option<f32>,
    /// Side branches that stick out of a strand by at most this are cut off, px; 0 keeps all.
    pub max_spur_px: usize,
}

impl fmt::Display for PostProcessing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { low, high, min_length_px, max_faintness_logits, max_spur_px } = self;
        write!(f, "threshold {high} down to {low}, pieces from {min_length_px} px")?;
        if let Some(logits) = max_faintness_logits {
            write!(f, ", up to {logits} logits fainter")?;
        }
        write!(f, ", spurs up to {max_spur_px} px cut")
    }
}

impl PostProcessing {
    /// Most of what a network gives besides the body is fainter than the body by more than this, hardly
    /// any piece of a body is that goes on from no other (images of seeds 1500 and 1501, pictures of
    /// `carm`, seed 1103).
    pub const FAINTNESS_LOGITS: f32 = 2.25;
    /// One threshold, everything kept: the paper's reading of a probability map.
    pub const PAPER: Self =
        Self { low: 0.5, high: 0.5, min_length_px: 0, max_faintness_logits: None, max_spur_px: 0 };
    /// Ours. What a network gives besides the body is short and faint.
    pub const DEFAULT: Self = Self {
        low: 0.3,
        high: 0.5,
        min_length_px: 12,
        max_faintness_logits: Some(Self::FAINTNESS_LOGITS),
        max_spur_px: 4,
    };

    /// Refuses values outside their ranges.
    ///
    /// # Errors
    /// [`SegError::LevelIsNan`], [`SegError::LevelsOutOfOrder`], [`SegError::LevelOutOfRange`],
    /// [`SegError::BadFaintness`].
    pub fn check(&self) -> Result<(), SegError> {
        for (name, value) in [("low", self.low), ("high", self.high)] {
            if value.is_nan() {
                return Err(SegError::LevelIsNan { name });
            }
            if !(0.0..=1.0).contains(&value) {
                return Err(SegError::LevelOutOfRange { name, value });
            }
        }
        if self.low > self.high {
            return Err(SegError::LevelsOutOfOrder { low: self.low, high: self.high });
        }
        self.max_faintness_logits.map_or(Ok(()), require_faintness)
    }

    /// The mask of a probability map, shape `(height, width)`. It may be empty.
    ///
    /// # Errors
    /// Those of [`Self::check`], and [`SegError::NotFinite`], [`SegError::EmptyImage`],
    /// [`SegError::TooLarge`].
    ///
    /// # Cost
    /// Thinning once for the lengths, once for the faint pieces and once for the spurs.
    pub fn mask_of(&self, probability: &Array2<f32>) -> Result<Mask, SegError> {
        self.check()?;
        let mask = binarise_hysteresis(probability, self.low, self.high)?;
        let mut mask = without_short_pieces(mask, self.min_length_px)?;
        if let Some(logits) = self.max_faintness_logits {
            mask = without_faint_pieces(&mask, probability, logits)?;
        }
        without_spurs(&mask, self.max_spur_px)
    }
}

impl Default for PostProcessing {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Without the pieces whose skeleton has fewer than `min_length_px` pixels; if all are shorter, the
/// longest stays (the first in raster order of several).
fn without_short_pieces(mask: Mask, min_length_px: usize) -> Result<Mask, SegError> {
    if min_length_px == 0 || mask.is_empty() {
        return Ok(mask);
    }
    let components = Components::of(&mask)?;
    let labels = components.labels();
    let mut lengths = vec![0_usize; components.sizes().len()];
    for at in zhang_suen(&mask).foreground() {
        lengths[labels[at] as usize - 1] += 1;
    }
    let longest = lengths.iter().copied().max().unwrap_or(0);
    let first = lengths.iter().position(|&length| length == longest);
    let keep: Vec<bool> = lengths
        .iter()
        .enumerate()
        .map(|(k, &length)| length >= min_length_px || Some(k) == first)
        .collect();
    Ok(components.select(&mask, |label| keep[label as usize - 1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A horizontal strand of 40 px, a blot of 3 px, a faint strand that touches the first one.
    fn probability() -> Array2<f32> {
        Array2::from_shape_fn((20, 60), |(row, col)| match (row, col) {
            (9..=11, 10..50) => 0.9,
            (9..=11, 50..58) => 0.4,
            (2..=4, 30..33) => 0.95,
            _ => 0.05,
        })
    }

    #[test]
    fn the_default_keeps_the_faint_end_and_drops_the_blot() {
        let mask = PostProcessing::DEFAULT.mask_of(&probability()).unwrap();
        assert!(mask.get(10, 57) && mask.get(10, 10) && !mask.get(3, 31));
        assert_eq!(mask.count(), 3 * 48);
    }

    #[test]
    fn the_papers_reading_is_one_threshold() {
        let mask = PostProcessing::PAPER.mask_of(&probability()).unwrap();
        assert_eq!(mask, Mask::from_array(probability().mapv(|p| p > 0.5)).unwrap());
    }

    #[test]
    fn the_longest_of_short_pieces_stays() {
        let blot = Array2::from_shape_fn((20, 20), |(row, col)| {
            if row == 4 && (3..6).contains(&col) || row == 12 && (3..9).contains(&col) {
                1.0
            } else {
                0.0
            }
        });
        let mask = PostProcessing::DEFAULT.mask_of(&blot).unwrap();
        assert!(mask.get(12, 5) && !mask.get(4, 4));
    }

    #[test]
    fn nothing_found_is_an_empty_mask_not_an_error() {
        let nothing = Array2::from_elem((8, 9), 0.1);
        assert!(PostProcessing::DEFAULT.mask_of(&nothing).unwrap().is_empty());
    }

    #[test]
    fn thresholds_outside_of_zero_to_one_are_refused() {
        let bad = |low, high| PostProcessing { low, high, ..PostProcessing::DEFAULT }.check();
        assert_eq!(bad(0.6, 0.5), Err(SegError::LevelsOutOfOrder { low: 0.6, high: 0.5 }));
        assert_eq!(bad(f32::NAN, 0.5), Err(SegError::LevelIsNan { name: "low" }));
        assert_eq!(bad(0.5, 1.5), Err(SegError::LevelOutOfRange { name: "high", value: 1.5 }));
    }
}
