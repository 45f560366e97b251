use accurate_fit::CurveCovariance;
use accurate_geom::nalgebra::{self, Matrix3};
use accurate_geom::{Curve3, EpipolarAngle, Point3, Rig};
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
    let count = count_between(curve, curve.domain(), rig);
    let parameters = curve.uniform_parameters(count).into_iter();
    at(parameters.map(|t| (curve.at(t), t)), covariance, rig)
}

/// Samples a closed curve that was fitted as an open one, which goes on beyond once around: from the
/// middle of where it overlaps with its end once around. What was cut open is blended over half of
/// that overlap. The last point repeats the first.
pub(crate) fn sampled_ring(
    curve: &Curve3,
    covariance: Option<&CurveCovariance>,
    rig: &Rig,
) -> SampledCurve {
    let (begin, end) = curve.domain();
    let middle = 0.5 * (begin + end);
    let nearest = |point: Point3, from: f64, to: f64| {
        let fine = |from: f64, to: f64| {
            (0..=SEARCHED).map(move |k| from + (to - from) * f64::from(k) / f64::from(SEARCHED))
        };
        let distance = |t: &f64| nalgebra::distance_squared(&curve.at(*t), &point);
        let by_distance = |a: &f64, b: &f64| distance(a).total_cmp(&distance(b));
        let t = fine(from, to).min_by(by_distance).unwrap_or(from);
        let step = (to - from) / f64::from(SEARCHED);
        fine((t - step).max(from), (t + step).min(to)).min_by(by_distance).unwrap_or(t)
    };
    let overlap_end = nearest(curve.at(end), begin, middle);
    let from = 0.5 * (begin + overlap_end);
    let to = nearest(curve.at(from), middle, end);
    let (period, blended) = (to - from, 0.5 * (from - begin));
    let count = count_between(curve, (from, to), rig);
    let parameters = (0..=count).map(|k| from + period * k as f64 / count as f64);
    let placed = parameters.map(|t| {
        // What goes on before the begin is the same stretch of the body as the end.
        let s = if blended > 0.0 { ((t - to + blended) / blended).max(0.0) } else { 0.0 };
        let weight = s * s * (3.0 - 2.0 * s);
        let here = curve.at(t);
        let position = here + (curve.at(t - period) - here) * weight;
        (position, if weight > 0.5 { t - period } else { t })
    });
    let mut ring = at(placed, covariance, rig);
    // The blend ends on the first point up to rounding; a closed curve ends on it exactly.
    if let Some(first) = ring.points.first().copied()
        && let Some(last) = ring.points.last_mut()
    {
        *last = first;
    }
    ring
}

/// Places at which the other pass of a ring is looked for, and again between two of them.
const SEARCHED: u32 = 512;

/// How many points lie at the output's distance, nearly, between two parameters.
fn count_between(curve: &Curve3, (from, to): (f64, f64), rig: &Rig) -> usize {
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
    (longest / OUTPUT_SPACING_PX).ceil().clamp(2.0, 65_536.0) as usize
}

/// Points with the parameters that their covariances belong to.
fn at(
    placed: impl Iterator<Item = (Point3, f64)>,
    covariance: Option<&CurveCovariance>,
    rig: &Rig,
) -> SampledCurve {
    let (mut points, mut covariances) = (Vec::new(), Vec::new());
    for (position, t) in placed {
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
