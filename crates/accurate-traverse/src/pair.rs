use accurate_geom::{Fundamental, Pixel, View, View1, View2};

use crate::gctt::walk;
use crate::skeleton::Skeleton;
use crate::{Trace, TraverseError, TraverseParams};

/// The endpoints of two views that fit one another best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartPair {
    /// Endpoint of view 1.
    pub start1: Pixel<View1>,
    /// Endpoint of view 2.
    pub start2: Pixel<View2>,
    /// Distance in view 1 of `start1` to the epipolar line of `start2`, px.
    pub epipolar_distance_px: f64,
}

/// Orders the skeletons of both views, starting at the pair of endpoints that fit one another best.
///
/// Each skeleton may be in any order. See [`trace_from`](crate::trace_from) for the walk and
/// [`start_pair`] for the start.
///
/// # Errors
/// [`TraverseError::NoEndpoint`] if a view has none (a closed curve); otherwise as [`start_pair`] and
/// [`trace_from`](crate::trace_from).
///
/// # Source
/// ACCURATE, section 2.2.
///
/// # Cost
/// That of two walks, and O(E1 E2) for E1 and E2 endpoints.
pub fn trace_pair(
    skeleton1: &[Pixel<View1>],
    skeleton2: &[Pixel<View2>],
    f: &Fundamental<View1, View2>,
    params: &TraverseParams,
) -> Result<(Trace<View1>, Trace<View2>), TraverseError> {
    params.validate()?;
    let skeleton1 = Skeleton::new(skeleton1)?;
    let skeleton2 = Skeleton::new(skeleton2)?;
    let ids1 = endpoint_ids(&skeleton1)?;
    let ids2 = endpoint_ids(&skeleton2)?;
    let ends1: Vec<_> = ids1.iter().map(|&id| skeleton1.pixel(id)).collect();
    let ends2: Vec<_> = ids2.iter().map(|&id| skeleton2.pixel(id)).collect();
    let ((i, j), _) = best_pair(&ends1, &ends2, f)?;
    Ok((walk(&skeleton1, ids1[i], params), walk(&skeleton2, ids2[j], params)))
}

/// The pair of endpoints with the least distance of the endpoint of view 1 to the epipolar line of
/// the endpoint of view 2; of equal pairs the first, view 1 counting before view 2.
///
/// An endpoint at the epipole is left out: in view 2 it has no line, in view 1 every line passes
/// through it.
///
/// # Errors
/// [`TraverseError::Empty`] if a view has no endpoint; [`TraverseError::NotFinite`];
/// [`TraverseError::EndpointsAtEpipole`] if none is left.
///
/// # Source
/// ACCURATE, section 2.2, `(î, ĵ)`. The paper is silent on ties and on the epipole.
pub fn start_pair(
    endpoints1: &[Pixel<View1>],
    endpoints2: &[Pixel<View2>],
    f: &Fundamental<View1, View2>,
) -> Result<StartPair, TraverseError> {
    check(endpoints1)?;
    check(endpoints2)?;
    let ((i, j), epipolar_distance_px) = best_pair(endpoints1, endpoints2, f)?;
    Ok(StartPair { start1: endpoints1[i], start2: endpoints2[j], epipolar_distance_px })
}

fn check<V: View>(endpoints: &[Pixel<V>]) -> Result<(), TraverseError> {
    let view = V::NUMBER;
    if endpoints.is_empty() {
        return Err(TraverseError::Empty { view });
    }
    match endpoints.iter().enumerate().find(|(_, pixel)| !pixel.is_finite()) {
        Some((index, &Pixel { x, y, .. })) => Err(TraverseError::NotFinite { view, index, x, y }),
        None => Ok(()),
    }
}

fn endpoint_ids<V: View>(skeleton: &Skeleton<V>) -> Result<Vec<usize>, TraverseError> {
    let ids = skeleton.endpoints();
    if ids.is_empty() {
        return Err(TraverseError::NoEndpoint { view: V::NUMBER, found: skeleton.len() });
    }
    Ok(ids)
}

/// Indices of the best pair and its distance, px.
fn best_pair(
    ends1: &[Pixel<View1>],
    ends2: &[Pixel<View2>],
    f: &Fundamental<View1, View2>,
) -> Result<((usize, usize), f64), TraverseError> {
    let transposed = f.transpose();
    let usable1: Vec<_> = (0..ends1.len()).filter(|&i| transposed.line(ends1[i]).is_ok()).collect();
    let lines2: Vec<_> =
        (0..ends2.len()).filter_map(|j| Some((j, f.line(ends2[j]).ok()?))).collect();
    if usable1.is_empty() {
        return Err(TraverseError::EndpointsAtEpipole { view: 1, found: ends1.len() });
    }
    let mut best = None;
    for &i in &usable1 {
        for (j, line) in &lines2 {
            let distance = line.distance(ends1[i]);
            if best.is_none_or(|(_, least)| distance < least) {
                best = Some(((i, *j), distance));
            }
        }
    }
    best.ok_or(TraverseError::EndpointsAtEpipole { view: 2, found: ends2.len() })
}
