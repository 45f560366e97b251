use std::io::Cursor;
use std::path::Path;

use accurate_geom::ImageSize;
use image::{
    DynamicImage, GenericImageView, ImageBuffer, ImageDecoder, ImageFormat, ImageReader, Limits,
};
use ndarray::Array2;

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_IMAGE_BYTES, read_bytes};

/// Largest accepted width and height, px.
pub const MAX_IMAGE_SIDE_PX: u32 = 16_384;
/// Largest accepted decoded image, bytes.
const MAX_DECODED_BYTES: u64 = 1 << 30;
/// Most decoded bytes per byte of file. Deflate reaches 1032, LZW and run lengths less, a blank
/// JPEG about 1500: what declares more than this is a bomb or a truncated file.
const MAX_EXPANSION: u64 = 4096;
/// What a decoder may take for colour profiles and rows besides the image itself, bytes.
const DECODER_WORKSPACE_BYTES: u64 = 16 << 20;

/// Bits per pixel of a grey image file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BitDepth {
    /// Values 0 to 255.
    Eight,
    /// Values 0 to 65 535.
    Sixteen,
}

impl BitDepth {
    /// The largest grey value.
    pub const fn max_value(self) -> f32 {
        match self {
            Self::Eight => 255.0,
            Self::Sixteen => 65_535.0,
        }
    }
}

/// A grey image as stored: raw values, not scaled.
#[derive(Debug, Clone, PartialEq)]
pub struct GreyImage {
    /// Grey values, shape `(height, width)`, index `[[y, x]]`, 0 to [`BitDepth::max_value`].
    pub values: Array2<f32>,
    /// The depth the file has.
    pub depth: BitDepth,
}

/// Reads a PNG, JPEG, TIFF, PNM or BMP image of 8 or 16 bits as grey values. The format is taken
/// from the content, not from the name. Colour becomes luma (Rec. 709); alpha is ignored.
///
/// # Errors
/// [`IoError::TooLarge`] above 16384 px a side, 1 GiB decoded, or a declared size the file cannot
/// hold, before the pixels are allocated; [`IoError::Malformed`]; [`IoError::Unsupported`] for
/// float pixels or another format; [`IoError::Missing`].
pub fn read_grey(path: &Path) -> Result<GreyImage, IoError> {
    let (image, _) = decode(path)?;
    let (width, height) = image.dimensions();
    let shape = (height as usize, width as usize);
    let (values, depth): (Vec<f32>, _) = match &image {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let values = image.into_luma16().into_raw().into_iter().map(f32::from).collect();
            (values, BitDepth::Sixteen)
        }
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => {
            let values = image.into_luma8().into_raw().into_iter().map(f32::from).collect();
            (values, BitDepth::Eight)
        }
        _ => {
            return Err(IoError::Unsupported {
                path: path.to_owned(),
                what: format!("{:?} pixels; expected 8 or 16 bit", image.color()),
            });
        }
    };
    Ok(GreyImage { values: to_array(path, shape, values)?, depth })
}

/// Reads a mask: every pixel with a non-zero channel is foreground (`true`). Alpha is ignored.
/// Shape `(height, width)`, index `[[y, x]]`.
///
/// # Errors
/// As [`read_grey`]; [`IoError::Unsupported`] for JPEG, whose compression noise would count as
/// foreground.
pub fn read_mask(path: &Path) -> Result<Array2<bool>, IoError> {
    let (image, format) = decode(path)?;
    if format == ImageFormat::Jpeg {
        return Err(IoError::Unsupported {
            path: path.to_owned(),
            what: "a mask must be stored without loss; JPEG noise would count as foreground".into(),
        });
    }
    let (width, height) = image.dimensions();
    let shape = (height as usize, width as usize);
    to_array(path, shape, foreground(&image))
}

/// Whether a channel other than alpha is not zero, for every pixel.
///
/// As stored: a conversion of colours would take most of the time of a whole reconstruction, and one
/// to 8 bits would round a value of 1 in 65535 to background.
fn foreground(image: &DynamicImage) -> Vec<bool> {
    match image {
        DynamicImage::ImageLuma8(image) => any_of::<_, 1>(image, 1),
        DynamicImage::ImageLumaA8(image) => any_of::<_, 2>(image, 1),
        DynamicImage::ImageRgb8(image) => any_of::<_, 3>(image, 3),
        DynamicImage::ImageRgba8(image) => any_of::<_, 4>(image, 3),
        DynamicImage::ImageLuma16(image) => any_of::<_, 1>(image, 1),
        DynamicImage::ImageLumaA16(image) => any_of::<_, 2>(image, 1),
        DynamicImage::ImageRgb16(image) => any_of::<_, 3>(image, 3),
        DynamicImage::ImageRgba16(image) => any_of::<_, 4>(image, 3),
        // Floats: what is too little for 16 bits is background.
        other => any_of::<_, 3>(&other.to_rgb16(), 3),
    }
}

/// Whether one of the first `colours` of the `N` channels of a pixel is not zero, for every pixel.
fn any_of<T: Default + PartialEq, const N: usize>(channels: &[T], colours: usize) -> Vec<bool> {
    let zero = T::default();
    let (pixels, _) = channels.as_chunks::<N>();
    pixels.iter().map(|pixel| pixel[..colours].iter().any(|value| *value != zero)).collect()
}

/// The size of an image file, from its header.
///
/// # Errors
/// As [`read_grey`].
pub fn read_image_size(path: &Path) -> Result<ImageSize, IoError> {
    let bytes = read_bytes(path, MAX_IMAGE_BYTES)?;
    let (decoder, _) = open(path, &bytes)?;
    let (width, height) = decoder.dimensions();
    Ok(ImageSize { width, height })
}

/// Writes a mask as 8-bit grey PNG: 0 background, 255 foreground.
///
/// # Errors
/// [`IoError::Empty`] without pixels, [`IoError::TooLarge`] above 16384 px a side,
/// [`IoError::System`].
pub fn write_mask(path: &Path, mask: &Array2<bool>) -> Result<(), IoError> {
    write_u8(path, &mask.mapv(|foreground| if foreground { 255 } else { 0 }))
}

/// Writes an 8-bit grey PNG, shape `(height, width)`.
///
/// # Errors
/// As [`write_mask`].
pub fn write_u8(path: &Path, image: &Array2<u8>) -> Result<(), IoError> {
    let size = size_of(path, image.dim())?;
    write_png(path, size, image.iter().copied().collect::<Vec<u8>>(), DynamicImage::ImageLuma8)
}

/// An 8-bit grey PNG in memory, shape `(height, width)`, for what embeds images in other files.
///
/// # Errors
/// As [`write_mask`], naming `<memory>`.
pub fn png_bytes(image: &Array2<u8>) -> Result<Vec<u8>, IoError> {
    let path = Path::new("<memory>");
    let size = size_of(path, image.dim())?;
    encode_png(path, size, image.iter().copied().collect::<Vec<u8>>(), DynamicImage::ImageLuma8)
}

/// Writes an 8-bit colour PNG, shape `(height, width)` of `[red, green, blue]`.
///
/// # Errors
/// As [`write_mask`].
pub fn write_rgb(path: &Path, image: &Array2<[u8; 3]>) -> Result<(), IoError> {
    let size = size_of(path, image.dim())?;
    let channels = image.iter().flatten().copied().collect::<Vec<u8>>();
    write_png(path, size, channels, DynamicImage::ImageRgb8)
}

/// Writes a 16-bit grey PNG, shape `(height, width)`.
///
/// # Errors
/// As [`write_mask`].
pub fn write_u16(path: &Path, image: &Array2<u16>) -> Result<(), IoError> {
    let size = size_of(path, image.dim())?;
    write_png(path, size, image.iter().copied().collect::<Vec<u16>>(), DynamicImage::ImageLuma16)
}

/// Writes a grey image as PNG of its depth, values rounded to the nearest integer.
///
/// # Errors
/// As [`write_mask`]; [`IoError::NotFinite`]; [`IoError::Field`] for a value outside the depth.
pub fn write_grey(path: &Path, image: &GreyImage) -> Result<(), IoError> {
    let max = image.depth.max_value();
    for ((y, x), &value) in image.values.indexed_iter() {
        crate::matrix::finite(path, f64::from(value), || format!("pixel ({x}, {y})"))?;
        if !(0.0..=max).contains(&value.round()) {
            let reason = format!("a grey value must lie in 0 to {max}");
            return Err(IoError::field(
                path,
                format!("pixel ({x}, {y})"),
                value.to_string(),
                reason,
            ));
        }
    }
    // In range by the check above, so the conversions are exact.
    match image.depth {
        BitDepth::Eight => write_u8(path, &image.values.mapv(|v| v.round() as u8)),
        BitDepth::Sixteen => write_u16(path, &image.values.mapv(|v| v.round() as u16)),
    }
}

fn decode(path: &Path) -> Result<(DynamicImage, ImageFormat), IoError> {
    let bytes = read_bytes(path, MAX_IMAGE_BYTES)?;
    let (mut decoder, format) = open(path, &bytes)?;
    let decoded = decoder.total_bytes();
    let possible = (bytes.len() as u64).saturating_mul(MAX_EXPANSION);
    let limit = MAX_DECODED_BYTES.min(possible);
    if decoded > limit {
        return Err(IoError::TooLarge {
            path: path.to_owned(),
            what: "declared image in bytes".into(),
            found: decoded,
            limit,
        });
    }
    decoder
        .set_limits(limits(decoded + DECODER_WORKSPACE_BYTES))
        .and_then(|()| DynamicImage::from_decoder(decoder))
        .map(|image| (image, format))
        .map_err(|e| image_error(path, &e))
}

fn open<'b>(
    path: &Path,
    bytes: &'b [u8],
) -> Result<(impl ImageDecoder + 'b, ImageFormat), IoError> {
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| IoError::system(path, "read", e))?;
    let format = reader.format().ok_or_else(|| IoError::Unsupported {
        path: path.to_owned(),
        what: "not an image; expected PNG, JPEG, TIFF, PNM or BMP".into(),
    })?;
    reader.limits(limits(MAX_DECODED_BYTES));
    let decoder = reader.into_decoder().map_err(|e| image_error(path, &e))?;
    let (width, height) = decoder.dimensions();
    for (what, side) in [("image width in px", width), ("image height in px", height)] {
        if side > MAX_IMAGE_SIDE_PX {
            return Err(too_wide(path, what, side));
        }
    }
    if width == 0 || height == 0 {
        return Err(IoError::Empty { path: path.to_owned(), what: "pixels" });
    }
    Ok((decoder, format))
}

fn limits(max_alloc_bytes: u64) -> Limits {
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_SIDE_PX);
    limits.max_image_height = Some(MAX_IMAGE_SIDE_PX);
    limits.max_alloc = Some(max_alloc_bytes);
    limits
}

fn image_error(path: &Path, error: &image::ImageError) -> IoError {
    match error {
        image::ImageError::Limits(_) => IoError::Unsupported {
            path: path.to_owned(),
            what: format!(
                "the image exceeds the limits of {MAX_IMAGE_SIDE_PX} px a side and 1 GiB: {error}"
            ),
        },
        image::ImageError::Unsupported(_) => IoError::Unsupported {
            path: path.to_owned(),
            what: crate::error::cut(&error.to_string(), 200),
        },
        _ => IoError::malformed(path, "image", None, error),
    }
}

fn too_wide(path: &Path, what: &str, side: u32) -> IoError {
    IoError::TooLarge {
        path: path.to_owned(),
        what: what.to_owned(),
        found: side.into(),
        limit: MAX_IMAGE_SIDE_PX.into(),
    }
}

fn size_of(path: &Path, (height, width): (usize, usize)) -> Result<(u32, u32), IoError> {
    let side = |what, side: usize| {
        let side = u32::try_from(side).unwrap_or(u32::MAX);
        if side > MAX_IMAGE_SIDE_PX { Err(too_wide(path, what, side)) } else { Ok(side) }
    };
    if width == 0 || height == 0 {
        return Err(IoError::Empty { path: path.to_owned(), what: "pixels" });
    }
    Ok((side("image width in px", width)?, side("image height in px", height)?))
}

fn write_png<P: image::Pixel>(
    path: &Path,
    size: (u32, u32),
    values: Vec<P::Subpixel>,
    wrap: impl FnOnce(ImageBuffer<P, Vec<P::Subpixel>>) -> DynamicImage,
) -> Result<(), IoError> {
    let png = encode_png(path, size, values, wrap)?;
    write_atomically(path, |w| w.write_all(&png))
}

fn encode_png<P: image::Pixel>(
    path: &Path,
    (width, height): (u32, u32),
    values: Vec<P::Subpixel>,
    wrap: impl FnOnce(ImageBuffer<P, Vec<P::Subpixel>>) -> DynamicImage,
) -> Result<Vec<u8>, IoError> {
    let buffer = ImageBuffer::from_raw(width, height, values)
        .ok_or_else(|| IoError::Empty { path: path.to_owned(), what: "pixels" })?;
    encode(path, &wrap(buffer))
}

fn encode(path: &Path, image: &DynamicImage) -> Result<Vec<u8>, IoError> {
    let mut png = Cursor::new(Vec::new());
    image
        .write_to(&mut png, ImageFormat::Png)
        .map_err(|e| IoError::system(path, "encode", std::io::Error::other(e.to_string())))?;
    Ok(png.into_inner())
}

fn to_array<T>(path: &Path, shape: (usize, usize), values: Vec<T>) -> Result<Array2<T>, IoError> {
    Array2::from_shape_vec(shape, values).map_err(|e| IoError::malformed(path, "image", None, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Luma, Rgb, RgbImage, RgbaImage};
    use proptest::prelude::*;
    use std::fs;

    fn save(image: &DynamicImage, format: ImageFormat) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("view_L.png");
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        fs::write(&path, bytes.get_ref()).unwrap();
        (folder, path)
    }

    #[test]
    fn colour_becomes_luma_and_a_faint_coloured_mask_pixel_is_foreground() {
        let rgb = RgbImage::from_fn(3, 2, |x, y| Rgb([0, 0, u8::from((x, y) == (2, 1))]));
        let (_folder, path) = save(&rgb.into(), ImageFormat::Png);
        let mask = read_mask(&path).unwrap();
        assert_eq!(mask.dim(), (2, 3));
        assert_eq!(
            mask.indexed_iter().filter(|(_, v)| **v).map(|(i, _)| i).collect::<Vec<_>>(),
            [(1, 2)]
        );
        let white = RgbImage::from_pixel(2, 2, Rgb([255, 255, 255]));
        let (_folder, path) = save(&white.into(), ImageFormat::Bmp);
        assert!(read_grey(&path).unwrap().values.iter().all(|&v| v == 255.0));
    }

    /// An image of every type that the decoders give, its channels taken from `values` in turn.
    fn images(width: u32, height: u32, values: &[u16]) -> Vec<DynamicImage> {
        fn image<P: image::Pixel>(
            (width, height): (u32, u32),
            values: &[u16],
            channel: impl Fn(u16) -> P::Subpixel,
        ) -> ImageBuffer<P, Vec<P::Subpixel>> {
            let count = width as usize * height as usize * usize::from(P::CHANNEL_COUNT);
            let channels = values.iter().cycle().take(count).map(|&v| channel(v)).collect();
            ImageBuffer::from_raw(width, height, channels).unwrap()
        }
        let size = (width, height);
        // The low byte: small values stay small.
        let byte = |v: u16| v as u8;
        let float = |v: u16| f32::from(v) / 65_535.0;
        vec![
            DynamicImage::ImageLuma8(image(size, values, byte)),
            DynamicImage::ImageLumaA8(image(size, values, byte)),
            DynamicImage::ImageRgb8(image(size, values, byte)),
            DynamicImage::ImageRgba8(image(size, values, byte)),
            DynamicImage::ImageLuma16(image(size, values, |v| v)),
            DynamicImage::ImageLumaA16(image(size, values, |v| v)),
            DynamicImage::ImageRgb16(image(size, values, |v| v)),
            DynamicImage::ImageRgba16(image(size, values, |v| v)),
            DynamicImage::ImageRgb32F(image(size, values, float)),
            DynamicImage::ImageRgba32F(image(size, values, float)),
        ]
    }

    proptest! {
        #[test]
        fn foreground_is_what_is_not_black_in_16_bits_of_red_green_and_blue(
            width in 1..6_u32, height in 1..6_u32,
            // Mostly 0, then 1, which 8 bits would lose.
            values in prop::collection::vec(
                prop_oneof![4 => Just(0_u16), 1 => Just(1), 1 => any::<u16>()], 1..40),
        ) {
            for image in images(width, height, &values) {
                let rgb = image.to_rgb16();
                let expected: Vec<bool> = rgb.pixels().map(|p| p.0 != [0; 3]).collect();
                prop_assert_eq!(foreground(&image), expected, "{:?}", image.color());
            }
        }
    }

    #[test]
    fn colours_are_read_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let colours = Array2::from_shape_fn((2, 3), |(y, x)| [(40 * y) as u8, (50 * x) as u8, 7]);
        write_rgb(&path, &colours).unwrap();
        let read = image::open(&path).unwrap().into_rgb8();
        for ((y, x), colour) in colours.indexed_iter() {
            assert_eq!(read.get_pixel(x as u32, y as u32).0, *colour);
        }
        assert!(matches!(write_rgb(&path, &Array2::default((0, 3))), Err(IoError::Empty { .. })));
    }

    #[test]
    fn opaque_black_is_background() {
        let (_folder, path) = save(
            &RgbaImage::from_pixel(2, 2, image::Rgba([0, 0, 0, 255])).into(),
            ImageFormat::Png,
        );
        assert!(read_mask(&path).unwrap().iter().all(|v| !v));
    }

    #[test]
    fn a_jpeg_is_an_image_but_no_mask() {
        let (_folder, path) =
            save(&RgbImage::from_pixel(8, 8, Rgb([90, 90, 90])).into(), ImageFormat::Jpeg);
        assert_eq!(read_grey(&path).unwrap().depth, BitDepth::Eight);
        assert!(matches!(read_mask(&path), Err(IoError::Unsupported { .. })));
    }

    #[test]
    fn every_format_is_read_in_sixteen_bits_where_it_has_them() {
        let values = Array2::from_shape_fn((3, 4), |(y, x)| (1000 * y + 77 * x) as u16);
        let buffer = ImageBuffer::<Luma<u16>, _>::from_raw(4, 3, values.iter().copied().collect());
        let image = DynamicImage::ImageLuma16(buffer.unwrap());
        for format in [ImageFormat::Png, ImageFormat::Tiff, ImageFormat::Pnm] {
            let (_folder, path) = save(&image, format);
            let grey = read_grey(&path).unwrap();
            assert_eq!(grey.depth, BitDepth::Sixteen, "{format:?}");
            assert_eq!(grey.values, values.mapv(f32::from), "{format:?}");
            assert_eq!(read_image_size(&path).unwrap(), ImageSize { width: 4, height: 3 });
        }
    }

    #[test]
    fn a_value_outside_the_depth_is_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        for (value, depth) in
            [(256.0, BitDepth::Eight), (-1.0, BitDepth::Eight), (f32::NAN, BitDepth::Sixteen)]
        {
            let image = GreyImage { values: Array2::from_elem((2, 2), value), depth };
            assert!(write_grey(&path, &image).is_err(), "{value}");
        }
        assert!(matches!(write_mask(&path, &Array2::default((0, 3))), Err(IoError::Empty { .. })));
        assert!(!path.exists());
    }
}
