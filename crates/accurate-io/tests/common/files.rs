//! Readers that tell whether what they read is sound, and files to try them on.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use accurate_geom::{ImageSize, View1};
use accurate_io::{
    IoError, PairParts, ViewDefaults, read_cameras, read_curve, read_grey, read_mask, read_matrix3,
    read_pair, read_points, read_rig,
};

/// Reads a file; `Ok(false)` if a number in the result is not finite.
pub type Read = fn(&Path) -> Result<bool, IoError>;

pub fn curve(path: &Path) -> Result<bool, IoError> {
    let curve = read_curve(path)?;
    let finite = |v: &f64| v.is_finite();
    Ok(curve.points.iter().all(|p| p.coords.iter().all(finite))
        && curve.columns.iter().all(|c| c.values.iter().all(finite)))
}

pub fn points(path: &Path) -> Result<bool, IoError> {
    Ok(read_points::<View1>(path)?.iter().all(|p| p.is_finite()))
}

pub fn rig(path: &Path) -> Result<bool, IoError> {
    let rig = read_rig(path)?;
    Ok([rig.camera1(), rig.camera2()]
        .iter()
        .all(|c| c.projection_matrix().iter().all(|v| v.is_finite())))
}

pub fn cameras(path: &Path) -> Result<bool, IoError> {
    let image_size = Some(ImageSize { width: 640, height: 480 });
    let views = read_cameras(&[path.to_owned()], &ViewDefaults { image_size, unit: None })?;
    let finite = |v: &f64| v.is_finite();
    Ok(!views.is_empty() && views.iter().all(|v| v.camera.projection_matrix().iter().all(finite)))
}

pub fn image(path: &Path) -> Result<bool, IoError> {
    let grey = read_grey(path)?;
    let mask = match read_mask(path) {
        Ok(mask) => mask.dim(),
        Err(IoError::Unsupported { .. }) => grey.values.dim(),
        Err(e) => return Err(e),
    };
    let range = 0.0..=grey.depth.max_value();
    Ok(mask == grey.values.dim() && grey.values.iter().all(|v| range.contains(v)))
}

/// The file is `meta.json` of a good pair folder.
pub fn meta(path: &Path) -> Result<bool, IoError> {
    let dir = path.parent().unwrap();
    let pair = read_pair(dir, PairParts::default())?;
    Ok(pair.size.iter().all(|s| s.width > 0 && s.height > 0))
}

pub fn matrix(path: &Path) -> Result<bool, IoError> {
    Ok(read_matrix3(path)?.iter().all(|v| v.is_finite()))
}

/// Writes `bytes`, reads them, and checks what came of it. `true` if they were accepted.
pub fn survives(path: &Path, bytes: &[u8], read: Read, what: &str) -> bool {
    // Some file systems flush a file that was truncated and written again: make a new one.
    let _ = fs::remove_file(path);
    fs::write(path, bytes).unwrap();
    let outcome = catch_unwind(AssertUnwindSafe(|| read(path)));
    match outcome.unwrap_or_else(|_| panic!("{what} panicked")) {
        Ok(finite) => {
            assert!(finite, "{what} gave a number that is not finite");
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.len() < 2000, "{what}: {} characters of error", text.len());
            assert!(!error.path().as_os_str().is_empty(), "{what}: {text}");
            false
        }
    }
}

/// The checksum of a PNG chunk.
pub fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |mut crc, b| {
        crc ^= u32::from(*b);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
        }
        crc
    })
}
