use accurate_geom::nalgebra::Vector2;
use ndarray::{Array2, Axis, Slice};

use super::params::IntensityFitParams;
use super::smooth::weighted_mean;
use crate::FitError;

/// Rounds of the background's robust weights.
const BACKGROUND_ROUNDS: usize = 3;
/// A pixel that is no brighter than this part of the brightest is black.
const DARKEST: f64 = 0.02;
/// Median of the absolute value of a standard normal variable, inverse.
const MAD_TO_SIGMA: f64 = 1.4826;

/// The pixels of one view near the curve, and what of their optical depth is not background.
#[derive(Debug)]
pub(crate) struct Band {
    /// Column and row of the first pixel of `index`.
    origin: [i64; 2],
    /// Number of each pixel of the band.
    index: Array2<u32>,
    /// Optical depth beyond the background, one per pixel of the band, in standard deviations.
    pub(crate) depth: Vec<f64>,
    /// Standard deviation of the optical depth where there is background only.
    pub(crate) noise: f64,
}

const OUTSIDE: u32 = u32::MAX;

impl Band {
    /// Of an image (bright where much light passes) around a curve that runs through `points`, which
    /// lie less than a pixel apart.
    ///
    /// The background is the weighted Gaussian mean of what lies away from the curve; pixels far from
    /// it (other bodies, edges) count little.
    pub(crate) fn new(
        image: &Array2<f32>,
        points: &[Vector2<f64>],
        view: u8,
        params: &IntensityFitParams,
    ) -> Result<Self, FitError> {
        let unseen = FitError::NotSeenInImage { view };
        let (rows, columns) = image.dim();
        let margin = params.reach_px + 3.0 * params.background_sigma_px;
        let span = |axis: usize, size: usize| {
            let values = points.iter().map(|p| p[axis]);
            let low = values.clone().fold(f64::INFINITY, f64::min) - margin;
            let high = values.fold(f64::NEG_INFINITY, f64::max) + margin;
            // NaN and what lies outside become an empty range.
            let first = low.floor().max(0.0) as usize;
            first..(high.ceil().max(-1.0) as usize).saturating_add(1).min(size).max(first.min(size))
        };
        let (xs, ys) = (span(0, columns), span(1, rows));
        if xs.is_empty() || ys.is_empty() {
            return Err(unseen);
        }
        let brightest = brightest(image).ok_or_else(|| unseen.clone())?;
        let rows = image.slice_axis(Axis(0), Slice::from(ys.clone()));
        let part = rows.slice_axis(Axis(1), Slice::from(xs.clone()));
        let depth = part.mapv(|v| -(f64::from(v) / brightest).max(DARKEST).ln());
        let near = distances(points, [xs.start, ys.start], depth.dim(), params.reach_px);

        let away = near.mapv(|d| if d > params.keep_off_px { 1.0 } else { 0.0 });
        let mut weights = away.clone();
        let mut noise = 0.0;
        let mut beyond = depth.clone();
        for _ in 0..BACKGROUND_ROUNDS {
            beyond = &depth - &weighted_mean(&depth, &weights, params.background_sigma_px);
            let mut sizes: Vec<f64> = beyond
                .iter()
                .zip(&away)
                .filter(|(_, away)| **away > 0.0)
                .map(|(v, _)| v.abs())
                .collect();
            let middle = sizes.len() / 2;
            if sizes.is_empty() {
                return Err(unseen);
            }
            noise = MAD_TO_SIGMA * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
            // A picture without noise is rounded to its grey levels at best.
            noise = noise.max(1e-4);
            weights = away.clone();
            weights.zip_mut_with(&beyond, |w, v| *w /= 1.0 + (v / (2.0 * noise)).powi(2));
        }

        let mut index = Array2::from_elem(depth.dim(), OUTSIDE);
        let mut inside = Vec::new();
        for (((at, d), v), depth) in near.indexed_iter().zip(&beyond).zip(&depth) {
            // What is black may be any darker.
            if *d <= params.reach_px && *depth < -DARKEST.ln() {
                index[at] = inside.len() as u32;
                inside.push(v / noise);
            }
        }
        Ok(Self { origin: [xs.start as i64, ys.start as i64], index, depth: inside, noise })
    }

    /// The number of a pixel in the band.
    #[inline]
    pub(crate) fn number(&self, x: i64, y: i64) -> Option<usize> {
        let (x, y) = (x - self.origin[0], y - self.origin[1]);
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        self.index.get((y, x)).filter(|n| **n != OUTSIDE).map(|n| *n as usize)
    }
}

/// The brightness that one pixel in a thousand exceeds; `None` if it is none, or a pixel is no number.
fn brightest(image: &Array2<f32>) -> Option<f64> {
    let mut values: Vec<f32> = image.iter().copied().collect();
    if values.is_empty() || values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let at = values.len() - 1 - values.len() / 1000;
    let value = f64::from(*values.select_nth_unstable_by(at, f32::total_cmp).1);
    (value > 0.0).then_some(value)
}

/// Distance of each pixel from the nearest point, where it is at most `reach_px`; else infinite.
fn distances(
    points: &[Vector2<f64>],
    origin: [usize; 2],
    (rows, columns): (usize, usize),
    reach_px: f64,
) -> Array2<f64> {
    let mut near = Array2::from_elem((rows, columns), f64::INFINITY);
    for p in points {
        let (px, py) = (p.x - origin[0] as f64, p.y - origin[1] as f64);
        let range = |at: f64, size: usize| {
            let first = (at - reach_px).ceil().max(0.0) as usize;
            first..((at + reach_px).floor().max(-1.0) + 1.0).min(size as f64) as usize
        };
        for y in range(py, rows) {
            for x in range(px, columns) {
                let d = (x as f64 - px).hypot(y as f64 - py);
                let entry = &mut near[(y, x)];
                if d <= reach_px && d < *entry {
                    *entry = d;
                }
            }
        }
    }
    near
}
