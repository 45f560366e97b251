use accurate_geom::Point2;
use ndarray::Array2;
use rand::RngExt;

use super::target::Target;
use super::wander::log_uniform;
use super::{XrayDomain, XraySample, in_image, label};
use crate::SynthError;
use crate::rng::named_rng;
use crate::xray::blur;

/// A wire of a domain drawn onto a given grey image, for evaluation: `background` is a square of
/// `domain.side_px`, its values taken as proportional to the intensity, dark where dense.
///
/// The image keeps its own noise; the wire, blurred as the domain says, takes its part of every
/// value. Width, density, blur and course are drawn as in [`draw_xray`](super::draw_xray), from
/// streams of their own; whether a very faint wire can be seen over the given image is not known,
/// so that the density has a floor of 0.25.
///
/// # Errors
/// [`SynthError::BadOption`] for a bad domain or an image of another shape.
pub fn draw_xray_onto(
    domain: &XrayDomain,
    background: &Array2<u8>,
    seed: u64,
    index: u64,
) -> Result<XraySample, SynthError> {
    domain.check()?;
    let side = domain.side_px as usize;
    if background.dim() != (side, side) {
        return Err(SynthError::BadOption {
            name: "background",
            value: format!("{:?} (rows, columns)", background.dim()),
            expected: "a square image of side_px",
        });
    }
    let mut rng = named_rng("xray-onto", seed, index, "wire");
    let width_px = log_uniform(&mut rng, *domain.width_px.start(), *domain.width_px.end());
    let (low, high) = (domain.wire_depth.start().max(0.25), domain.wire_depth.end().max(0.25));
    let wire_depth = log_uniform(&mut rng, low, high);
    let sigma_px = rng.random_range(domain.blur_sigma_px.clone());
    let target = Target::draw(&mut rng, side as f64, width_px);
    let pieces = label::visible_pieces(
        &target.points,
        |s| target.radius_px(s),
        |p: &Point2| in_image(p, side as f64, target.shaft_px),
    );
    let mut depth = Array2::zeros((side, side));
    target.add_to(&mut depth, wire_depth);
    let mut passed = depth.mapv(|d: f64| (-d).exp());
    blur(&mut passed, sigma_px);
    let mut image = background.clone();
    image.zip_mut_with(&passed, |value, part| *value = (f64::from(*value) * part).round() as u8);
    Ok(XraySample {
        image,
        mask: label::wire_mask(domain.side_px, &pieces, |_| true),
        tube: label::tube_mask(domain.side_px, &pieces),
        centreline: pieces,
        inverted: false,
    })
}
