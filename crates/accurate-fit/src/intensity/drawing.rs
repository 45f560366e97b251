use std::ops::Range;

use accurate_geom::nalgebra::{Matrix2x3, Vector2, Vector3};
use pulp::{Arch, Simd, WithSimd};

use super::band::Band;
use crate::projector::Projector;
use crate::uniform_spline::{UniformSpline, basis, basis_1};

/// Samples per pixel of the curve's length: of Gaussian blots of sigma >= 0.7 px, one every px, a line's
/// darkness ripples by 2 exp(-2 π² 0.7²) = 1e-4 of it.
pub(crate) const SAMPLES_PER_PX: f64 = 1.0;
/// A blot ends at so many of its standard deviations.
const REACH_SIGMAS: f64 = 4.5;

/// Blur of focal spot, detector and pixels that a body of no thickness would have.
const DETECTOR_BLUR_PX: f64 = 0.75;

/// A curve drawn into the band of one view as an absorber of one unit per world unit of its length:
/// what lies along the line of sight adds up, as optical depth does (Beer-Lambert).
pub(crate) struct Drawing {
    /// Optical depth for an amplitude of one, per pixel of the band.
    pub(crate) depth: Vec<f64>,
    /// Its derivatives, if asked for, per pixel of the band.
    pub(crate) rows: Vec<Row>,
}

/// Derivatives of one pixel's drawn depth.
#[derive(Debug, Clone, Default)]
pub(crate) struct Row {
    /// With respect to the four control points of each span that draws into it.
    pub(crate) spans: Vec<(usize, [f64; 12])>,
    /// With respect to the blur.
    pub(crate) blur: f64,
    /// With respect to shift x, shift y and roll of the image.
    pub(crate) nuisance: [f64; 3],
}

impl Drawing {
    /// Draws with blots of standard deviation `blur_px`, and derivatives if asked for.
    pub(crate) fn new(
        spline: &UniformSpline,
        samples: usize,
        projector: &Projector,
        blur_px: f64,
        band: &Band,
        derivatives: bool,
    ) -> Self {
        let pixels = band.depth.len();
        let mut drawing = Self {
            depth: vec![0.0; pixels],
            rows: vec![Row::default(); if derivatives { pixels } else { 0 }],
        };
        let radius_px = radius_px(blur_px);
        let cap = |outwards| Piece::Cap { radius_px, outwards };
        let pieces = (0..samples).map(|k| stretch(spline, samples, k));
        let pieces = std::iter::once((0.0, cap(-1.0))).chain(pieces);
        let pieces = pieces.chain([(spline.spans() as f64, cap(1.0))]);
        let mut brush = Brush { blur_px, across: Vec::new() };
        for (u, piece) in pieces {
            if let Some(blot) = Blot::new(spline, u, piece, projector) {
                // No operation is fused: the same drawing on every machine.
                let (brush, drawing) = (&mut brush, &mut drawing);
                Arch::new().dispatch(Stroke { brush, blot: &blot, projector, band, drawing });
            }
        }
        drawing
    }
}

/// Visits what some of the pieces of a drawing put into the band, the caps aside: the number of the piece,
/// of the pixel, and the optical depth there for an amplitude of one.
pub(crate) fn each_darkness(
    spline: &UniformSpline,
    samples: usize,
    pieces: Range<usize>,
    (projector, blur_px): (&Projector, f64),
    band: &Band,
    mut visit: impl FnMut(usize, usize, f64),
) {
    let mut brush = Brush { blur_px, across: Vec::new() };
    for k in pieces {
        let (u, piece) = stretch(spline, samples, k);
        if let Some(blot) = Blot::new(spline, u, piece, projector) {
            brush.each_pixel(&blot, band, |n, _, density| visit(k, n, blot.weight * density));
        }
    }
}

/// A piece of a curve that is drawn with so many, and where it lies.
fn stretch(spline: &UniformSpline, samples: usize, piece: usize) -> (f64, Piece) {
    let du = spline.spans() as f64 / samples as f64;
    ((piece as f64 + 0.5) * du, Piece::Stretch { du })
}

/// Radius of a solid round body whose blurred cross-section looks like a blot of this size.
pub(crate) fn radius_px(blur_px: f64) -> f64 {
    // The chord of a disc of radius r, over its width, has the variance r² / 4.
    2.0 * (blur_px * blur_px - DETECTOR_BLUR_PX * DETECTOR_BLUR_PX).max(0.0).sqrt()
}

/// What one blot stands for.
#[derive(Clone, Copy)]
enum Piece {
    /// A stretch of the curve, `du` long in its parameter.
    Stretch { du: f64 },
    /// The half ball beyond an end: a tip is a round cap, as its outline is. That it grows with the blur
    /// is left out of the derivatives; steps that gain nothing are not taken.
    Cap { radius_px: f64, outwards: f64 },
}

/// A piece of the curve, and how it hangs on the control points of its span.
struct Blot {
    span: usize,
    basis: [f64; 4],
    basis_1: [f64; 4],
    /// Where it is seen, px.
    image: Vector2<f64>,
    jacobian: Matrix2x3<f64>,
    /// Unit vector along the curve.
    tangent: Vector3<f64>,
    /// Of the point with the curve's direction, world unit per unit of the velocity.
    swing: f64,
    /// World unit of the curve's length times pixels per squared world unit.
    weight: f64,
    /// Of the weight with the velocity's length.
    stretch: f64,
}

impl Blot {
    /// None where the curve stands still or is not in front of the camera.
    fn new(spline: &UniformSpline, u: f64, piece: Piece, projector: &Projector) -> Option<Self> {
        let (span, t) = spline.locate(u);
        let (b, b1) = (basis(t), basis_1(t));
        let (mut point, velocity) = (spline.combine(span, b), spline.combine(span, b1));
        let speed = velocity.norm();
        if !(projector.depth(&point) > 0.0) || !(speed > 0.0) {
            return None;
        }
        let tangent = velocity / speed;
        let mut swing = 0.0;
        if let Piece::Cap { radius_px, outwards } = piece {
            // Of a half ball the centre of mass.
            let ahead = outwards * 0.375 * radius_px / projector.px_per_unit(&point);
            point += tangent * ahead;
            swing = ahead / speed;
        }
        let (image, jacobian) = projector.project_with_jacobian(&point);
        if !(image.x.abs() < 1e6 && image.y.abs() < 1e6) {
            return None;
        }
        // Pixels per squared world unit: a body farther away darkens fewer pixels.
        let area = 0.5 * jacobian.norm_squared();
        let (length, stretch) = match piece {
            Piece::Stretch { du } => (speed * du, du * area),
            // As much as of the body two thirds of a radius.
            Piece::Cap { radius_px, .. } => (radius_px * 2.0 / 3.0 / area.sqrt(), 0.0),
        };
        let weight = length * area;
        Some(Self { span, basis: b, basis_1: b1, image, jacobian, tangent, swing, weight, stretch })
    }

    /// What the coordinates of the span's control points change of a pixel, for one unit of its derivatives
    /// with respect to the blot's image, x and y, and of the blot's density there.
    fn of_controls(&self) -> [[f64; 12]; 3] {
        let Self { basis, basis_1, tangent, .. } = self;
        let of_image = |axis: usize| {
            let moved = self.jacobian.row(axis).transpose();
            let turned = (moved - tangent * tangent.dot(&moved)) * self.swing;
            std::array::from_fn(|k| moved[k % 3] * basis[k / 3] + turned[k % 3] * basis_1[k / 3])
        };
        let stretched = std::array::from_fn(|k| tangent[k % 3] * self.stretch * basis_1[k / 3]);
        [of_image(0), of_image(1), stretched]
    }
}

/// Puts blots of one size into a drawing.
struct Brush {
    blur_px: f64,
    /// Scratch: offset of each column from the blot's middle, and the blot's profile there.
    across: Vec<(f64, f64)>,
}

/// One blot that is added to a drawing.
struct Stroke<'a> {
    brush: &'a mut Brush,
    blot: &'a Blot,
    projector: &'a Projector,
    band: &'a Band,
    drawing: &'a mut Drawing,
}

impl WithSimd for Stroke<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { brush, blot, projector, band, drawing } = self;
        let (blur_px, variance) = (brush.blur_px, brush.blur_px * brush.blur_px);
        let Blot { image, weight, .. } = blot;
        let roll = projector.roll_derivative(image);
        let [along_x, along_y, along_density] = blot.of_controls();
        brush.each_pixel(blot, band, |n, [dx, dy], density| {
            let darkness = weight * density;
            drawing.depth[n] += darkness;
            let Some(row) = drawing.rows.get_mut(n) else { return };
            // Of the blot's place, px.
            let (gx, gy) = (darkness * dx / variance, darkness * dy / variance);
            row.nuisance[0] += gx;
            row.nuisance[1] += gy;
            row.nuisance[2] += gx * roll.x + gy * roll.y;
            row.blur += darkness * ((dx * dx + dy * dy) / variance - 2.0) / blur_px;
            if row.spans.last().is_none_or(|last| last.0 != blot.span) {
                row.spans.push((blot.span, [0.0; 12]));
            }
            let Some((_, sums)) = row.spans.last_mut() else { return };
            for k in 0..12 {
                sums[k] += gx * along_x[k] + gy * along_y[k] + density * along_density[k];
            }
        });
    }
}

impl Brush {
    /// Visits the pixels of the band that a blot reaches: their numbers, how far each is from its middle, px,
    /// and the blot's density there, 1/px².
    #[inline(always)]
    fn each_pixel(
        &mut self,
        blot: &Blot,
        band: &Band,
        mut visit: impl FnMut(usize, [f64; 2], f64),
    ) {
        let variance = self.blur_px * self.blur_px;
        let reach = (REACH_SIGMAS * self.blur_px).ceil() as i64;
        let profile = |offset: f64| (-0.5 * offset * offset / variance).exp();
        let image = &blot.image;
        let (x0, y0) = (image.x.round() as i64, image.y.round() as i64);
        let columns = x0 - reach..=x0 + reach;
        self.across.clear();
        self.across.extend(columns.clone().map(|x| x as f64 - image.x).map(|d| (d, profile(d))));
        for y in y0 - reach..=y0 + reach {
            let dy = y as f64 - image.y;
            let row_profile = profile(dy) / (2.0 * std::f64::consts::PI * variance);
            for (&(dx, column_profile), x) in self.across.iter().zip(columns.clone()) {
                if let Some(n) = band.number(x, y) {
                    visit(n, [dx, dy], row_profile * column_profile);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::Matrix3;
    use accurate_geom::{Camera, ImageSize};
    use ndarray::Array2;
    use proptest::prelude::*;

    use super::*;
    use crate::IntensityFitParams;

    const BLUR_PX: f64 = 1.1;
    /// Blots end at 4.5 sigma, where one of half a pixel of length has 0.5 / (2 pi 1.21) exp(-4.5² / 2)
    /// = 2.6e-6: what a pixel gains or loses when the borders of three pass it.
    const BORDERS: f64 = 3.0 * 2.6e-6;

    /// Looks along z from 1000 units away, 1 px per unit there.
    fn projector() -> Projector {
        let k = Matrix3::new(1000.0, 0.0, 60.0, 0.0, 1000.0, 50.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 120, height: 100 };
        let t = Vector3::new(0.0, 0.0, 1000.0);
        Projector::new(&Camera::new(k, Matrix3::identity(), t, size).unwrap())
    }

    fn spline(bends: &[f64]) -> UniformSpline {
        let control = bends
            .chunks_exact(2)
            .enumerate()
            .map(|(k, b)| Vector3::new(8.0 * k as f64 - 24.0, 3.0 * b[0], 40.0 * b[1]))
            .collect();
        UniformSpline { control }
    }

    /// All pixels within 12 px of the curve.
    fn band(spline: &UniformSpline, projector: &Projector) -> Band {
        let shown: Vec<_> =
            spline.sample(30).iter().map(|p| projector.project(&p.coords)).collect();
        let params = IntensityFitParams { reach_px: 12.0, ..IntensityFitParams::DEFAULT };
        Band::new(&Array2::from_elem((100, 120), 1.0), &shown, 1, &params).unwrap()
    }

    proptest! {
        #[test]
        fn all_that_a_body_absorbs_is_drawn(bends in prop::collection::vec(-1.0..1.0f64, 14)) {
            let (projector, spline) = (projector(), spline(&bends));
            let band = band(&spline, &projector);
            let drawn: f64 =
                Drawing::new(&spline, 400, &projector, BLUR_PX, &band, false).depth.iter().sum();
            let cap = 2.0 / 3.0 * radius_px(BLUR_PX);
            // Both caps are a length in pixels; depths within 40 of 1000 and up to 34 units off the
            // axis change the scale (squared) by 8.5 % at most.
            let expected = spline.length(50) + 2.0 * cap;
            // A blot cut at 4.5 sigma lacks 1.4e-5 of its mass.
            prop_assert!((drawn / expected - 1.0).abs() < 0.085 + 1e-3, "{drawn} {expected}");
        }

        #[test]
        fn derivatives_are_limits_of_differences(
            bends in prop::collection::vec(-1.0..1.0f64, 14),
            control in 0..7usize,
            axis in 0..3usize,
        ) {
            let (projector, spline) = (projector(), spline(&bends));
            let band = band(&spline, &projector);
            let rows = Drawing::new(&spline, 200, &projector, BLUR_PX, &band, true).rows;
            let h = 1e-3;
            let moved = |by: f64| {
                let mut spline = spline.clone();
                spline.control[control][axis] += by;
                Drawing::new(&spline, 200, &projector, BLUR_PX, &band, false).depth
            };
            let (more, less) = (moved(h), moved(-h));
            for (n, row) in rows.iter().enumerate() {
                let derivative: f64 = row
                    .spans
                    .iter()
                    .filter(|(span, _)| (*span..span + 4).contains(&control))
                    .map(|(span, values)| values[3 * (control - span) + axis])
                    .sum();
                let difference = (more[n] - less[n]) / (2.0 * h);
                // The scale's own change with depth is left out of the derivative: 2 / 1000 per unit
                // of a depth of at most 0.4 per pixel and overlap.
                let close = (derivative - difference).abs() < 2e-3 + BORDERS / (2.0 * h);
                prop_assert!(close, "{derivative} {difference}");
            }
        }
    }

    #[test]
    fn derivatives_of_blur_shift_and_roll_are_limits_of_differences() {
        let (projector, spline) = (
            projector(),
            spline(&[0.1, 0.2, -0.9, 0.3, 0.8, -0.5, 0.4, 0.1, -0.3, 0.6, 0.0, 0.2, 0.7, -0.7]),
        );
        let band = band(&spline, &projector);
        let draw = |projector: &Projector, blur: f64, derivatives| {
            Drawing::new(&spline, 200, projector, blur, &band, derivatives)
        };
        let rows = draw(&projector, BLUR_PX, true).rows;
        for k in 0..3 {
            // Up to 60 px from the axis a roll moves a pixel so much more than a shift.
            let size = if k == 2 { 60.0 } else { 1.0 };
            let h = 1e-3 / size;
            let turned = |by: f64| {
                let mut nuisance = crate::projector::Nuisance::default();
                let mut step = [0.0; 3];
                step[k] = by;
                nuisance.add(&step);
                let mut projector = projector.clone();
                projector.set_nuisance(nuisance);
                draw(&projector, BLUR_PX, false).depth
            };
            let (more, less) = (turned(h), turned(-h));
            for (n, row) in rows.iter().enumerate() {
                let difference = (more[n] - less[n]) / (2.0 * h);
                let close =
                    (row.nuisance[k] - difference).abs() < 1e-4 * size + BORDERS / (2.0 * h);
                assert!(close, "{k} {n} {} {difference}", row.nuisance[k]);
            }
        }
        let h = 1e-5;
        let (more, less) = (
            draw(&projector, BLUR_PX + h, false).depth,
            draw(&projector, BLUR_PX - h, false).depth,
        );
        let away_from_caps = |n: usize| rows[n].spans.iter().all(|(span, _)| (1..3).contains(span));
        let mut seen = 0;
        for (n, row) in rows.iter().enumerate().filter(|(n, _)| away_from_caps(*n)) {
            let difference = (more[n] - less[n]) / (2.0 * h);
            assert!((row.blur - difference).abs() < 1e-4, "{n} {} {difference}", row.blur);
            seen += usize::from(!row.spans.is_empty());
        }
        assert!(seen > 20, "{seen}");
    }
}
