use accurate_fit::OutlineFitParams;
use accurate_geom::nalgebra::Point2;
use accurate_geom::{Camera, Curve3, Pixel, Point3, Polyline, View};
use accurate_match::FreeEnds;

use super::other_ways::{OtherWay, other_ways};
use super::score::Candidate;
use super::search::{Effort, PLAIN, SAME_PX, Search};
use super::shape::{Shape, dense, px_per_unit};
use super::start::{PRICES, start_from, through};

/// Other ways of a candidate that are tried, and candidates whose ways are: without much effort ...
const QUICKLY: [usize; 2] = [2, 1];
/// ... and with it.
const THOROUGHLY: [usize; 2] = [12, 3];
/// Without much effort a curve is left whose score is so much behind the best or more.
const BEHIND: f64 = 0.5;
/// The whole body is seen at once as this wide where strands run side by side, px more than it is.
const APART_PX: f64 = 1.0;

impl Search<'_> {
    /// The finalists with curves among them that run otherwise through one view where its outline
    /// hardly tells: strands side by side change places, a loop is run through the other way. Also how
    /// many were fitted.
    pub(crate) fn rerouted(&self, mut finalists: Vec<Candidate>) -> (Vec<Candidate>, usize) {
        let [most, candidates] = match self.effort {
            Effort::Quick => QUICKLY,
            Effort::Thorough => THOROUGHLY,
        };
        let mut rerouted = Vec::new();
        for candidate in finalists.iter().take(candidates) {
            let starts = self.starts_elsewhere(candidate).filter(|start| {
                let shape = Shape::new(start, self.rig);
                !finalists.iter().any(|known| shape.is_along(&known.shape, SAME_PX))
            });
            rerouted.extend(starts.take(most).filter_map(|start| {
                let mut other = candidate.refitted(self.fit(&start, &PLAIN)?, self.rig);
                other.good = other.is_good(self.params);
                Some(other)
            }));
        }
        let fits = rerouted.len();
        if self.effort == Effort::Quick {
            let least = finalists.first().map_or(f64::INFINITY, |best| best.score);
            rerouted.retain(|other| other.score < least + BEHIND);
        }
        if !rerouted.is_empty() {
            rerouted.append(&mut finalists);
            finalists = self.finalists(rerouted);
        }
        (finalists, fits)
    }

    /// The candidate on other ways through one view, the most promising first.
    fn starts_elsewhere<'c>(
        &'c self,
        candidate: &'c Candidate,
    ) -> impl Iterator<Item = Curve3> + 'c {
        let points = dense(&candidate.fit.curve, self.rig);
        let cameras = [self.rig.camera1(), self.rig.camera2()];
        let paths = cameras.map(|camera| seen(camera, &points)?.resample(1.0).ok());
        let mut ways: Vec<(usize, OtherWay)> = Vec::new();
        for (view, path) in paths.iter().enumerate() {
            let reach_px = 2.0 * candidate.fit.half_thickness_px[view] + APART_PX;
            let others = path.iter().flat_map(|path| other_ways(path.points(), reach_px));
            ways.extend(others.map(|way| (view, way)));
        }
        ways.sort_by(|(_, a), (_, b)| b.promise_px.total_cmp(&a.promise_px));
        ways.into_iter().filter_map(move |(view, way)| {
            let [Some(path1), Some(path2)] = &paths else { return None };
            let mut both = [path1.clone(), path2.clone()];
            both[view] = Polyline::new(way.path).ok()?.resample(1.0).ok()?;
            let length_px = paths[view].as_ref()?.length();
            self.matched_within(&points, &both, view, way.range.map(|k| k as f64), length_px)
        })
    }

    /// The start of a fit along `points`, but matched anew within a range of arc length of one view's
    /// path, which was `length_px` long.
    fn matched_within(
        &self,
        points: &[Point3],
        paths: &[Polyline<2>; 2],
        view: usize,
        range_px: [f64; 2],
        length_px: f64,
    ) -> Option<Curve3> {
        /// How much around the range is matched anew too, px.
        const AROUND_PX: f64 = 6.0;
        let (matched, _) = start_from(
            &PRICES,
            (&pixels(&paths[0]), FreeEnds::NONE),
            (&pixels(&paths[1]), FreeEnds::NONE),
            false,
            self.rig,
            OutlineFitParams::DEFAULT.knot_spacing_px,
        )?;
        let matched = dense(&matched, self.rig);
        let camera = [self.rig.camera1(), self.rig.camera2()][view];
        let before = range_px[0] - AROUND_PX;
        let behind = length_px - range_px[1] - AROUND_PX;
        // From either end by its own length: within the range they may differ.
        let cut = |points: &[Point3]| {
            let path = seen(camera, points)?;
            let arc = path.cumulative_lengths();
            let from = arc.partition_point(|s| *s < before);
            let to = arc.partition_point(|s| *s <= path.length() - behind);
            Some([from, to.max(from)])
        };
        let ([a, b], [c, d]) = (cut(points)?, cut(&matched)?);
        let spliced = [&points[..a], &matched[c..d], &points[b..]].concat();
        through(&spliced, px_per_unit(points, self.rig))
    }
}

fn seen(camera: &Camera, points: &[Point3]) -> Option<Polyline<2>> {
    let path: Option<Vec<Point2<f64>>> = points.iter().map(|p| camera.project(p).ok()).collect();
    Polyline::new(path?).ok()
}

fn pixels<V: View>(path: &Polyline<2>) -> Vec<Pixel<V>> {
    path.points().iter().map(|p| Pixel::new(p.x, p.y)).collect()
}
