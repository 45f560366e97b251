use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageFormat};
use ndarray::Array2;

use crate::SynthError;

/// The image after a JPEG encoder of this quality (1 to 100) and a decoder.
pub(crate) fn through_jpeg(image: &Array2<u8>, quality: u8) -> Result<Array2<u8>, SynthError> {
    let failed = |reason: String| SynthError::Encoding { what: "JPEG", reason };
    let (height, width) = image.dim();
    let pixels: Vec<u8> = image.iter().copied().collect();
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .encode(&pixels, width as u32, height as u32, ExtendedColorType::L8)
        .map_err(|e| failed(e.to_string()))?;
    let decoded = image::load_from_memory_with_format(&bytes, ImageFormat::Jpeg)
        .map_err(|e| failed(e.to_string()))?
        .into_luma8();
    Array2::from_shape_vec((height, width), decoded.into_raw()).map_err(|e| failed(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fine_quality_keeps_a_smooth_image_and_a_coarse_one_leaves_blocks() {
        let image = Array2::from_shape_fn((48, 64), |(r, c)| (2 * r + c) as u8);
        let off = |quality| {
            let back = through_jpeg(&image, quality).unwrap();
            assert_eq!(back.dim(), image.dim());
            image.iter().zip(&back).map(|(a, b)| a.abs_diff(*b)).max().unwrap()
        };
        // Quantisation steps of 1 to 3 at quality 98; tens at quality 10.
        assert!(off(98) <= 4);
        assert!(off(10) > off(98));
    }
}
