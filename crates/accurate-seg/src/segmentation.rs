use std::fmt;
use std::ops::ControlFlow;

use ndarray::Array2;

use crate::{Mask, SegError};

/// What segmentation says about one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    /// Probability of the body per pixel, 0 to 1, shape of the image.
    pub probability: Array2<f32>,
    /// The body, of the same shape; it may be empty.
    pub mask: Mask,
}

/// Finds the thin body in a grey image.
///
/// Implemented by networks; a caller with a segmentation of another kind implements it too.
pub trait Segmenter: fmt::Debug + Send + Sync {
    /// Segments an image of shape `(height, width)` in any grey values, with the same result for any
    /// number of threads.
    ///
    /// `watch` hears of every finished part and may end the work.
    ///
    /// # Errors
    /// [`SegError::EmptyImage`], [`SegError::TooLarge`], [`SegError::NotFinite`],
    /// [`SegError::Constant`] where every pixel is the same, [`SegError::Cancelled`], and what the
    /// implementation itself refuses.
    fn segment(&self, image: &Array2<f32>, watch: &Watch<'_>) -> Result<Segmentation, SegError>;

    /// The same image once more, with more care: what is asked where a result is in doubt. `before` is the
    /// probability that [`segment`](Self::segment) gave for it, of the image's shape, on which this may
    /// build. `None` where there is no more careful way, or where it is the one that is always gone.
    ///
    /// # Errors
    /// Those of [`segment`](Self::segment), and [`SegError::WrongShape`] if `before` has another shape.
    fn segment_again(
        &self,
        _image: &Array2<f32>,
        _before: &Array2<f32>,
        _watch: &Watch<'_>,
    ) -> Result<Option<Segmentation>, SegError> {
        Ok(None)
    }

    /// What segments, for a report: model, engine and settings in one line.
    fn describe(&self) -> String;
}

/// How far a segmentation is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Parts that are done.
    pub done: usize,
    /// Parts there are, at least 1.
    pub total: usize,
}

/// Hears of progress; [`ControlFlow::Break`] ends the work with [`SegError::Cancelled`].
pub type Watch<'a> = dyn Fn(Progress) -> ControlFlow<()> + Sync + 'a;

/// A [`Watch`] that lets everything run.
pub fn unwatched(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}
