use accurate_geom::Point3;
use serde::Serialize;

/// Why a result is what it is: what was considered, and what was decided on the way.
///
/// Empty for methods that consider nothing: the published ones walk and match greedily.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Explanation {
    /// The curves of the last choice, the chosen one first.
    pub candidates: Vec<ConsideredCurve>,
    /// What the chosen walk of each view did where strands meet, in order along the walk.
    pub junctions: [Vec<JunctionDecision>; 2],
}

/// A curve of the last choice.
#[derive(Debug, Clone, PartialEq)]
pub struct ConsideredCurve {
    /// Index of its walk in each view, cheapest first.
    pub walks: [usize; 2],
    /// Whether one of the walks was turned round: they run against each other.
    pub reversed: bool,
    /// What the search compares; what is close to the least is fitted once more.
    pub score: f64,
    /// What the choice compares among those; the least wins. On the scale of the score.
    pub unlikeliness: Option<f64>,
    /// Outline that the curve does not explain, cut faces aside; 0 at the truth. No fraction: it is
    /// summed along the outlines, as [`OutlineDiagnostics::unexplained`].
    ///
    /// [`OutlineDiagnostics::unexplained`]: crate::OutlineDiagnostics::unexplained
    pub unexplained: f64,
    /// Curve that the masks do not show; 0 at the truth. Summed along the curve, as
    /// [`OutlineDiagnostics::outside`].
    ///
    /// [`OutlineDiagnostics::outside`]: crate::OutlineDiagnostics::outside
    pub outside: f64,
    /// Mean squared residual of the boundary points, px²; 1/18 at the truth.
    pub chi_per_point: f64,
    /// Mean epipolar disagreement of its two walks, px.
    pub mean_distance_px: f64,
    /// Points along the curve.
    pub points: Vec<Point3>,
}

/// What a walk did at a place where strands meet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JunctionDecision {
    /// The place, `[x, y]`, px.
    pub at: [f64; 2],
    /// The way taken, in words.
    pub taken: String,
    /// Price of its turn.
    pub price: f64,
    /// The ways not taken.
    pub alternatives: Vec<Alternative>,
}

/// A way that was not taken.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alternative {
    /// The way, in words.
    pub way: String,
    /// Price of its turn.
    pub price: f64,
}
