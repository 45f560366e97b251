use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Five rows of three pixels each, a bit a pixel, most significant bit to the left.
const GLYPHS: [[u8; 5]; 24] = [
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [7, 1, 7, 4, 7],
    [7, 1, 3, 1, 7],
    [5, 5, 7, 1, 1],
    [7, 4, 7, 1, 7],
    [7, 4, 7, 5, 7],
    [7, 1, 2, 2, 2],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 7],
    [2, 5, 7, 5, 5],
    [6, 5, 6, 5, 6],
    [7, 4, 4, 4, 7],
    [7, 4, 6, 4, 7],
    [5, 5, 7, 5, 5],
    [7, 2, 2, 2, 7],
    [4, 4, 4, 4, 7],
    [5, 7, 7, 5, 5],
    [7, 5, 7, 4, 4],
    [7, 5, 6, 5, 5],
    [7, 2, 2, 2, 2],
    [0, 0, 0, 0, 2],
    [0, 2, 0, 2, 0],
    [0, 0, 7, 0, 0],
];

/// Text in the corners, a ruler along an edge: bright or dark, as an archive prints them.
pub(crate) fn add_overlay(rng: &mut ChaCha8Rng, image: &mut Array2<f64>) {
    let (height, width) = image.dim();
    let scale = rng.random_range(1..=(width / 256).clamp(1, 4));
    let ink = if rng.random_bool(0.8) { 1.0 } else { 0.0 };
    for corner in 0..4 {
        if !rng.random_bool(0.5) {
            continue;
        }
        let lines = rng.random_range(1..5_usize);
        for line in 0..lines {
            let letters = rng.random_range(3..13_usize);
            let text_width = letters * 4 * scale;
            let left = if corner % 2 == 0 { 6 } else { width.saturating_sub(6 + text_width) };
            let down = 6 + line * 8 * scale;
            let top = if corner < 2 { down } else { height.saturating_sub(down + 5 * scale) };
            for letter in 0..letters {
                let glyph = GLYPHS[rng.random_range(0..GLYPHS.len())];
                put(image, &glyph, (left + letter * 4 * scale, top), scale, ink);
            }
        }
    }
    if rng.random_bool(0.4) {
        ruler(rng, image, ink);
    }
}

fn put(image: &mut Array2<f64>, glyph: &[u8; 5], at: (usize, usize), scale: usize, ink: f64) {
    for (row, bits) in glyph.iter().enumerate() {
        for column in 0..3 {
            if bits >> (2 - column) & 1 == 0 {
                continue;
            }
            for y in 0..scale {
                for x in 0..scale {
                    let place = [at.1 + row * scale + y, at.0 + column * scale + x];
                    if let Some(value) = image.get_mut(place) {
                        *value = ink;
                    }
                }
            }
        }
    }
}

/// Ticks every few pixels, every fifth longer.
fn ruler(rng: &mut ChaCha8Rng, image: &mut Array2<f64>, ink: f64) {
    let (height, width) = image.dim();
    let upright = rng.random_bool(0.5);
    let long_side = if upright { height } else { width };
    let pitch = rng.random_range(5..14_usize);
    let offset = rng.random_range(2..12_usize);
    let (first, last) = (long_side / 4, 3 * long_side / 4);
    for (tick, along) in (first..last).step_by(pitch).enumerate() {
        let length = if tick % 5 == 0 { 9 } else { 4 };
        for across in offset..offset + length {
            let place = if upright { [along, across] } else { [across, along] };
            if let Some(value) = image.get_mut(place) {
                *value = ink;
            }
        }
    }
}
