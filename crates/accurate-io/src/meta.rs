use std::path::Path;

use accurate_geom::{ImageSize, LengthUnit};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::IoError;
use crate::bounded::{MAX_SMALL_BYTES, read_text};
use crate::image_file::MAX_IMAGE_SIDE_PX;
use crate::unit::length_unit;

/// `meta.json` of a pair folder. Every field may be missing; unknown fields are ignored.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Meta {
    pub(crate) case_id: Option<String>,
    #[serde(skip_deserializing)]
    pub(crate) num_points: Option<usize>,
    /// `[W, H]`, or `[[W1, H1], [W2, H2]]` where the views differ.
    image_size: Option<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<Value>,
    unit: Option<String>,
}

impl Meta {
    pub(crate) fn new(
        case_id: String,
        num_points: Option<usize>,
        sizes: [ImageSize; 2],
        source: Option<String>,
        unit: LengthUnit,
    ) -> Self {
        let [a, b] = sizes.map(|s| vec![s.width, s.height]);
        let image_size = Some(if a == b { a.into() } else { vec![a, b].into() });
        Self {
            case_id: Some(case_id),
            num_points,
            image_size,
            source: source.map(Value::String),
            unit: Some(unit.label().to_owned()),
        }
    }

    pub(crate) fn read(path: &Path) -> Result<Self, IoError> {
        let text = read_text(path, MAX_SMALL_BYTES)?;
        serde_json::from_str(&text)
            .map_err(|e| IoError::malformed(path, "JSON", Some(e.line()), e.to_string()))
    }

    /// The image sizes of both views, where the file gives them.
    pub(crate) fn sizes(&self, path: &Path) -> Result<Option<[ImageSize; 2]>, IoError> {
        let Some(value) = &self.image_size else { return Ok(None) };
        let bad = || {
            let reason = "expected [width, height] in px, or one such pair per view";
            IoError::field(path, "image_size", value.to_string(), reason)
        };
        let size = |value: &Value| -> Result<ImageSize, IoError> {
            let [width, height] = value.as_array().map(Vec::as_slice).ok_or_else(bad)? else {
                return Err(bad());
            };
            let side = |side: &Value| {
                let px = side.as_u64().filter(|px| *px > 0).ok_or_else(bad)?;
                let too_large = || IoError::TooLarge {
                    path: path.to_owned(),
                    what: "image_size in px".into(),
                    found: px,
                    limit: MAX_IMAGE_SIDE_PX.into(),
                };
                u32::try_from(px).ok().filter(|p| *p <= MAX_IMAGE_SIDE_PX).ok_or_else(too_large)
            };
            Ok(ImageSize { width: side(width)?, height: side(height)? })
        };
        match value.as_array().map(Vec::as_slice) {
            Some([a @ Value::Array(_), b @ Value::Array(_)]) => Ok(Some([size(a)?, size(b)?])),
            _ => size(value).map(|s| Some([s, s])),
        }
    }

    /// The unit of the world; files of the paper's public set name none.
    pub(crate) fn unit(&self, path: &Path) -> Result<LengthUnit, IoError> {
        self.unit.as_deref().map_or(Ok(LengthUnit::Unit), |label| length_unit(path, "unit", label))
    }

    pub(crate) fn source(&self) -> Option<String> {
        match &self.source {
            None | Some(Value::Null) => None,
            Some(Value::String(text)) => Some(text.clone()),
            Some(other) => Some(other.to_string()),
        }
    }
}

/// Refuses a case name that would leave the folder it is joined to: outputs go to `OUT/<case_id>`.
pub(crate) fn check_case_id(path: &Path, case_id: &str) -> Result<(), IoError> {
    let outside = case_id.is_empty()
        || case_id == "."
        || case_id == ".."
        || case_id.len() > 200
        || case_id.chars().any(|c| c.is_control() || matches!(c, '/' | '\\' | ':'));
    if outside {
        let reason = "a case name must be usable as a folder name";
        return Err(IoError::field(path, "case_id", case_id, reason));
    }
    Ok(())
}
