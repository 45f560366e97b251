use accurate_geom::Rig;
use accurate_io::png_bytes;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ndarray::Array2;
use serde_json::{Value, json};

use crate::{Error, Traces, ViewPair};

/// Most rows or columns of the correspondence picture.
const MOST_CELLS: usize = 320;
/// Epipolar distance from which a cell is as bright as can be, px.
const BRIGHT_PX: f64 = 12.0;

/// What stands behind the trace of a view: the image, else the mask, else nothing.
pub(super) fn view_image(
    pair: &ViewPair,
    index: usize,
) -> Result<(&'static str, Option<String>), Error> {
    if let Some(images) = &pair.images {
        return Ok(("X-ray", Some(data_url(&stretched(&images[index]))?)));
    }
    match &pair.masks {
        Some(masks) => {
            let grey = masks[index].mapv(|on| if on { 255 } else { 0 });
            Ok(("mask", Some(data_url(&grey)?)))
        }
        None => Ok(("none", None)),
    }
}

/// Grey values as bytes, from the 0.5th to the 99.5th percentile.
fn stretched(image: &Array2<f32>) -> Array2<u8> {
    let mut sorted: Vec<f32> = image.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return image.mapv(|_| 0) };
    let at = |share: f64| sorted[(share * last as f64).round() as usize];
    let (low, high) = (at(0.005), at(0.995));
    let range = if high > low { high - low } else { 1.0 };
    // `as` maps NaN to 0 and stops at the ends.
    image.mapv(|v| ((v - low) / range * 255.0).round() as u8)
}

/// The epipolar distance of every pair of trace points as a picture, thinned to what a screen shows.
pub(super) fn cost_image(traces: &Traces, rig: &Rig) -> Result<Value, Error> {
    let (rows, columns) = (traces.points1.len(), traces.points2.len());
    if rows == 0 || columns == 0 {
        return Ok(Value::Null);
    }
    Ok(json!({"rows": rows, "columns": columns, "image": cost_url(traces, rig)?}))
}

/// That picture as a data URL; the traces must not be empty.
pub(crate) fn cost_url(traces: &Traces, rig: &Rig) -> Result<String, Error> {
    let (rows, columns) = (traces.points1.len(), traces.points2.len());
    let shape = (rows.min(MOST_CELLS), columns.min(MOST_CELLS));
    let f = rig.fundamental();
    let mut grey = Array2::from_elem(shape, 255u8);
    for column in 0..shape.1 {
        let p2 = traces.points2[column * columns / shape.1];
        // At the epipole there is no line; the column stays bright.
        let Ok(line) = f.line(p2) else { continue };
        for row in 0..shape.0 {
            let d = line.distance(traces.points1[row * rows / shape.0]);
            // The square root spends the grey values where pairs are decided.
            grey[[row, column]] = ((d / BRIGHT_PX).min(1.0).sqrt() * 255.0).round() as u8;
        }
    }
    data_url(&grey)
}

fn data_url(grey: &Array2<u8>) -> Result<String, Error> {
    let png = png_bytes(grey).map_err(|source| Error::Report { source })?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_hot_pixel_does_not_darken_the_rest() {
        let mut image = Array2::from_shape_fn((40, 40), |(y, x)| (x + y) as f32);
        image[[0, 0]] = 60_000.0;
        let grey = stretched(&image);
        assert_eq!(grey[[0, 0]], 255);
        assert!(grey[[39, 39]] > 240 && grey[[20, 20]] > 100, "{}", grey[[20, 20]]);
        let flat = stretched(&Array2::from_elem((3, 3), 7.0));
        assert!(flat.iter().all(|v| *v == 0));
    }
}
