use accurate_geom::Point2;
use ndarray::{Array2, Zip};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

use super::aperture::Aperture;
use super::wander::log_uniform;
use crate::xray::blur;

/// Above this mean the Poisson distribution is drawn as a normal one of the same mean and
/// variance: their distribution functions differ by less than 0.02 (Berry and Esseen), far below
/// what eight bits and a window leave to see.
const NORMAL_FROM: f64 = 60.0;

/// How one image is taken and shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Exposure {
    /// Photons of an open pixel.
    pub dose_photons_per_px: f64,
    /// Gaussian blur of focal spot and detector, px.
    pub blur_sigma_px: f64,
    /// Way of the object during the exposure, px (x, y).
    pub motion_px: (f64, f64),
    /// Part of the open field that arrives everywhere as scatter.
    pub scatter: f64,
    /// Relative change of the beam across the image (x, y).
    pub heel: (f64, f64),
    /// Correlation of the noise: sigma of a Gaussian, px.
    pub noise_sigma_px: f64,
    /// Logarithmic response instead of a linear one.
    pub log_response: bool,
    /// Strength and sigma (px) of the unsharp mask.
    pub sharpen: (f64, f64),
    /// Exponent of the display.
    pub gamma: f64,
    /// How far beyond the 0.5 % and 99.5 % quantiles the window reaches, parts of their distance.
    pub window_margin: (f64, f64),
    /// Dark is shown bright.
    pub inverted: bool,
    /// Dead rows and columns.
    pub dead_lines: u32,
}

impl Exposure {
    /// Attenuation of a wire's contrast by blur and motion, at most 1: a box of its width against
    /// the spread of the two.
    pub fn kept_contrast(&self, width_px: f64) -> f64 {
        let spread = 2.5 * self.blur_sigma_px.hypot(self.noise_sigma_px);
        width_px / width_px.hypot(spread).hypot(self.motion_px.0.hypot(self.motion_px.1))
    }

    /// From optical depth to values 0 to 1.
    pub fn take(
        &self,
        depth: &Array2<f64>,
        aperture: &Aperture,
        noise: &mut ChaCha8Rng,
    ) -> Array2<f64> {
        let (height, width) = depth.dim();
        let mut image = depth.mapv(|d| (-d).exp());
        self.smear(&mut image);
        blur(&mut image, self.blur_sigma_px);
        for ((row, column), value) in image.indexed_iter_mut() {
            let x = column as f64 / width as f64 - 0.5;
            let y = row as f64 / height as f64 - 0.5;
            let beam = 1.0 + self.heel.0 * x + self.heel.1 * y;
            let shade = 1.0 - 1.2 * (x * x + y * y);
            *value = beam * ((1.0 - self.scatter) * *value + self.scatter * shade);
        }
        self.count(&mut image, noise);
        blur(&mut image, self.noise_sigma_px);
        self.kill_lines(&mut image, noise);
        if self.log_response {
            // Half a photon is the least that the logarithm is taken of.
            let least = 0.5 / self.dose_photons_per_px;
            image.mapv_inplace(|value| value.max(least).ln());
        }
        if self.sharpen.0 > 0.0 {
            let mut smooth = image.clone();
            blur(&mut smooth, self.sharpen.1);
            image.zip_mut_with(&smooth, |v, s| *v += self.sharpen.0 * (*v - s));
        }
        self.display(&mut image, aperture);
        image
    }

    /// Motion blur: the mean of the image at places along the way, bilinear.
    fn smear(&self, image: &mut Array2<f64>) {
        let (dx, dy) = self.motion_px;
        let way = dx.hypot(dy);
        if way <= 0.0 {
            return;
        }
        let taps = (2.0 * way).ceil().max(2.0) as usize;
        let source = image.clone();
        let (rows, columns) = source.dim();
        image.fill(0.0);
        for tap in 0..taps {
            let part = (tap as f64 + 0.5) / taps as f64 - 0.5;
            let (sx, sy) = (dx * part, dy * part);
            let (fx, fy) = (sx - sx.floor(), sy - sy.floor());
            for (oy, wy) in [(0, 1.0 - fy), (1, fy)] {
                for (ox, wx) in [(0, 1.0 - fx), (1, fx)] {
                    let (shift_x, shift_y) = (sx.floor() as isize + ox, sy.floor() as isize + oy);
                    let weight = wx * wy / taps as f64;
                    for row in 0..rows {
                        let from_row = row.saturating_add_signed(shift_y).min(rows - 1);
                        for column in 0..columns {
                            let from = column.saturating_add_signed(shift_x).min(columns - 1);
                            image[[row, column]] += weight * source[[from_row, from]];
                        }
                    }
                }
            }
        }
    }

    fn count(&self, image: &mut Array2<f64>, rng: &mut ChaCha8Rng) {
        let dose = self.dose_photons_per_px;
        image.mapv_inplace(|value| {
            let mean = (value * dose).max(0.0);
            let counted = if mean >= NORMAL_FROM {
                mean + mean.sqrt() * rng.sample::<f64, _>(StandardNormal)
            } else {
                // No photon expected is the one mean that has no Poisson distribution: 0.
                Poisson::new(mean).map_or(0.0, |poisson| poisson.sample(rng))
            };
            counted / dose
        });
    }

    /// Rows or columns stuck at a value within the image's range.
    fn kill_lines(&self, image: &mut Array2<f64>, rng: &mut ChaCha8Rng) {
        for _ in 0..self.dead_lines {
            let value = rng.random_range(0.0..1.0);
            if rng.random_bool(0.5) {
                let row = rng.random_range(0..image.nrows());
                image.row_mut(row).fill(value);
            } else {
                let column = rng.random_range(0..image.ncols());
                image.column_mut(column).fill(value);
            }
        }
    }

    /// Window, gamma and polarity; what the aperture hides is black before the polarity.
    fn display(&self, image: &mut Array2<f64>, aperture: &Aperture) {
        let mut seen: Vec<f64> = Vec::new();
        for ((row, column), value) in image.indexed_iter() {
            // Every third pixel in each direction is enough for two quantiles.
            if row % 3 == 0
                && column % 3 == 0
                && aperture.inside_px(&Point2::new(column as f64, row as f64)) > 4.0
            {
                seen.push(*value);
            }
        }
        seen.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let index = (part * seen.len().saturating_sub(1) as f64) as usize;
            seen.get(index).copied().unwrap_or(0.0)
        };
        let (low, high) = (at(0.005), at(0.995));
        let span = (high - low).max(1e-9);
        let bottom = low - self.window_margin.0 * span;
        let scale = 1.0 / (span * (1.0 + self.window_margin.0 + self.window_margin.1));
        let gamma = self.gamma;
        Zip::indexed(image).for_each(|(row, column), value| {
            let inside = aperture.inside_px(&Point2::new(column as f64, row as f64));
            // Blades and the rim of a round field are a little soft.
            let open = (inside + 0.5).clamp(0.0, 1.0);
            let shown = ((*value - bottom) * scale).clamp(0.0, 1.0).powf(gamma) * open;
            *value = if self.inverted { 1.0 - shown } else { shown };
        });
    }
}

/// An exposure within the ranges of a domain.
pub(crate) fn draw_exposure(rng: &mut ChaCha8Rng, domain: &super::XrayDomain) -> Exposure {
    let d = domain;
    let motion = if rng.random_bool(d.motion_probability) {
        let way = rng.random_range(d.motion_px.clone());
        let heading = rng.random_range(0.0..std::f64::consts::TAU);
        (way * heading.cos(), way * heading.sin())
    } else {
        (0.0, 0.0)
    };
    let log_dose = log_uniform(rng, *d.dose_photons_per_px.start(), *d.dose_photons_per_px.end());
    Exposure {
        dose_photons_per_px: log_dose,
        blur_sigma_px: rng.random_range(d.blur_sigma_px.clone()),
        motion_px: motion,
        scatter: rng.random_range(d.scatter.clone()),
        heel: (rng.random_range(-0.3..0.3), rng.random_range(-0.3..0.3)),
        noise_sigma_px: if rng.random_bool(0.5) { rng.random_range(0.0..0.9) } else { 0.0 },
        log_response: !rng.random_bool(d.linear_probability),
        sharpen: if rng.random_bool(0.35) {
            (rng.random_range(0.3..1.5), rng.random_range(1.0..4.0))
        } else {
            (0.0, 0.0)
        },
        gamma: log_uniform(rng, 0.6, 1.6),
        window_margin: (rng.random_range(-0.02..0.5), rng.random_range(-0.02..0.5)),
        inverted: rng.random_bool(d.inverted_probability),
        dead_lines: if rng.random_bool(0.08) { rng.random_range(1..4) } else { 0 },
    }
}
