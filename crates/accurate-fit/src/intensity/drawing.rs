use accurate_geom::nalgebra::{Matrix2x3, Vector2, Vector3};

use super::band::Band;
use crate::projector::Projector;
use crate::uniform_spline::{UniformSpline, basis, basis_1};

/// Samples per pixel of the curve's length: a Gaussian blot of sigma >= 0.7 px every 0.5 px draws a
/// line without ripples.
pub(crate) const SAMPLES_PER_PX: f64 = 2.0;
/// A blot ends at so many of its standard deviations.
const REACH_SIGMAS: f64 = 3.5;

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
        let spans = spline.spans() as f64;
        let du = spans / samples as f64;
        let radius_px = radius_px(blur_px);
        let cap = |outwards| Piece::Cap { radius_px, outwards };
        let pieces = (0..samples).map(|k| ((k as f64 + 0.5) * du, Piece::Stretch { du }));
        let pieces = std::iter::once((0.0, cap(-1.0))).chain(pieces).chain([(spans, cap(1.0))]);
        let mut brush = Brush { blur_px, across: Vec::new() };
        for (u, piece) in pieces {
            if let Some(blot) = Blot::new(spline, u, piece, projector) {
                brush.add(&blot, projector, band, &mut drawing);
            }
        }
        drawing
    }
}

/// Radius of a solid round body whose blurred cross-section looks like a blot of this size.
fn radius_px(blur_px: f64) -> f64 {
    // The chord of a disc of radius r, over its width, has the variance r² / 4.
    2.0 * (blur_px * blur_px - DETECTOR_BLUR_PX * DETECTOR_BLUR_PX).max(0.0).sqrt()
}

/// What one blot stands for.
#[derive(Clone, Copy)]
enum Piece {
    /// A stretch of the curve, `du` long in its parameter.
    Stretch { du: f64 },
    /// The half ball beyond an end: a tip is a round cap, as its outline is.
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
}

/// Puts blots of one size into a drawing.
struct Brush {
    blur_px: f64,
    /// Scratch: offset of each column from the blot's middle, and the blot's profile there.
    across: Vec<(f64, f64)>,
}

impl Brush {
    fn add(&mut self, blot: &Blot, projector: &Projector, band: &Band, drawing: &mut Drawing) {
        let variance = self.blur_px * self.blur_px;
        let reach = (REACH_SIGMAS * self.blur_px).ceil() as i64;
        let profile = |offset: f64| (-0.5 * offset * offset / variance).exp();
        let Blot { image, jacobian, tangent, weight, .. } = blot;
        let (x0, y0) = (image.x.round() as i64, image.y.round() as i64);
        let columns = x0 - reach..=x0 + reach;
        self.across.clear();
        self.across.extend(columns.clone().map(|x| x as f64 - image.x).map(|d| (d, profile(d))));
        let roll = projector.roll_derivative(image);
        for y in y0 - reach..=y0 + reach {
            let dy = y as f64 - image.y;
            let row_profile = profile(dy) / (2.0 * std::f64::consts::PI * variance);
            for (&(dx, column_profile), x) in self.across.iter().zip(columns.clone()) {
                let Some(n) = band.number(x, y) else { continue };
                let density = row_profile * column_profile;
                let darkness = weight * density;
                drawing.depth[n] += darkness;
                let Some(row) = drawing.rows.get_mut(n) else { continue };
                // Of the blot's place, px.
                let (gx, gy) = (darkness * dx / variance, darkness * dy / variance);
                row.nuisance[0] += gx;
                row.nuisance[1] += gy;
                row.nuisance[2] += gx * roll.x + gy * roll.y;
                row.blur += darkness * ((dx * dx + dy * dy) / variance - 2.0) / self.blur_px;
                if row.spans.last().is_none_or(|last| last.0 != blot.span) {
                    row.spans.push((blot.span, [0.0; 12]));
                }
                let Some((_, sums)) = row.spans.last_mut() else { continue };
                let moved = jacobian.transpose() * Vector2::new(gx, gy);
                let turned = (moved - tangent * tangent.dot(&moved)) * blot.swing
                    + tangent * (density * blot.stretch);
                for j in 0..4 {
                    for d in 0..3 {
                        sums[3 * j + d] += moved[d] * blot.basis[j] + turned[d] * blot.basis_1[j];
                    }
                }
            }
        }
    }
}
