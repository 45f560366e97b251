use accurate_geom::{Curve3, Pixel, Rig, View, View1, View2};
use accurate_match::CurvePoint;
use accurate_seg::{Mask, Skeleton, zhang_suen};
use accurate_traverse::{TraverseParams, trace_pair};
use ndarray::Array2;

use crate::direction::runs_against;
use crate::robust::reconstruct_masks;
use crate::{
    Diagnostics, Error, InputKind, Method, Reconstruction, RobustParams, Traces, ViewPair,
};

/// What to do with a pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Params {
    /// Which part of the pair is read.
    pub input: InputKind,
    /// How it is reconstructed.
    pub method: Method,
    /// Parameters of the published traversal (masks only).
    pub traverse: TraverseParams,
    /// Parameters of our own method.
    pub robust: RobustParams,
}

impl Params {
    /// The published parameters for an input and a method.
    pub const fn new(input: InputKind, method: Method) -> Self {
        Self { input, method, traverse: TraverseParams::PAPER, robust: RobustParams::DEFAULT }
    }
}

impl Params {
    /// The parameters that take effect, stage by stage, as text for a report.
    pub fn described(&self) -> Vec<(&'static str, String)> {
        let joint = (self.method, self.input) == (Method::Accurate, InputKind::Mask);
        let mut stages = Vec::new();
        if joint {
            stages.push(("joint choice", format!("{:?}", self.robust)));
        } else {
            if self.input == InputKind::Mask {
                stages.push(("traversal", format!("{:?}", self.traverse)));
            }
            stages.push(("matching", self.method.matching_described()));
        }
        stages
    }
}

/// Reconstructs the 3D curve seen in both views of a pair.
///
/// Masks are skeletonised (Zhang-Suen), ordered by GCTT, and matched. Points are matched in their
/// order; if view 2 runs against view 1 it is turned round first, and the diagnostics say so.
///
/// # Errors
/// [`Error`], which names the case and the stage; never an empty curve, never a NaN.
pub fn reconstruct(pair: &ViewPair, params: &Params) -> Result<Reconstruction, Error> {
    if (params.method, params.input) == (Method::Accurate, InputKind::Mask) {
        return joint_choice(pair, params);
    }
    let case = || pair.id.clone();
    let missing = || Error::MissingInput { case: case(), input: params.input };
    let traces = match params.input {
        InputKind::Points => {
            let (points1, points2) = pair.points.as_ref().ok_or_else(missing)?;
            let reversed = runs_against(points1, points2, &pair.rig)
                .map_err(|source| Error::Matching { case: case(), source })?;
            Traces::given(points1.clone(), points2.clone(), reversed)
        }
        InputKind::Mask => {
            let [mask1, mask2] = pair.masks.as_ref().ok_or_else(missing)?;
            let skeleton1 = skeleton_pixels::<View1>(mask1, &pair.id)?;
            let skeleton2 = skeleton_pixels::<View2>(mask2, &pair.id)?;
            let f = pair.rig.fundamental();
            let (trace1, trace2) = trace_pair(&skeleton1, &skeleton2, f, &params.traverse)
                .map_err(|source| Error::Traversal { case: case(), source })?;
            Traces::traced(trace1, trace2)
        }
        InputKind::Image => {
            pair.images.as_ref().ok_or_else(missing)?;
            return Err(Error::NoNetwork { case: case() });
        }
    };
    let matched = params
        .method
        .matcher()
        .reconstruct(&traces.points1, &traces.points2, &pair.rig)
        .map_err(|source| Error::Matching { case: case(), source })?;
    let diagnostics = Diagnostics::of(&matched, &traces);
    Ok(Reconstruction {
        id: case(),
        method: params.method,
        input: params.input,
        unit: pair.rig.unit(),
        points: matched.points,
        traces,
        diagnostics,
    })
}

/// Our own method on masks.
fn joint_choice(pair: &ViewPair, params: &Params) -> Result<Reconstruction, Error> {
    let masks = pair
        .masks
        .as_ref()
        .ok_or_else(|| Error::MissingInput { case: pair.id.clone(), input: params.input })?;
    let result = reconstruct_masks(masks, &pair.rig, &params.robust, &pair.id)?;
    let points = sampled(&result.fit.curve, &pair.rig);
    let diagnostics = Diagnostics::of_joint(&result);
    Ok(Reconstruction {
        id: pair.id.clone(),
        method: params.method,
        input: params.input,
        unit: pair.rig.unit(),
        points,
        traces: Traces::walked(result),
        diagnostics,
    })
}

/// Distance of the points of a fitted curve in the image, px.
const OUTPUT_SPACING_PX: f64 = 0.5;

/// The fitted curve as points with their projections.
fn sampled(curve: &Curve3, rig: &Rig) -> Vec<CurvePoint> {
    let (from, to) = curve.domain();
    let pixels: Vec<_> = (0..=16)
        .filter_map(|k| rig.project(&curve.at(from + (to - from) * f64::from(k) / 16.0)).ok())
        .collect();
    // Sixteen chords miss little of the length, and the spacing needs no more than that.
    let length_px = |distance: fn(&[(Pixel<View1>, Pixel<View2>)]) -> f64| {
        pixels.windows(2).map(distance).sum::<f64>()
    };
    let longest =
        length_px(|w| w[0].0.distance(w[1].0)).max(length_px(|w| w[0].1.distance(w[1].1)));
    let count = (longest / OUTPUT_SPACING_PX).ceil().clamp(2.0, 65_536.0) as usize;
    curve
        .uniform_parameters(count)
        .into_iter()
        .filter_map(|t| {
            let position = curve.at(t);
            let (pixel1, pixel2) = rig.project(&position).ok()?;
            Some(CurvePoint { position, pixel1, pixel2, epipolar_distance_px: 0.0 })
        })
        .collect()
}

fn skeleton_pixels<V: View>(mask: &Array2<bool>, case: &str) -> Result<Vec<Pixel<V>>, Error> {
    let refuse = |source| Error::Segmentation { case: case.to_owned(), view: V::NUMBER, source };
    let mask = Mask::from_array(mask.clone()).map_err(refuse)?;
    let skeleton = Skeleton::of(&zhang_suen(&mask)).map_err(refuse)?;
    Ok(skeleton.pixels_as::<V>())
}
