use std::path::Path;
use std::sync::Arc;

use accurate3d::io::write_atomically;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};

use crate::code::Code;
use crate::failure::Failure;
use crate::text::{has_extension, write_text};

/// The font of all letters: no picture depends on what is installed.
const FONT: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");
/// Largest side of a picture, px.
const LARGEST_SIDE_PX: f32 = 8192.0;

/// Whether a picture of this name can be written.
pub fn is_picture(path: &Path) -> bool {
    is_png(path) || has_extension(path, "svg")
}

/// Writes one of our SVG pictures as SVG, or drawn as PNG, by the extension; whole or not at all.
///
/// `png_scale` is PNG pixels per SVG unit. The same picture gives the same bytes.
///
/// # Errors
/// [`Code::Usage`] for another extension.
pub fn write_picture(path: &Path, svg: &str, png_scale: f32) -> Result<(), Failure> {
    if is_png(path) {
        let bytes = png(svg, png_scale)?;
        return write_atomically(path, |file| file.write_all(&bytes)).map_err(Failure::of_output);
    }
    if has_extension(path, "svg") {
        return write_text(path, svg);
    }
    let message = format!("pictures are written as .svg or .png, not as {}", path.display());
    Err(Failure::new(Code::Usage, message))
}

fn is_png(path: &Path) -> bool {
    has_extension(path, "png")
}

fn png(svg: &str, scale: f32) -> Result<Vec<u8>, Failure> {
    let internal = |what: String| Failure::new(Code::Internal, format!("drawing: {what}"));
    let mut fonts = Database::new();
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    fonts.set_serif_family("DejaVu Sans");
    fonts.set_monospace_family("DejaVu Sans");
    let options = Options {
        font_family: "DejaVu Sans".to_owned(),
        fontdb: Arc::new(fonts),
        ..Options::default()
    };
    let tree = Tree::from_str(svg, &options).map_err(|e| internal(e.to_string()))?;
    let (width, height) = (tree.size().width() * scale, tree.size().height() * scale);
    if !(width.max(height) <= LARGEST_SIDE_PX) {
        let message = format!("a PNG of {width:.0} x {height:.0} px; at most {LARGEST_SIDE_PX}");
        return Err(Failure::new(Code::TooLarge, message).with_hint("write it as .svg"));
    }
    // Within the limit, and at least one pixel.
    let side = |length: f32| length.ceil().max(1.0) as u32;
    let mut pixels = Pixmap::new(side(width), side(height))
        .ok_or_else(|| internal(format!("no picture of {width} x {height} px")))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels.encode_png().map_err(|e| internal(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_drawn_with_the_own_font_and_always_alike() {
        let svg = |text: &str| {
            format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 80 20\" \
                 font-family=\"sans-serif\"><text x=\"2\" y=\"15\">{text}</text></svg>"
            )
        };
        let (a, b) = (png(&svg("\u{3c3} \u{b1} 1"), 2.0).unwrap(), png(&svg(""), 2.0).unwrap());
        assert!(a.starts_with(b"\x89PNG") && a != b);
        assert_eq!(a, png(&svg("\u{3c3} \u{b1} 1"), 2.0).unwrap());
        let huge = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 9000 5\"></svg>";
        assert!(png(huge, 1.0).is_err());
        assert!(png("<svg", 1.0).is_err());
    }
}
