use accurate_geom::Point3;
use ndarray::Array2;

use crate::require::require_usable;
use crate::robust::{Evidence, Searched, search_masks, without_strays};
use crate::sampled_curve::{SampledCurve, along_epipolar_lines, sampled, sampled_ring};
use crate::{
    Closure, Diagnostics, Error, InputKind, Params, Reconstruction, RobustParams, Traces, ViewPair,
};

/// Our own method on a pair's masks, or on the maps that they were made of, before the pictures are asked.
pub(crate) struct JointSearch<'a> {
    pair: &'a ViewPair,
    params: &'a Params,
    /// The maps that curves are judged by, if any.
    maps: Option<&'a [Array2<f32>; 2]>,
    /// The pictures that are asked, if any.
    images: Option<&'a [Array2<f32>; 2]>,
    in_effect: RobustParams,
    searched: Searched,
    strays_px: [usize; 2],
}

impl<'a> JointSearch<'a> {
    /// # Errors
    /// As [`reconstruct`](crate::reconstruct).
    pub(crate) fn of(pair: &'a ViewPair, params: &'a Params) -> Result<Self, Error> {
        require_usable(pair, params.input)?;
        let masks = pair
            .masks
            .as_ref()
            .ok_or_else(|| Error::MissingInput { case: pair.id.clone(), input: params.input })?;
        let maps = pair.probabilities.as_ref().filter(|_| params.input == InputKind::Image);
        // What a person has drawn is the body; what a network has found need not be.
        let cleaned;
        let (masks, strays_px) = match maps {
            Some(maps) => {
                let (kept, strays_px) = without_strays(masks, maps, &pair.rig, &pair.id)?;
                cleaned = kept;
                (&cleaned, strays_px)
            }
            None => (masks, [0, 0]),
        };
        // As given: what takes effect has mended some of them.
        let given = params.robust.validate();
        given.map_err(|source| Error::Fitting { case: pair.id.clone(), source })?;
        let in_effect = params.in_effect();
        let by_grey_levels =
            maps.is_some() && params.robust.by_grey_levels && params.closure == Closure::Open;
        let images = pair.images.as_ref().filter(|_| by_grey_levels);
        let maps = maps.filter(|_| params.robust.by_probability);
        let searched = search_masks(
            masks,
            maps,
            maps.is_none() && images.is_none(),
            &pair.rig,
            &in_effect,
            params.closure,
            &pair.id,
        )?;
        Ok(Self { pair, params, maps, images, in_effect, searched, strays_px })
    }

    /// What bears on the choice so far.
    pub(crate) fn evidence(&self) -> Evidence {
        self.searched.evidence()
    }

    /// Points of the curve so far.
    pub(crate) fn positions(&self) -> Vec<Point3> {
        let SampledCurve { points, .. } = sampled(self.searched.curve(), None, &self.pair.rig);
        points.into_iter().map(|point| point.position).collect()
    }

    /// Asks the pictures, if there are some, and gives the curve.
    ///
    /// # Errors
    /// [`Error::Fitting`], [`Error::Matching`].
    pub(crate) fn finished(self) -> Result<Reconstruction, Error> {
        let Self { pair, params, maps, images, in_effect, searched, strays_px } = self;
        let result = match images {
            Some(images) => searched.by_pictures(images, maps, &pair.rig, &in_effect),
            None => searched.into_result(),
        };
        // The curve was fitted under the corrected camera, if one was asked for.
        let rig = match &result.calibration {
            Some(calibration) => &calibration
                .correct(&pair.rig)
                .map_err(|source| Error::Fitting { case: pair.id.clone(), source })?,
            None => &pair.rig,
        };
        let sampling = match params.closure {
            Closure::Open => sampled,
            Closure::Closed => sampled_ring,
        };
        let SampledCurve { points, covariances } =
            sampling(&result.fit.curve, result.fit.covariance.as_ref(), rig);
        let along_epipolar_line = along_epipolar_lines(&points, rig)
            .map_err(|source| Error::Matching { case: pair.id.clone(), source })?;
        let mut diagnostics = Diagnostics::of_joint(&result, strays_px, &along_epipolar_line);
        diagnostics.closed = params.closure == Closure::Closed;
        let explanation = result.explanation.clone();
        Ok(Reconstruction {
            id: pair.id.clone(),
            method: params.method,
            input: params.input,
            unit: pair.rig.unit(),
            points,
            covariances,
            along_epipolar_line,
            traces: Traces::walked(result),
            diagnostics,
            explanation,
        })
    }
}
