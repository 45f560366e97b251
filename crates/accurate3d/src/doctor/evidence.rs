use accurate_geom::nalgebra::{Matrix3, Point2 as P2};
use accurate_geom::{
    Camera, LengthUnit, Pixel, Point2, Point3, Polyline2, Rig, Triangulation, Triangulator, View,
    View1, View2, sampson_distance,
};
use accurate_match::{FreeMatchParams, FreeMatcher};

use super::DoctorError;

/// What both views show of the same body, in recorded pixels: nothing is undistorted yet.
#[derive(Debug, Clone, PartialEq)]
pub enum Seen {
    /// Points of which it is known which belong together: beads, landmarks, tips.
    Matched(Vec<[Point2; 2]>),
    /// Ordered curves; which point belongs to which is not known. Each pair in either direction, and
    /// either view may see more of it.
    Curves(Vec<[Vec<Point2>; 2]>),
}

/// Fewest matched points that a verdict can stand on.
pub(super) const LEAST_MATCHED: usize = 8;
/// More matched points than this do not make a verdict surer: errors of a calibration are common to
/// all of them.
const MOST_INDEPENDENT: f64 = 200.0;
/// Samples of the longest curve.
const CURVE_SAMPLES: f64 = 250.0;
/// Neighbouring samples of a curve that err together.
const SAMPLES_TOGETHER: f64 = 10.0;
/// Longest curve for the diagonal of its box. Of the generated families helices are the longest (9.3 at
/// most of 120 curves); `n` shuffled points reach about `0.35 n`, so of fewer than 60 nothing is known. In
/// samples of so long a curve the picture is a few samples wide, and anything goes with anything.
pub const MOST_TANGLED: f64 = 20.0;
/// Scale of the errors that the matcher's prices are made for, in samples.
const CURVE_ERROR: f64 = 0.3;
/// Share of the smallest residuals that is taken for good matches.
const TRIMMED: f64 = 0.8;
/// Residuals below this are taken as equal, px: exact data must not decide by rounding.
const FLOOR_PX: f64 = 0.02;

/// How well two cameras explain what was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Explains {
    /// Matched points: root mean square Sampson distance of the best 80 %, px. Curves: mean cost of
    /// the match per point, px.
    pub residual_px: f64,
    /// Share of what was matched that lies in front of both cameras.
    pub in_front: f64,
    /// Minus the log likelihood, up to a constant.
    pub nats: f64,
    /// Median depth before both cameras, world unit; 0 if nothing is in front.
    pub depth: f64,
}

/// What was seen, ready to be explained many times.
pub(super) enum Evidence {
    Matched(Vec<[Point2; 2]>),
    /// Curves one sample apart, in units of `px` pixels.
    Curves {
        curves: Vec<[Vec<Point2>; 2]>,
        px: f64,
    },
}

impl Evidence {
    /// # Errors
    /// Too little to judge by, or a pixel that is not finite.
    pub(super) fn of(seen: &Seen) -> Result<Self, DoctorError> {
        match seen {
            Seen::Matched(pairs) => {
                if pairs.len() < LEAST_MATCHED {
                    let (found, needed) = (pairs.len(), LEAST_MATCHED);
                    return Err(DoctorError::TooFewPoints { found, needed });
                }
                if let Some(index) = pairs.iter().position(|p| !p.iter().all(is_finite)) {
                    return Err(DoctorError::NotFinite { index });
                }
                Ok(Self::Matched(pairs.clone()))
            }
            Seen::Curves(curves) => {
                if curves.is_empty() {
                    return Err(DoctorError::TooFewPoints { found: 0, needed: 2 });
                }
                let mut longest: f64 = 0.0;
                let mut lines = Vec::with_capacity(curves.len());
                for (index, pair) in curves.iter().enumerate() {
                    let mut line =
                        |view: u8, points: &Vec<Point2>| -> Result<Polyline2, DoctorError> {
                            if let Some(index) = points.iter().position(|p| !is_finite(p)) {
                                return Err(DoctorError::NotFinite { index });
                            }
                            let line = Polyline2::new(points.clone())?;
                            if !(line.length() > 0.0) {
                                return Err(DoctorError::TooFewPoints { found: 1, needed: 2 });
                            }
                            let times = line.length() / line.bounding_box_diagonal();
                            if times > MOST_TANGLED {
                                let curve = index + 1;
                                return Err(DoctorError::Tangled { curve, view, times });
                            }
                            longest = longest.max(line.length());
                            Ok(line)
                        };
                    lines.push([line(1, &pair[0])?, line(2, &pair[1])?]);
                }
                let px = (longest / CURVE_SAMPLES).max(1.0);
                let sampled = |line: &Polyline2| -> Result<Vec<Point2>, DoctorError> {
                    let line = line.resample(px)?;
                    Ok(line.points().iter().map(|p| P2::from(p.coords / px)).collect())
                };
                let curves = lines
                    .iter()
                    .map(|[a, b]| Ok([sampled(a)?, sampled(b)?]))
                    .collect::<Result<_, DoctorError>>()?;
                Ok(Self::Curves { curves, px })
            }
        }
    }

    /// Whether positions are known well enough for shifts below a pixel.
    pub(super) const fn is_matched(&self) -> bool {
        matches!(self, Self::Matched(_))
    }

    /// Matched points, or samples of curves.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Matched(pairs) => pairs.len(),
            Self::Curves { curves, .. } => curves.iter().map(|c| c[0].len() + c[1].len()).sum(),
        }
    }

    /// How well `cameras` explain it; `None` if they are no rig or their lens cannot be undone.
    pub(super) fn explained_by(&self, cameras: &[Camera; 2]) -> Option<Explains> {
        match self {
            Self::Matched(pairs) => matched(pairs, cameras),
            Self::Curves { curves, px } => {
                let [one, two] = [scaled(&cameras[0], *px)?, scaled(&cameras[1], *px)?];
                matched_curves(curves, &[one, two], *px)
            }
        }
    }
}

fn is_finite(p: &Point2) -> bool {
    p.x.is_finite() && p.y.is_finite()
}

pub(super) fn freed<V: View>(camera: &Camera, point: &Point2) -> Option<Pixel<V>> {
    camera.undistort(point).ok().map(Pixel::from)
}

fn matched(pairs: &[[Point2; 2]], cameras: &[Camera; 2]) -> Option<Explains> {
    let rig = Rig::new(cameras[0].clone(), cameras[1].clone(), LengthUnit::Unit).ok()?;
    let triangulator = Triangulator::new(&rig, Triangulation::Midpoint);
    let mut distances = Vec::with_capacity(pairs.len());
    let mut depths = Vec::with_capacity(pairs.len());
    for [p1, p2] in pairs {
        let (p1, p2) = (freed(&cameras[0], p1)?, freed(&cameras[1], p2)?);
        distances.push(sampson_distance(rig.fundamental(), p1, p2).unwrap_or(f64::MAX));
        if let Ok(x) = triangulator.triangulate(p1, p2) {
            depths.extend(depth_in_front(cameras, &x));
        }
    }
    distances.sort_unstable_by(f64::total_cmp);
    let kept = ((TRIMMED * pairs.len() as f64).ceil() as usize).max(1);
    let square = distances[..kept].iter().map(|d| d * d).sum::<f64>() / kept as f64;
    let residual_px = square.sqrt();
    if !residual_px.is_finite() {
        return None;
    }
    let nats = (kept as f64).min(MOST_INDEPENDENT) * residual_px.max(FLOOR_PX).ln();
    let in_front = depths.len() as f64 / pairs.len() as f64;
    Some(Explains { residual_px, in_front, nats, depth: median(depths) })
}

fn matched_curves(curves: &[[Vec<Point2>; 2]], cameras: &[Camera; 2], px: f64) -> Option<Explains> {
    let rig = Rig::new(cameras[0].clone(), cameras[1].clone(), LengthUnit::Unit).ok()?;
    let matcher = FreeMatcher::new(FreeMatchParams::DEFAULT);
    let (mut cost, mut samples, mut matched, mut dropped) = (0.0, 0.0, 0, 0);
    let mut depths = Vec::new();
    for [points1, points2] in curves {
        let points1: Vec<Pixel<View1>> =
            points1.iter().map(|p| freed(&cameras[0], p)).collect::<Option<_>>()?;
        let points2: Vec<Pixel<View2>> =
            points2.iter().map(|p| freed(&cameras[1], p)).collect::<Option<_>>()?;
        let count = (points1.len() + points2.len()) as f64;
        samples += count;
        // Curves that cannot be matched at all cost what leaving every point out costs.
        match matcher.match_best_direction(&points1, &points2, &rig) {
            Ok(found) => {
                cost += found.mean_cost_px * count;
                let seen = found.points.iter().filter_map(|p| depth_in_front(cameras, &p.position));
                depths.extend(seen);
                matched += found.points.len() + found.dropped;
                dropped += found.dropped;
            }
            Err(_) => cost += FreeMatchParams::DEFAULT.prices.end_skip * count,
        }
    }
    let mean = cost / samples;
    let in_front = if matched == 0 { 0.0 } else { 1.0 - dropped as f64 / matched as f64 };
    let nats = samples / SAMPLES_TOGETHER * mean / CURVE_ERROR;
    Some(Explains { residual_px: mean * px, in_front, nats, depth: median(depths) })
}

/// The mean depth of a point before both cameras, if it is in front of both.
fn depth_in_front(cameras: &[Camera; 2], x: &Point3) -> Option<f64> {
    let [a, b] = [cameras[0].depth(x), cameras[1].depth(x)];
    (a > 0.0 && b > 0.0).then_some(0.5 * (a + b))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The camera for pixels counted in units of `px`.
pub(super) fn scaled(camera: &Camera, px: f64) -> Option<Camera> {
    let mut scale = Matrix3::identity() / px;
    scale[(2, 2)] = 1.0;
    camera.with_matrices(scale * camera.k(), *camera.r(), *camera.t()).ok()
}
