use std::io::Cursor;
use std::path::Path;

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use dicom_object::{DefaultDicomObject, OpenFileOptions};

use super::scan::scan;
use crate::IoError;
use crate::bounded::{MAX_IMAGE_BYTES, read_bytes};

pub(super) fn open(path: &Path, with_pixels: bool) -> Result<DefaultDicomObject, IoError> {
    let bytes = read_bytes(path, MAX_IMAGE_BYTES)?;
    let malformed = |reason: String| IoError::malformed(path, "DICOM", None, reason);
    scan(&bytes).map_err(malformed)?;
    let options = OpenFileOptions::new();
    let options = if with_pixels { options } else { options.read_until(tags::PIXEL_DATA) };
    // The parser's own words may quote the file, and with it a patient.
    options
        .from_reader(Cursor::new(&bytes))
        .map_err(|_| malformed("the parser refuses the data set".into()))
}

/// A number by its tag; `None` if the tag is absent or empty.
pub(super) fn number(
    path: &Path,
    object: &DefaultDicomObject,
    tag: Tag,
    name: &str,
    index: usize,
) -> Result<Option<f64>, IoError> {
    let Some(element) = object.element_opt(tag).map_err(|_| bad(path, name))? else {
        return Ok(None);
    };
    if element.value().multiplicity() == 0 {
        return Ok(None);
    }
    let values = element.to_multi_float64().map_err(|_| bad(path, name))?;
    match values.get(index) {
        Some(value) if value.is_finite() => Ok(Some(*value)),
        _ => Err(bad(path, name)),
    }
}

/// The error for a tag whose value is no number; the value itself is not quoted.
fn bad(path: &Path, name: &str) -> IoError {
    IoError::field(path, name, "(not shown)", "not a finite number")
}

/// One word of a coded tag, upper case, from the words allowed; anything else is not told apart.
pub(super) fn word(
    object: &DefaultDicomObject,
    tag: Tag,
    allowed: &[&'static str],
) -> Option<&'static str> {
    let text = object.element_opt(tag).ok()??.to_str().ok()?.trim().to_uppercase();
    allowed.iter().find(|word| **word == text).copied()
}
