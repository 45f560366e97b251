use std::fmt;
use std::sync::Arc;
use std::thread::{self, ScopedJoinHandle};

use ndarray::{Array2, Array3};
use rten::{Model, ModelOptions, NodeId, RunOptions, ThreadPool};
use rten_tensor::NdTensorView;
use rten_tensor::prelude::*;

use super::{Engine, ModelBundle, ModelError};
use crate::SegError;

const NAME: &str = "rten 0.27";

/// The engine in pure Rust: nothing to install.
pub struct RtenEngine {
    model: Model,
    input: NodeId,
    output: NodeId,
    threads: usize,
    pool: Arc<ThreadPool>,
}

impl RtenEngine {
    /// Prepares the network of a bundle for `threads` threads, at least 1.
    ///
    /// # Errors
    /// [`ModelError::Engine`].
    ///
    /// # Cost
    /// The weights are held in float32, once.
    pub fn new(bundle: &ModelBundle, threads: usize) -> Result<Self, ModelError> {
        let refuse = |message: String| ModelError::Engine { engine: NAME, message };
        let model = ModelOptions::with_all_ops()
            .load(bundle.network().to_vec())
            .map_err(|error| refuse(error.to_string()))?;
        let spec = &bundle.manifest().network;
        let node = |name: &str| model.node_id(name).map_err(|error| refuse(error.to_string()));
        let (input, output) = (node(&spec.input)?, node(&spec.output)?);
        let threads = threads.max(1);
        let pool = Arc::new(ThreadPool::with_num_threads(threads));
        Ok(Self { model, input, output, threads, pool })
    }
}

impl Engine for RtenEngine {
    fn logits(&self, input: &Array2<f32>) -> Result<Array3<f32>, SegError> {
        let refuse = |message: String| SegError::Engine { engine: self.describe(), message };
        let (height, width) = input.dim();
        let data = input.as_standard_layout();
        let pixels = data.as_slice().unwrap_or_default();
        let view = NdTensorView::from_data([1, 1, height, width], pixels);
        let options = RunOptions::default().with_thread_pool(Some(self.pool.clone()));
        let run =
            || self.model.run_n(vec![(self.input, view.into())], [self.output], Some(options));
        // On a thread of its own, which only waits: a worker of the caller's pool would begin other
        // work of its pool meanwhile, the next image, and the next within that one.
        let ran = thread::scope(|scope| {
            thread::Builder::new().spawn_scoped(scope, run).map(ScopedJoinHandle::join)
        });
        let [output] = ran
            .map_err(|error| refuse(format!("no thread for it: {error}")))?
            .map_err(|_| refuse("it panicked".to_owned()))?
            .map_err(|error| refuse(error.to_string()))?;
        let shape = output.shape().to_vec();
        let data: Vec<f32> = output
            .into_tensor::<f32>()
            .ok_or_else(|| refuse("its output is not float32".to_owned()))?
            .into_data();
        let [1, classes, rows, columns] = shape[..] else {
            return Err(refuse(format!("output of shape {shape:?}")));
        };
        Array3::from_shape_vec((classes, rows, columns), data)
            .map_err(|error| refuse(error.to_string()))
    }

    fn describe(&self) -> String {
        NAME.to_owned()
    }
}

impl fmt::Debug for RtenEngine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RtenEngine").field("threads", &self.threads).finish_non_exhaustive()
    }
}
