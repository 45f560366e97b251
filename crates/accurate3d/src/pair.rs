use accurate_geom::{Point3, Rig};
use accurate_io::{OrderedPoints, Pair};
use accurate_synth::SynthCase;
use ndarray::Array2;

/// Two calibrated views of one thin body: what [`reconstruct`](crate::reconstruct) reads.
///
/// Only what the chosen input needs has to be there. Images and masks have shape (height, width);
/// points are undistorted pixels in order along the body.
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
    /// Grey images of both views, raw values.
    pub images: Option<[Array2<f32>; 2]>,
    /// Probability of the body in both images, 0 to 1, where they were segmented
    /// ([`segment_images`](crate::segment_images)); the masks are then what was made of it.
    pub probabilities: Option<[Array2<f32>; 2]>,
    /// The true curve, in order, in the rig's unit.
    pub truth: Option<Vec<Point3>>,
}

impl From<Pair> for ViewPair {
    fn from(pair: Pair) -> Self {
        Self {
            id: pair.case_id,
            rig: pair.rig,
            points: pair.points,
            masks: pair.masks,
            images: pair.images,
            probabilities: None,
            truth: pair.truth,
        }
    }
}

impl From<SynthCase> for ViewPair {
    /// Takes the rounded points: the paper's protocol for its "Points" rows.
    fn from(case: SynthCase) -> Self {
        Self {
            id: case.id,
            rig: case.rig,
            points: Some(case.rounded_points),
            masks: Some(case.masks),
            images: None,
            probabilities: None,
            truth: Some(case.truth),
        }
    }
}
