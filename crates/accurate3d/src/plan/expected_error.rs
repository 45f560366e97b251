use accurate_geom::nalgebra::{Matrix2, Matrix2x3, Matrix3, RowVector3, Vector3};
use accurate_geom::{Camera, Point3};

use super::PlanParams;

/// What the curve itself says about its place where no view does: it lies within this share of its
/// length of where its neighbourhood leads it.
const PRIOR_SHARE: f64 = 0.05;

/// The error expected along a curve, world unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ExpectedError {
    pub mean: f64,
    pub max: f64,
}

/// The error across the tangent to expect if both views measure the curve across its images with
/// `sigma_px`; `None` if the curve is nowhere measured, as by two views from one place.
///
/// Each view gives one equation per px of its trace, `n J δ = e`, with `J` the Jacobian of the
/// projection, `n` across the image of the tangent and errors independent from px to px. Their
/// information is pooled over the smoothing length, with Gaussian weights, which carries depth across
/// stretches along epipolar lines; a weak prior bounds what is left.
pub(super) fn expected_error(
    shape: &[Point3],
    cameras: [&Camera; 2],
    params: &PlanParams,
) -> Option<ExpectedError> {
    let n = shape.len();
    let apart = (cameras[0].centre() - cameras[1].centre()).norm();
    // Rounding of the pose is of the order of 1e-15 of the distance.
    if !(apart > 1e-9 * (cameras[0].centre() - shape.first()?).norm()) {
        return None;
    }
    let length: f64 = shape.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    // Unit tangents, and the length that each sample stands for.
    let steps: Vec<(Vector3<f64>, f64)> = (0..n)
        .map(|i| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(n - 1));
            let chord = shape[after] - shape[before];
            let step = chord.norm();
            (chord / step, step / (after - before) as f64)
        })
        .collect();
    let information: Vec<Matrix3<f64>> = shape
        .iter()
        .zip(&steps)
        .map(|(x, (tangent, step))| {
            cameras
                .iter()
                .filter_map(|camera| across(camera, x, tangent))
                .map(|seen| {
                    let points = seen.along_px_per_unit * step;
                    let weight = points / (params.sigma_px * params.sigma_px);
                    seen.across.transpose() * seen.across * weight
                })
                .sum()
        })
        .collect();
    let sigma = params.smoothing_share * (n - 1) as f64;
    let reach = ((3.0 * sigma).ceil() as usize).min(n);
    let prior = 1.0 / (PRIOR_SHARE * length).powi(2);
    let (mut sum, mut max) = (0.0, 0f64);
    for i in 0..n {
        let (mut pooled, mut weights, mut squares) = (Matrix3::zeros(), 0.0, 0.0);
        for j in i.saturating_sub(reach)..(i + reach + 1).min(n) {
            let away = (i as f64 - j as f64) / sigma;
            let weight: f64 = (-0.5 * away * away).exp();
            pooled += information[j] * weight;
            weights += weight;
            squares += weight * weight;
        }
        // A weighted mean of independent errors has the weights' (sum)² / (sum of squares) fold
        // information of one.
        let pooled = pooled * (weights / squares);
        let plane = across_basis(&steps[i].0);
        let in_plane: Matrix2<f64> = plane * pooled * plane.transpose();
        let variance = (in_plane + Matrix2::identity() * prior).try_inverse()?.trace();
        sum += variance.sqrt();
        max = max.max(variance);
    }
    let mean = sum / n as f64;
    // As large as the prior alone: nothing was measured in one direction, all along.
    let unmeasured = (1.0 / prior).sqrt();
    (mean.is_finite() && mean < 0.98 * unmeasured).then(|| ExpectedError { mean, max: max.sqrt() })
}

/// What one view measures of a curve.
struct Seen {
    /// px across the image of the tangent, per world unit in each direction.
    across: RowVector3<f64>,
    /// Length of the image of the tangent, px per world unit.
    along_px_per_unit: f64,
}

fn across(camera: &Camera, x: &Point3, tangent: &Vector3<f64>) -> Option<Seen> {
    let x_cam = camera.r() * x.coords + camera.t();
    if !(x_cam.z > 0.0) {
        return None;
    }
    let p = camera.k() * (x_cam / x_cam.z);
    let m = camera.k() * camera.r();
    let jacobian = Matrix2x3::from_rows(&[
        (m.row(0) - m.row(2) * p.x) / x_cam.z,
        (m.row(1) - m.row(2) * p.y) / x_cam.z,
    ]);
    let along = jacobian * tangent;
    let norm = along.norm();
    // Seen end on: no direction is across.
    if !(norm > 1e-9 * jacobian.norm()) {
        return None;
    }
    let across = (jacobian.row(1) * along.x - jacobian.row(0) * along.y) / norm;
    Some(Seen { across, along_px_per_unit: norm })
}

/// Two unit rows across a unit vector.
fn across_basis(tangent: &Vector3<f64>) -> Matrix2x3<f64> {
    let axis = if tangent.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let a = tangent.cross(&axis).normalize();
    Matrix2x3::from_rows(&[a.transpose(), tangent.cross(&a).transpose()])
}

#[cfg(test)]
mod tests {
    use accurate_geom::ImageSize;

    use super::*;
    use crate::c_arm::arm;

    /// A straight line across both views: closed form. Each view measures one direction `a`, `b` of
    /// the plane across the line, with σ / m px per unit; the covariance's trace is
    /// 2 (σ / m)² / sin² of the angle between them.
    #[test]
    fn a_straight_line_has_the_error_of_the_formula() {
        let k = Matrix3::new(1500.0, 0.0, 250.0, 0.0, 1500.0, 250.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 500, height: 500 };
        let t = Vector3::new(0.0, 0.0, 1000.0);
        let at = |deg: f64| Camera::new(k, arm(deg.to_radians(), 0.0), t, size).unwrap();
        // Along the axis of the turn, short beside the distance.
        let shape: Vec<Point3> =
            (0..50).map(|i| Point3::new(0.0, 0.0, 0.02 * (f64::from(i) - 24.5))).collect();
        // No pooling: every sample stands for the 0.03 px of its own stretch.
        let params = PlanParams { sigma_px: 1e-4, smoothing_share: 1e-3, ..PlanParams::DEFAULT };
        for apart in [20f64, 50.0, 90.0] {
            let found = expected_error(&shape, [&at(0.0), &at(apart)], &params).unwrap();
            let px_per_unit = 1.5;
            let sigma = params.sigma_px / px_per_unit / (0.02f64 * px_per_unit).sqrt();
            let exact = (2.0f64).sqrt() * sigma / apart.to_radians().sin();
            // The prior of 5 % of the length weighs (σ / 0.05)² less, and perspective over half a
            // unit at 1000 changes scales by less than 1e-3.
            assert!((found.mean / exact - 1.0).abs() < 2e-3, "{apart}: {} {exact}", found.mean);
        }
    }
}
