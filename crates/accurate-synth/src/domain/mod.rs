//! Single X-ray images with a labelled wire, randomised over everything that a real archive varies:
//! what a segmentation network is trained on.

mod anatomy;
mod aperture;
mod composite;
mod detector;
mod device;
mod held_out;
mod jpeg;
mod label;
mod of_pair;
mod overlay;
mod phantom;
mod stroke;
mod target;
mod wander;

use std::fmt::Debug;
use std::ops::RangeInclusive;

use accurate_geom::Point2;
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

pub use composite::draw_xray_onto;
pub use held_out::draw_xray_held_out;
pub use label::{TUBE_RADIUS_PX, VisiblePiece};
pub use phantom::draw_xray_phantom;

use crate::options::within;
use crate::rng::named_rng;
use crate::{Family, SynthError};
use aperture::Aperture;
use detector::{Exposure, draw_exposure};
use target::Target;
use wander::log_uniform;

/// Changes whenever [`draw_xray`] gives other images for the same arguments.
pub const XRAY_VERSION: u32 = 4;

/// Ranges that an image is drawn from. The default is what the shipped network was trained on first,
/// [`XrayDomain::of_pairs`] what it went on with.
#[derive(Debug, Clone, PartialEq)]
pub struct XrayDomain {
    /// Width and height of the image, px, 64 to 4096.
    pub side_px: u32,
    /// Width of the wire, px, drawn uniform in its logarithm; within 1 to 64.
    pub width_px: RangeInclusive<f64>,
    /// Optical depth across the wire's shaft, drawn uniform in its logarithm; within 0.01 to 10. A
    /// wire that the noise would hide (see `least_contrast_to_noise`) is made denser.
    pub wire_depth: RangeInclusive<f64>,
    /// Least contrast to noise per pixel times the square root of the width in px, 0 to 100. Rose's
    /// criterion asks for a signal of five deviations of the noise; over 5 px of wire (what a
    /// tolerance of 2 px to both sides resolves) that is `5 / sqrt(5)`. A target below it would be a
    /// label that nobody can check.
    pub least_contrast_to_noise: f64,
    /// Photons of an open pixel, drawn uniform in the logarithm; within 1 to 1e6.
    pub dose_photons_per_px: RangeInclusive<f64>,
    /// Gaussian blur, px, within 0 to 20.
    pub blur_sigma_px: RangeInclusive<f64>,
    /// Strength of the anatomy; 1 is a chest; within 0 to 4.
    pub background: RangeInclusive<f64>,
    /// Part of the open field that arrives as scatter, within 0 to 0.95.
    pub scatter: RangeInclusive<f64>,
    /// Way of the object during the exposure, px, within 0 to 20.
    pub motion_px: RangeInclusive<f64>,
    /// Probability of motion, 0 to 1.
    pub motion_probability: f64,
    /// Probability of a linear instead of a logarithmic response, 0 to 1.
    pub linear_probability: f64,
    /// Probability that the wire is shown brighter than its surroundings, 0 to 1.
    pub inverted_probability: f64,
    /// Probability of JPEG artefacts, 0 to 1.
    pub jpeg_probability: f64,
    /// JPEG quality, within 1 to 100.
    pub jpeg_quality: RangeInclusive<u8>,
    /// Probability of text and rulers, 0 to 1.
    pub overlay_probability: f64,
    /// Probability of an image without a wire, 0 to 1.
    pub empty_probability: f64,
    /// Probability of the picture of one view of a generated pair (`sim-paper`, `carm`, ...)
    /// instead, 0 to 1. Of the other fields only `side_px` and those below concern it.
    pub pair_probability: f64,
    /// Families of those pairs, at least one, drawn alike; one that is named twice, twice as often.
    pub pair_families: Vec<Family>,
    /// Mean width of the wire in such a picture, px, drawn uniform in its logarithm; within 1 to 64.
    pub pair_width_px: RangeInclusive<f64>,
}

/// Families of pictures of pairs: the arms of the table count twice.
const PAIR_FAMILIES: [Family; 8] = [
    Family::SimPaper,
    Family::SimPaper,
    Family::Carm,
    Family::Carm,
    Family::Easy,
    Family::Medium,
    Family::Hard,
    Family::Helix,
];

impl Default for XrayDomain {
    fn default() -> Self {
        Self {
            side_px: 512,
            width_px: 1.0..=8.0,
            wire_depth: 0.06..=1.8,
            least_contrast_to_noise: 2.25,
            dose_photons_per_px: 30.0..=6000.0,
            blur_sigma_px: 0.2..=1.8,
            background: 0.1..=1.5,
            scatter: 0.0..=0.6,
            motion_px: 1.0..=5.0,
            motion_probability: 0.2,
            linear_probability: 0.3,
            inverted_probability: 0.2,
            jpeg_probability: 0.3,
            jpeg_quality: 25..=95,
            overlay_probability: 0.25,
            empty_probability: 0.03,
            pair_probability: 0.25,
            pair_families: PAIR_FAMILIES.to_vec(),
            pair_width_px: 1.0..=8.0,
        }
    }
}

impl XrayDomain {
    /// Mostly pictures of pairs, half of them of C-arms, with wires of 1 to 5 px: what a network that
    /// knows the default domain goes on with (docs/training.md).
    pub fn of_pairs() -> Self {
        let more = [Family::Carm; 4];
        Self {
            pair_probability: 0.7,
            pair_families: more.into_iter().chain(PAIR_FAMILIES).collect(),
            pair_width_px: 1.0..=5.0,
            ..Self::default()
        }
    }

    /// Refuses ranges outside the documented limits.
    ///
    /// # Errors
    /// [`SynthError::BadOption`].
    pub fn check(&self) -> Result<(), SynthError> {
        check_side(self.side_px)?;
        for (name, width_px) in
            [("width_px", &self.width_px), ("pair_width_px", &self.pair_width_px)]
        {
            span(name, width_px, 1.0..=64.0, "low..=high within 1 to 64 px")?;
        }
        if self.pair_families.is_empty() {
            let (name, value) = ("pair_families", "none".to_owned());
            return Err(SynthError::BadOption { name, value, expected: "at least one family" });
        }
        span("wire_depth", &self.wire_depth, 0.01..=10.0, "low..=high within 0.01 to 10")?;
        let dose = &self.dose_photons_per_px;
        span("dose_photons_per_px", dose, 1.0..=1e6, "low..=high within 1 to 1e6")?;
        span("blur_sigma_px", &self.blur_sigma_px, 0.0..=20.0, "low..=high within 0 to 20 px")?;
        span("background", &self.background, 0.0..=4.0, "low..=high within 0 to 4")?;
        span("scatter", &self.scatter, 0.0..=0.95, "low..=high within 0 to 0.95")?;
        span("motion_px", &self.motion_px, 0.0..=20.0, "low..=high within 0 to 20 px")?;
        span("jpeg_quality", &self.jpeg_quality, 1..=100, "low..=high within 1 to 100")?;
        let least = self.least_contrast_to_noise;
        within("least_contrast_to_noise", least, 0.0..=100.0, "0 to 100")?;
        for (name, probability) in [
            ("motion_probability", self.motion_probability),
            ("linear_probability", self.linear_probability),
            ("inverted_probability", self.inverted_probability),
            ("jpeg_probability", self.jpeg_probability),
            ("overlay_probability", self.overlay_probability),
            ("empty_probability", self.empty_probability),
            ("pair_probability", self.pair_probability),
        ] {
            within(name, probability, 0.0..=1.0, "0 to 1")?;
        }
        Ok(())
    }
}

fn check_side(side_px: u32) -> Result<(), SynthError> {
    if (64..=4096).contains(&side_px) {
        return Ok(());
    }
    Err(SynthError::BadOption {
        name: "side_px",
        value: side_px.to_string(),
        expected: "64 to 4096 px",
    })
}

fn span<T: PartialOrd + Debug>(
    name: &'static str,
    range: &RangeInclusive<T>,
    limits: RangeInclusive<T>,
    expected: &'static str,
) -> Result<(), SynthError> {
    // NaN is in no range.
    if limits.contains(range.start())
        && limits.contains(range.end())
        && range.start() <= range.end()
    {
        return Ok(());
    }
    Err(SynthError::BadOption { name, value: format!("{range:?}"), expected })
}

/// One image with its labels. Arrays have the shape (side, side), index `[[y, x]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct XraySample {
    /// Eight-bit grey values.
    pub image: Array2<u8>,
    /// Pixels of the wire: within its radius (at least 1/2 px) of the visible centreline.
    pub mask: Array2<bool>,
    /// Pixels within [`TUBE_RADIUS_PX`] of the visible centreline: the tubed skeleton, from the
    /// exact curve instead of a thinned mask.
    pub tube: Array2<bool>,
    /// The exact centreline where it can be seen.
    pub centreline: Vec<VisiblePiece>,
    /// Whether the wire is brighter than its surroundings.
    pub inverted: bool,
}

/// Image `index` of the set `seed` of a domain.
///
/// Pure: the same arguments give the same image, whatever else is drawn and on any number of
/// threads. Streams of their own draw the scene, the wire, the other devices, the exposure and the
/// display. The wire to be found is the long, thin (`width_px`), solid and even one; everything
/// else in the image is hollow, beaded, dashed, a mesh, short, much wider, or soft and branching.
///
/// # Errors
/// [`SynthError::BadOption`]; [`SynthError::Encoding`] if the JPEG encoder fails (not known to
/// happen).
///
/// # Source
/// Domain randomisation: Tobin et al., IROS 2017. Tubed skeleton: Kirchhoff et al., ECCV 2024.
///
/// # Cost
/// Below 0.1 s for 512 x 512 px.
pub fn draw_xray(domain: &XrayDomain, seed: u64, index: u64) -> Result<XraySample, SynthError> {
    domain.check()?;
    let stream = |what: &str| named_rng("xray-domain", seed, index, what);
    let side = domain.side_px as usize;
    let mut pair = stream("pair");
    if pair.random_bool(domain.pair_probability)
        && let Some(sample) = of_pair::draw(&mut pair, domain, seed, index)
    {
        return Ok(sample);
    }

    let mut scene = stream("scene");
    let strength = scene.random_range(domain.background.clone());
    let mut depth = anatomy::draw(&mut scene, side, strength);
    let aperture = Aperture::draw(&mut stream("aperture"), side as f64);
    let exposure = draw_exposure(&mut stream("exposure"), domain);

    let mut wire = stream("wire");
    let width_px = log_uniform(&mut wire, *domain.width_px.start(), *domain.width_px.end());
    let drawn = log_uniform(&mut wire, *domain.wire_depth.start(), *domain.wire_depth.end());
    let present = !wire.random_bool(domain.empty_probability);
    let target = present.then(|| Target::draw(&mut wire, side as f64, width_px));
    let visible = |p: &Point2| aperture.inside_px(p) > 0.5;
    let mut wire_depth = drawn;
    let mut pieces = Vec::new();
    if let Some(target) = &target {
        wire_depth = drawn.max(least_depth(domain, &exposure, &depth, target));
        pieces = label::visible_pieces(
            &target.points,
            |s| target.radius_px(s),
            |p| visible(p) && in_image(p, side as f64, target.shaft_px),
        );
    }
    device::add_devices(&mut stream("devices"), &mut depth, target.as_ref(), wire_depth);
    if let Some(target) = &target {
        target.add_to(&mut depth, wire_depth);
    }

    let mut image = exposure.take(&depth, &aperture, &mut stream("noise"));
    let image = finish(domain, &mut image, &mut stream("display"))?;
    Ok(XraySample {
        image,
        mask: label::wire_mask(domain.side_px, &pieces, visible),
        tube: label::tube_mask(domain.side_px, &pieces),
        centreline: pieces,
        inverted: exposure.inverted,
    })
}

/// Whether a vertex can touch a pixel of the image.
fn in_image(p: &Point2, side: f64, radius: f64) -> bool {
    let range = -0.5 - radius..side - 0.5 + radius;
    range.contains(&p.x) && range.contains(&p.y)
}

/// The optical depth at which the wire can just be followed over the median of its surroundings.
fn least_depth(
    domain: &XrayDomain,
    exposure: &Exposure,
    background: &Array2<f64>,
    target: &Target,
) -> f64 {
    let mut behind: Vec<f64> = target
        .points
        .iter()
        .filter_map(|p| {
            let inside = p.x >= 0.0 && p.y >= 0.0;
            inside.then(|| background.get([p.y as usize, p.x as usize]).copied()).flatten()
        })
        .collect();
    behind.sort_by(f64::total_cmp);
    let median = behind.get(behind.len() / 2).copied().unwrap_or(0.0);
    let direct = (1.0 - exposure.scatter) * (-median).exp();
    let photons = exposure.dose_photons_per_px * (direct + exposure.scatter);
    let width = 2.0 * target.shaft_px;
    // The wire takes `1 - exp(-depth)` of the direct part.
    let per_photon = direct / (direct + exposure.scatter) * exposure.kept_contrast(width);
    let share = domain.least_contrast_to_noise / (per_photon * (photons * width).sqrt());
    -(1.0 - share.min(0.9)).ln()
}

/// Overlay, eight bits, JPEG.
fn finish(
    domain: &XrayDomain,
    image: &mut Array2<f64>,
    rng: &mut ChaCha8Rng,
) -> Result<Array2<u8>, SynthError> {
    if rng.random_bool(domain.overlay_probability) {
        overlay::add_overlay(rng, image);
    }
    // The cast saturates at both ends.
    let eight = image.mapv(|value| (255.0 * value).round() as u8);
    if rng.random_bool(domain.jpeg_probability) {
        return jpeg::through_jpeg(&eight, rng.random_range(domain.jpeg_quality.clone()));
    }
    Ok(eight)
}
