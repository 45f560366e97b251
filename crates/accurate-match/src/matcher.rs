use accurate_geom::{Pixel, Point3, Rig, View1, View2};

use crate::MatchError;

/// A method that turns two ordered curves into one 3D curve. ECDP and every classical baseline
/// implement it, so that a table treats them alike.
pub trait CurveMatcher: Send + Sync {
    /// The name used by the command line and the tables, e.g. `hoffmann-table`.
    fn name(&self) -> &'static str;

    /// Matches the curves and triangulates the pairs, in the order of the curves.
    ///
    /// `curve1` and `curve2` are undistorted pixels in order along the body.
    ///
    /// # Errors
    /// [`MatchError`] if a curve is empty or not finite, or if no correspondence exists: an empty
    /// reconstruction is never returned.
    fn reconstruct(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CurveReconstruction, MatchError>;
}

/// One reconstructed point and where it came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// World position, in the rig's unit.
    pub position: Point3,
    /// The matched (possibly refined) pixel of view 1.
    pub pixel1: Pixel<View1>,
    /// The matched (possibly refined) pixel of view 2.
    pub pixel2: Pixel<View2>,
    /// Distance in view 1 of `pixel1` to the epipolar line of `pixel2`, px.
    pub epipolar_distance_px: f64,
}

/// A 3D curve as a matcher returns it: at least one point, all finite.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveReconstruction {
    /// Points in order along the body.
    pub points: Vec<CurvePoint>,
    /// The matched index pairs `(i of view 1, j of view 2)`, monotone where the method promises it.
    /// A method that matches samples of a fitted curve gives the index of the nearest input point.
    /// As long as `points`: `pairs[k]` belongs to `points[k]`.
    pub pairs: Vec<(usize, usize)>,
    /// Matched pairs left out because their rays have no usable meeting point (parallel rays, a
    /// point behind a camera). 0 on sound input.
    pub dropped: usize,
}

impl CurveReconstruction {
    /// Mean of [`CurvePoint::epipolar_distance_px`].
    pub fn mean_epipolar_distance_px(&self) -> f64 {
        let sum: f64 = self.points.iter().map(|p| p.epipolar_distance_px).sum();
        sum / self.points.len() as f64
    }
}
