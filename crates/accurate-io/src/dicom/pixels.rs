use std::path::Path;

use dicom_dictionary_std::tags;
use dicom_pixeldata::{PhotometricInterpretation, PixelDecoder, PixelRepresentation};
use ndarray::Array2;

use super::open::{number, open};
use crate::{IoError, MAX_IMAGE_SIDE_PX};

/// Most decoded pixel data accepted, bytes.
const MAX_DECODED_BYTES: u64 = 512 << 20;

/// Which frames of a run become the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum FrameChoice {
    /// The mean over all frames: less noise where nothing moves.
    #[default]
    Mean,
    /// One frame, from 0.
    One(u32),
}

/// Grey values of a DICOM file.
#[derive(Debug, Clone, PartialEq)]
pub struct DicomPixels {
    /// Stored values, shape `(height, width)`; MONOCHROME1 is inverted, so that more radiation is
    /// brighter either way.
    pub values: Array2<f32>,
    /// Largest value the stored bits can hold.
    pub max_value: f32,
    /// Frames of the file.
    pub frames: u32,
    /// Centre and width of the first window, if there is one.
    pub window: Option<(f32, f32)>,
}

impl DicomPixels {
    /// The values through the file's window, 0 to 255; without a window, the whole range.
    ///
    /// # Source
    /// DICOM PS3.3 C.11.2.1.2.1 (linear).
    pub fn windowed(&self) -> Array2<f32> {
        let (centre, width) = self.window.unwrap_or((0.5 * self.max_value, self.max_value + 1.0));
        let (centre, width) = (centre - 0.5, (width - 1.0).max(1.0));
        self.values.mapv(|v| (((v - centre) / width + 0.5) * 255.0).clamp(0.0, 255.0))
    }
}

/// Reads the frames of a DICOM file: uncompressed, JPEG (also lossless) or RLE, one sample per pixel of
/// 8 or 16 bits, unsigned.
///
/// # Errors
/// [`IoError::TooLarge`] before memory is taken; [`IoError::Unsupported`] for colour, signed values or
/// another coding; [`IoError::Field`] for a frame that is not there; [`IoError::Malformed`].
pub fn read_dicom_pixels(path: &Path, choice: FrameChoice) -> Result<DicomPixels, IoError> {
    let object = open(path, true)?;
    let whole = |tag, name: &str, absent: Option<f64>, limit: f64| -> Result<u32, IoError> {
        let value = number(path, &object, tag, name, 0)?
            .or(absent)
            .ok_or_else(|| IoError::field(path, name, "", "the tag is missing"))?;
        if value >= 1.0 && value <= limit && value.fract() == 0.0 {
            Ok(value as u32)
        } else {
            let reason = format!("expected a whole number from 1 to {limit}");
            Err(IoError::field(path, name, value.to_string(), reason))
        }
    };
    let side = f64::from(MAX_IMAGE_SIDE_PX);
    let width = whole(tags::COLUMNS, "Columns", None, side)?;
    let height = whole(tags::ROWS, "Rows", None, side)?;
    let frames = whole(tags::NUMBER_OF_FRAMES, "NumberOfFrames", Some(1.0), 100_000.0)?;
    let samples = whole(tags::SAMPLES_PER_PIXEL, "SamplesPerPixel", Some(1.0), 4.0)?;
    let bits = whole(tags::BITS_ALLOCATED, "BitsAllocated", None, 64.0)?;
    let unsupported = |what: String| IoError::Unsupported { path: path.to_owned(), what };
    if samples != 1 || !(bits == 8 || bits == 16) {
        return Err(unsupported(format!(
            "{samples} samples of {bits} bits per pixel; expected one of 8 or 16"
        )));
    }
    let pixels = u64::from(width) * u64::from(height);
    let decoded = pixels * u64::from(frames) * u64::from(bits / 8);
    if decoded > MAX_DECODED_BYTES {
        return Err(IoError::TooLarge {
            path: path.to_owned(),
            what: "decoded pixel data in bytes".into(),
            found: decoded,
            limit: MAX_DECODED_BYTES,
        });
    }
    if let FrameChoice::One(index) = choice
        && index >= frames
    {
        let reason = format!("the file has {frames} frames, counted from 0");
        return Err(IoError::field(path, "frame", index.to_string(), reason));
    }
    let window = match (
        number(path, &object, tags::WINDOW_CENTER, "WindowCenter", 0)?,
        number(path, &object, tags::WINDOW_WIDTH, "WindowWidth", 0)?,
    ) {
        (Some(centre), Some(width)) if width >= 1.0 => Some((centre as f32, width as f32)),
        _ => None,
    };
    let malformed = |reason: &str| IoError::malformed(path, "DICOM", None, reason);
    let data = object.decode_pixel_data().map_err(|_| {
        unsupported("the pixel data cannot be decoded (read are: plain, JPEG, RLE)".into())
    })?;
    if data.pixel_representation() != PixelRepresentation::Unsigned {
        return Err(unsupported("signed pixel values are not read".into()));
    }
    let inverted = match data.photometric_interpretation() {
        PhotometricInterpretation::Monochrome1 => true,
        PhotometricInterpretation::Monochrome2 => false,
        _ => return Err(unsupported("neither MONOCHROME1 nor MONOCHROME2".into())),
    };
    let max_value = ((1u32 << data.bits_stored().clamp(1, 16)) - 1) as f32;
    let range = match choice {
        FrameChoice::Mean => 0..frames,
        FrameChoice::One(index) => index..index + 1,
    };
    let mut sums = vec![0.0f64; pixels as usize];
    let count = f64::from(range.end - range.start);
    for frame in range {
        let bytes = data.frame_data(frame).map_err(|_| malformed("a frame is missing"))?;
        if bytes.len() != sums.len() * (bits / 8) as usize {
            return Err(malformed("a frame has another size than declared"));
        }
        if bits == 8 {
            sums.iter_mut().zip(bytes).for_each(|(sum, v)| *sum += f64::from(*v));
        } else {
            let words = bytes.chunks_exact(2).map(|w| u16::from_ne_bytes([w[0], w[1]]));
            sums.iter_mut().zip(words).for_each(|(sum, v)| *sum += f64::from(v));
        }
    }
    let grey = |sum: f64| {
        let value = (sum / count) as f32;
        if inverted { max_value - value } else { value }
    };
    let values = sums.into_iter().map(grey).collect();
    let values = Array2::from_shape_vec((height as usize, width as usize), values)
        .map_err(|_| malformed("a frame has another size than declared"))?;
    Ok(DicomPixels { values, max_value, frames, window })
}
