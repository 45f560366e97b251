use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::ModelError;
use crate::PostProcessing;

/// Everything about a model that is not weights: how to feed it and how to read it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Name of the model, 1 to 100 characters.
    pub name: String,
    /// The network's outside.
    pub network: NetworkSpec,
    /// From grey values to what the network reads.
    pub normalisation: Normalisation,
    /// How large images are cut.
    pub tiling: Tiling,
    /// Axes along which the network may see the image mirrored as well: 0 rows, 1 columns.
    pub mirror_axes: Vec<u8>,
    /// From probabilities to a mask.
    pub postprocessing: PostProcessing,
    /// What a reader should know: data, training, metrics, licence. Not read by the program.
    pub card: Map<String, Value>,
}

/// The outside of a network.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkSpec {
    /// Name of the input, float32 (N, 1, H, W).
    pub input: String,
    /// Name of the output, float32 (N, classes, H, W), before softmax.
    pub output: String,
    /// Channels of the output, at least 2.
    pub classes: u16,
    /// The classes that are the body; the probability is their sum.
    pub foreground: Vec<u16>,
    /// Both sides of what it reads are multiples of this, px.
    pub multiple_px: u32,
}

/// What is done to grey values before the network sees them, over the whole image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "scheme", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Normalisation {
    /// Mean 0, standard deviation 1.
    ZScore {
        /// What the standard deviation is at least, in grey values.
        least_std: f64,
    },
    /// Clipped to `low` and `high`, then `(value - mean) / std` with the training set's figures.
    Fixed {
        /// Lower clip, grey values.
        low: f64,
        /// Upper clip, grey values.
        high: f64,
        /// Subtracted, grey values.
        mean: f64,
        /// Divided by, grey values.
        std: f64,
    },
    /// From 0 at the least value to 1 at the greatest.
    ZeroToOne,
    /// Divided by 255.
    Over255,
    /// As it is.
    None,
}

/// In words, for people.
impl fmt::Display for Normalisation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ZScore { least_std } => {
                write!(
                    f,
                    "mean 0, standard deviation 1 over the whole image (divided by at least {least_std})"
                )
            }
            Self::Fixed { low, high, mean, std } => {
                write!(f, "clipped to {low} .. {high}, less {mean}, divided by {std}")
            }
            Self::ZeroToOne => f.write_str("0 at the least value to 1 at the greatest"),
            Self::Over255 => f.write_str("divided by 255"),
            Self::None => f.write_str("none"),
        }
    }
}

/// How images are cut into what the network reads at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tiling {
    /// Images of at most so many pixels (padded) are read whole.
    pub whole_up_to_px: u64,
    /// Rows and columns of the windows for larger ones, px; multiples of the network's.
    pub window_px: [u32; 2],
}

/// Largest description, bytes.
pub(super) const MAX_MANIFEST_BYTES: u64 = 1 << 20;
const MAX_WINDOW_PX: u32 = 4096;
const MAX_WHOLE_PX: u64 = 1 << 26;

impl Manifest {
    /// Reads and checks a description.
    ///
    /// # Errors
    /// [`ModelError::BadManifest`].
    pub fn from_json(json: &[u8]) -> Result<Self, ModelError> {
        let manifest: Self = serde_json::from_slice(json)
            .map_err(|error| ModelError::BadManifest { message: error.to_string() })?;
        manifest.check()?;
        Ok(manifest)
    }

    /// Refuses a description that contradicts itself or asks for too much.
    ///
    /// # Errors
    /// [`ModelError::BadManifest`].
    pub fn check(&self) -> Result<(), ModelError> {
        let refuse = |message: String| Err(ModelError::BadManifest { message });
        if !(1..=100).contains(&self.name.chars().count())
            || self.name.chars().any(char::is_control)
        {
            return refuse(format!("name {:?}; expected 1 to 100 characters", self.name));
        }
        let net = &self.network;
        if net.input.is_empty() || net.output.is_empty() || net.input == net.output {
            return refuse(format!("input `{}` and output `{}`", net.input, net.output));
        }
        if !(2..=256).contains(&net.classes) {
            return refuse(format!("{} classes; expected 2 to 256", net.classes));
        }
        let mut foreground = net.foreground.clone();
        foreground.sort_unstable();
        foreground.dedup();
        if foreground.is_empty()
            || foreground.len() != net.foreground.len()
            || foreground.len() == usize::from(net.classes)
            || foreground.iter().any(|class| *class >= net.classes)
        {
            return refuse(format!("foreground {:?} of {} classes", net.foreground, net.classes));
        }
        if !(1..=1024).contains(&net.multiple_px) {
            return refuse(format!("sides in multiples of {} px; 1 to 1024", net.multiple_px));
        }
        for side in self.tiling.window_px {
            if !(1..=MAX_WINDOW_PX).contains(&side) || !side.is_multiple_of(net.multiple_px) {
                return refuse(format!(
                    "windows of {side} px; expected a multiple of {} up to {MAX_WINDOW_PX}",
                    net.multiple_px
                ));
            }
        }
        if self.tiling.whole_up_to_px > MAX_WHOLE_PX {
            return refuse(format!(
                "whole images of {} px; at most {MAX_WHOLE_PX}",
                self.tiling.whole_up_to_px
            ));
        }
        if !matches!(self.mirror_axes.as_slice(), [] | [0] | [1] | [0, 1]) {
            return refuse(format!("mirror axes {:?}; expected 0 and 1", self.mirror_axes));
        }
        self.normalisation.check()?;
        self.postprocessing
            .check()
            .map_err(|error| ModelError::BadManifest { message: error.to_string() })
    }
}

impl Normalisation {
    fn check(&self) -> Result<(), ModelError> {
        let good = match *self {
            Self::ZScore { least_std } => least_std > 0.0 && least_std.is_finite(),
            Self::Fixed { low, high, mean, std } => {
                low < high
                    && [low, high, mean].iter().all(|v| v.is_finite())
                    && std > 0.0
                    && std.is_finite()
            }
            Self::ZeroToOne | Self::Over255 | Self::None => true,
        };
        if good {
            return Ok(());
        }
        Err(ModelError::BadManifest { message: format!("normalisation {self:?}") })
    }
}
