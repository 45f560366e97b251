use accurate_geom::{Point3, Rig};
use accurate_io::{OrderedPoints, Pair};
use accurate_synth::SynthCase;
use ndarray::Array2;

/// Two calibrated views of one thin body: what [`reconstruct`](crate::reconstruct) reads.
///
/// Only what the chosen input needs has to be there. Images and masks have shape (height, width), the
/// size of their camera's image ([`Error::OtherSize`](crate::Error::OtherSize) otherwise); points are
/// undistorted pixels in order along the body.
#[derive(Debug, Clone)]
pub struct ViewPair {
    /// Name of the case, used in messages and results.
    pub id: String,
    /// The two cameras.
    pub rig: Rig,
    /// Ordered centreline points of both views.
    pub points: Option<OrderedPoints>,
    /// Binary masks of both views.
    pub masks: Option<[Array2<bool>; 2]>,
    /// Grey images of both views, raw values. The body is taken to be darker than what surrounds it:
    /// of others take [`Polarity::with_body_dark`](accurate_seg::Polarity::with_body_dark) first.
    pub images: Option<[Array2<f32>; 2]>,
    /// Probability of the body in both images, 0 to 1, where they were segmented
    /// ([`segment_images`](crate::segment_images)); the masks are then what was made of it.
    pub probabilities: Option<[Array2<f32>; 2]>,
    /// The true curve, in order, in the rig's unit.
    pub truth: Option<Vec<Point3>>,
}

impl ViewPair {
    /// Two cameras that show nothing yet: `ViewPair { masks, ..ViewPair::new(id, rig) }`.
    pub fn new(id: impl Into<String>, rig: Rig) -> Self {
        Self {
            id: id.into(),
            rig,
            points: None,
            masks: None,
            images: None,
            probabilities: None,
            truth: None,
        }
    }
}

impl From<Pair> for ViewPair {
    fn from(pair: Pair) -> Self {
        Self {
            points: pair.points,
            masks: pair.masks,
            images: pair.images,
            truth: pair.truth,
            ..Self::new(pair.case_id, pair.rig)
        }
    }
}

impl From<SynthCase> for ViewPair {
    /// Takes the rounded points: the paper's protocol for its "Points" rows.
    fn from(case: SynthCase) -> Self {
        Self {
            points: Some(case.rounded_points),
            masks: Some(case.masks),
            truth: Some(case.truth),
            ..Self::new(case.id, case.rig)
        }
    }
}
