use accurate_geom::number::{Number, Vector};
use pulp::{Arch, Simd, WithSimd};

use crate::chords::Chords;
use crate::outline::OutlineData;

/// Outline points that are looked at together.
pub(crate) const LANES: usize = 8;

/// Coordinates of outline points, `LANES` of them side by side; the last ones may be NaN.
#[derive(Debug, Clone)]
pub(crate) struct PointLanes {
    x: Vec<[f64; LANES]>,
    y: Vec<[f64; LANES]>,
}

impl PointLanes {
    /// Of `[x, y, ..]` points.
    pub(crate) fn new(points: &[[f64; 4]]) -> Self {
        let side_by_side = |axis: usize| {
            let lanes = |chunk: &[[f64; 4]]| {
                std::array::from_fn(|k| chunk.get(k).map_or(f64::NAN, |point| point[axis]))
            };
            points.chunks(LANES).map(lanes).collect()
        };
        Self { x: side_by_side(0), y: side_by_side(1) }
    }
}

/// For every outline point the nearest point of a projected curve.
#[derive(Debug, Clone, Default)]
pub(crate) struct NearestPoints {
    len: usize,
    squared: Vec<[f64; LANES]>,
    u: Vec<[f64; LANES]>,
}

impl NearestPoints {
    /// Number of outline points.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Squared distances, px²; infinite where there is none within reach.
    pub(crate) fn squared(&self) -> &[f64] {
        &self.squared.as_flattened()[..self.len]
    }

    /// Parameters on the curve; NaN where there is none within reach.
    pub(crate) fn u(&self) -> &[f64] {
        &self.u.as_flattened()[..self.len]
    }

    /// Replaces one.
    pub(crate) fn set(&mut self, i: usize, squared: f64, u: f64) {
        self.squared[i / LANES][i % LANES] = squared;
        self.u[i / LANES][i % LANES] = u;
    }

    /// Finds them anew, if nearer than `radius_px`; of equally near chords the first.
    ///
    /// Works from the curve's side: each chord visits the outline points around it. The outline's
    /// grid is built once per image, the curve's would have to be built in every iteration.
    pub(crate) fn find(&mut self, chords: &Chords, outline: &OutlineData, radius_px: f64) {
        let lanes = outline.lanes.x.len();
        self.len = outline.points.len();
        self.squared.clear();
        self.squared.resize(lanes, [radius_px * radius_px; LANES]);
        self.u.clear();
        self.u.resize(lanes, [f64::NAN; LANES]);
        // No operation is fused: the same points on every machine.
        Arch::new().dispatch(Visit { found: self, chords, outline, radius_px });
    }
}

/// Every chord's visit to the points around it.
struct Visit<'a> {
    found: &'a mut NearestPoints,
    chords: &'a Chords,
    outline: &'a OutlineData,
    radius_px: f64,
}

impl WithSimd for Visit<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { found, chords, outline, radius_px } = self;
        let to_u = chords.parameter(1);
        for (k, pair) in chords.points.windows(2).enumerate() {
            let [ax, ay, bx, by] = [pair[0].x, pair[0].y, pair[1].x, pair[1].y];
            let (ex, ey) = (bx - ax, by - ay);
            let inverse = 1.0 / (ex * ex + ey * ey).max(f64::MIN_POSITIVE);
            let bounds = [
                ax.min(bx) - radius_px,
                ay.min(by) - radius_px,
                ax.max(bx) + radius_px,
                ay.max(by) + radius_px,
            ];
            let chord = Chord { a: [ax, ay], e: [ex, ey], inverse, begin: k as f64, to_u };
            let (rows, columns) = outline.grid.buckets_of(bounds);
            for row in rows {
                let points = outline.grid.points_of(row, &columns);
                // Whole lanes: what lies outside the box is out of reach.
                for lanes in points.start / LANES..points.end.div_ceil(LANES) {
                    let (x, y) = (&outline.lanes.x[lanes], &outline.lanes.y[lanes]);
                    chord.visit(simd, x, y, &mut found.squared[lanes], &mut found.u[lanes]);
                }
            }
        }
        for (squared, u) in found.squared.iter_mut().zip(&found.u) {
            for lane in 0..LANES {
                squared[lane] = if u[lane].is_nan() { f64::INFINITY } else { squared[lane] };
            }
        }
    }
}

struct Chord {
    a: [f64; 2],
    e: [f64; 2],
    /// One over the squared length.
    inverse: f64,
    /// Number of the chord.
    begin: f64,
    /// Parameters per chord.
    to_u: f64,
}

impl Chord {
    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        x: &[f64; LANES],
        y: &[f64; LANES],
        squared: &mut [f64; LANES],
        u: &mut [f64; LANES],
    ) {
        for k in 0..LANES / S::F64_LANES {
            let (x, y) = (Vector::load(simd, x, k), Vector::load(simd, y, k));
            let (ex, ey) = (x.all(self.e[0]), x.all(self.e[1]));
            let (dx, dy) = (x - x.all(self.a[0]), y - x.all(self.a[1]));
            let t = (dx * ex + dy * ey) * x.all(self.inverse);
            let t = t.larger(x.all(0.0)).smaller(x.all(1.0));
            let (rx, ry) = (dx - t * ex, dy - t * ey);
            let here = rx * rx + ry * ry;
            let least = Vector::load(simd, squared, k);
            let gain = least - here;
            gain.if_positive(here, least).store(squared, k);
            let place = (x.all(self.begin) + t) * x.all(self.to_u);
            gain.if_positive(place, Vector::load(simd, u, k)).store(u, k);
        }
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::{Curve3, View1, View2};
    use accurate_synth::{CaseOptions, Family, generate};
    use pulp::Scalar;

    use super::*;
    use crate::pose::pose;
    use crate::{Outline, OutlinePair};

    /// By a scan of all chords, of crossing wires and of both views; with and without vectors.
    #[test]
    fn the_nearest_points_are_those_of_a_scan() {
        const RADIUS_PX: f64 = 4.5;
        let mut found_some = 0;
        for (family, index) in [(Family::Hard, 0), (Family::Carm, 1), (Family::SimPaper, 2)] {
            let case = generate(family, 1901, index, &CaseOptions::default()).unwrap();
            let one = Outline::<View1>::from_mask(case.masks[0].view()).unwrap();
            let two = Outline::<View2>::from_mask(case.masks[1].view()).unwrap();
            let pair = OutlinePair::new(&one, &two);
            let points: Vec<_> = case.truth.iter().step_by(25).copied().collect();
            let truth = Curve3::interpolate(&points).unwrap();
            let (problem, spline) = pose(&truth, &pair, &case.rig, 10.0).unwrap();
            for view in 0..2 {
                let mut chords = Chords::default();
                let projector = &problem.projectors[view];
                chords.rebuild(&spline, projector, view as u8 + 1, problem.steps).unwrap();
                let outline = problem.outlines[view];
                let mut found = NearestPoints::default();
                found.find(&chords, outline, RADIUS_PX);
                for (i, [x, y, ..]) in outline.points.iter().enumerate() {
                    let mut least = (RADIUS_PX * RADIUS_PX, f64::NAN);
                    for (k, chord) in chords.points.windows(2).enumerate() {
                        let e = chord[1] - chord[0];
                        let (dx, dy) = (x - chord[0].x, y - chord[0].y);
                        let inverse = 1.0 / (e.x * e.x + e.y * e.y);
                        let t = ((dx * e.x + dy * e.y) * inverse).clamp(0.0, 1.0);
                        let (rx, ry) = (dx - t * e.x, dy - t * e.y);
                        let squared = rx * rx + ry * ry;
                        if squared < least.0 {
                            least = (squared, (k as f64 + t) * chords.parameter(1));
                        }
                    }
                    if least.1.is_nan() {
                        assert_eq!(found.squared()[i], f64::INFINITY);
                    } else {
                        found_some += 1;
                        assert_eq!((found.squared()[i], found.u()[i]), least);
                    }
                }
                let mut plain = found.clone();
                plain.squared.fill([RADIUS_PX * RADIUS_PX; LANES]);
                plain.u.fill([f64::NAN; LANES]);
                let visit =
                    Visit { found: &mut plain, chords: &chords, outline, radius_px: RADIUS_PX };
                visit.with_simd(Scalar::new());
                assert_eq!(plain.squared(), found.squared());
            }
        }
        assert!(found_some > 1000, "{found_some}");
    }
}
