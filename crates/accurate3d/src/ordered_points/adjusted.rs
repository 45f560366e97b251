use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Pixel, Rig, View1, View2};
use accurate_match::{CurvePoint, FreeMatch};

use crate::diagnostics::Adjustment;
use crate::reconstruction::sigmas_across;
use crate::robust::px_per_unit;
use crate::sampled_curve::along_epipolar_lines;
use crate::{Diagnostics, Error, Explanation, Params, Reconstruction, Traces, ViewPair};

/// What matching and adjustment of ordered points came to.
pub(crate) struct Adjusted<'a> {
    pub(crate) points: Vec<CurvePoint>,
    pub(crate) covariances: Option<Vec<Matrix3<f64>>>,
    /// Under which the points were projected.
    pub(crate) rig: &'a Rig,
    pub(crate) matched: &'a FreeMatch,
    pub(crate) adjustment: Adjustment,
}

impl Adjusted<'_> {
    /// The result for `pair`, whose points as they were matched are `given`.
    ///
    /// # Errors
    /// [`Error::Matching`] if no epipolar line can be drawn through a point.
    pub(crate) fn into_reconstruction(
        self,
        pair: &ViewPair,
        params: &Params,
        given: (&[Pixel<View1>], &[Pixel<View2>]),
    ) -> Result<Reconstruction, Error> {
        let along_epipolar_line = along_epipolar_lines(&self.points, self.rig)
            .map_err(|source| Error::Matching { case: pair.id.clone(), source })?;
        let counts = [given.0.len(), given.1.len()];
        let positions: Vec<_> = self.points.iter().map(|p| p.position).collect();
        let sigmas = self.covariances.iter().flat_map(|list| sigmas_across(&positions, list));
        let sigma_px = sigmas.fold(0.0, f64::max) * px_per_unit(&positions, self.rig);
        let diagnostics = Diagnostics::of_free_match(
            self.matched,
            counts,
            &along_epipolar_line,
            self.adjustment,
            sigma_px,
        );
        Ok(Reconstruction {
            id: pair.id.clone(),
            method: params.method,
            input: params.input,
            unit: pair.rig.unit(),
            points: self.points,
            covariances: self.covariances,
            along_epipolar_line,
            traces: Traces::given(given.0.to_vec(), given.1.to_vec(), self.matched.reversed),
            diagnostics,
            explanation: Explanation::default(),
        })
    }
}
