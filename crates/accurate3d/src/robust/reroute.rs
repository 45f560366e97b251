use accurate_fit::{OutlineFitParams, side_by_side};
use accurate_geom::{Camera, Curve3, Pixel, Point3, Polyline, Rig, View};
use accurate_match::FreeEnds;

use super::finalists::SAME_PX;
use super::fitting::{PLAIN, SETTLED};
use super::other_ways::{OtherWay, other_ways};
use super::score::Candidate;
use super::search::{Effort, Search};
use super::shape::{Shape, dense, image_of, px_per_unit};
use super::start::{PRICES, start_from, through};

/// Other ways of a candidate that are tried, and candidates whose ways are: without much effort ...
const QUICKLY: [usize; 2] = [6, 1];
/// ... and with it.
const THOROUGHLY: [usize; 2] = [12, 3];
/// Without much effort a curve is left whose score is so much behind the best or more.
const BEHIND: f64 = 0.5;
/// Strands run side by side where their bodies are no farther apart than this, px.
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
        let elsewhere = |candidate: &Candidate| {
            let starts = self.starts_elsewhere(candidate).filter(|start| {
                let shape = Shape::new(start, self.rig);
                !finalists.iter().any(|known| shape.is_along(&known.shape, SAME_PX))
            });
            let others = side_by_side(&starts.take(most).collect::<Vec<_>>(), |start| {
                self.anew(candidate, start, &PLAIN, SETTLED)
            });
            others.into_iter().flatten().collect::<Vec<_>>()
        };
        let tried = &finalists[..finalists.len().min(candidates)];
        let mut rerouted = side_by_side(tried, elsewhere).concat();
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

    /// Starts on other ways through one view, the most promising first.
    fn starts_elsewhere<'c>(
        &'c self,
        candidate: &'c Candidate,
    ) -> impl Iterator<Item = Curve3> + 'c {
        let shown = Shown::of(dense(&candidate.fit.curve, self.rig), self.rig);
        shown.into_iter().flat_map(move |shown| {
            let mut ways: Vec<(usize, OtherWay)> = Vec::new();
            for (view, path) in shown.paths.iter().enumerate() {
                let reach_px = 2.0 * candidate.fit.half_thickness_px[view] + APART_PX;
                ways.extend(other_ways(path.points(), reach_px).into_iter().map(|way| (view, way)));
            }
            ways.sort_by(|(_, a), (_, b)| b.promise_px.total_cmp(&a.promise_px));
            ways.into_iter().filter_map(move |(view, way)| self.matched_within(&shown, view, way))
        })
    }

    /// The start of a fit that takes another way through one view: matched anew where it does, along
    /// the curve elsewhere.
    fn matched_within(&self, shown: &Shown, view: usize, way: OtherWay) -> Option<Curve3> {
        /// How much around the other way is matched anew too, px.
        const AROUND_PX: f64 = 6.0;
        let mut paths = shown.paths.each_ref();
        let changed = Polyline::new(way.path).ok()?.resample(1.0).ok()?;
        paths[view] = &changed;
        let (matched, _) = start_from(
            &PRICES,
            (&pixels(paths[0]), FreeEnds::NONE),
            (&pixels(paths[1]), FreeEnds::NONE),
            false,
            self.rig,
            OutlineFitParams::DEFAULT.knot_spacing_px,
        )?;
        let matched = dense(&matched, self.rig);
        let [from, to] = way.range.map(|k| k as f64);
        let before = from - AROUND_PX;
        let behind = shown.paths[view].length() - to - AROUND_PX;
        // From either end by its own length: within the range they may differ.
        let cut = |path: &Polyline<2>| {
            let arc = path.cumulative_lengths();
            let from = arc.partition_point(|s| *s < before);
            let to = arc.partition_point(|s| *s <= path.length() - behind);
            [from, to.max(from)]
        };
        let camera = [self.rig.camera1(), self.rig.camera2()][view];
        let ([a, b], [c, d]) = (cut(&shown.images[view]), cut(&seen(camera, &matched)?));
        let spliced = [&shown.points[..a], &matched[c..d], &shown.points[b..]].concat();
        through(&spliced, shown.px_per_unit)
    }
}

/// A curve as both views show it.
struct Shown {
    points: Vec<Point3>,
    px_per_unit: f64,
    /// The points, by view ...
    images: [Polyline<2>; 2],
    /// ... and with a vertex every px.
    paths: [Polyline<2>; 2],
}

impl Shown {
    fn of(points: Vec<Point3>, rig: &Rig) -> Option<Self> {
        let images = [seen(rig.camera1(), &points)?, seen(rig.camera2(), &points)?];
        let paths = [images[0].resample(1.0).ok()?, images[1].resample(1.0).ok()?];
        let px_per_unit = px_per_unit(&points, rig);
        Some(Self { points, px_per_unit, images, paths })
    }
}

fn seen(camera: &Camera, points: &[Point3]) -> Option<Polyline<2>> {
    Polyline::new(image_of(camera, points)?).ok()
}

fn pixels<V: View>(path: &Polyline<2>) -> Vec<Pixel<V>> {
    path.points().iter().map(|p| Pixel::new(p.x, p.y)).collect()
}
