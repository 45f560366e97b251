use accurate_geom::{Fundamental, GeomError, Rig, View};

use crate::projection::Projection;

/// A stretch of the projected curve that runs along the epipolar lines it meets.
///
/// There a pixel of one view matches a whole stretch of the other: depth is not observed point by
/// point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TangentStretch {
    /// Arc length in the image where it starts, px.
    pub start_px: f64,
    /// Arc length in the image where it ends, px.
    pub end_px: f64,
}

impl TangentStretch {
    /// Length in the image, px.
    pub fn length_px(&self) -> f64 {
        self.end_px - self.start_px
    }
}

/// The stretches of both views, of at least `min_length_px`, whose direction is within
/// `max_angle_deg` of the epipolar direction everywhere. The projections are of the same curve.
pub(crate) fn stretches(
    rig: &Rig,
    projections: &[Projection; 2],
    max_angle_deg: f64,
    min_length_px: f64,
) -> Result<[Vec<TangentStretch>; 2], GeomError> {
    let [one, two] = projections;
    let f = rig.fundamental();
    Ok([
        in_view(f, one, two, max_angle_deg, min_length_px)?,
        in_view(&f.transpose(), two, one, max_angle_deg, min_length_px)?,
    ])
}

fn in_view<A: View, B: View>(
    f: &Fundamental<A, B>,
    here: &Projection,
    there: &Projection,
    max_angle_deg: f64,
    min_length_px: f64,
) -> Result<Vec<TangentStretch>, GeomError> {
    let limit = max_angle_deg.to_radians().sin();
    let mut found = Vec::new();
    let mut start: Option<f64> = None;
    let mut close = |start: &mut Option<f64>, end_px: f64| {
        if let Some(start_px) = start.take()
            && end_px - start_px >= min_length_px
        {
            found.push(TangentStretch { start_px, end_px });
        }
    };
    for k in 0..here.points.len().saturating_sub(1) {
        // The line of the segment's first end: it passes through that end itself, so only the
        // direction matters, and it turns by far less than the limit within one segment.
        let line = f.line(there.points[k].into())?;
        let step = here.points[k + 1] - here.points[k];
        let normal = line.coefficients().xy();
        if step.dot(&normal).abs() <= limit * step.norm() {
            start.get_or_insert(here.arc[k]);
        } else {
            close(&mut start, here.arc[k]);
        }
    }
    close(&mut start, here.length());
    Ok(found)
}
