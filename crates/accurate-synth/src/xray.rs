use accurate_geom::{Camera, Point3};
use ndarray::{Array2, Axis};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Poisson};

use crate::background::{Background, Collimator};
use crate::damage::Disc;
use crate::mask::{covered, squared_distance};
use crate::options::within;
use crate::projection::Projection;
use crate::{SynthCase, SynthError, case_rng};

/// How the picture of a case is taken. The default looks like one frame of fluoroscopy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct XrayOptions {
    /// Mean number of photons that an open detector pixel counts, 1 to 1e6. Sets the noise.
    pub dose_photons_per_px: f64,
    /// Part of the photons lost on the way through the middle of the wire, seen from the side: 0 to
    /// 0.99. Scatter and the spectrum are in this number.
    pub contrast: f64,
    /// Standard deviation of the Gaussian blur of focal spot and detector, px, 0 to 20.
    pub blur_sigma_px: f64,
    /// Strength of the anatomy behind the wire, 0 (none) to 4; 1 is a chest. The collimator is
    /// there at any strength but 0.
    pub background: f64,
    /// Standard deviation of the readout noise, photons, 0 to 1e4.
    pub readout_noise_photons: f64,
    /// What the 16-bit values are.
    pub response: XrayResponse,
}

/// The meaning of the values of a picture. In both, the wire is darker than its surroundings (DICOM
/// MONOCHROME2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum XrayResponse {
    /// Proportional to the photon count; 50,000 for an open pixel.
    Linear,
    /// Proportional to the logarithm of the count: 50,000 for an open pixel, 0 at 3 % of it.
    #[default]
    Log,
}

impl Default for XrayOptions {
    fn default() -> Self {
        Self {
            dose_photons_per_px: 400.0,
            contrast: 0.45,
            blur_sigma_px: 0.8,
            background: 1.0,
            readout_noise_photons: 3.0,
            response: XrayResponse::Log,
        }
    }
}

/// Value of an open pixel.
const OPEN: f64 = 50_000.0;
/// Part of the photons at which the logarithmic response is 0.
const DARKEST: f64 = 0.03;

impl XrayOptions {
    /// Refuses values outside the documented ranges.
    ///
    /// # Errors
    /// [`SynthError::BadOption`].
    pub fn check(&self) -> Result<(), SynthError> {
        within("dose_photons_per_px", self.dose_photons_per_px, 1.0..=1e6, "1 to 1e6")?;
        within("contrast", self.contrast, 0.0..=0.99, "0 to 0.99")?;
        within("blur_sigma_px", self.blur_sigma_px, 0.0..=20.0, "0 to 20 px")?;
        within("background", self.background, 0.0..=4.0, "0 to 4")?;
        within("readout_noise_photons", self.readout_noise_photons, 0.0..=1e4, "0 to 10000")
    }

    /// Every number moved into its range; what is not a number becomes the default.
    fn clamped(&self) -> Self {
        let d = Self::default();
        let clamp = |value: f64, low: f64, high: f64, default: f64| {
            if value.is_nan() { default } else { value.clamp(low, high) }
        };
        Self {
            dose_photons_per_px: clamp(self.dose_photons_per_px, 1.0, 1e6, d.dose_photons_per_px),
            contrast: clamp(self.contrast, 0.0, 0.99, d.contrast),
            blur_sigma_px: clamp(self.blur_sigma_px, 0.0, 20.0, d.blur_sigma_px),
            background: clamp(self.background, 0.0, 4.0, d.background),
            readout_noise_photons: clamp(
                self.readout_noise_photons,
                0.0,
                1e4,
                d.readout_noise_photons,
            ),
            response: self.response,
        }
    }
}

/// X-ray-like pictures of both views, shape (height, width), 16 bits, the wire dark.
///
/// Beer-Lambert attenuation of the wire (a solid cylinder, seen at its true angle; strands that
/// cross add up) over an anatomy-like background, a collimator and the case's occluding discs, then
/// blur, photon (Poisson) and readout noise, and the detector's response. The background of the two
/// views is not one three-dimensional scene. Seeded by the case: the same case and options give the
/// same pictures; options change neither the anatomy nor the case.
///
/// Options outside their ranges are moved into them; call [`XrayOptions::check`] to refuse them.
///
/// # Cost
/// About 0.1 s for 512 x 512 px.
pub fn render_xray(case: &SynthCase, options: &XrayOptions) -> [Array2<u16>; 2] {
    [0, 1].map(|view| render_xray_of_view(case, view, options))
}

/// The picture of one view, 0 or 1; the views have streams of their own.
pub(crate) fn render_xray_of_view(
    case: &SynthCase,
    view: usize,
    options: &XrayOptions,
) -> Array2<u16> {
    let options = options.clamped();
    let camera = [case.true_rig.camera1(), case.true_rig.camera2()][view];
    let stream = |what: &str| {
        let name = format!("xray-{what}-{}", view + 1);
        case_rng(case.family, case.seed, case.index, &name)
    };
    let mut optical_depth = wire_depth(case, view, camera, options.contrast);
    add_scene(&mut optical_depth, case, view, camera, &options, &mut stream("anatomy"));
    let mut intensity = optical_depth.mapv(|depth| (-depth).exp());
    blur(&mut intensity, options.blur_sigma_px);
    detect(&intensity, &options, &mut stream("noise"))
}

/// Optical depth of the wire in one view.
fn wire_depth(case: &SynthCase, view: usize, camera: &Camera, contrast: f64) -> Array2<f64> {
    let size = camera.size();
    let mut total = Array2::zeros((size.height as usize, size.width as usize));
    let Ok(projection) = Projection::new(camera, &case.truth) else { return total };
    if projection.points.len() < 2 {
        return total;
    }
    // Optical depth per chord of one diameter, so that no unit of length enters.
    let full = -(1.0 - contrast).ln();
    let centre = camera.centre();

    // One value per pixel and strand: the nearest segment of a run of segments that touch the
    // pixel. A new run begins when the curve comes back after more than its own thickness.
    let mut open: Array2<(f64, f64, f64)> =
        Array2::from_elem(total.dim(), (f64::NEG_INFINITY, f64::INFINITY, 0.0));
    for (k, ends) in projection.points.windows(2).enumerate() {
        let arc = projection.arc[k];
        let hidden = case.gaps[view].iter().any(|&(start, end)| start <= arc && arc < end);
        if hidden {
            continue;
        }
        let radius_px = case.wire_radius * camera.k()[(0, 0)].abs() / projection.depth[k];
        let reach = radius_px + 0.5;
        let obliquity = obliquity(&centre, &case.truth[k], &case.truth[k + 1]);
        let (a, b) = (ends[0], ends[1]);
        let columns = covered(a.x.min(b.x) - reach, a.x.max(b.x) + reach, size.width);
        for row in covered(a.y.min(b.y) - reach, a.y.max(b.y) + reach, size.height) {
            for column in columns.clone() {
                let pixel = accurate_geom::Point2::new(column as f64, row as f64);
                let distance = squared_distance(&pixel, &a, &b).sqrt();
                if distance > reach {
                    continue;
                }
                let depth = full * obliquity * mean_chord(distance, radius_px);
                let (last_arc, nearest, pending) = &mut open[[row, column]];
                if arc - *last_arc > 4.0 * reach {
                    total[[row, column]] += *pending;
                    (*nearest, *pending) = (distance, depth);
                } else if distance < *nearest {
                    (*nearest, *pending) = (distance, depth);
                }
                *last_arc = arc;
            }
        }
    }
    total.zip_mut_with(&open, |total, (_, _, pending)| *total += pending);
    total
}

/// How much longer a ray's way through the wire is than seen from the side: 1 / sin of the angle
/// between ray and wire, at most 5 (a bent wire is not seen end-on for longer).
fn obliquity(centre: &Point3, from: &Point3, to: &Point3) -> f64 {
    let (ray, wire) = (from - centre, to - from);
    let sine = ray.cross(&wire).norm() / (ray.norm() * wire.norm());
    // NaN (a segment of no length) becomes 1.
    if sine > 0.2 {
        1.0 / sine
    } else if sine >= 0.0 {
        5.0
    } else {
        1.0
    }
}

/// Chord of a circle of radius `r` at distance `d` from its centre, averaged over one pixel across
/// the wire, in diameters: thin wires keep their mass whatever their position between pixels.
pub(crate) fn mean_chord(d: f64, r: f64) -> f64 {
    // Antiderivative of the chord 2 sqrt(r² - x²), clamped to the circle.
    let area = |x: f64| {
        let x = x.clamp(-r, r);
        x * (r * r - x * x).max(0.0).sqrt() + r * r * (x / r).clamp(-1.0, 1.0).asin()
    };
    (area(d + 0.5) - area(d - 0.5)) / (2.0 * r)
}

/// Adds anatomy, collimator and occluding discs.
fn add_scene(
    depth: &mut Array2<f64>,
    case: &SynthCase,
    view: usize,
    camera: &Camera,
    options: &XrayOptions,
    rng: &mut ChaCha8Rng,
) {
    let size = camera.size();
    if options.background > 0.0 {
        let background = Background::draw(rng, size);
        let anatomy = background.upsampled(size);
        depth.zip_mut_with(&anatomy, |depth, anatomy| *depth += options.background * anatomy);
        let free_px = case
            .truth
            .iter()
            .filter_map(|x| camera.project(x).ok())
            .map(|p| {
                let right = f64::from(size.width) - 1.0 - p.x;
                let bottom = f64::from(size.height) - 1.0 - p.y;
                p.x.min(p.y).min(right).min(bottom)
            })
            .fold(f64::INFINITY, f64::min);
        let collimator = Collimator::draw(rng, size, free_px - 6.0);
        for ((row, column), depth) in depth.indexed_iter_mut() {
            *depth += collimator.depth(column as f64, row as f64);
        }
    }
    for disc in &case.occlusions[view] {
        cover(depth, disc);
    }
}

/// A dense disc with a rim one pixel soft.
fn cover(depth: &mut Array2<f64>, disc: &Disc) {
    let (height, width) = depth.dim();
    let reach = disc.radius_px + 1.0;
    for row in covered(disc.y - reach, disc.y + reach, height as u32) {
        for column in covered(disc.x - reach, disc.x + reach, width as u32) {
            let from_centre = (column as f64 - disc.x).hypot(row as f64 - disc.y);
            let coverage = (disc.radius_px - from_centre + 0.5).clamp(0.0, 1.0);
            depth[[row, column]] += 3.0 * coverage;
        }
    }
}

/// Gaussian blur in place, separable, cut at 4 sigma; the border value continues outside.
pub(crate) fn blur(image: &mut Array2<f64>, sigma_px: f64) {
    if sigma_px <= 0.0 {
        return;
    }
    let reach = (4.0 * sigma_px).ceil() as usize;
    let mut kernel: Vec<f64> = (0..=2 * reach)
        .map(|k| (-0.5 * ((k as f64 - reach as f64) / sigma_px).powi(2)).exp())
        .collect();
    let sum: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|weight| *weight /= sum);

    // Rows in place through a padded copy of each; columns by adding whole shifted rows, which
    // runs along memory.
    let width = image.ncols();
    let mut padded = vec![0.0; width + 2 * reach];
    for mut row in image.rows_mut() {
        let (first, last) = (row[0], row[width - 1]);
        padded[..reach].fill(first);
        padded[reach + width..].fill(last);
        padded[reach..reach + width].iter_mut().zip(row.iter()).for_each(|(p, v)| *p = *v);
        for (window, out) in padded.windows(kernel.len()).zip(row.iter_mut()) {
            *out = window.iter().zip(&kernel).map(|(value, weight)| value * weight).sum();
        }
    }
    let source = image.clone();
    let last = source.nrows() - 1;
    for (row, mut out) in image.axis_iter_mut(Axis(0)).enumerate() {
        out.fill(0.0);
        for (k, weight) in kernel.iter().enumerate() {
            let from = (row + k).saturating_sub(reach).min(last);
            out.scaled_add(*weight, &source.row(from));
        }
    }
}

/// Photon and readout noise, then the detector's response. `intensity` is relative to an open pixel.
fn detect(intensity: &Array2<f64>, options: &XrayOptions, rng: &mut ChaCha8Rng) -> Array2<u16> {
    let dose = options.dose_photons_per_px;
    let readout = Normal::new(0.0, options.readout_noise_photons).ok();
    intensity.mapv(|relative| {
        let expected = relative * dose;
        // No photon expected is the one mean that has no Poisson distribution: 0.
        let photons = Poisson::new(expected).map_or(0.0, |poisson| poisson.sample(rng));
        let counted = photons + readout.map_or(0.0, |normal| normal.sample(rng));
        let value = match options.response {
            XrayResponse::Linear => counted / dose,
            XrayResponse::Log => 1.0 + (counted / dose).max(1e-9).ln() / -DARKEST.ln(),
        };
        // The cast saturates at both ends.
        (value * OPEN).round() as u16
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_wire_keeps_its_mass_wherever_it_lies_between_pixels(r in 0.1..6.0, offset in 0.0..1.0_f64) {
            // Sum over pixels of the mean chord = area of the circle, in units of the diameter.
            let sum: f64 = (-10..=10_i32).map(|k| mean_chord((f64::from(k) - offset).abs(), r)).sum();
            let area = std::f64::consts::PI * r * r / (2.0 * r);
            prop_assert!((sum - area).abs() < 1e-12 * area, "{sum} {area}");
        }

        #[test]
        fn blur_keeps_constants_and_the_mass_of_an_inner_dot(sigma in 0.1..3.0) {
            let mut flat = Array2::from_elem((30, 31), 7.0);
            blur(&mut flat, sigma);
            prop_assert!(flat.iter().all(|v| (v - 7.0_f64).abs() < 1e-12));
            let mut dot = Array2::zeros((31, 31));
            dot[[15, 15]] = 1.0;
            blur(&mut dot, sigma);
            prop_assert!((dot.sum() - 1.0).abs() < 1e-12);
            prop_assert!(dot.iter().all(|v| *v <= dot[[15, 15]]));
        }
    }

    #[test]
    fn options_out_of_range_are_named() {
        let d = XrayOptions::default();
        assert_eq!(d.check(), Ok(()));
        let bad = [
            XrayOptions { dose_photons_per_px: 0.0, ..d },
            XrayOptions { contrast: 1.0, ..d },
            XrayOptions { blur_sigma_px: f64::NAN, ..d },
            XrayOptions { background: -1.0, ..d },
            XrayOptions { readout_noise_photons: f64::INFINITY, ..d },
        ];
        for options in bad {
            assert!(matches!(options.check(), Err(SynthError::BadOption { .. })));
            assert_eq!(options.clamped().check(), Ok(()));
        }
    }
}
