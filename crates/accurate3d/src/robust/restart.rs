use accurate_fit::{OutlineFitParams, side_by_side, start_curve};
use accurate_geom::{Curve3, Point3, View1, View2};
use accurate_match::FreeEnds;

use super::candidates::ViewCandidates;
use super::fitting::{ANNEALED, PLAIN, SETTLED};
use super::pairs::Tried;
use super::score::{Candidate, CutEnds};
use super::search::{Effort, Search};
use super::shape::{Shape, arc_lengths_px, dense, is_shown_near, px_per_unit};
use super::start::{OTHER_PRICES, start_from};

/// A start no farther than this from a fitted curve would end there, px: within reach of the fit.
const SAME_START_PX: f64 = 4.0;

/// How much around the ends of bridges a restart spans smoothly, px.
pub(crate) const BRIDGED_PX: [f64; 2] = [12.0, 25.0];

impl Search<'_> {
    /// The first walk pairs again, matched from corner to corner: some stretches along epipolar lines
    /// come out otherwise. Without much effort only where that start is another one than those `tried`.
    /// Before that, where a walk takes bridges, once more without what lies near them.
    pub(crate) fn restarted(
        &self,
        finalists: &[Candidate],
        tried: &[Tried],
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
    ) -> Vec<Candidate> {
        let restarts = |candidate: &Candidate| {
            let mut more = Vec::new();
            for reach_px in BRIDGED_PX {
                let bridged = self.bridged(candidate, reach_px);
                more.extend(
                    bridged.and_then(|start| self.anew(candidate, &start, &PLAIN, SETTLED)),
                );
            }
            let [i, j] = candidate.walks;
            let start = start_from(
                &OTHER_PRICES,
                (&view1.walks[i].points, FreeEnds::NONE),
                (&view2.walks[j].points, FreeEnds::NONE),
                candidate.reversed,
                self.rig,
                OutlineFitParams::DEFAULT.knot_spacing_px,
            );
            let Some((start, _)) = start else { return more };
            if self.effort == Effort::Quick {
                let shape = Shape::new(&start, self.rig);
                if shape.is_along(&candidate.shape, SAME_START_PX)
                    || tried.iter().any(|t| t.starts_as(&shape))
                {
                    return more;
                }
            }
            for params in [PLAIN, ANNEALED] {
                more.extend(self.anew(candidate, &start, &params, SETTLED));
            }
            more
        };
        side_by_side(&finalists[..finalists.len().min(3)], restarts).concat()
    }

    /// A start that leaves out what is near the ends of bridges, px in either view, and spans it
    /// smoothly: the rim of what hides the body may have drawn the fit aside. `None` where there are
    /// no bridges.
    fn bridged(&self, candidate: &Candidate, reach_px: f64) -> Option<Curve3> {
        if candidate.cuts.iter().all(Vec::is_empty) {
            return None;
        }
        let points = dense(&candidate.fit.curve, self.rig);
        let px_per_unit = px_per_unit(&points, self.rig);
        let last = points.len() - 1;
        let arc_px = arc_lengths_px(&points, px_per_unit);
        let (kept, arc_px): (Vec<Point3>, Vec<f64>) = points
            .iter()
            .zip(arc_px)
            .enumerate()
            .filter(|(k, (point, _))| {
                !self.is_near(&candidate.cuts, point, reach_px) || *k == 0 || *k == last
            })
            .map(|(_, (point, arc))| (*point, arc))
            .unzip();
        start_curve(&kept, &arc_px, OutlineFitParams::DEFAULT.knot_spacing_px).ok()
    }

    /// Whether a point lies near an end of a bridge in either view.
    pub(crate) fn is_near(&self, cuts: &CutEnds, point: &Point3, reach_px: f64) -> bool {
        let cameras = [self.rig.camera1(), self.rig.camera2()];
        cameras.iter().zip(cuts).any(|(camera, cuts)| is_shown_near(camera, point, cuts, reach_px))
    }
}
