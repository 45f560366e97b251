use thiserror::Error;

/// Why a model is not used. Found before an engine sees the network, unless it is
/// [`ModelError::Engine`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The bytes are no bundle at all.
    #[error("not an accurate model: the first 8 bytes are {found:02x?}, not `ACCMODEL`")]
    NotAModel {
        /// What stands there.
        found: Vec<u8>,
    },
    /// A bundle of a version that this program does not know.
    #[error("model format {found} is not known: this program reads format {known}")]
    UnknownFormat {
        /// The version found.
        found: u32,
        /// The version read.
        known: u32,
    },
    /// The parts do not add up to the file.
    #[error("the model has {found} bytes where its header says {expected}")]
    WrongLength {
        /// Bytes the header calls for, at least.
        expected: u64,
        /// Bytes there are.
        found: u64,
    },
    /// Some part is larger than any honest model.
    #[error("{what}: {found} is more than the limit of {limit}")]
    TooLarge {
        /// Which part.
        what: &'static str,
        /// Its size.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// The contents are not those that were packed.
    #[error("damaged: the contents have BLAKE3 {found}, the model says {expected}")]
    WrongHash {
        /// The hash in the file.
        expected: String,
        /// The hash of what is there.
        found: String,
    },
    /// The description is not what a description looks like.
    #[error("model description: {message}")]
    BadManifest {
        /// What is wrong with it.
        message: String,
    },
    /// The network is not readable as ONNX.
    #[error("network is not ONNX: {message}")]
    NotOnnx {
        /// What the protobuf reader says.
        message: String,
    },
    /// The network uses what this program does not run.
    #[error("network not supported: {message}")]
    Unsupported {
        /// What, and where.
        message: String,
    },
    /// The network contradicts itself or the description.
    #[error("network refused: {message}")]
    BadNetwork {
        /// What, and where.
        message: String,
    },
    /// A weight is NaN or infinite.
    #[error("network refused: weight {index} of `{tensor}` is {value}")]
    NotFinite {
        /// Name of the tensor.
        tensor: String,
        /// Index of the first such element, row-major.
        index: usize,
        /// `NaN`, `inf` or `-inf`.
        value: String,
    },
    /// nnU-Net's plans cannot be carried over.
    #[error("nnU-Net plans: {message}")]
    BadPlans {
        /// What is missing or not supported.
        message: String,
    },
    /// An engine could not be made of a network that passed every check.
    #[error("engine {engine}: {message}")]
    Engine {
        /// Which engine.
        engine: &'static str,
        /// What it says.
        message: String,
    },
}

impl ModelError {
    pub(super) fn unsupported(message: impl Into<String>) -> Self {
        Self::Unsupported { message: message.into() }
    }

    pub(super) fn bad_network(message: impl Into<String>) -> Self {
        Self::BadNetwork { message: message.into() }
    }
}
