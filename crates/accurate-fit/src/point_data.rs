use accurate_geom::{
    GeomError, Pixel, Point3, Rig, Triangulation, Triangulator, View, View1, View2,
    epipolar_distance,
};

use crate::{FitError, PointFitParams};

/// Ordered points of one view, without their view.
#[derive(Debug, Clone)]
pub(crate) struct PointData {
    pub(crate) points: Vec<[f64; 2]>,
    /// Whether the first and the last point may lie beyond the fitted curve.
    pub(crate) free: [bool; 2],
    /// Place of each point along the body, px: the mean arc length of both views.
    pub(crate) arc_px: Vec<f64>,
}

/// Points to start from: triangulated pairs and their places along the body.
#[derive(Debug, Clone)]
pub(crate) struct Matched {
    pub(crate) data: [PointData; 2],
    pub(crate) points: Vec<Point3>,
    pub(crate) arc_px: Vec<f64>,
    pub(crate) mean_distance_px: f64,
    pub(crate) coverage: f64,
}

/// Checks curves and pairs, and refuses a match that is not good enough to be refined.
pub(crate) fn matched(
    curve1: &[Pixel<View1>],
    curve2: &[Pixel<View2>],
    pairs: &[(usize, usize)],
    rig: &Rig,
    params: &PointFitParams,
) -> Result<Matched, FitError> {
    let arc1 = arc_lengths(curve1, "point of curve 1")?;
    let arc2 = arc_lengths(curve2, "point of curve 2")?;
    if pairs.len() < 4 {
        return Err(FitError::TooFewPoints {
            what: "matched pairs",
            found: pairs.len(),
            needed: 4,
        });
    }
    let (n1, n2) = (curve1.len(), curve2.len());
    let mut previous = (0, 0);
    for (index, &(i, j)) in pairs.iter().enumerate() {
        if i >= n1 || j >= n2 || i < previous.0 || j < previous.1 {
            return Err(FitError::BadPair { index, pair: (i, j), lengths: (n1, n2) });
        }
        previous = (i, j);
    }

    let triangulator = Triangulator::new(rig, Triangulation::LindstromNiter2);
    let mut distances = 0.0;
    let mut points = Vec::with_capacity(pairs.len());
    let mut arc_px = Vec::with_capacity(pairs.len());
    for &(i, j) in pairs {
        // A pair at an epipole or behind a camera is no point to start from, but no reason to stop.
        let usable = epipolar_distance(rig.fundamental(), curve1[i], curve2[j])
            .and_then(|d| Ok((d, triangulator.triangulate(curve1[i], curve2[j])?)));
        match usable {
            Ok((distance, point)) => {
                distances += distance;
                points.push(point);
                arc_px.push(0.5 * (arc1[i] + arc2[j]));
            }
            Err(GeomError::NotFinite { what, value }) => {
                return Err(GeomError::NotFinite { what, value }.into());
            }
            Err(_) => {}
        }
    }
    if points.len() < 4 {
        let found = points.len();
        return Err(FitError::TooFewPoints { what: "triangulated pairs", found, needed: 4 });
    }
    let mean_distance_px = distances / points.len() as f64;
    let coverage = f64::min(
        covered(pairs.iter().map(|p| p.0), n1, params.free_ends[0]),
        covered(pairs.iter().map(|p| p.1), n2, params.free_ends[1]),
    );
    // A calibration that is still to be found moves all points of a view off their lines.
    let off_px = params.calibration.map_or(0.0, |priors| 3.0 * priors.shift_sigma_px);
    let max_distance_px = params.max_mean_distance_px + off_px;
    // The comparisons are false for NaN, too.
    if !(mean_distance_px <= max_distance_px && coverage >= params.min_coverage) {
        return Err(FitError::BadMatch {
            mean_distance_px,
            max_distance_px,
            coverage,
            min_coverage: params.min_coverage,
        });
    }

    let place1 = places(pairs.iter().map(|&(i, j)| (i, 0.5 * (arc1[i] + arc2[j]))), &arc1);
    let place2 = places(pairs.iter().map(|&(i, j)| (j, 0.5 * (arc1[i] + arc2[j]))), &arc2);
    let data = [
        PointData { points: flat(curve1), free: params.free_ends[0], arc_px: place1 },
        PointData { points: flat(curve2), free: params.free_ends[1], arc_px: place2 },
    ];
    Ok(Matched { data, points, arc_px, mean_distance_px, coverage })
}

fn flat<V: View>(curve: &[Pixel<V>]) -> Vec<[f64; 2]> {
    curve.iter().map(|p| [p.x, p.y]).collect()
}

fn arc_lengths<V: View>(curve: &[Pixel<V>], what: &'static str) -> Result<Vec<f64>, FitError> {
    if curve.len() < 4 {
        return Err(FitError::TooFewPoints { what, found: curve.len(), needed: 4 });
    }
    let mut arc = Vec::with_capacity(curve.len());
    let mut total = 0.0;
    for (index, p) in curve.iter().enumerate() {
        if !p.is_finite() {
            return Err(FitError::NotFinite { what, index });
        }
        if index > 0 {
            total += p.distance(curve[index - 1]);
        }
        arc.push(total);
    }
    Ok(arc)
}

/// Fraction of a curve's points that have a partner, not counting the tails of free ends.
fn covered(indices: impl Iterator<Item = usize> + Clone, count: usize, free: [bool; 2]) -> f64 {
    let first = if free[0] { indices.clone().min().unwrap_or(0) } else { 0 };
    let last = if free[1] { indices.clone().max().unwrap_or(0) } else { count - 1 };
    let mut seen = vec![false; count];
    for i in indices {
        seen[i] = true;
    }
    let matched = seen[first..=last].iter().filter(|s| **s).count();
    matched as f64 / (last - first + 1) as f64
}

/// Place along the body of every point of a view: the mean over its pairs, linear in the view's own
/// arc length between them and of unit rate beyond.
fn places(pairs: impl Iterator<Item = (usize, f64)>, arc: &[f64]) -> Vec<f64> {
    // (index, sum, count) of the points with partners, in order.
    let mut known: Vec<(usize, f64, f64)> = Vec::new();
    for (i, s) in pairs {
        match known.last_mut() {
            Some(last) if last.0 == i => {
                last.1 += s;
                last.2 += 1.0;
            }
            _ => known.push((i, s, 1.0)),
        }
    }
    let mut places = vec![0.0; arc.len()];
    let mut next = 0;
    for (i, place) in places.iter_mut().enumerate() {
        while next < known.len() && known[next].0 < i {
            next += 1;
        }
        let at = |k: usize| (arc[known[k].0], known[k].1 / known[k].2);
        *place = if next == known.len() {
            let (a, s) = at(next - 1);
            s + arc[i] - a
        } else if known[next].0 == i {
            at(next).1
        } else if next == 0 {
            let (a, s) = at(0);
            s + arc[i] - a
        } else {
            let ((a0, s0), (a1, s1)) = (at(next - 1), at(next));
            let share = if a1 > a0 { (arc[i] - a0) / (a1 - a0) } else { 0.0 };
            s0 + (s1 - s0) * share
        };
    }
    places
}
