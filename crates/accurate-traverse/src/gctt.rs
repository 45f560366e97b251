use accurate_geom::{Pixel, View};

use crate::curvature::CurvatureRows;
use crate::skeleton::Skeleton;
use crate::{Trace, TraverseError, TraverseParams};

/// Orders the pixels of one skeleton, starting at `start`.
///
/// From the current point the nearest non-empty square of unvisited pixels is searched, half side
/// `radius_min_px` to `max_gap_px`; of its pixels the one of least loss
/// `κ + angle_weight (1 - cos) + distance_weight ‖step‖` comes next. The walk ends when no unvisited
/// pixel is within `max_gap_px`. `skeleton` may be in any order: the result does not depend on it.
///
/// # Errors
/// [`TraverseError::StartNotOnSkeleton`]; what [`endpoints`](crate::endpoints) refuses;
/// [`TraverseError::InvalidParameter`].
///
/// # Source
/// ACCURATE, section 2.2, the loss L(q). The paper is silent on ties: candidates are looked at by
/// row, then column, and the first of equal loss wins. Pixels passed over by a step stay unvisited,
/// as published; at the far end the walk may therefore turn back to them. [`Trace::jumps`] and
/// [`Trace::coverage`] tell when it did.
///
/// # Cost
/// O(N (|C| + m + r log N)) time for N pixels with |C| candidates each, O(N + height) memory.
pub fn trace_from<V: View>(
    skeleton: &[Pixel<V>],
    start: Pixel<V>,
    params: &TraverseParams,
) -> Result<Trace<V>, TraverseError> {
    params.validate()?;
    let skeleton = Skeleton::new(skeleton)?;
    let first = skeleton.find(start).ok_or(TraverseError::StartNotOnSkeleton {
        view: V::NUMBER,
        x: start.x,
        y: start.y,
    })?;
    Ok(walk(&skeleton, first, params))
}

/// Orders the pixels of one skeleton, starting at its first endpoint in raster order: for a single
/// view, where no other one helps to choose.
///
/// # Errors
/// [`TraverseError::NoEndpoint`] for a closed curve; otherwise as [`trace_from`].
pub fn trace_single<V: View>(
    skeleton: &[Pixel<V>],
    params: &TraverseParams,
) -> Result<Trace<V>, TraverseError> {
    params.validate()?;
    let skeleton = Skeleton::new(skeleton)?;
    let no_endpoint = TraverseError::NoEndpoint { view: V::NUMBER, found: skeleton.len() };
    let first = skeleton.endpoints().into_iter().next().ok_or(no_endpoint)?;
    Ok(walk(&skeleton, first, params))
}

/// The walk itself, for valid parameters.
pub(crate) fn walk<V: View>(
    skeleton: &Skeleton<V>,
    first: usize,
    params: &TraverseParams,
) -> Trace<V> {
    // A window never holds more points than the trace.
    let rows = CurvatureRows::new(params.curvature_window.min(skeleton.len()));
    let mut visited = vec![false; skeleton.len()];
    let mut order = vec![first];
    let mut candidates = Vec::new();
    let mut window = Vec::new();
    let mut here = first;
    visited[first] = true;
    loop {
        find_candidates(skeleton, here, &visited, params, &mut candidates);
        here = match candidates[..] {
            [] => break,
            [only] => only,
            _ => cheapest(skeleton, &order, &candidates, &rows, params, &mut window),
        };
        visited[here] = true;
        order.push(here);
    }
    Trace::new(skeleton, &order)
}

/// The unvisited pixels of the first non-empty square around `here`, in raster order.
fn find_candidates<V: View>(
    skeleton: &Skeleton<V>,
    here: usize,
    visited: &[bool],
    params: &TraverseParams,
    candidates: &mut Vec<usize>,
) {
    let unvisited = |radius| skeleton.square(here, radius).filter(|&id| !visited[id]);
    candidates.clear();
    candidates.extend(unvisited(params.radius_min_px));
    if candidates.is_empty() {
        // Growing the square by one pixel at a time stops at the distance of the nearest pixel.
        let (x, y) = skeleton.xy(here);
        let distance = |id: usize| {
            let (x_id, y_id) = skeleton.xy(id);
            x_id.abs_diff(x).max(y_id.abs_diff(y))
        };
        if let Some(nearest) = unvisited(params.max_gap_px).map(distance).min() {
            candidates.extend(unvisited(nearest));
        }
    }
}

/// The candidate of least loss, the first of equal ones. `order` and `candidates` are not empty.
fn cheapest<V: View>(
    skeleton: &Skeleton<V>,
    order: &[usize],
    candidates: &[usize],
    rows: &CurvatureRows,
    params: &TraverseParams,
    window: &mut Vec<[f64; 2]>,
) -> usize {
    let here = order[order.len() - 1];
    let (x, y) = skeleton.xy(here);
    // Relative to the current point everything is a small whole number: translating the image
    // changes no bit of the loss.
    let offset = |id: usize| {
        let (x_id, y_id) = skeleton.xy(id);
        [f64::from(x_id - x), f64::from(y_id - y)]
    };
    window.clear();
    let oldest = order.len().saturating_sub(params.curvature_window);
    window.extend(order[oldest..].iter().map(|&id| offset(id)));
    let sums = rows.window_sums(window);
    let heading = (order.len() > 1).then(|| {
        let [dx, dy] = offset(order[order.len() - 2]);
        [-dx, -dy]
    });

    let mut best = candidates[0];
    let mut least = f64::INFINITY;
    for &id in candidates {
        let step = offset(id);
        let curvature = sums.map_or(0.0, |sums| sums.curvature(step));
        let angle = heading.map_or(0.0, |heading| one_minus_cosine(heading, step));
        let distance = params.distance_norm.length(step[0], step[1]);
        let loss = curvature + params.angle_weight * angle + params.distance_weight * distance;
        if loss < least {
            (best, least) = (id, loss);
        }
    }
    best
}

/// `1 - cos` of the angle between two steps, with the published constant in the denominator.
fn one_minus_cosine(a: [f64; 2], b: [f64; 2]) -> f64 {
    let norm = |v: [f64; 2]| (v[0] * v[0] + v[1] * v[1]).sqrt();
    1.0 - (a[0] * b[0] + a[1] * b[1]) / (norm(a) * norm(b) + 1e-8)
}
