use accurate_fit::OutlineFit;
use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{EpipolarAngle, Pixel, Rig, View, View1, View2};
use accurate_match::{CurvePoint, MatchError, TangencyParams, tangency_sines1, tangency_sines2};
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
    let along_epipolar_line = along_epipolar_lines(&matched.points, &pair.rig)
        .map_err(|source| Error::Matching { case: case(), source })?;
    let diagnostics = Diagnostics::of(&matched, &traces, &along_epipolar_line);
    Ok(Reconstruction {
        id: case(),
        method: params.method,
        input: params.input,
        unit: pair.rig.unit(),
        points: matched.points,
        covariances: None,
        along_epipolar_line,
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
    let (points, covariances) = sampled(&result.fit, &pair.rig);
    let along_epipolar_line = along_epipolar_lines(&points, &pair.rig)
        .map_err(|source| Error::Matching { case: pair.id.clone(), source })?;
    let diagnostics = Diagnostics::of_joint(&result, &along_epipolar_line);
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
    })
}

/// Distance of the points of a fitted curve in the image, px.
const OUTPUT_SPACING_PX: f64 = 0.5;

/// The fitted curve as points with their projections, and the covariance of each.
fn sampled(fit: &OutlineFit, rig: &Rig) -> (Vec<CurvePoint>, Option<Vec<Matrix3<f64>>>) {
    let curve = &fit.curve;
    let (from, to) = curve.domain();
    let pixels: Vec<_> = (0..=64)
        .filter_map(|k| rig.project(&curve.at(from + (to - from) * f64::from(k) / 64.0)).ok())
        .collect();
    // The spacing need not be exact, and these chords miss little of the length.
    let length_px = |distance: fn(&[(Pixel<View1>, Pixel<View2>)]) -> f64| {
        pixels.windows(2).map(distance).sum::<f64>()
    };
    let longest =
        length_px(|w| w[0].0.distance(w[1].0)).max(length_px(|w| w[0].1.distance(w[1].1)));
    let count = (longest / OUTPUT_SPACING_PX).ceil().clamp(2.0, 65_536.0) as usize;
    let (mut points, mut covariances) = (Vec::with_capacity(count), Vec::new());
    for t in curve.uniform_parameters(count) {
        let position = curve.at(t);
        // A fit in front of both cameras was promised; a point that is not has no picture.
        let Ok((pixel1, pixel2)) = rig.project(&position) else { continue };
        points.push(CurvePoint { position, pixel1, pixel2, epipolar_distance_px: 0.0 });
        covariances.extend(fit.covariance.as_ref().map(|covariance| covariance.at(t)));
    }
    (points, fit.covariance.is_some().then_some(covariances))
}

/// Sine of the angle between curve and epipolar line below which a depth is carried over.
const ALONG_LINE_SINE: f64 = 0.1;

/// Whether the curve runs along an epipolar line at each point, in either view.
fn along_epipolar_lines(points: &[CurvePoint], rig: &Rig) -> Result<Vec<bool>, MatchError> {
    let angles = EpipolarAngle::new(rig);
    let curve1: Vec<_> = points.iter().map(|p| p.pixel1).collect();
    let curve2: Vec<_> = points.iter().map(|p| p.pixel2).collect();
    let window_px = TangencyParams::WHOLE_PIXELS.window_px;
    let sines1 = tangency_sines1(&angles, &curve1, window_px)?;
    let sines2 = tangency_sines2(&angles, &curve2, window_px)?;
    Ok(sines1.iter().zip(&sines2).map(|(a, b)| a.min(*b) < ALONG_LINE_SINE).collect())
}

fn skeleton_pixels<V: View>(mask: &Array2<bool>, case: &str) -> Result<Vec<Pixel<V>>, Error> {
    let refuse = |source| Error::Segmentation { case: case.to_owned(), view: V::NUMBER, source };
    let mask = Mask::from_array(mask.clone()).map_err(refuse)?;
    let skeleton = Skeleton::of(&zhang_suen(&mask)).map_err(refuse)?;
    Ok(skeleton.pixels_as::<V>())
}
