//! From an image or a probability map to a mask, and from a mask to its skeleton.
//!
//! - [`binarise_fixed`], [`binarise_otsu`], [`binarise_hysteresis`]: grey values to a [`Mask`];
//! - [`keep_largest`], [`remove_smaller_than`], [`Components`]: what belongs together;
//! - [`without_faint_pieces`]: what a probability map is less sure of than of the body goes;
//! - [`zhang_suen`] (as scikit-image's `skeletonize`), [`guo_hall`]: lines one pixel wide;
//! - [`Polarity`]: whether the body is dark, as everything here takes it to be, or bright;
//! - [`Segmenter`]: whatever finds the body in an image, with a [`Segmentation`] as its answer;
//! - [`Skeleton`]: its endpoints, junctions and gaps, and its pixels for the stages that follow;
//! - [`gap_hints()`]: where a probability map goes on between two pieces of its mask;
//! - [`ridge_centreline`]: a centreline between the pixels, and the width, from a probability map;
//! - [`distance_to_background`], [`median_width_px`]: how thick the wire is.
//!
//! # Conventions
//! Images are [`ndarray::Array2`] of shape `(height, width)`, indexed `[[row, col]]` = `[[y, x]]`,
//! with pixel centres at integers. Foreground is 8-connected, background 4-connected.
//!
//! ```
//! use accurate_seg::{Mask, Skeleton, median_width_px};
//! use ndarray::Array2;
//!
//! // A horizontal bar, 3 px thick.
//! let mask = Mask::from_array(Array2::from_shape_fn((7, 20), |(row, col)| {
//!     (2..5).contains(&row) && (2..18).contains(&col)
//! }))?;
//! let skeleton = Skeleton::of(&mask)?;
//! assert_eq!(skeleton.endpoints().len(), 2);
//! assert!(skeleton.junctions()?.is_empty());
//! assert_eq!(median_width_px(&mask)?, 3.0);
//! # Ok::<(), accurate_seg::SegError>(())
//! ```

mod bit_image;
mod components;
mod distance;
mod error;
mod faint_pieces;
mod gap_hints;
mod mask;
mod median;
#[cfg(feature = "network")]
pub mod network;
mod polarity;
mod post_processing;
mod ridge;
mod segmentation;
mod skeleton;
mod spurs;
mod strands;
mod surety;
mod thin;
mod thin_rules;
#[cfg(test)]
mod thin_tables;
mod threshold;

pub use components::{Components, keep_largest, remove_smaller_than};
pub use distance::{distance_to_background, median_width_px};
pub use error::SegError;
pub use faint_pieces::without_faint_pieces;
pub use gap_hints::{GapHint, GapParams, gap_hints};
pub use mask::Mask;
pub use polarity::Polarity;
pub use post_processing::PostProcessing;
pub use ridge::{RidgeParams, RidgePoint, median_ridge_width_px, ridge_centreline};
pub use segmentation::{Progress, Segmentation, Segmenter, Watch, unwatched};
pub use skeleton::Skeleton;
pub use strands::Strands;
pub use surety::Surety;
pub use thin::{guo_hall, zhang_suen};
pub use threshold::{binarise_fixed, binarise_hysteresis, binarise_otsu, otsu_level};
