//! Networks: model bundles, the engines that run them, and the way from an image of any size to a
//! probability map.
//!
//! - [`ModelBundle`]: one file with a network and everything that is needed to run it, checked
//!   before any engine sees it;
//! - [`RtenEngine`] (feature `rten`), [`OrtEngine`] (feature `ort`): both an [`Engine`];
//! - [`NetworkSegmenter`]: a bundle and an engine as a [`Segmenter`](crate::Segmenter);
//! - [`NnunetFolder`]: the parts of a folder of nnU-Net's results, as a bundle.

mod bundle;
#[cfg(feature = "rten")]
mod convolution;
#[cfg(feature = "rten")]
mod convolution_plan;
mod engine;
mod manifest;
mod model_error;
mod nnunet;
mod normalise;
mod onnx_check;
mod onnx_fields;
mod onnx_proto;
mod onnx_shapes;
#[cfg(feature = "ort")]
mod ort_engine;
#[cfg(feature = "rten")]
mod rten_engine;
mod segmenter;
mod windows;

pub use bundle::{MAX_MODEL_BYTES, MAX_NETWORK_BYTES, ModelBundle};
pub use engine::Engine;
pub use manifest::{Manifest, NetworkSpec, Normalisation, Tiling};
pub use model_error::ModelError;
pub use nnunet::NnunetFolder;
pub use onnx_check::NetworkFacts;
#[cfg(feature = "ort")]
pub use ort_engine::{OrtEngine, OrtRuntime};
#[cfg(feature = "rten")]
pub use rten_engine::RtenEngine;
pub use segmenter::{Mirroring, NetworkOptions, NetworkSegmenter};
