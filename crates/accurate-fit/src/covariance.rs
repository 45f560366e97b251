use accurate_geom::Curve3;
use accurate_geom::nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector3};

use crate::uniform_spline::{UniformSpline, basis};

/// How uncertain a fitted curve is, point by point.
///
/// The curve is the most probable one given the data and a prior on its bending whose strength was
/// estimated from the same data, so the covariance `σ² B H⁻¹ Bᵀ` (with the prior in `H`) also counts
/// what smoothing may have taken away: the bias is a draw from the prior.
///
/// Right topology and calibration are taken for granted. Calibrated over many kinds of curve: where
/// the true curve is smooth the ellipses are too large (they hold it 98 % of the time instead of 95),
/// where its curvature jumps, or exact points leave the spline's own error alone, too small (down to
/// 75 to 85 %). `cargo run -p accurate-fit --example coverage` measures it.
#[derive(Debug, Clone)]
pub struct CurveCovariance {
    /// Per control point: its covariance with itself and the next three.
    blocks: Vec<[Matrix3<f64>; 4]>,
}

impl CurveCovariance {
    /// From the covariance of control points that share a span.
    pub(crate) fn new(controls: usize, block: impl Fn(usize, usize) -> Matrix3<f64>) -> Self {
        let within = |i, j| if j < controls { block(i, j) } else { Matrix3::zeros() };
        let blocks = (0..controls).map(|i| [0, 1, 2, 3].map(|k| within(i, i + k))).collect();
        Self { blocks }
    }

    /// The covariance of the curve's point at parameter `t` of the fitted curve's domain
    /// (values outside are cut to it), squared world unit.
    ///
    /// Its part along the curve's tangent is an uncertainty of the parametrisation, which moves
    /// points on the curve, not the curve (except at its ends).
    pub fn at(&self, t: f64) -> Matrix3<f64> {
        let (span, offset) = UniformSpline::locate_in(self.blocks.len() - 3, t);
        let weights = basis(offset);
        let mut sum = Matrix3::zeros();
        for i in 0..4 {
            sum += self.blocks[span + i][0] * (weights[i] * weights[i]);
            for j in i + 1..4 {
                let block = &self.blocks[span + i][j - i];
                sum += (block + block.transpose()) * (weights[i] * weights[j]);
            }
        }
        sum
    }

    /// Two unit vectors across `curve` (the fit this covariance belongs to) at `t`, and the
    /// covariance of the curve's position in their plane: an ellipse of `chi² = 5.99` in it is passed
    /// by the true curve with probability 95 %.
    pub fn across(&self, curve: &Curve3, t: f64) -> ([Vector3<f64>; 2], Matrix2<f64>) {
        let tangent = curve.derivative(t);
        // Any direction across will do for a curve that stands still.
        let tangent = tangent.try_normalize(0.0).unwrap_or_else(Vector3::x);
        // The axis least along the tangent.
        let helper = Vector3::ith(tangent.iamin(), 1.0);
        let first = tangent.cross(&helper).normalize();
        let second = tangent.cross(&first);
        let plane = Matrix3x2::from_columns(&[first, second]);
        ([first, second], plane.transpose() * self.at(t) * plane)
    }
}
