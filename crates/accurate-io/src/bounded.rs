use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::IoError;

/// Largest accepted calibration, rig, meta or manifest file, bytes.
pub(crate) const MAX_SMALL_BYTES: u64 = 1 << 20;
/// Largest accepted file of points, bytes.
pub(crate) const MAX_POINTS_BYTES: u64 = 256 << 20;
/// Largest accepted image file, bytes.
pub(crate) const MAX_IMAGE_BYTES: u64 = 1 << 30;

/// Reads a whole file of at most `limit` bytes, for formats that other crates know.
///
/// # Errors
/// [`IoError::TooLarge`] before taking memory for it, [`IoError::Missing`], [`IoError::System`].
pub fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, IoError> {
    read_bytes(path, limit)
}

/// Reads a whole file, refusing one above `limit` bytes before taking memory for it. Also safe for
/// a file that grows, or a device that never ends.
///
/// Every reader of this crate starts here: whatever size a file then declares is compared with the
/// bytes that are really there.
pub(crate) fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, IoError> {
    let system = |e| IoError::system(path, "read", e);
    let too_large = |found| IoError::TooLarge {
        path: path.to_owned(),
        what: "file size in bytes".into(),
        found,
        limit,
    };
    let file = File::open(path).map_err(system)?;
    let length = file.metadata().map_err(system)?.len();
    if length > limit {
        return Err(too_large(length));
    }
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(system)?;
    if bytes.len() as u64 > limit {
        return Err(too_large(bytes.len() as u64));
    }
    Ok(bytes)
}

/// Bytes of a file as UTF-8 text, without a byte order mark.
pub(crate) fn as_text<'b>(path: &Path, bytes: &'b [u8]) -> Result<&'b str, IoError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|e| IoError::NotText { path: path.to_owned(), offset: e.valid_up_to() })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// [`read_bytes`] as UTF-8 text, without a byte order mark.
pub(crate) fn read_text(path: &Path, limit: u64) -> Result<String, IoError> {
    let mut text = String::from_utf8(read_bytes(path, limit)?).map_err(|e| IoError::NotText {
        path: path.to_owned(),
        offset: e.utf8_error().valid_up_to(),
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}
