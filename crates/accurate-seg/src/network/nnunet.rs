use bytes::Bytes;
use serde_json::{Map, Value, json};

use super::onnx_check::interface_names;
use super::{Manifest, ModelBundle, ModelError, NetworkSpec, Normalisation, Tiling};
use crate::PostProcessing;

/// The parts of a folder of nnU-Net v2's results, with the network exported to ONNX.
///
/// The export must give logits, before any softmax, and hold its weights.
#[derive(Debug, Clone)]
pub struct NnunetFolder<'a> {
    /// Name of the model that is made.
    pub name: &'a str,
    /// `plans.json`.
    pub plans: &'a [u8],
    /// `dataset.json`.
    pub dataset: &'a [u8],
    /// The exported network.
    pub network: Bytes,
    /// Which of the plans' configurations the network has; `2d` as a rule.
    pub configuration: &'a str,
    /// Labels that are the body; empty takes all but `background`.
    pub foreground: &'a [&'a str],
    /// Axes along which it was trained with mirroring, which the plans do not say: nnU-Net's
    /// trainer mirrors along both.
    pub mirror_axes: Vec<u8>,
}

impl NnunetFolder<'_> {
    /// One bundle with normalisation, patch size, mirroring and labels as nnU-Net has them.
    ///
    /// # Errors
    /// [`ModelError::BadPlans`] for what is missing or cannot be carried over (3D, several
    /// channels, resampling, regions, masks for normalisation), and those of [`ModelBundle::new`].
    pub fn to_bundle(&self) -> Result<ModelBundle, ModelError> {
        let plans = object("plans.json", self.plans)?;
        let dataset = object("dataset.json", self.dataset)?;
        let configuration = configuration(&plans, self.configuration)?;

        let patch = numbers(&configuration, "patch_size")?;
        let [rows, columns] = patch[..] else {
            return refuse(format!("patch_size has {} sides; only 2D can be run", patch.len()));
        };
        let side = |value: f64| {
            if value >= 1.0 && value.fract() == 0.0 && value <= f64::from(u32::MAX) {
                Ok(value as u32)
            } else {
                refuse(format!("patch_size {patch:?}"))
            }
        };
        let window_px = [side(rows)?, side(columns)?];
        let spacing = numbers(&configuration, "spacing")?;
        if spacing.iter().any(|s| (s - 1.0).abs() > 1e-6) {
            return refuse(format!("spacing {spacing:?}: images would have to be resampled"));
        }
        let (classes, foreground) = self.labels(&dataset)?;
        let (input, output) = interface_names(&self.network)?;
        let manifest = Manifest {
            name: self.name.to_owned(),
            network: NetworkSpec {
                input,
                output,
                classes,
                foreground,
                multiple_px: multiple(&configuration)?,
            },
            normalisation: normalisation(&plans, &configuration)?,
            // As nnU-Net itself: always in patches.
            tiling: Tiling { whole_up_to_px: 0, window_px },
            mirror_axes: self.mirror_axes.clone(),
            // nnU-Net takes the likelier class and keeps every component.
            postprocessing: PostProcessing::PAPER,
            card: self.card(&plans, &dataset),
        };
        ModelBundle::new(manifest, self.network.clone())
    }

    /// Number of classes, and those that are the body.
    fn labels(&self, dataset: &Map<String, Value>) -> Result<(u16, Vec<u16>), ModelError> {
        let channels = dataset.get("channel_names").and_then(Value::as_object);
        if channels.is_none_or(|c| c.len() != 1) {
            return refuse(format!("channel_names {channels:?}; only one channel can be run"));
        }
        let labels = dataset
            .get("labels")
            .and_then(Value::as_object)
            .ok_or_else(|| bad("dataset.json has no labels"))?;
        let mut foreground = Vec::new();
        let mut classes = 0_u16;
        for (name, number) in labels {
            if name == "ignore" {
                continue;
            }
            let number = number
                .as_u64()
                .and_then(|n| u16::try_from(n).ok())
                .ok_or_else(|| bad(format!("label `{name}` is {number}; regions cannot be run")))?;
            classes = classes.max(number.saturating_add(1));
            let wanted = match self.foreground {
                [] => number != 0,
                names => names.contains(&name.as_str()),
            };
            if wanted {
                foreground.push(number);
            }
        }
        if foreground.is_empty() || foreground.len() < self.foreground.len() {
            let names: Vec<&String> = labels.keys().collect();
            return refuse(format!("foreground {:?} among the labels {names:?}", self.foreground));
        }
        foreground.sort_unstable();
        Ok((classes, foreground))
    }

    fn card(&self, plans: &Map<String, Value>, dataset: &Map<String, Value>) -> Map<String, Value> {
        let text = |from: &Map<String, Value>, key: &str| {
            from.get(key).and_then(Value::as_str).map_or(Value::Null, |t| json!(t))
        };
        let mut card = Map::new();
        card.insert("source".into(), json!("nnU-Net v2"));
        card.insert("configuration".into(), json!(self.configuration));
        card.insert("dataset".into(), text(plans, "dataset_name"));
        card.insert("plans".into(), text(plans, "plans_name"));
        card.insert("licence".into(), text(dataset, "licence"));
        card.insert("labels".into(), dataset.get("labels").cloned().unwrap_or(Value::Null));
        card
    }
}

fn bad(message: impl Into<String>) -> ModelError {
    ModelError::BadPlans { message: message.into() }
}

fn refuse<T>(message: impl Into<String>) -> Result<T, ModelError> {
    Err(bad(message))
}

fn object(file: &str, json: &[u8]) -> Result<Map<String, Value>, ModelError> {
    match serde_json::from_slice(json) {
        Ok(Value::Object(map)) => Ok(map),
        Ok(_) => refuse(format!("{file} is no JSON object")),
        Err(error) => refuse(format!("{file}: {error}")),
    }
}

/// A configuration with what it inherits filled in.
fn configuration(plans: &Map<String, Value>, name: &str) -> Result<Map<String, Value>, ModelError> {
    const DEEPEST: usize = 8;
    let all = plans
        .get("configurations")
        .and_then(Value::as_object)
        .ok_or_else(|| bad("plans.json has no configurations"))?;
    let mut merged = Map::new();
    let mut next = Some(name.to_owned());
    for _ in 0..DEEPEST {
        let Some(current) = next else { return Ok(merged) };
        let found = all.get(&current).and_then(Value::as_object).ok_or_else(|| {
            bad(format!("no configuration `{current}` among {:?}", all.keys().collect::<Vec<_>>()))
        })?;
        for (key, value) in found {
            merged.entry(key.clone()).or_insert_with(|| value.clone());
        }
        next = found.get("inherits_from").and_then(Value::as_str).map(str::to_owned);
    }
    refuse(format!("configuration `{name}` inherits from more than {DEEPEST} others"))
}

fn numbers(from: &Map<String, Value>, key: &str) -> Result<Vec<f64>, ModelError> {
    from.get(key)
        .and_then(Value::as_array)
        .and_then(|list| list.iter().map(Value::as_f64).collect())
        .ok_or_else(|| bad(format!("the configuration has no list of numbers `{key}`")))
}

/// The product of all strides, the larger of both axes: the sides of what the network reads.
fn multiple(configuration: &Map<String, Value>) -> Result<u32, ModelError> {
    let strides = configuration
        .get("architecture")
        .and_then(|a| a.get("arch_kwargs"))
        .and_then(|a| a.get("strides"))
        // Plans of nnU-Net before 2.4.
        .or_else(|| configuration.get("pool_op_kernel_sizes"))
        .and_then(Value::as_array)
        .ok_or_else(|| bad("the configuration has no strides"))?;
    let mut product = [1_u32; 2];
    for stage in strides {
        let pair: Option<Vec<u32>> = match stage {
            Value::Array(list) => {
                list.iter().map(|v| v.as_u64().and_then(|n| u32::try_from(n).ok())).collect()
            }
            Value::Number(n) => n.as_u64().and_then(|n| u32::try_from(n).ok()).map(|n| vec![n, n]),
            _ => None,
        };
        let Some([rows, columns]) = pair.as_deref() else {
            return refuse(format!("strides {stage}; only 2D can be run"));
        };
        product = [product[0].saturating_mul(*rows), product[1].saturating_mul(*columns)];
    }
    Ok(product[0].max(product[1]))
}

fn normalisation(
    plans: &Map<String, Value>,
    configuration: &Map<String, Value>,
) -> Result<Normalisation, ModelError> {
    let masked = configuration.get("use_mask_for_norm").and_then(Value::as_array);
    if masked.is_some_and(|m| m.iter().any(|v| v.as_bool() != Some(false))) {
        return refuse("use_mask_for_norm: normalisation within a mask");
    }
    let schemes = configuration
        .get("normalization_schemes")
        .and_then(Value::as_array)
        .ok_or_else(|| bad("the configuration has no normalization_schemes"))?;
    let [scheme] = schemes.as_slice() else {
        return refuse(format!("normalization_schemes {schemes:?}; one channel can be run"));
    };
    Ok(match scheme.as_str().unwrap_or_default() {
        // nnU-Net divides by at least 1e-8.
        "ZScoreNormalization" => Normalisation::ZScore { least_std: 1e-8 },
        "RescaleTo01Normalization" => Normalisation::ZeroToOne,
        "RGBTo01Normalization" => Normalisation::Over255,
        "NoNormalization" => Normalisation::None,
        "CTNormalization" => {
            let figures = plans
                .get("foreground_intensity_properties_per_channel")
                .and_then(|p| p.get("0"))
                .ok_or_else(|| bad("no foreground_intensity_properties_per_channel"))?;
            let figure = |key: &str| {
                figures
                    .get(key)
                    .and_then(Value::as_f64)
                    .ok_or_else(|| bad(format!("no intensity property `{key}`")))
            };
            Normalisation::Fixed {
                low: figure("percentile_00_5")?,
                high: figure("percentile_99_5")?,
                mean: figure("mean")?,
                std: figure("std")?.max(1e-8),
            }
        }
        other => return refuse(format!("normalisation `{other}`")),
    })
}
