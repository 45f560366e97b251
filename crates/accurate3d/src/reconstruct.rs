use std::fmt;
use std::str::FromStr;

use accurate_fit::PointFitParams;
use accurate_geom::{Pixel, View, View1, View2};
use accurate_match::FreeMatchParams;
use accurate_seg::{Mask, Skeleton, zhang_suen};
use accurate_traverse::{TraverseParams, trace_pair};
use ndarray::Array2;

use crate::direction::runs_against;
use crate::disorder::is_disordered;
use crate::joint_search::JointSearch;
use crate::ordered_points::adjusted_points;
use crate::require::require_usable;
use crate::sampled_curve::along_epipolar_lines;
use crate::{
    Diagnostics, Error, Explanation, InputKind, Method, Reconstruction, RobustParams, Suspicion,
    Traces, UnknownName, ViewPair,
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
    /// Whether the body is a ring (our own method only).
    pub closure: Closure,
}

/// Whether the body is a ring: a curve without ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Closure {
    /// It has two ends.
    #[default]
    Open,
    /// It has none.
    Closed,
}

impl Closure {
    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Open => "no",
            Self::Closed => "yes",
        }
    }
}

impl FromStr for Closure {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let all = [Self::Open, Self::Closed];
        all.into_iter().find(|c| c.name() == name).ok_or_else(|| UnknownName {
            what: "closure",
            name: name.to_owned(),
            expected: all.map(Self::name).join(", "),
        })
    }
}

impl fmt::Display for Closure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Params {
    /// The defaults for an input and a method: the published parameters of the traversal,
    /// [`RobustParams::DEFAULT`] for our own method, and a body with two ends.
    pub const fn new(input: InputKind, method: Method) -> Self {
        Self {
            input,
            method,
            traverse: TraverseParams::PAPER,
            robust: RobustParams::DEFAULT,
            closure: Closure::Open,
        }
    }
}

/// On images, where nothing but the search itself proposes curves, the first good one is less often the
/// right one: so many are fitted, and others unless they are so far behind.
const IMAGES_MIN_FITS: usize = 6;
const IMAGES_CLEAR_LEAD: f64 = 4.0;

/// On masks all that is shown is the body: of the price of a doubled length so much is left.
const DRAWN_DOUBLED: f64 = 0.1;

impl Params {
    /// What the joint choice goes by: on what a network found, not everything that masks allow.
    pub(crate) fn in_effect(&self) -> RobustParams {
        let drawn = self.input != InputKind::Image;
        RobustParams {
            exchange: self.robust.exchange && drawn,
            turned: self.robust.turned && drawn,
            kink_weight: if drawn { 0.0 } else { self.robust.kink_weight },
            doubled_weight: self.robust.doubled_weight * if drawn { DRAWN_DOUBLED } else { 1.0 },
            min_fits: self.robust.min_fits.max(if drawn { 1 } else { IMAGES_MIN_FITS }),
            clear_lead: self.robust.clear_lead.max(if drawn { 0.0 } else { IMAGES_CLEAR_LEAD }),
            ..self.robust
        }
    }

    /// The parameters that take effect, stage by stage, as text for a report. Where ordered points are
    /// whole pixels, tangency is looked for over longer stretches
    /// ([`TangencyParams::WHOLE_PIXELS`](accurate_match::TangencyParams::WHOLE_PIXELS)).
    pub fn described(&self) -> Vec<(&'static str, String)> {
        match (self.method, self.input) {
            (Method::Accurate, InputKind::Points) => vec![
                ("matching", format!("{:?}", FreeMatchParams::DEFAULT)),
                (
                    "adjustment",
                    format!(
                        "{:?}",
                        PointFitParams {
                            calibration: self.robust.calibration,
                            ..PointFitParams::DEFAULT
                        }
                    ),
                ),
                ("closed", self.closure.to_string()),
            ],
            (Method::Accurate, _) => vec![
                ("joint choice", format!("{:?}", self.in_effect())),
                ("closed", self.closure.to_string()),
            ],
            (method, InputKind::Points) => vec![("matching", method.matching_described())],
            (method, _) => vec![
                ("traversal", format!("{:?}", self.traverse)),
                ("matching", method.matching_described()),
            ],
        }
    }
}

/// Reconstructs the 3D curve seen in both views of a pair.
///
/// Images must have been segmented by [`segment_images`](crate::segment_images); from there on they
/// take the way of masks. By [`Method::Accurate`] one curve is fitted to the outlines of both masks, the
/// likeliest of all that the walks through them propose; of the other methods masks are skeletonised
/// (Zhang-Suen), ordered by GCTT, and matched. Points are matched in their order; if view 2 runs against
/// view 1 it is turned round first, and the diagnostics say so.
///
/// # Errors
/// [`Error`], which names the case and the stage; never an empty curve, never a NaN.
pub fn reconstruct(pair: &ViewPair, params: &Params) -> Result<Reconstruction, Error> {
    let mut found = reconstruct_as_given(pair, params)?;
    if let (InputKind::Points, Some((points1, points2))) = (params.input, &pair.points)
        && (is_disordered(points1) || is_disordered(points2))
    {
        found.diagnostics.suspicions.push(Suspicion::NotInOrder);
    }
    Ok(found)
}

fn reconstruct_as_given(pair: &ViewPair, params: &Params) -> Result<Reconstruction, Error> {
    if params.method == Method::Accurate && params.input != InputKind::Points {
        return JointSearch::of(pair, params)?.finished();
    }
    require_usable(pair, params.input)?;
    if params.method == Method::Accurate {
        return adjusted_points(pair, params);
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
        InputKind::Mask | InputKind::Image => {
            let [mask1, mask2] = pair.masks.as_ref().ok_or_else(missing)?;
            let skeleton1 = skeleton_pixels::<View1>(mask1, &pair.id)?;
            let skeleton2 = skeleton_pixels::<View2>(mask2, &pair.id)?;
            let f = pair.rig.fundamental();
            let (trace1, trace2) = trace_pair(&skeleton1, &skeleton2, f, &params.traverse)
                .map_err(|source| Error::Traversal { case: case(), source })?;
            Traces::traced(trace1, trace2)
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
        explanation: Explanation::default(),
    })
}

fn skeleton_pixels<V: View>(mask: &Array2<bool>, case: &str) -> Result<Vec<Pixel<V>>, Error> {
    let refuse = |source| Error::Segmentation { case: case.to_owned(), view: V::NUMBER, source };
    let mask = Mask::from_array(mask.clone()).map_err(refuse)?;
    let skeleton = Skeleton::of(&zhang_suen(&mask)).map_err(refuse)?;
    Ok(skeleton.pixels_as::<V>())
}
