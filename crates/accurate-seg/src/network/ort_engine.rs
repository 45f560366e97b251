use std::fmt;
use std::path::Path;
use std::sync::{Mutex, OnceLock};

use ndarray::{Array2, Array3};
use ort::environment::Environment;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::TensorRef;

use super::{Engine, ModelBundle, ModelError};
use crate::SegError;

const NAME: &str = "ONNX Runtime";

/// The library of ONNX Runtime, loaded while the program runs. A process has one: loading another
/// path later gives the first one again.
#[derive(Clone)]
pub struct OrtRuntime {
    environment: Environment,
}

impl OrtRuntime {
    /// Loads the library at an absolute path (`libonnxruntime.so.*`, version 1.24 or later).
    ///
    /// # Errors
    /// [`ModelError::Engine`] if there is no such library or it is too old. Never a panic: the
    /// binding's own search, which would, is not reached.
    pub fn load(library: &Path) -> Result<Self, ModelError> {
        static ENVIRONMENT: OnceLock<Result<Environment, String>> = OnceLock::new();
        let refuse = |message: String| ModelError::Engine { engine: NAME, message };
        if !library.is_absolute() {
            return Err(refuse(format!("the path {} is not absolute", library.display())));
        }
        // A failure to load leaves nothing behind, so that another path may be tried.
        let builder = ort::init_from(library).map_err(|error| refuse(error.to_string()))?;
        ENVIRONMENT
            .get_or_init(|| {
                builder
                    .with_name("accurate")
                    .with_telemetry(false)
                    .build()
                    .map_err(|error| error.to_string())
            })
            .clone()
            .map(|environment| Self { environment })
            .map_err(refuse)
    }
}

impl fmt::Debug for OrtRuntime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OrtRuntime").finish_non_exhaustive()
    }
}

/// ONNX Runtime, on the CPU: the fastest engine where its library is installed.
pub struct OrtEngine {
    /// A session is run by one caller at a time, on all its threads.
    session: Mutex<Session>,
    input: String,
    output: String,
    threads: usize,
}

impl OrtEngine {
    /// Prepares the network of a bundle for `threads` threads, at least 1.
    ///
    /// # Errors
    /// [`ModelError::Engine`].
    pub fn new(
        runtime: &OrtRuntime,
        bundle: &ModelBundle,
        threads: usize,
    ) -> Result<Self, ModelError> {
        let refuse = |message: String| ModelError::Engine { engine: NAME, message };
        let threads = threads.max(1);
        let session =
            session(runtime, bundle, threads).map_err(|error| refuse(error.to_string()))?;
        let spec = &bundle.manifest().network;
        Ok(Self {
            session: Mutex::new(session),
            input: spec.input.clone(),
            output: spec.output.clone(),
            threads,
        })
    }
}

fn session(
    runtime: &OrtRuntime,
    bundle: &ModelBundle,
    threads: usize,
) -> Result<Session, ort::Error> {
    Session::builder(&runtime.environment)?
        .with_optimization_level(GraphOptimizationLevel::Level3)?
        .with_intra_threads(threads)?
        .with_inter_threads(1)?
        // The same bytes for any number of threads.
        .with_deterministic_compute(true)?
        // Threads that wait must not burn the cores of the other pairs.
        .with_intra_op_spinning(false)?
        .commit_from_memory(bundle.network())
}

impl Engine for OrtEngine {
    fn logits(&self, input: &Array2<f32>) -> Result<Array3<f32>, SegError> {
        let refuse = |message: String| SegError::Engine { engine: self.describe(), message };
        let failed = |error: ort::Error| refuse(error.to_string());
        let (height, width) = input.dim();
        let data = input.as_standard_layout();
        let pixels = data.as_slice().unwrap_or_default();
        let tensor = TensorRef::from_array_view(([1, 1, height, width], pixels)).map_err(failed)?;
        // A caller that panicked while running has left the session as it was.
        let mut session = self.session.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let outputs = session.run(ort::inputs![self.input.as_str() => tensor]).map_err(failed)?;
        let output = outputs
            .get(self.output.as_str())
            .ok_or_else(|| refuse(format!("there is no output `{}`", self.output)))?;
        let (shape, data) = output.try_extract_tensor::<f32>().map_err(failed)?;
        let side = |k: usize| shape.get(k).and_then(|d| usize::try_from(*d).ok()).unwrap_or(0);
        if shape.len() != 4 || side(0) != 1 {
            return Err(refuse(format!("output of shape {shape:?}")));
        }
        Array3::from_shape_vec((side(1), side(2), side(3)), data.to_vec())
            .map_err(|error| refuse(error.to_string()))
    }

    fn describe(&self) -> String {
        NAME.to_owned()
    }
}

impl fmt::Debug for OrtEngine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OrtEngine").field("threads", &self.threads).finish_non_exhaustive()
    }
}
