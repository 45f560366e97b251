use accurate_fit::CurveCovariance;
use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Curve3, EpipolarAngle, Rig};
use accurate_match::{CurvePoint, MatchError, TangencyParams, tangency_sines1, tangency_sines2};

/// Distance of the points of a fitted curve in the image, px: a metric of points, as the published
/// one, adds at most half of it to what it measures.
const OUTPUT_SPACING_PX: f64 = 0.2;

/// A fitted curve as points with their projections, and the covariance of each.
pub(crate) struct SampledCurve {
    pub(crate) points: Vec<CurvePoint>,
    pub(crate) covariances: Option<Vec<Matrix3<f64>>>,
}

/// Samples a fitted curve at equal arc lengths.
pub(crate) fn sampled(
    curve: &Curve3,
    covariance: Option<&CurveCovariance>,
    rig: &Rig,
) -> SampledCurve {
    let (from, to) = curve.domain();
    let coarse: Vec<_> = (0..=64)
        .filter_map(|k| rig.project(&curve.at(from + (to - from) * f64::from(k) / 64.0)).ok())
        .collect();
    // The spacing need not be exact, and these chords miss little of the length.
    let (mut length1, mut length2) = (0.0, 0.0);
    for w in coarse.windows(2) {
        length1 += w[0].0.distance(w[1].0);
        length2 += w[0].1.distance(w[1].1);
    }
    let longest = f64::max(length1, length2);
    let count = (longest / OUTPUT_SPACING_PX).ceil().clamp(2.0, 65_536.0) as usize;
    let (mut points, mut covariances) = (Vec::with_capacity(count), Vec::new());
    for t in curve.uniform_parameters(count) {
        let position = curve.at(t);
        // A fit in front of both cameras was promised; a point that is not has no picture.
        let Ok((pixel1, pixel2)) = rig.project(&position) else { continue };
        points.push(CurvePoint { position, pixel1, pixel2, epipolar_distance_px: 0.0 });
        covariances.extend(covariance.map(|covariance| covariance.at(t)));
    }
    SampledCurve { points, covariances: covariance.is_some().then_some(covariances) }
}

/// Sine of the angle between curve and epipolar line below which a depth is carried over.
const ALONG_LINE_SINE: f64 = 0.1;

/// Whether the curve runs along an epipolar line at each point, in either view.
pub(crate) fn along_epipolar_lines(
    points: &[CurvePoint],
    rig: &Rig,
) -> Result<Vec<bool>, MatchError> {
    let angles = EpipolarAngle::new(rig);
    let curve1: Vec<_> = points.iter().map(|p| p.pixel1).collect();
    let curve2: Vec<_> = points.iter().map(|p| p.pixel2).collect();
    let window_px = TangencyParams::WHOLE_PIXELS.window_px;
    let sines1 = tangency_sines1(&angles, &curve1, window_px)?;
    let sines2 = tangency_sines2(&angles, &curve2, window_px)?;
    Ok(sines1.iter().zip(&sines2).map(|(a, b)| a.min(*b) < ALONG_LINE_SINE).collect())
}
