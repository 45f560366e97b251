use accurate_fit::{
    CalibrationPriors, CurveEnd, FitError, IntensityFitParams, IntensityPair, ShownPiece,
};
use accurate_geom::{Curve3, Point2, Rig};
use ndarray::Array2;

use super::shape::{arc_lengths_px, dense, px_per_unit};
use super::start::through;

/// Pictures and maps together must show a piece of an end to this degree, or it lacks what is missing: as
/// dark as the rest in both pictures and in no map, or in no picture (neither dark nor bright) and in both
/// maps.
const SHOWN: f64 = 1.0;
/// An end goes if it lacks more than this, px ...
const MOST_LACKING_PX: f64 = 12.0;
/// ... and is doubted from here on.
pub(super) const DOUBTED_LACKING_PX: f64 = 3.0;
/// The shortest end that is tried, and by how much each next one is longer: as a part, and px at least.
const FIRST_PX: f64 = 5.0;
const LONGER: f64 = 0.2;
/// What must be left of the curve, of both ends together: of one that is wrong for the most part no end
/// tells which part is right.
const LEAST_PART: f64 = 0.55;

/// What tells whether the pictures show an end.
pub(super) struct Pictures<'a> {
    pub(super) images: &'a [Array2<f32>; 2],
    /// How sure a segmentation is of the body, 0 to 1.
    pub(super) maps: &'a [Array2<f32>; 2],
    pub(super) rig: &'a Rig,
    /// Priors, and the correction of view 2.
    pub(super) calibration: Option<(&'a CalibrationPriors, [f64; 3])>,
}

/// What the pictures say of a curve's ends.
#[derive(Default)]
pub(super) struct Ends {
    /// What the end that lacks most does, px.
    pub(super) lacking_px: f64,
    /// The curve without the ends that lack too much.
    pub(super) shorter: Option<Curve3>,
    /// How much of it went at its begin and end, px.
    pub(super) cut_px: [f64; 2],
}

impl Pictures<'_> {
    /// Asks whether an end hangs on the curve by one view alone: where a map shows something that is none of
    /// the body, the fit finds some way through the other view that explains it.
    pub(super) fn ends(&self, curve: &Curve3) -> Ends {
        let mut found = Ends::default();
        // Either end, once.
        for _ in 0..2 {
            let curve = found.shorter.as_ref().unwrap_or(curve);
            let Ok(Some((lacking_px, end, px))) = self.worst_end(curve, found.cut_px) else {
                break;
            };
            found.lacking_px = found.lacking_px.max(lacking_px);
            if lacking_px < MOST_LACKING_PX {
                break;
            }
            let points = dense(curve, self.rig);
            let scale = px_per_unit(&points, self.rig);
            let gone = arc_lengths_px(&points, scale).partition_point(|arc| *arc < px);
            let kept = match end {
                CurveEnd::Begin => &points[gone..],
                CurveEnd::End => &points[..points.len() - gone],
            };
            let Some(shorter) = through(kept, scale) else { break };
            found.cut_px[usize::from(end == CurveEnd::End)] = px;
            found.shorter = Some(shorter);
        }
        found
    }

    /// Of the ends that were not cut the one that lacks most: what it lacks, which it is and how long, px.
    fn worst_end(
        &self,
        curve: &Curve3,
        cut_px: [f64; 2],
    ) -> Result<Option<(f64, CurveEnd, f64)>, FitError> {
        let params = IntensityFitParams { extension_px: 0.0, ..IntensityFitParams::DEFAULT };
        let pair =
            IntensityPair::around(&[curve], self.images, self.rig, &params, self.calibration)?;
        let ends = pair.ends(curve)?;
        let gone_px: f64 = cut_px.iter().sum();
        let mut worst: Option<(f64, CurveEnd, f64)> = None;
        for end in [CurveEnd::Begin, CurveEnd::End] {
            if cut_px[usize::from(end == CurveEnd::End)] > 0.0 {
                continue;
            }
            let mut px = FIRST_PX;
            while px + gone_px < (1.0 - LEAST_PART) * (ends.length_px() + gone_px) {
                let lacking: f64 = ends.beyond(end, px).iter().map(|p| self.lacking_px(p)).sum();
                if worst.is_none_or(|(most, ..)| lacking > most) {
                    worst = Some((lacking, end, px));
                }
                px += (LONGER * px).max(FIRST_PX);
            }
        }
        Ok(worst)
    }

    fn lacking_px(&self, piece: &ShownPiece) -> f64 {
        let in_map = |view: usize| {
            if piece.upon[view] { 0.0 } else { most_near(&self.maps[view], piece.images[view]) }
        };
        let shown = 0.5 * (piece.shown[0] + piece.shown[1] + in_map(0) + in_map(1));
        piece.length_px * (SHOWN - shown)
    }
}

/// The largest value within a pixel; 0 outside.
fn most_near(map: &Array2<f32>, at: Point2) -> f64 {
    let near = |value: f64| (-1..=1).map(move |d| (value.round() as i64).saturating_add(d));
    let values = near(at.y).flat_map(|y| near(at.x).map(move |x| (y, x))).filter_map(|(y, x)| {
        map.get((usize::try_from(y).ok()?, usize::try_from(x).ok()?)).copied()
    });
    f64::from(values.fold(0.0, f32::max))
}

#[cfg(test)]
mod tests {
    use accurate_eval::curve_scores;
    use accurate_geom::Point3;
    use accurate_synth::{CaseOptions, Family, SynthCase, XrayOptions, generate, render_xray};

    use super::*;

    const TAIL_PX: f64 = 30.0;

    /// Of a body in a clear picture and the map of it.
    struct Shown {
        case: SynthCase,
        images: [Array2<f32>; 2],
        maps: [Array2<f32>; 2],
    }

    impl Shown {
        fn new(index: u64) -> Self {
            let case = generate(Family::Carm, 1904, index, &CaseOptions::default()).unwrap();
            let clear =
                XrayOptions { dose_photons_per_px: 1e5, background: 0.0, ..Default::default() };
            let images = render_xray(&case, &clear).map(|image| image.mapv(f32::from));
            let maps = case.masks.clone().map(|mask| mask.mapv(|b| if b { 0.99 } else { 0.01 }));
            Self { case, images, maps }
        }

        fn px_per_unit(&self) -> f64 {
            px_per_unit(&self.case.truth, &self.case.rig)
        }

        fn curve(&self, points: &[Point3]) -> Curve3 {
            through(points, self.px_per_unit()).unwrap()
        }

        /// The body, and straight on beyond its end.
        fn with_tail(&self) -> Vec<Point3> {
            let truth = &self.case.truth;
            let last = truth[truth.len() - 1];
            let ahead = (last - truth[truth.len() - 40]).normalize() / self.px_per_unit();
            let tail = (1..=(2.0 * TAIL_PX) as usize).map(|k| last + ahead * (0.5 * k as f64));
            truth.iter().copied().chain(tail).collect()
        }

        /// The map of a view shows the tail.
        fn draw(&mut self, view: usize) {
            let tail = self.with_tail();
            let camera = if view == 0 { self.case.rig.camera1() } else { self.case.rig.camera2() };
            for point in &tail[self.case.truth.len()..] {
                let at = camera.project(point).unwrap();
                self.maps[view][(at.y.round() as usize, at.x.round() as usize)] = 0.99;
            }
        }

        fn ends(&self, points: &[Point3]) -> Ends {
            let pictures = Pictures {
                images: &self.images,
                maps: &self.maps,
                rig: &self.case.rig,
                calibration: None,
            };
            pictures.ends(&self.curve(points))
        }

        fn off_px(&self, curve: &Curve3) -> f64 {
            let scores = curve_scores(&dense(curve, &self.case.rig), &self.case.truth, 0.1);
            scores.unwrap().hausdorff * self.px_per_unit()
        }
    }

    #[test]
    fn an_end_that_one_map_alone_shows_goes_and_the_body_stays() {
        for (index, view) in [(0, 0), (2, 1), (3, 0)] {
            let mut shown = Shown::new(index);
            let body = shown.ends(&shown.case.truth);
            assert!(body.shorter.is_none() && body.lacking_px < DOUBTED_LACKING_PX, "{index}");
            shown.draw(view);
            let mut longer = shown.with_tail();
            for end in [1, 0] {
                let found = shown.ends(&longer);
                // A px of it lacks 1.5: no picture is dark, one map of two is sure.
                assert!(found.lacking_px > TAIL_PX, "{index} {}", found.lacking_px);
                // The next longer ends that are tried.
                let cut_px = found.cut_px[end];
                assert!((cut_px - TAIL_PX).abs() < 0.25 * TAIL_PX, "{index} {cut_px}");
                assert_eq!(found.cut_px[1 - end], 0.0);
                let shorter = found.shorter.unwrap();
                assert!(shown.off_px(&shorter) < 0.25 * TAIL_PX, "{index}");
                longer.reverse();
            }
        }
    }

    #[test]
    fn what_cannot_be_asked_stays_as_it_is() {
        let mut shown = Shown::new(0);
        let longer = shown.with_tail();
        shown.images[1].fill(1000.0);
        let found = shown.ends(&longer);
        assert!(found.shorter.is_none() && found.lacking_px == 0.0 && found.cut_px == [0.0; 2]);
    }

    #[test]
    fn the_map_is_read_within_a_pixel_and_nowhere_else() {
        let mut map = Array2::zeros((8, 9));
        map[(3, 4)] = 0.7;
        assert_eq!(most_near(&map, Point2::new(5.2, 1.8)), f64::from(0.7_f32));
        for (x, y) in [(5.6, 3.0), (4.0, 1.4), (-3.0, 3.0), (4.0, 1e300), (f64::NAN, -9.0)] {
            assert_eq!(most_near(&map, Point2::new(x, y)), 0.0, "{x} {y}");
        }
    }
}
