use ndarray::Array2;

use crate::median::median;
use crate::{Mask, SegError};

/// A point of a sub-pixel centreline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RidgePoint {
    /// Column, px.
    pub x: f64,
    /// Row, px.
    pub y: f64,
    /// Unit vector along the line, `[x, y]`; its sign says nothing.
    pub direction: [f64; 2],
    /// Width across the line between the places where the map has half its value on the ridge, px.
    pub width_px: f64,
    /// Value of the map on the ridge.
    pub value: f64,
}

/// How wide a body the ridge is looked for with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RidgeParams {
    /// Standard deviation of the Gaussian that the map is seen through, px.
    pub sigma_px: f64,
    /// Farthest that a ridge may lie from its skeleton pixel, px.
    pub reach_px: f64,
    /// Greatest width that is measured, px.
    pub widest_px: f64,
}

impl RidgeParams {
    /// For bodies of about this width, px: the least smoothing under which a bar has one ridge, and no
    /// less than what a grid of pixels can carry (Steger 1998, eq. 12).
    pub fn for_width(width_px: f64) -> Self {
        let sigma_px = (width_px / (2.0 * 3.0_f64.sqrt())).max(1.0);
        Self { sigma_px, reach_px: (0.5 * width_px).max(1.5), widest_px: 4.0 * width_px.max(3.0) }
    }

    fn validate(&self) -> Result<(), SegError> {
        for (name, value) in [
            ("sigma_px", self.sigma_px),
            ("reach_px", self.reach_px),
            ("widest_px", self.widest_px),
        ] {
            // No image is wider.
            if !(value > 0.0 && value < 1e5) {
                return Err(SegError::BadLength { name, value });
            }
        }
        Ok(())
    }
}

/// The ridge of a probability map at the pixels of a skeleton, to a fraction of a pixel, and the width
/// of the body there.
///
/// A thinned mask lies on whole pixels and moves with the threshold; the ridge does neither. One point
/// a skeleton pixel, in the order of rows. Pixels near which no direction prevails (crossings, blobs)
/// or the map does not fall off on both sides have no point.
///
/// `map` and `skeleton` have the same shape, `(height, width)`. Beyond its border the map goes on with
/// the values of the border.
///
/// # Errors
/// [`SegError::WrongShape`], [`SegError::NotFinite`], [`SegError::BadLength`] for a parameter.
///
/// # Source
/// C. Steger, "An unbiased detector of curvilinear structures", IEEE PAMI 20, 1998: the first derivative
/// vanishes in the direction of the strongest second derivative.
///
/// # Cost
/// O(skeleton pixels · `sigma_px`²).
pub fn ridge_centreline(
    map: &Array2<f32>,
    skeleton: &Mask,
    params: &RidgeParams,
) -> Result<Vec<RidgePoint>, SegError> {
    params.validate()?;
    skeleton.require_map(map)?;
    let pixels = skeleton.foreground();
    Ok(pixels.filter_map(|(row, column)| ridge_at(map, column, row, params)).collect())
}

/// The median width of a centreline, px; `None` without points.
pub fn median_ridge_width_px(points: &[RidgePoint]) -> Option<f64> {
    median(points.iter().map(|point| point.width_px).collect())
}

/// Of a line, the second derivative along it is small beside the one across.
const LINE_LIKE: f64 = 0.5;
const NEWTON_STEPS: usize = 6;
const REST_PX: f64 = 1e-3;
const LONGEST_STEP_PX: f64 = 0.5;

fn ridge_at(
    map: &Array2<f32>,
    column: usize,
    row: usize,
    params: &RidgeParams,
) -> Option<RidgePoint> {
    let start = [column as f64, row as f64];
    let mut at = start;
    let mut across = [0.0; 2];
    for _ in 0..NEWTON_STEPS {
        let derivatives = Derivatives::at(map, at, params.sigma_px);
        let (normal, strongest, other) = derivatives.strongest();
        if strongest >= 0.0 || other.abs() > LINE_LIKE * strongest.abs() {
            return None;
        }
        across = normal;
        let slope = derivatives.gradient[0] * normal[0] + derivatives.gradient[1] * normal[1];
        let step = (-slope / strongest).clamp(-LONGEST_STEP_PX, LONGEST_STEP_PX);
        at = [at[0] + step * normal[0], at[1] + step * normal[1]];
        if (at[0] - start[0]).hypot(at[1] - start[1]) > params.reach_px {
            return None;
        }
        if step.abs() < REST_PX {
            break;
        }
    }
    let value = bilinear(map, at);
    let half = |sign: f64| {
        let direction = [sign * across[0], sign * across[1]];
        half_width(map, at, direction, 0.5 * value, 0.5 * params.widest_px)
    };
    let width_px = half(1.0)? + half(-1.0)?;
    Some(RidgePoint { x: at[0], y: at[1], direction: [-across[1], across[0]], width_px, value })
}

/// How far the map stays above a level in a direction; `None` if it does so too far.
fn half_width(
    map: &Array2<f32>,
    from: [f64; 2],
    direction: [f64; 2],
    level: f64,
    farthest_px: f64,
) -> Option<f64> {
    const STEP_PX: f64 = 0.125;
    let value = |s: f64| bilinear(map, [from[0] + s * direction[0], from[1] + s * direction[1]]);
    let mut before = value(0.0);
    let steps = (farthest_px / STEP_PX) as usize;
    for k in 1..=steps {
        let s = k as f64 * STEP_PX;
        let here = value(s);
        if here < level {
            return Some(s - STEP_PX * (level - here) / (before - here));
        }
        before = here;
    }
    None
}

/// First and second derivatives of a map seen through a Gaussian.
struct Derivatives {
    gradient: [f64; 2],
    /// xx, xy, yy.
    hessian: [f64; 3],
}

impl Derivatives {
    fn at(map: &Array2<f32>, at: [f64; 2], sigma: f64) -> Self {
        let reach = (4.0 * sigma).ceil() as i64;
        let (column, row) = (at[0].round() as i64, at[1].round() as i64);
        let (mut gradient, mut hessian) = ([0.0; 2], [0.0; 3]);
        let inverse = 1.0 / (sigma * sigma);
        for y in row - reach..=row + reach {
            for x in column - reach..=column + reach {
                // From the pixel to the place: derivatives act on the place.
                let (dx, dy) = (at[0] - x as f64, at[1] - y as f64);
                let weight = (-0.5 * inverse * (dx * dx + dy * dy)).exp() * clamped(map, x, y);
                let (u, v) = (-dx * inverse, -dy * inverse);
                gradient[0] += weight * u;
                gradient[1] += weight * v;
                hessian[0] += weight * (u * u - inverse);
                hessian[1] += weight * u * v;
                hessian[2] += weight * (v * v - inverse);
            }
        }
        Self { gradient, hessian }
    }

    /// Unit vector of the strongest downward curvature, that second derivative, and the other one.
    fn strongest(&self) -> ([f64; 2], f64, f64) {
        let [xx, xy, yy] = self.hessian;
        let (mean, difference) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let radius = difference.hypot(xy);
        let (least, other) = (mean - radius, mean + radius);
        // Eigenvector of the least eigenvalue: half the angle of (difference, xy), turned by 90 degrees.
        let angle = 0.5 * xy.atan2(difference) + std::f64::consts::FRAC_PI_2;
        ([angle.cos(), angle.sin()], least, other)
    }
}

fn clamped(map: &Array2<f32>, x: i64, y: i64) -> f64 {
    let (height, width) = map.dim();
    let row = y.clamp(0, height as i64 - 1) as usize;
    let column = x.clamp(0, width as i64 - 1) as usize;
    f64::from(map[(row, column)])
}

fn bilinear(map: &Array2<f32>, at: [f64; 2]) -> f64 {
    let (left, top) = (at[0].floor(), at[1].floor());
    let (fx, fy) = (at[0] - left, at[1] - top);
    let (x, y) = (left as i64, top as i64);
    let above = (1.0 - fx) * clamped(map, x, y) + fx * clamped(map, x + 1, y);
    let below = (1.0 - fx) * clamped(map, x, y + 1) + fx * clamped(map, x + 1, y + 1);
    (1.0 - fy) * above + fy * below
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    const SIDE: usize = 48;

    /// How much of every pixel a bar covers: through `centre`, in the direction of `angle`.
    fn bar(centre: [f64; 2], angle: f64, width: f64) -> Array2<f32> {
        let (sin, cos) = angle.sin_cos();
        Array2::from_shape_fn((SIDE, SIDE), |(row, column)| {
            let off = cos * (row as f64 - centre[1]) - sin * (column as f64 - centre[0]);
            let below = |edge: f64| part_below(edge - off, sin, cos);
            (below(0.5 * width) - below(-0.5 * width)) as f32
        })
    }

    /// The part of a pixel that lies below an edge, which passes its centre at `distance`: the
    /// distribution of the sum of two uniform variables, as wide as the pixel is across the edge.
    fn part_below(distance: f64, sin: f64, cos: f64) -> f64 {
        let (wide, narrow) = (sin.abs().max(cos.abs()), sin.abs().min(cos.abs()));
        if narrow < 1e-6 {
            return (distance / wide + 0.5).clamp(0.0, 1.0);
        }
        let corner = |at: f64| (distance + 0.5 * at).max(0.0).powi(2);
        let (sum, difference) = (wide + narrow, wide - narrow);
        (corner(sum) - corner(difference) - corner(-difference) + corner(-sum))
            / (2.0 * wide * narrow)
    }

    /// The pixels nearest to the axis: thinning can lose a slanted bar of even width.
    fn axis(centre: [f64; 2], angle: f64) -> Mask {
        let (sin, cos) = angle.sin_cos();
        Mask::from_array(Array2::from_shape_fn((SIDE, SIDE), |(row, column)| {
            (cos * (row as f64 - centre[1]) - sin * (column as f64 - centre[0])).abs() <= 0.5
        }))
        .unwrap()
    }

    fn inside(point: &RidgePoint) -> bool {
        // The border's continuation bends the ends of a slanted bar.
        let margin = 8.0..SIDE as f64 - 8.0;
        margin.contains(&point.x) && margin.contains(&point.y)
    }

    #[test]
    fn lengths_that_no_image_has_are_refused() {
        let map = Array2::zeros((4, 4));
        let skeleton = Mask::from_array(Array2::from_elem((4, 4), true)).unwrap();
        let usual = RidgeParams::for_width(3.0);
        for (params, name) in [
            (RidgeParams { widest_px: f64::INFINITY, ..usual }, "widest_px"),
            (RidgeParams { sigma_px: f64::INFINITY, ..usual }, "sigma_px"),
            (RidgeParams { sigma_px: 0.0, ..usual }, "sigma_px"),
            (RidgeParams { reach_px: f64::NAN, ..usual }, "reach_px"),
        ] {
            let refused = ridge_centreline(&map, &skeleton, &params).unwrap_err();
            assert!(
                matches!(refused, SegError::BadLength { name: n, .. } if n == name),
                "{refused}"
            );
        }
    }

    proptest! {
        #[test]
        fn the_axis_and_the_width_of_a_bar_are_found_between_the_pixels(
            x in 23.0..25.0, y in 23.0..25.0, angle in 0.0..std::f64::consts::PI, width in 2.0..6.0,
        ) {
            let map = bar([x, y], angle, width);
            let skeleton = axis([x, y], angle);
            let params = RidgeParams::for_width(width);
            let points = ridge_centreline(&map, &skeleton, &params).unwrap();
            let points: Vec<_> = points.into_iter().filter(inside).collect();
            prop_assert!(points.len() > 20, "{}", points.len());
            let (sin, cos) = angle.sin_cos();
            let mut mean = 0.0;
            for point in &points {
                let off = cos * (point.y - y) - sin * (point.x - x);
                // An edge near the grid's direction beats with it: of its harmonic of about one cycle
                // a pixel the pixel's area lets sinc(1.06) / 2π = 0.01 through, as waves of 0.06 cycles
                // a pixel, a slope of 0.004 an edge. The profile bends by 0.308 / σ² at the ridge, 0.1
                // for 6 px: 0.07 px.
                prop_assert!(off.abs() < 0.09, "{off} at {point:?}");
                mean += off / points.len() as f64;
                let along = (cos * point.direction[0] + sin * point.direction[1]).abs();
                prop_assert!(along > 0.99, "{along}");
                // Interpolation moves an edge by at most 0.09 px (max of (f - 1/2)(1 - f)/f over the
                // covered part f); half of the ridge's own value, which between pixels is up to 0.02
                // short of 1, by 0.01.
                prop_assert!((point.width_px - width).abs() < 2.0 * (0.09 + 0.01), "{point:?}");
            }
            // The waves cancel over a length. An edge along the grid has none: over all widths and
            // places of such a bar the slope vanishes at most 0.0754 px from the axis (the sum over
            // its one column of pixels, solved for; worst for 3.48 px).
            prop_assert!(mean.abs() < 0.08, "{mean}");
        }

        #[test]
        fn a_transposed_map_has_the_transposed_ridge(
            x in 23.0..25.0, y in 23.0..25.0, angle in 0.1..1.4, width in 2.0..6.0,
        ) {
            let map = bar([x, y], angle, width);
            let skeleton = axis([x, y], angle);
            let params = RidgeParams::for_width(width);
            let here = ridge_centreline(&map, &skeleton, &params).unwrap();
            let turned = Mask::from_array(skeleton.as_array().t().to_owned()).unwrap();
            let there = ridge_centreline(&map.t().to_owned(), &turned, &params).unwrap();
            prop_assert_eq!(here.len(), there.len());
            for point in &here {
                let same = |other: &RidgePoint| {
                    (other.x - point.y).abs() < 1e-6
                        && (other.y - point.x).abs() < 1e-6
                        && (other.width_px - point.width_px).abs() < 1e-6
                };
                prop_assert!(there.iter().any(same), "{point:?}");
            }
        }
    }

    #[test]
    fn the_middle_of_a_crossing_a_blob_and_a_plateau_have_no_point() {
        let one = bar([24.0, 24.0], 0.8, 3.0);
        let crossing = ndarray::Zip::from(&one)
            .and(&bar([24.0, 24.0], 0.8 + std::f64::consts::FRAC_PI_2, 3.0))
            .map_collect(|a, b| a.max(*b));
        let at = |row, column| {
            let mut mask = Array2::from_elem((SIDE, SIDE), false);
            mask[(row, column)] = true;
            Mask::from_array(mask).unwrap()
        };
        let params = RidgeParams::for_width(3.0);
        let points = |map: &Array2<f32>, row, column| {
            ridge_centreline(map, &at(row, column), &params).unwrap().len()
        };
        assert_eq!(points(&one, 24, 24), 1);
        assert_eq!(points(&crossing, 24, 24), 0);
        let blob = Array2::from_shape_fn((SIDE, SIDE), |(row, column)| {
            let (x, y) = (column as f64 - 24.0, row as f64 - 24.0);
            if x.hypot(y) < 4.0 { 1.0 } else { 0.0 }
        });
        assert_eq!(points(&blob, 24, 24), 0);
        assert_eq!(points(&Array2::from_elem((SIDE, SIDE), 0.7), 24, 24), 0);
    }

    #[test]
    fn shapes_and_values_are_checked() {
        let map = bar([24.0, 24.0], 0.3, 3.0);
        let skeleton = axis([24.0, 24.0], 0.3);
        let params = RidgeParams::for_width(3.0);
        let small = Array2::zeros((4, 4));
        let refused = ridge_centreline(&small, &skeleton, &params);
        assert!(matches!(refused, Err(SegError::WrongShape { .. })));
        let mut bad = map;
        bad[(3, 5)] = f32::NAN;
        let refused = ridge_centreline(&bad, &skeleton, &params);
        assert!(matches!(refused, Err(SegError::NotFinite { row: 3, column: 5, .. })));
    }

    #[test]
    fn the_median_width_of_no_points_is_none() {
        assert_eq!(median_ridge_width_px(&[]), None);
        let point =
            |width_px| RidgePoint { x: 0.0, y: 0.0, direction: [1.0, 0.0], width_px, value: 1.0 };
        assert_eq!(median_ridge_width_px(&[point(2.0), point(5.0), point(3.0)]), Some(3.0));
        assert_eq!(median_ridge_width_px(&[point(2.0), point(3.0)]), Some(2.5));
    }
}
