use std::borrow::Cow;

use accurate_fit::{CalibrationEstimate, FitError};
use accurate_geom::{GeomError, Rig};
use ndarray::Array2;

use super::candidates::cut_to_body;
use super::frame::{Frame, Turn};
use crate::Error;

/// Masks and cameras brought to where they lie the same however they were turned and whichever was the first.
///
/// Sums in another order, or boundary points thinned out from the other end, differ by little; but where
/// two curves explain the outlines almost equally well that little decides.
pub(crate) struct Upright<'a> {
    pub(crate) masks: Cow<'a, [Array2<bool>; 2]>,
    pub(crate) rig: Cow<'a, Rig>,
    pub(crate) orientation: Orientation,
}

/// How images lie beside those that were given.
pub(crate) struct Orientation {
    /// Where the images lie in the given ones.
    pub(crate) frames: [Frame; 2],
    /// Whether the first of the images is the second of the given ones.
    pub(crate) swapped: bool,
}

impl<'a> Upright<'a> {
    /// If the calibration of camera 2 `is_exact`, the views too are put in order: else the two are not alike.
    ///
    /// # Errors
    /// [`Error::Fitting`] if a turned camera is none, which cannot happen to a camera.
    pub(crate) fn of(
        masks: &[Array2<bool>; 2],
        rig: &Rig,
        is_exact: bool,
        case: &str,
    ) -> Result<Self, Error> {
        let geometry = |source: GeomError| Error::Fitting {
            case: case.to_owned(),
            source: FitError::Geometry(source),
        };
        let [(one, frame1), (two, frame2)] = [upright(&masks[0]), upright(&masks[1])];
        let camera1 = frame1.camera(rig.camera1()).map_err(geometry)?;
        let camera2 = frame2.camera(rig.camera2()).map_err(geometry)?;
        let turned = Rig::new(camera1, camera2, rig.unit()).map_err(geometry)?;
        let order = two.shape().cmp(one.shape()).then_with(|| two.iter().cmp(&one));
        let swapped = is_exact && order.is_lt();
        let (masks, frames, rig) = if swapped {
            ([two, one], [frame2, frame1], turned.swapped())
        } else {
            ([one, two], [frame1, frame2], turned)
        };
        let orientation = Orientation { frames, swapped };
        Ok(Self { masks: Cow::Owned(masks), rig: Cow::Owned(rig), orientation })
    }

    /// As they lie: a network has seen the images so.
    pub(crate) fn as_given(masks: &'a [Array2<bool>; 2], rig: &'a Rig) -> Self {
        let frames = [0, 1].map(|view| Frame::new(Turn::NONE, [0.0; 2], &masks[view]));
        let orientation = Orientation { frames, swapped: false };
        Self { masks: Cow::Borrowed(masks), rig: Cow::Borrowed(rig), orientation }
    }
}

impl Orientation {
    /// What was found about camera 2 here, of the given one.
    pub(crate) fn given_calibration(&self, here: &CalibrationEstimate) -> CalibrationEstimate {
        here.in_axes(&self.frames[1].axes_in_image())
    }
}

/// A mask brought to the same pixels however it was turned before, and where it lies in the given one.
pub(crate) fn upright(mask: &Array2<bool>) -> (Array2<bool>, Frame) {
    let turn = Turn::upright(&cut_to_body(mask).0, mask);
    (turn.array(mask), Frame::new(turn, [0.0; 2], mask))
}
