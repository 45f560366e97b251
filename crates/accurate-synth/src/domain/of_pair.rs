use accurate_geom::Point2;
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::wander::log_uniform;
use super::{XrayDomain, XraySample, in_image, label};
use crate::projection::Projection;
use crate::xray::{XrayOptions, XrayResponse, render_xray_of_view};
use crate::{CaseOptions, generate};

/// One view of a generated pair as its X-ray picture shows it, with width, dose, contrast, blur,
/// background and window drawn anew: a square of `side` px about a point of the wire. The wire's
/// shape is the family's case `index` of set `seed`, which no evaluation shares (their seeds are
/// below 2000).
///
/// Where the family's images are smaller than the square, their last rows and columns go on.
/// `None` only if no case can be drawn (not known to happen).
pub(crate) fn draw(
    rng: &mut ChaCha8Rng,
    domain: &XrayDomain,
    seed: u64,
    index: u64,
) -> Option<XraySample> {
    let side = domain.side_px;
    let family = domain.pair_families[rng.random_range(0..domain.pair_families.len())];
    let width_px = log_uniform(rng, *domain.pair_width_px.start(), *domain.pair_width_px.end());
    let mut case = generate(family, seed, index, &CaseOptions::default()).ok()?;
    let options = XrayOptions {
        dose_photons_per_px: log_uniform(rng, 100.0, 3000.0),
        contrast: rng.random_range(0.2..0.8),
        blur_sigma_px: rng.random_range(0.3..1.5),
        background: rng.random_range(0.3..1.6),
        readout_noise_photons: rng.random_range(1.0..5.0),
        response: if rng.random_bool(0.7) { XrayResponse::Log } else { XrayResponse::Linear },
    };
    let view = rng.random_range(0..2_usize);
    let camera = [case.true_rig.camera1(), case.true_rig.camera2()][view];
    let course = Projection::new(camera, &case.truth).ok()?;
    // The picture shows the wire of the world; its width follows the distance to the camera.
    let focal = camera.k()[(0, 0)].abs();
    let mean_depth = course.depth.iter().sum::<f64>() / course.depth.len().max(1) as f64;
    case.wire_radius = 0.5 * width_px * mean_depth / focal;
    let picture = render_xray_of_view(&case, view, &options);
    let (rows, columns) = picture.dim();
    let square = side as usize;
    let (free_rows, free_columns) = (rows.saturating_sub(square), columns.saturating_sub(square));
    let middle = course.points.get(rng.random_range(0..course.points.len().max(1)))?;
    let corner = |at: f64, free: usize| ((at - f64::from(side) / 2.0).max(0.0) as usize).min(free);
    let (top, left) = (corner(middle.y, free_rows), corner(middle.x, free_columns));
    let cut = Array2::from_shape_fn((square, square), |(y, x)| {
        picture[[(top + y).min(rows - 1), (left + x).min(columns - 1)]]
    });
    let inverted = rng.random_bool(0.2);
    let image = windowed(&cut, rng, inverted);

    let shift = nalgebra::Vector2::new(left as f64, top as f64);
    let points: Vec<Point2> = course.points.iter().map(|p| p - shift).collect();
    let arc = crate::polyline::arc_lengths(&points);
    let radius_px = |at: f64| {
        let k = arc.partition_point(|s| *s < at).min(course.depth.len().saturating_sub(1));
        (case.wire_radius * focal / course.depth[k]).max(0.5)
    };
    let pieces =
        label::visible_pieces(&points, radius_px, |p| in_image(p, f64::from(side), width_px));
    Some(XraySample {
        image,
        mask: label::wire_mask(side, &pieces, |_| true),
        tube: label::tube_mask(side, &pieces),
        centreline: pieces,
        inverted,
    })
}

/// Eight bits between two drawn quantiles.
fn windowed(values: &Array2<u16>, rng: &mut ChaCha8Rng, inverted: bool) -> Array2<u8> {
    let mut sorted: Vec<u16> = values.iter().copied().collect();
    sorted.sort_unstable();
    let cut = (sorted.len() as f64 * rng.random_range(0.0..0.004)) as usize;
    let last = sorted.len().saturating_sub(1);
    let low = f64::from(sorted.get(cut).copied().unwrap_or(0));
    let high = f64::from(sorted.get(last.saturating_sub(cut)).copied().unwrap_or(0)).max(low + 1.0);
    values.mapv(|value| {
        // The cast saturates at both ends.
        let grey = (255.0 * (f64::from(value) - low) / (high - low)).round() as u8;
        if inverted { 255 - grey } else { grey }
    })
}
