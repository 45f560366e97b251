use std::fmt::Debug;

use ndarray::{Array2, Array3};

use crate::SegError;

/// Runs a network on one image.
///
/// Implementations give the same bytes for any number of threads; two engines agree to rounding.
pub trait Engine: Debug + Send + Sync {
    /// The network's output before softmax, shape (classes, height, width), for an input of shape
    /// `(height, width)` as the network wants it: normalised, sides multiples of the network's.
    ///
    /// # Errors
    /// [`SegError::Engine`] with what the engine says, also for an output of another shape.
    fn logits(&self, input: &Array2<f32>) -> Result<Array3<f32>, SegError>;

    /// Name and version.
    fn describe(&self) -> String;
}
