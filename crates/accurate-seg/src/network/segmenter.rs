use std::ops::ControlFlow;

use ndarray::{Array2, Axis};

use super::normalise::normalise;
use super::windows::{extend_to, starts, window_weights};
use super::{Engine, Manifest, ModelBundle};
use crate::{Mask, PostProcessing, Progress, SegError, Segmentation, Segmenter, Watch};

/// What a caller may choose about a segmentation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetworkOptions {
    /// Over which mirror images probabilities are averaged.
    pub mirroring: Mirroring,
    /// From probabilities to a mask; `None` takes the model's own.
    pub postprocessing: Option<PostProcessing>,
}

impl NetworkOptions {
    /// Looked at from both sides, the model's own post-processing.
    pub const DEFAULT: Self = Self { mirroring: Mirroring::Opposite, postprocessing: None };
}

impl Default for NetworkOptions {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Over which mirror images, along the axes that the model was trained with, probabilities are
/// averaged. What breaks in one image seldom breaks in all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mirroring {
    /// The image as it is.
    Never,
    /// And mirrored along all axes at once, a half turn: twice the time.
    Opposite,
    /// All mirror images: with two axes four times the time.
    All,
}

/// A network with an engine, ready to segment images of any size.
#[derive(Debug)]
pub struct NetworkSegmenter {
    engine: Box<dyn Engine>,
    manifest: Manifest,
    hash: String,
    options: NetworkOptions,
}

/// Most pixels of an image, padded to what the network takes: 16384 squared.
const MAX_IMAGE_PX: u64 = 1 << 28;

impl NetworkSegmenter {
    /// The engine must run the bundle's network.
    ///
    /// # Errors
    /// [`SegError::LevelIsNan`], [`SegError::LevelsOutOfOrder`], [`SegError::LevelOutOfRange`],
    /// [`SegError::BadFaintness`] for bad options.
    pub fn new(
        bundle: &ModelBundle,
        engine: Box<dyn Engine>,
        options: NetworkOptions,
    ) -> Result<Self, SegError> {
        if let Some(postprocessing) = options.postprocessing {
            postprocessing.check()?;
        }
        let (manifest, hash) = (bundle.manifest().clone(), bundle.hash().to_owned());
        Ok(Self { engine, manifest, hash, options })
    }

    /// Probability of the body per pixel, 0 to 1.
    ///
    /// The image is normalised as a whole, its sides made multiples of the network's by going on with its
    /// border, and read at once or, above the model's limit, in windows that overlap by half and count by a
    /// Gaussian of their middle.
    ///
    /// # Errors
    /// Those of [`Segmenter::segment`].
    ///
    /// # Cost
    /// One run of the network per window and mirror image, one after the other; the memory of one
    /// run (with the shipped network about 0.5 KiB a pixel).
    pub fn probability(
        &self,
        image: &Array2<f32>,
        watch: &Watch<'_>,
    ) -> Result<Array2<f32>, SegError> {
        self.seen(image, &self.mirrors(self.options.mirroring), watch)
    }

    /// The probability, averaged over mirror images.
    fn seen(
        &self,
        image: &Array2<f32>,
        mirrors: &[[bool; 2]],
        watch: &Watch<'_>,
    ) -> Result<Array2<f32>, SegError> {
        let (height, width) = image.dim();
        let multiple = self.manifest.network.multiple_px as usize;
        let padded = [height, width].map(|side| side.next_multiple_of(multiple));
        let tiling = self.manifest.tiling;
        let window = if (padded[0] as u64).saturating_mul(padded[1] as u64) <= tiling.whole_up_to_px
        {
            padded
        } else {
            tiling.window_px.map(|side| side as usize)
        };
        let sides = [padded[0].max(window[0]), padded[1].max(window[1])];
        if (sides[0] as u64).saturating_mul(sides[1] as u64) > MAX_IMAGE_PX {
            return Err(SegError::TooLarge { height, width, most: MAX_IMAGE_PX });
        }
        let image = normalise(image, self.manifest.normalisation)?;
        let padded = extend_to(&image, sides);
        let probability = self.in_windows(&padded.image, window, mirrors, watch)?;
        let [top, left] = padded.before;
        Ok(Array2::from_shape_fn((height, width), |(row, col)| {
            probability[[top + row, left + col]]
        }))
    }

    fn in_windows(
        &self,
        image: &Array2<f32>,
        window: [usize; 2],
        mirrors: &[[bool; 2]],
        watch: &Watch<'_>,
    ) -> Result<Array2<f32>, SegError> {
        let (height, width) = image.dim();
        let (rows, columns) = (starts(height, window[0]), starts(width, window[1]));
        let total = rows.len() * columns.len() * mirrors.len();
        let weights = window_weights(window);
        let mut sum = Array2::<f32>::zeros((height, width));
        let mut weight = Array2::<f32>::zeros((height, width));
        let mut done = 0;
        for (&top, &left) in rows.iter().flat_map(|r| columns.iter().map(move |c| (r, c))) {
            let shape = (window[0], window[1]);
            let cut = Array2::from_shape_fn(shape, |(r, c)| image[[top + r, left + c]]);
            let mut mean = Array2::<f32>::zeros(shape);
            for &axes in mirrors {
                if watch(Progress { done, total }) == ControlFlow::Break(()) {
                    return Err(SegError::Cancelled { done, total });
                }
                let seen = self.foreground(&flipped(&cut, axes))?;
                mean += &flipped(&seen, axes);
                done += 1;
            }
            mean /= mirrors.len() as f32;
            if total == mirrors.len() {
                // One window is the image: nothing to weigh.
                sum = mean;
                weight.fill(1.0);
                break;
            }
            for ((r, c), value) in mean.indexed_iter() {
                sum[[top + r, left + c]] += value * weights[[r, c]];
                weight[[top + r, left + c]] += weights[[r, c]];
            }
        }
        // The last word may still be that the caller has lost interest; the work is done by then.
        let _ = watch(Progress { done, total });
        sum.zip_mut_with(&weight, |value, weight| *value = (*value / weight).clamp(0.0, 1.0));
        Ok(sum)
    }

    /// Axes to reverse, for each image that the network sees.
    fn mirrors(&self, mirroring: Mirroring) -> Vec<[bool; 2]> {
        let axes = [0, 1].map(|axis: u8| self.manifest.mirror_axes.contains(&axis));
        let all = [[false; 2], axes, [axes[0], false], [false, axes[1]]];
        let mut mirrors = match mirroring {
            Mirroring::Never => all[..1].to_vec(),
            Mirroring::Opposite => all[..2].to_vec(),
            Mirroring::All => all.to_vec(),
        };
        mirrors.sort_unstable();
        mirrors.dedup();
        mirrors
    }

    fn with_mask(&self, probability: Array2<f32>) -> Result<Segmentation, SegError> {
        let post = self.options.postprocessing.unwrap_or(self.manifest.postprocessing);
        let mask: Mask = post.mask_of(&probability)?;
        Ok(Segmentation { probability, mask })
    }

    /// Softmax, summed over the foreground.
    fn foreground(&self, input: &Array2<f32>) -> Result<Array2<f32>, SegError> {
        let spec = &self.manifest.network;
        let logits = self.engine.logits(input)?;
        let expected = (usize::from(spec.classes), input.nrows(), input.ncols());
        let engine = |message| SegError::Engine { engine: self.engine.describe(), message };
        if logits.dim() != expected {
            let found = logits.dim();
            return Err(engine(format!("output of shape {found:?}; expected {expected:?}")));
        }
        let mut bad = None;
        let mut probability = Array2::zeros(input.dim());
        for ((at, value), scores) in probability.indexed_iter_mut().zip(logits.lanes(Axis(0))) {
            let most = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            let share = |score: f32| (score - most).exp();
            let all: f32 = scores.iter().map(|&s| share(s)).sum();
            let body: f32 = spec.foreground.iter().map(|&k| share(scores[usize::from(k)])).sum();
            *value = body / all;
            if !value.is_finite() {
                bad.get_or_insert(at);
            }
        }
        match bad {
            None => Ok(probability),
            Some((row, column)) => {
                Err(engine(format!("no number at row {row}, column {column} of its output")))
            }
        }
    }
}

impl Segmenter for NetworkSegmenter {
    fn segment(&self, image: &Array2<f32>, watch: &Watch<'_>) -> Result<Segmentation, SegError> {
        self.with_mask(self.probability(image, watch)?)
    }

    /// The average over all mirror images: only those are run that are not among those before.
    fn segment_again(
        &self,
        image: &Array2<f32>,
        before: &Array2<f32>,
        watch: &Watch<'_>,
    ) -> Result<Option<Segmentation>, SegError> {
        if before.dim() != image.dim() {
            return Err(SegError::WrongShape { expected: image.dim(), found: before.dim() });
        }
        let seen = self.mirrors(self.options.mirroring);
        let mut others = self.mirrors(Mirroring::All);
        others.retain(|mirror| !seen.contains(mirror));
        if others.is_empty() {
            return Ok(None);
        }
        let mut probability = self.seen(image, &others, watch)?;
        let [others, seen] = [others.len(), seen.len()].map(|images| images as f32);
        probability.zip_mut_with(before, |other, before| {
            *other = (*other * others + before * seen) / (others + seen);
        });
        self.with_mask(probability).map(Some)
    }

    fn describe(&self) -> String {
        format!(
            "{} (BLAKE3 {}) by {}, images of each: {}, {}",
            self.manifest.name,
            self.hash,
            self.engine.describe(),
            self.mirrors(self.options.mirroring).len(),
            self.options.postprocessing.unwrap_or(self.manifest.postprocessing)
        )
    }
}

fn flipped(image: &Array2<f32>, axes: [bool; 2]) -> Array2<f32> {
    let mut view = image.view();
    for (axis, reverse) in axes.into_iter().enumerate() {
        if reverse {
            view.invert_axis(Axis(axis));
        }
    }
    view.as_standard_layout().into_owned()
}
