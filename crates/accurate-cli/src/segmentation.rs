//! From the command line's choice of model and engine to a segmenter.

use std::path::{Path, PathBuf};

use accurate3d::io::read_file;
use accurate3d::seg::network::{
    Engine, MAX_MODEL_BYTES, Mirroring, ModelBundle, ModelError, NetworkOptions, NetworkSegmenter,
    OrtEngine, OrtRuntime, RtenEngine,
};
use accurate3d::seg::{PostProcessing, SegError};

use crate::args::{EngineChoice, Mirror, ModelArgs};
use crate::code::Code;
use crate::console::Console;
use crate::failure::Failure;

/// The model that is used without `--model`, where one is built in. Nothing reads it before it is
/// asked for.
#[cfg(feature = "embedded-model")]
const EMBEDDED: Option<&[u8]> = Some(include_bytes!("../../../models/wire.accmodel"));
#[cfg(not(feature = "embedded-model"))]
const EMBEDDED: Option<&[u8]> = None;

/// The environment variable that names ONNX Runtime's library; the Rust binding's own.
const LIBRARY_VARIABLE: &str = "ORT_DYLIB_PATH";

/// The segmenter that the options ask for.
///
/// # Errors
/// [`Code::Unavailable`] without a model or with an engine that is not there; [`Code::Malformed`]
/// and others for a model that is refused.
pub fn segmenter(args: &ModelArgs, console: &Console) -> Result<NetworkSegmenter, Failure> {
    segmenter_with(args, console, |options, _| options)
}

/// As [`segmenter`], with more of the options that only `accurate segment` has.
pub fn segmenter_with(
    args: &ModelArgs,
    console: &Console,
    choose: impl FnOnce(NetworkOptions, PostProcessing) -> NetworkOptions,
) -> Result<NetworkSegmenter, Failure> {
    let bundle = bundle(args.model.as_deref())?;
    let engine = engine(args, &bundle, console)?;
    let mirroring = match args.mirror {
        Mirror::Never => Mirroring::Never,
        Mirror::Opposite => Mirroring::Opposite,
        Mirror::All => Mirroring::All,
    };
    let options = NetworkOptions { mirroring, ..NetworkOptions::DEFAULT };
    let options = choose(options, bundle.manifest().postprocessing);
    Ok(NetworkSegmenter::new(&bundle, engine, options)?)
}

/// The model in a file, or the built-in one.
pub fn bundle(path: Option<&Path>) -> Result<ModelBundle, Failure> {
    match (path, EMBEDDED) {
        (Some(path), _) => {
            let bytes = read_file(path, MAX_MODEL_BYTES)?;
            ModelBundle::read(bytes.into()).map_err(|error| Failure::from(error).of_file(path))
        }
        (None, Some(bytes)) => Ok(ModelBundle::read(bytes.into())?),
        (None, None) => {
            Err(Failure::new(Failure::UNAVAILABLE, "no segmentation network is installed")
                .with_hint(
                    "name one with --model FILE.accmodel, or segment elsewhere: --input mask",
                ))
        }
    }
}

fn engine(
    args: &ModelArgs,
    bundle: &ModelBundle,
    console: &Console,
) -> Result<Box<dyn Engine>, Failure> {
    // As many as the rest of the program has (--threads).
    let threads = rayon::current_num_threads();
    if args.engine == EngineChoice::Rten && args.onnxruntime.is_some() {
        return Err(Failure::new(Failure::USAGE, "the engine `rten` takes no --onnxruntime")
            .with_hint("take --engine ort, or leave one of the two out"));
    }
    let named = library(args.onnxruntime.as_ref());
    let chosen = match args.engine {
        EngineChoice::Auto if named.is_some() => EngineChoice::Ort,
        EngineChoice::Auto => EngineChoice::Rten,
        chosen => chosen,
    };
    if chosen == EngineChoice::Ort {
        let Some(library) = named else {
            return Err(Failure::new(
                Failure::UNAVAILABLE,
                "the engine `ort` needs the library of ONNX Runtime",
            )
            .with_hint(format!(
                "name libonnxruntime.so.* with --onnxruntime or {LIBRARY_VARIABLE}, or take --engine rten"
            )));
        };
        match onnx_runtime(&library, bundle, threads) {
            Ok(engine) => return Ok(Box::new(engine)),
            // Whoever names a library wants that one; the environment's may be meant for others.
            Err(error) if args.engine == EngineChoice::Ort || args.onnxruntime.is_some() => {
                return Err(Failure::new(Failure::UNAVAILABLE, error.to_string()).with_hint(
                    "version 1.24 or later is needed, one that knows the model's operations; \
                         or take --engine rten",
                ));
            }
            Err(error) => console.remark(&format!("{error}; going on with rten")),
        }
    }
    Ok(Box::new(RtenEngine::new(bundle, threads)?))
}

fn onnx_runtime(
    library: &Path,
    bundle: &ModelBundle,
    threads: usize,
) -> Result<OrtEngine, ModelError> {
    OrtEngine::new(&OrtRuntime::load(library)?, bundle, threads)
}

/// The library of ONNX Runtime that the option or the environment names, as an absolute path.
pub fn library(option: Option<&PathBuf>) -> Option<PathBuf> {
    let named = option.cloned().or_else(|| {
        std::env::var_os(LIBRARY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from)
    })?;
    // A path that does not exist is refused by the loader in its own words.
    Some(std::path::absolute(&named).unwrap_or(named))
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        let code = match error {
            ModelError::TooLarge { .. } => Code::TooLarge,
            ModelError::NotFinite { .. } => Code::NotFinite,
            ModelError::UnknownFormat { .. }
            | ModelError::Unsupported { .. }
            | ModelError::BadPlans { .. } => Code::Unsupported,
            ModelError::Engine { .. } => Code::Unavailable,
            _ => Code::Malformed,
        };
        Self::new(code, error.to_string())
    }
}

/// What of a [`SegError`] is not about a mask.
pub fn code_of(error: &SegError) -> Code {
    match error {
        SegError::TooLarge { .. } => Code::TooLarge,
        SegError::NotFinite { .. } => Code::NotFinite,
        SegError::NotAProbability { .. } => Code::BadInput,
        SegError::LevelIsNan { .. }
        | SegError::LevelOutOfRange { .. }
        | SegError::LevelsOutOfOrder { .. } => Code::Usage,
        SegError::Engine { .. } => Code::Internal,
        _ => Code::BadMask,
    }
}
