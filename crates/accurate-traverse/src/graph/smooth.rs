//! Pixel chains to smooth polylines.

use accurate_geom::{GeomError, Point2, Polyline2};
use nalgebra::Vector2;

/// A chain of pixels as a smooth polyline of points about 1 px apart, with the radius at each.
///
/// Resampled and smoothed by a Gaussian once per entry of `sigmas` (in samples, that is px). The
/// ends stay where they are: beyond them the chain goes on point-reflected. The chain read backwards
/// gives the polyline backwards.
pub(super) fn smooth(
    points: &[Point2],
    radii: &[f64],
    sigmas: [f64; 2],
) -> Result<(Vec<Point2>, Vec<f64>), GeomError> {
    let mut line = Polyline2::new(points.to_vec())?;
    for sigma in sigmas {
        line = Polyline2::new(gaussian(line.resample(1.0)?.points(), sigma))?;
    }
    let line = line.resample(1.0)?;
    let radii = spread(points, radii, line.points());
    Ok((line.points().to_vec(), radii))
}

fn gaussian(points: &[Point2], sigma: f64) -> Vec<Point2> {
    let n = points.len();
    if n < 3 || sigma == 0.0 {
        return points.to_vec();
    }
    // Beyond three standard deviations is less than 0.3 % of the weight.
    let reach = ((3.0 * sigma).ceil() as usize).min(n - 1);
    let kernel: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total = kernel[0] + 2.0 * kernel[1..].iter().sum::<f64>();
    let at = |k: isize| -> Vector2<f64> {
        if k < 0 {
            points[0].coords * 2.0 - points[k.unsigned_abs()].coords
        } else if k as usize >= n {
            points[n - 1].coords * 2.0 - points[2 * (n - 1) - k as usize].coords
        } else {
            points[k as usize].coords
        }
    };
    let mut smoothed: Vec<Point2> = (0..n as isize)
        .map(|i| {
            let mut sum = at(i) * kernel[0];
            for (k, weight) in kernel.iter().enumerate().skip(1) {
                sum += (at(i - k as isize) + at(i + k as isize)) * *weight;
            }
            Point2::from(sum / total)
        })
        .collect();
    // The reflection keeps the ends up to rounding; this keeps them.
    smoothed[0] = points[0];
    smoothed[n - 1] = points[n - 1];
    smoothed
}

/// Radii of the chain at the points of the polyline, by the share of the length: the polyline is a
/// little shorter, everywhere alike.
fn spread(points: &[Point2], radii: &[f64], line: &[Point2]) -> Vec<f64> {
    let mut arc = vec![0.0];
    for pair in points.windows(2) {
        arc.push(arc[arc.len() - 1] + (pair[1] - pair[0]).norm());
    }
    let length = arc[arc.len() - 1];
    let mut k = 0;
    (0..line.len())
        .map(|i| {
            let s = length * i as f64 / (line.len() - 1).max(1) as f64;
            while k + 2 < arc.len() && arc[k + 1] <= s {
                k += 1;
            }
            let span = arc.get(k + 1).map_or(0.0, |end| end - arc[k]);
            let t = if span > 0.0 { ((s - arc[k]) / span).clamp(0.0, 1.0) } else { 0.0 };
            radii[k] + (radii[(k + 1).min(radii.len() - 1)] - radii[k]) * t
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digital_line_becomes_straight_and_keeps_its_ends() {
        let points: Vec<_> =
            (0..60).map(|x| Point2::new(f64::from(x), (f64::from(x) * 0.3).round())).collect();
        let (line, radii) = smooth(&points, &vec![2.0; 60], [1.5, 1.0]).unwrap();
        assert_eq!(line[0], points[0]);
        assert_eq!(line[line.len() - 1], points[59]);
        for p in &line[8..line.len() - 8] {
            // The chain is off by up to half a pixel; together the Gaussians average over about 4.5
            // px (2 sqrt(pi) sigma with sigma² = 1.5² + 1), more than the 10/3 px of a step.
            assert!((p.y - 0.3 * p.x).abs() < 0.25, "{p}");
        }
        assert!(radii.iter().all(|&r| r == 2.0));
        assert_eq!(radii.len(), line.len());
    }

    #[test]
    fn two_points_stay() {
        let points = [Point2::new(0.0, 0.0), Point2::new(0.6, 0.0)];
        assert_eq!(smooth(&points, &[1.0, 3.0], [1.5, 1.0]).unwrap().0, points);
    }
}
