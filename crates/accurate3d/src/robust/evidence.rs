use accurate_fit::OutlineFit;
use accurate_geom::{Curve3, Rig, View};
use accurate_traverse::Walk;
use serde::{Deserialize, Serialize};

use super::hairpins::{DOUBLED, KINKS, Turns};
use super::score::{BENDING, Candidate, MISFIT};
use super::shape::{Shape, px_per_unit_along};

/// What bears on whether a chosen curve is the right one, all known without the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Boundary points of both outlines.
    pub boundary_points: usize,
    /// Outline that the curve does not explain, cut faces at bridges aside; 0 at the truth.
    pub unexplained: f64,
    /// Curve that the masks do not show; 0 at the truth.
    pub outside: f64,
    /// Mean squared residual of the boundary points, px²; 1/18 at the truth.
    pub chi_per_point: f64,
    /// The largest such mean over 50 px of the curve.
    pub worst_chi_per_point: f64,
    /// By how much the likeliest curve that is another one (somewhere more than 5 px away) is less
    /// likely, in twelfths of -2 ln of the probability; none if there is no other.
    pub margin: Option<f64>,
    /// Mean distance of the pixels of one view to their partners' epipolar lines, of the walks that the
    /// curve started from, px.
    pub walks_distance_px: f64,
    /// Part of the less covered skeleton that its walk leaves out.
    pub uncovered: f64,
    /// By how much the walks are dearer than the cheapest of each view, in the unit of their cost.
    pub walks_behind: f64,
    /// Fraction of the walks' points where two strands lie on each other.
    pub overlap: f64,
    /// Bridges over gaps that the walks take.
    pub bridges: usize,
    /// Junctions where the walks could have gone on otherwise.
    pub junctions: usize,
    /// Largest standard deviation of the curve across its own direction, px; 0 if unknown.
    pub sigma_px: f64,
    /// Fraction of the curve that runs along epipolar lines (within 6 degrees).
    pub along_epipolar_line: f64,
    /// How far the last, adaptive fit moved the curve, px.
    pub last_move_px: f64,
    /// `∫ min(κ, 0.1 / px) |dθ|` of the curve, 1/px.
    pub bending: f64,
    /// By how much a curve of images turns where it bends more sharply than a radius of 4 px allows,
    /// radians; 0 of masks.
    pub kinks: f64,
    /// Length along which the curve lies upon itself in both views and runs back, px.
    pub doubled_px: f64,
}

impl Evidence {
    /// What a score counts of it that does not depend on how many boundary points there are.
    pub(crate) fn cost(&self) -> f64 {
        let turns = Turns { kinks: self.kinks, doubled_px: self.doubled_px };
        MISFIT * (self.unexplained + self.outside)
            + BENDING * self.bending
            + turns.price([KINKS, DOUBLED])
    }

    pub(crate) fn new(
        best: &Candidate,
        before: &Shape,
        margin: f64,
        walks: &Walks,
        rig: &Rig,
    ) -> Self {
        let judgement = &best.fit.judgement;
        Self {
            boundary_points: judgement.boundary_points(),
            unexplained: best.misfit - judgement.outside,
            outside: judgement.outside,
            chi_per_point: judgement.chi_per_point(),
            worst_chi_per_point: judgement.worst_chi_per_point,
            margin: margin.is_finite().then_some(margin),
            walks_distance_px: best.mean_distance_px,
            uncovered: walks.uncovered,
            walks_behind: walks.behind,
            overlap: walks.overlap,
            bridges: walks.bridges,
            junctions: walks.junctions,
            sigma_px: largest_sigma_px(&best.fit, rig),
            along_epipolar_line: along_epipolar_line(&best.fit.curve, rig),
            last_move_px: before.distance_px(&best.shape),
            bending: super::shape::bending(&best.fit.curve, rig),
            kinks: best.turns.kinks,
            doubled_px: best.turns.doubled_px,
        }
    }
}

/// What the two chosen walks say.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Walks {
    uncovered: f64,
    behind: f64,
    overlap: f64,
    bridges: usize,
    junctions: usize,
}

impl Walks {
    /// Takes in the walk of one view, out of all of that view.
    pub(crate) fn add<V: View>(&mut self, all: &[Walk<V>], chosen: usize, bridges: usize) {
        let walk = &all[chosen];
        let cheapest = all.iter().map(|w| w.cost.total()).fold(f64::INFINITY, f64::min);
        self.uncovered = self.uncovered.max(1.0 - walk.coverage);
        self.behind += walk.cost.total() - cheapest;
        let reused = walk.flags.iter().filter(|flag| flag.reused).count();
        self.overlap += 0.5 * reused as f64 / walk.flags.len().max(1) as f64;
        self.bridges += bridges;
        let open = |d: &&accurate_traverse::Decision<V>| {
            d.alternatives.iter().any(|(_, price)| price.is_finite())
        };
        self.junctions += walk.decisions.iter().filter(open).count();
    }
}

const SAMPLES: usize = 200;

/// The largest standard deviation of the curve across its own direction, px; 0 if unknown.
fn largest_sigma_px(fit: &OutlineFit, rig: &Rig) -> f64 {
    let Some(covariance) = &fit.covariance else { return 0.0 };
    let curve = &fit.curve;
    let variance = curve
        .uniform_parameters(SAMPLES)
        .into_iter()
        .map(|t| covariance.across(curve, t).1.symmetric_eigenvalues().max())
        .fold(0.0, f64::max);
    variance.sqrt() * px_per_unit_along(curve, rig)
}

/// A curve runs along the epipolar lines of both views where its tangent lies in the epipolar plane.
fn along_epipolar_line(curve: &Curve3, rig: &Rig) -> f64 {
    const SINE: f64 = 0.1;
    let (c1, c2) = (rig.camera1().centre(), rig.camera2().centre());
    let along = |t: &f64| {
        let normal = (c2 - c1).cross(&(curve.at(*t) - c1));
        let tangent = curve.derivative(*t);
        normal.dot(&tangent).abs() < SINE * normal.norm() * tangent.norm()
    };
    curve.uniform_parameters(SAMPLES).iter().filter(|t| along(t)).count() as f64 / SAMPLES as f64
}
