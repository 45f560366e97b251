use accurate_geom::nalgebra::{Matrix2, Matrix3, Vector2};
use accurate_geom::{Curve3, Rig};

use crate::adaptive::fit_posterior;
use crate::minimise::Priors;
use crate::{AdaptiveParams, FitError, OutlineFit, OutlineFitParams, OutlinePair};

/// How wrong the calibration of view 2 may be: standard deviations of normal priors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationPriors {
    /// Shift of the image in each direction, px. A turn of the camera about an axis across its line
    /// of sight is, to first order, such a shift of `f` times the angle.
    pub shift_sigma_px: f64,
    /// Turn of the camera about its optical axis, rad.
    pub roll_sigma_rad: f64,
}

impl CalibrationPriors {
    /// A turn of some 0.03 degrees under f = 1200 px, or a principal point half a pixel off.
    pub const DEFAULT: Self = Self { shift_sigma_px: 0.7, roll_sigma_rad: 1e-3 };

    /// Refuses what is no standard deviation.
    ///
    /// # Errors
    /// [`FitError::BadParameter`] for one that is not positive and finite.
    pub fn validate(&self) -> Result<(), FitError> {
        for (name, value) in
            [("shift_sigma_px", self.shift_sigma_px), ("roll_sigma_rad", self.roll_sigma_rad)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return Err(FitError::BadParameter { name, value });
            }
        }
        Ok(())
    }

    /// Weights of shift x, shift y and roll in a cost that counts squares in units of a residual's
    /// `variance`, px².
    pub(crate) fn weights(&self, variance: f64) -> [f64; 3] {
        let weight = |sigma: f64| variance / (sigma * sigma);
        let shift = weight(self.shift_sigma_px);
        [shift, shift, weight(self.roll_sigma_rad)]
    }
}

/// What the curve itself says about the calibration of view 2.
///
/// Only relative: view 1 is taken as exact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationEstimate {
    /// Shift of the image of view 2 against its camera, `[x, y]`, px.
    pub shift_px: [f64; 2],
    /// Turn of camera 2 about its optical axis (x towards y), rad.
    pub roll_rad: f64,
    /// Posterior covariance of `(shift x, shift y, roll)`.
    pub covariance: Matrix3<f64>,
    /// Unit direction in image 2 in which the shift is seen best ...
    pub observed: [f64; 2],
    /// ... its posterior standard deviation, px ...
    pub observed_sigma_px: f64,
    /// ... and the direction in which it is seen worst. Along the epipolar lines a shift only
    /// changes depths: there the posterior is the prior, and the estimate stays near zero.
    pub unobserved: [f64; 2],
    /// Posterior standard deviation of the shift in that direction, px.
    pub unobserved_sigma_px: f64,
}

impl CalibrationEstimate {
    /// The rig with camera 2 corrected by the estimate.
    ///
    /// # Errors
    /// [`FitError::Geometry`] if the corrected camera is none (cannot happen for a small estimate).
    pub fn correct(&self, rig: &Rig) -> Result<Rig, FitError> {
        let camera = rig.camera2();
        let mut k = *camera.k();
        k[(0, 2)] += self.shift_px[0];
        k[(1, 2)] += self.shift_px[1];
        let (s, c) = self.roll_rad.sin_cos();
        let roll = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let camera2 = camera.with_matrices(k, roll * camera.r(), roll * camera.t())?;
        Ok(Rig::new(rig.camera1().clone(), camera2, rig.unit())?)
    }

    /// The same of an image that lies otherwise: `axes` takes a direction in this one to that in the other, a
    /// turn by quarters or its mirror image. The camera's turn about its axis stays what it is.
    pub fn in_axes(&self, axes: &Matrix2<f64>) -> Self {
        let shift = axes * Vector2::from(self.shift_px);
        let mut all = Matrix3::identity();
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(axes);
        Self::new(shift.into(), self.roll_rad, all * self.covariance * all.transpose())
    }

    pub(crate) fn new(shift_px: [f64; 2], roll_rad: f64, covariance: Matrix3<f64>) -> Self {
        let shift = Matrix2::new(
            covariance[(0, 0)],
            covariance[(0, 1)],
            covariance[(1, 0)],
            covariance[(1, 1)],
        );
        let eigen = shift.symmetric_eigen();
        let worst = usize::from(eigen.eigenvalues[1] > eigen.eigenvalues[0]);
        let direction = |k: usize| {
            let v: Vector2<f64> = eigen.eigenvectors.column(k).into_owned();
            // An axis has two unit vectors; take the one that looks right, or up.
            let sign = if v.x < 0.0 || (v.x == 0.0 && v.y < 0.0) { -1.0 } else { 1.0 };
            [sign * v.x, sign * v.y]
        };
        let sigma = |k: usize| eigen.eigenvalues[k].max(0.0).sqrt();
        Self {
            shift_px,
            roll_rad,
            covariance,
            observed: direction(1 - worst),
            observed_sigma_px: sigma(1 - worst),
            unobserved: direction(worst),
            unobserved_sigma_px: sigma(worst),
        }
    }
}

/// A fit that allowed for an error of the calibration.
#[derive(Debug, Clone)]
pub struct CalibratedFit {
    /// The curve, in the world frame of the rig whose view 1 is taken as exact, and its covariance,
    /// which includes what the calibration leaves uncertain.
    pub fit: OutlineFit,
    /// The calibration's correction.
    pub calibration: CalibrationEstimate,
}

/// [`fit_outlines_adaptively`](crate::fit_outlines_adaptively) with three more unknowns: a shift of
/// image 2 and a roll of camera 2, held by priors.
///
/// The part of a calibration error that moves image 2 across the epipolar lines shows as misfit in
/// both views and is removed; the part along them is the same as a change of depth and cannot be
/// seen by any method ([`CalibrationEstimate::unobserved`]).
///
/// # Errors
/// As [`fit_outlines_adaptively`](crate::fit_outlines_adaptively).
///
/// # Source
/// Maximum a posteriori self-calibration, as in bundle adjustment (Triggs et al. 2000, section 9).
///
/// # Cost
/// As without; the equations gain three full columns.
pub fn fit_outlines_and_calibration(
    start: &Curve3,
    outlines: &OutlinePair<'_>,
    rig: &Rig,
    params: &OutlineFitParams,
    adaptive: &AdaptiveParams,
    priors: &CalibrationPriors,
) -> Result<CalibratedFit, FitError> {
    params.validate()?;
    adaptive.validate()?;
    priors.validate()?;
    let weights = priors.weights(adaptive.variance_px2());
    let priors = Priors { nuisance_weights: Some(weights) };
    let found = fit_posterior(start, outlines, rig, params, adaptive, priors)?;
    let calibration = CalibrationEstimate::new(
        found.nuisance.shift_px,
        found.nuisance.roll,
        found.nuisance_covariance,
    );
    Ok(CalibratedFit { fit: found.fit, calibration })
}
