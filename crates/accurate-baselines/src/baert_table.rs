use accurate_geom::{EpipolarLine, Pixel, Rig, Triangulation, View, View1, View2};
use accurate_match::{
    CurveMatcher, CurveReconstruction, MatchError, PixelPair, triangulate_pairs, validate_curve,
};

use crate::track::Track;

/// Baert's method as comparison tables run it: `baert-table`.
///
/// A cubic spline through the points of view 2 is sampled into a polyline. For each point of view 1,
/// the epipolar line is cut with the polyline. The first point takes the crossing of smallest x,
/// every later one the crossing nearest to the one chosen before; a point without a crossing is
/// skipped. The pairs are triangulated linearly. Nothing keeps the order along view 2.
///
/// # Source
/// Baert et al., IEEE TMI 22(10), 2003: points of a guide wire, tracked as a B-spline in both
/// planes, are matched along epipolar lines from the tip on. How it settles several crossings is
/// not known to us; smallest x, then nearest, is how the ACCURATE paper's comparison treats it. The
/// end conditions of the spline (not-a-knot) are our choice. [`Baert`](crate::Baert) is the fair
/// reading.
///
/// A sample exactly on the line counts as one crossing. Ties go to the crossing that comes first
/// along view 2.
///
/// # Cost
/// O(n2 + n1 · `samples`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BaertTable {
    /// Vertices of the polyline, at equal steps of the spline's chord length. 2000 in the table;
    /// at least 2.
    pub samples: usize,
}

impl BaertTable {
    /// As in the paper's comparison table.
    pub const PAPER: Self = Self { samples: 2000 };

    /// Name of the method.
    pub const NAME: &'static str = "baert-table";
}

impl Default for BaertTable {
    fn default() -> Self {
        Self::PAPER
    }
}

impl CurveMatcher for BaertTable {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn reconstruct(
        &self,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        rig: &Rig,
    ) -> Result<CurveReconstruction, MatchError> {
        validate_curve(curve1)?;
        validate_curve(curve2)?;
        let track = Track::new(curve2, 0.0)?;
        let step_px = track.length_px() / (self.samples.max(2) - 1) as f64;
        let polyline: Vec<Pixel<View2>> =
            (0..self.samples.max(2)).map(|k| track.pixel(k as f64 * step_px)).collect();

        let line_of = rig.fundamental().transpose();
        let mut chosen: Option<Crossing<View2>> = None;
        let mut pairs = Vec::new();
        let mut candidates = 0;
        for (i, &pixel1) in curve1.iter().enumerate() {
            // At the epipole there is no line, and so no crossing.
            let Ok(line) = line_of.line(pixel1) else { continue };
            let found = crossings(&polyline, &line);
            candidates += found.len();
            let rank = |c: &Crossing<View2>| match chosen {
                Some(last) => c.pixel.distance(last.pixel),
                None => c.pixel.x,
            };
            // `min_by` keeps the first of equals.
            let best = found.into_iter().min_by(|a, b| rank(a).total_cmp(&rank(b)));
            if let Some(crossing) = best {
                let j = track.nearest_input(crossing.place * step_px);
                pairs.push(PixelPair { cell: (i, j), pixel1, pixel2: crossing.pixel });
                chosen = best;
            }
        }
        if pairs.is_empty() {
            return Err(MatchError::NoCorrespondence { method: Self::NAME, candidates });
        }
        triangulate_pairs(Self::NAME, rig, Triangulation::Dlt, &pairs)
    }
}

/// Where a line meets a polyline.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Crossing<V: View> {
    pixel: Pixel<V>,
    /// Index of the vertex before plus the share of the segment.
    place: f64,
}

/// All crossings in the order of the polyline: vertices exactly on the line, and segments whose ends
/// lie on opposite sides, cut by linear interpolation.
fn crossings<V: View>(polyline: &[Pixel<V>], line: &EpipolarLine<V>) -> Vec<Crossing<V>> {
    let mut found = Vec::new();
    let mut before: Option<(f64, Pixel<V>)> = None;
    for (k, &pixel) in polyline.iter().enumerate() {
        let value = line.signed_distance(pixel);
        if let Some((value0, pixel0)) = before
            && ((value0 < 0.0 && value > 0.0) || (value0 > 0.0 && value < 0.0))
        {
            let share = value0 / (value0 - value);
            let between = pixel0.point() + (pixel.point() - pixel0.point()) * share;
            found.push(Crossing { pixel: between.into(), place: (k - 1) as f64 + share });
        }
        if value == 0.0 {
            found.push(Crossing { pixel, place: k as f64 });
        }
        before = Some((value, pixel));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use accurate_geom::Fundamental;
    use accurate_geom::nalgebra::Matrix3;
    use proptest::prelude::*;

    /// The line `y = level` of view 2.
    fn level(level: f64) -> EpipolarLine<View2> {
        // Rectified views: p2 lies on the row of p1.
        let f = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
        let f = Fundamental::<View2, View1>::from_matrix(f).unwrap();
        f.line(Pixel::new(0.0, level)).unwrap()
    }

    fn zigzag(rows: &[f64]) -> Vec<Pixel<View2>> {
        rows.iter().enumerate().map(|(k, &y)| Pixel::new(k as f64, y)).collect()
    }

    #[test]
    fn a_vertex_on_the_line_is_one_crossing() {
        let found = crossings(&zigzag(&[0.0, 2.0, 4.0, 2.0, 0.0]), &level(2.0));
        let places: Vec<f64> = found.iter().map(|c| c.place).collect();
        assert_eq!(places, [1.0, 3.0]);
        let touched = crossings(&zigzag(&[0.0, 2.0, 0.0]), &level(2.0));
        assert_eq!(touched.len(), 1);
    }

    #[test]
    fn a_line_beside_the_polyline_has_no_crossing() {
        assert!(crossings(&zigzag(&[0.0, 2.0, 1.0]), &level(3.0)).is_empty());
        assert!(crossings(&[], &level(0.0)).is_empty());
    }

    proptest! {
        #[test]
        fn crossings_lie_on_the_line_and_there_are_as_many_as_sign_changes(
            rows in prop::collection::vec(-50.0..50.0f64, 1..40), row in -40.0..40.0f64,
        ) {
            let found = crossings(&zigzag(&rows), &level(row));
            let changes = rows.windows(2).filter(|w| (w[0] > row) != (w[1] > row)).count();
            prop_assert_eq!(found.len(), changes);
            for crossing in found {
                // Interpolation between values up to 100 px: a few roundings.
                prop_assert!((crossing.pixel.y - row).abs() < 100.0 * 8.0 * f64::EPSILON);
                prop_assert!((crossing.pixel.x - crossing.place).abs() < 40.0 * 8.0 * f64::EPSILON);
            }
        }
    }
}
