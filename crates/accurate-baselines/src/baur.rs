use accurate_geom::{Pixel, Rig, Triangulation, View1, View2};
use accurate_match::{
    CostModel, CurveMatcher, CurvePoint, CurveReconstruction, DistanceKind, MatchError, PixelPair,
    triangulate_pairs, validate_curve,
};

use crate::grid_path::{cheapest_grid_path, cheapest_of_each_run};
use crate::pchip::Pchip;
use crate::range::{not_negative, positive};
use crate::reprojection_fit::{Fit, Observation, Prior, fit};
use crate::resample::{Match, Scene};
use crate::track::Track;

/// Baur-style reconstruction: `baur`.
///
/// Samples of both curves are matched by the monotone path of least summed symmetric epipolar
/// distance, found by Dijkstra's algorithm on the explicit graph. The best pair of every
/// one-to-many run is triangulated, and a cubic B-spline in space is fitted to the images by
/// Levenberg-Marquardt, under a curvature weight and, for a device of known length, that length.
///
/// # Source
/// Baur et al., Int. J. CARS 11, 2016: reconstruction that "does not purely rely on triangulation
/// but incorporates prior knowledge about the catheters"; to it ACCURATE, section 2.3, attributes
/// the least sum of `D_ij` over monotone correspondences and the one-to-many runs. Everything else
/// is our choice, and no published number is claimed for it.
///
/// # Cost
/// O(N log N) time and 9 bytes for N = n1 · n2 pairs of samples (up to 4 million by default), then O(n)
/// per iteration of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Baur {
    /// Noise of the input points per coordinate, px: how closely the splines follow them; 0 for
    /// splines through them.
    pub sigma_px: f64,
    /// Distance of the samples along both curves, px.
    pub step_px: f64,
    /// Most samples per view, at least 2: longer curves are sampled less densely. The graph has as
    /// many nodes as the product of both.
    pub max_samples: usize,
    /// Length of a span of the spline in space, px of the images.
    pub span_px: f64,
    /// Weight of the integral of the squared curvature (taken in 1/px) against squared px: px³.
    /// Details shorter than about the fourth root of its product with the sample spacing (3.2 px at
    /// the defaults) are smoothed.
    pub curvature_weight_px3: f64,
    /// Length of the device, if it is known and all of it is seen.
    pub known_length: Option<KnownLength>,
    /// Distance of the points returned, in the rig's unit; `None` for about a point per image px.
    pub output_step: Option<f64>,
    /// Iterations after which the fit counts as failed.
    pub max_iterations: usize,
}

/// The length of a device between its ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownLength {
    /// In the rig's unit.
    pub length: f64,
    /// Standard deviation, in the rig's unit, against residuals of 1 px.
    pub sigma: f64,
}

/// What [`Baur::solve`] finds out.
#[derive(Debug, Clone, PartialEq)]
pub struct BaurReconstruction {
    /// The curve: the fitted one, or the triangulated pairs if [`Refinement::Failed`].
    pub curve: CurveReconstruction,
    /// Sum of the symmetric epipolar distances along the path, px.
    pub path_cost_px: f64,
    /// What became of the fit.
    pub refinement: Refinement,
}

/// Outcome of the fit of [`Baur`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refinement {
    /// The energy has settled.
    Converged {
        /// Levenberg-Marquardt iterations.
        iterations: usize,
        /// Root mean square distance, px, of a matched pixel to the projected curve.
        rms_px: f64,
    },
    /// Too few pairs, a point left the space before a camera, or the energy did not settle.
    Failed,
}

/// Most points returned, whatever the output step.
const MAX_OUTPUT: usize = 1_000_000;

impl Baur {
    /// Name of the method.
    pub const NAME: &'static str = "baur";

    /// As [`CurveMatcher::reconstruct`], with the cost of the path and the outcome of the fit.
    ///
    /// # Errors
    /// As [`CurveMatcher::reconstruct`]; a fit that fails is no error.
    pub fn solve(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<BaurReconstruction, MatchError> {
        self.check()?;
        validate_curve(curve1)?;
        validate_curve(curve2)?;
        let track1 = Track::new(curve1, self.sigma_px)?;
        let track2 = Track::new(curve2, self.sigma_px)?;
        let places1 = track1.samples(self.step_px, self.max_samples);
        let places2 = track2.samples(self.step_px, self.max_samples);
        let samples1: Vec<_> = places1.iter().map(|&u| track1.pixel(u)).collect();
        let samples2: Vec<_> = places2.iter().map(|&u| track2.pixel(u)).collect();

        let kind = DistanceKind::Symmetric;
        let costs = CostModel::new(rig.fundamental(), &samples1, &samples2, kind)?;
        let cost = |i, j| costs.cost(i, j);
        let path = cheapest_grid_path(samples1.len(), samples2.len(), cost)?;
        let pairs: Vec<PixelPair> = cheapest_of_each_run(&path.cells, cost)
            .into_iter()
            .map(|(i, j)| PixelPair { cell: (i, j), pixel1: samples1[i], pixel2: samples2[j] })
            .collect();
        let mut curve = triangulate_pairs(Self::NAME, rig, Triangulation::LindstromNiter2, &pairs)?;
        let places: Vec<Match> =
            curve.pairs.iter().map(|&(i, j)| (places1[i], places2[j])).collect();
        for (cell, place) in curve.pairs.iter_mut().zip(&places) {
            *cell = (track1.nearest_input(place.0), track2.nearest_input(place.1));
        }
        let scene = Scene { rig, track1: &track1, track2: &track2 };
        let fitted = self.fit_to(&curve, &places, rig).and_then(|fit| {
            let resampled = self.resample(&fit, &places, &scene)?;
            Some((resampled, fit))
        });
        let refinement = match fitted {
            Some((resampled, fit)) => {
                curve = CurveReconstruction { dropped: curve.dropped, ..resampled };
                Refinement::Converged { iterations: fit.iterations, rms_px: fit.rms_px }
            }
            None => Refinement::Failed,
        };
        Ok(BaurReconstruction { curve, path_cost_px: path.cost, refinement })
    }

    fn check(&self) -> Result<(), MatchError> {
        positive("step_px", self.step_px)?;
        positive("span_px", self.span_px)?;
        not_negative("curvature_weight_px3", self.curvature_weight_px3)?;
        if let Some(known) = self.known_length {
            positive("known length", known.length)?;
            positive("sigma of the known length", known.sigma)?;
        }
        if let Some(step) = self.output_step {
            positive("output_step", step)?;
        }
        Ok(())
    }

    fn fit_to(&self, curve: &CurveReconstruction, places: &[Match], rig: &Rig) -> Option<Fit> {
        let observations: Vec<Observation> = curve
            .points
            .iter()
            .zip(places)
            .map(|(point, place)| Observation {
                t: parameter(place),
                pixel1: point.pixel1,
                pixel2: point.pixel2,
                position: point.position,
            })
            .collect();
        let (first, last) = (observations.first()?, observations.last()?);
        let spans = ((last.t - first.t) / self.span_px).ceil().max(1.0) as usize;
        let prior = Prior {
            curvature_px3: self.curvature_weight_px3,
            px_per_unit: px_per_unit(&observations, rig)?,
            length: self.known_length.map(|known| (known.length, known.sigma)),
            max_iterations: self.max_iterations,
        };
        // A span without an observation has only the curvature weight to hold it.
        fit(&observations, spans.min(observations.len()), rig, &prior)
    }

    /// Points at equal steps of the arc length; `None` if one is not in front of both cameras.
    fn resample(
        &self,
        fit: &Fit,
        places: &[Match],
        scene: &Scene<'_>,
    ) -> Option<CurveReconstruction> {
        let steps = match self.output_step {
            Some(step) => fit.spline.length() / step,
            None => fit.spline.width * fit.spline.spans() as f64,
        };
        let count = (steps.round() as usize).clamp(1, MAX_OUTPUT) + 1;
        let along = |of: fn(&Match) -> f64| {
            let knots: Vec<_> = places.iter().map(|p| (parameter(p), of(p))).collect();
            Pchip::new(&knots).ok()
        };
        let (place1, place2) = (along(|p| p.0)?, along(|p| p.1)?);
        let mut points = Vec::with_capacity(count);
        let mut pairs = Vec::with_capacity(count);
        for t in equal_steps(fit, count) {
            let position = fit.spline.point(t);
            scene.rig.project(&position).ok()?;
            // The matched pixels, not the projections: their distance says how well views agree.
            let (u1, u2) = (place1.value(t), place2.value(t));
            let (pixel1, pixel2) = (scene.track1.pixel(u1), scene.track2.pixel(u2));
            let epipolar_distance_px = scene.rig.fundamental().line(pixel2).ok()?.distance(pixel1);
            points.push(CurvePoint { position, pixel1, pixel2, epipolar_distance_px });
            pairs.push((scene.track1.nearest_input(u1), scene.track2.nearest_input(u2)));
        }
        Some(CurveReconstruction { points, pairs, dropped: 0 })
    }
}

impl Default for Baur {
    /// Samples every 2 px, spans of 20 px, a curvature weight that smooths details of a few px.
    fn default() -> Self {
        Self {
            sigma_px: 0.3,
            step_px: 2.0,
            max_samples: 2048,
            span_px: 20.0,
            curvature_weight_px3: 50.0,
            known_length: None,
            output_step: None,
            max_iterations: 100,
        }
    }
}

impl CurveMatcher for Baur {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn reconstruct(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CurveReconstruction, MatchError> {
        Ok(self.solve(curve1, curve2, rig)?.curve)
    }
}

/// Curve parameter of a matched pair, px: smooth where either view is, as the chords of noisy
/// triangulated points would not be.
fn parameter(place: &Match) -> f64 {
    0.5 * (place.0 + place.1)
}

/// Magnification at the middle of the curve: focal length over depth, mean of both views.
fn px_per_unit(observations: &[Observation], rig: &Rig) -> Option<f64> {
    let middle = observations.get(observations.len() / 2)?.position;
    let magnification = [rig.camera1(), rig.camera2()].map(|camera| {
        let k = camera.k();
        (k[(0, 0)] * k[(1, 1)]).abs().sqrt() / camera.depth(&middle)
    });
    let mean = 0.5 * (magnification[0] + magnification[1]);
    (mean.is_finite() && mean > 0.0).then_some(mean)
}

/// `count` parameters at equal steps of the arc length, both ends among them.
fn equal_steps(fit: &Fit, count: usize) -> Vec<f64> {
    // Between neighbours of so fine a table the speed of a cubic hardly changes.
    let fine = (8 * fit.spline.spans()).max(4 * count);
    let end = fit.spline.width * fit.spline.spans() as f64;
    let at = |k: usize| fit.spline.start + end * (k as f64 / fine as f64);
    let mut arc = Vec::with_capacity(fine + 1);
    let mut sum = 0.0;
    for k in 0..=fine {
        if k > 0 {
            sum += (fit.spline.point(at(k)) - fit.spline.point(at(k - 1))).norm();
        }
        arc.push(sum);
    }
    let mut left = 0;
    (0..count)
        .map(|k| {
            let s = sum * (k as f64 / (count - 1).max(1) as f64);
            while left + 2 < arc.len() && arc[left + 1] <= s {
                left += 1;
            }
            let step = arc[left + 1] - arc[left];
            let share = if step > 0.0 { ((s - arc[left]) / step).clamp(0.0, 1.0) } else { 0.0 };
            at(left) + (at(left + 1) - at(left)) * share
        })
        .collect()
}
