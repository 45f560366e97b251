use std::marker::PhantomData;

use accurate_geom::{Curve2, EpipolarLine, GeomError, Pixel, Point2, View};

/// Most samples along a track: a stray far point must not fill the memory.
const MAX_SAMPLES: usize = 20_000;

/// One view's curve as a cubic spline over its chord length in px, from 0 to
/// [`length_px`](Self::length_px).
#[derive(Debug, Clone)]
pub(crate) struct Track<V> {
    curve: Curve2,
    /// Between two knots each; asking one of them is cheaper than asking the whole curve.
    pieces: Vec<Piece>,
    /// Chord length at each input point that moves on, and which input point it is.
    places: Vec<(f64, usize)>,
    view: PhantomData<V>,
}

impl<V: View> Track<V> {
    /// The spline through the points (`sigma_px` 0), or the smoothest as far from them as noise of
    /// `sigma_px` per coordinate would put it. Points that repeat the one before are passed over.
    ///
    /// # Errors
    /// [`GeomError::TooFewPoints`] if fewer than two points differ, [`GeomError::OutOfRange`] for
    /// `sigma_px`, [`GeomError::NotFinite`] if the length overflows.
    pub(crate) fn new(points: &[Pixel<V>], sigma_px: f64) -> Result<Self, GeomError> {
        let mut places: Vec<(f64, usize)> = Vec::with_capacity(points.len());
        let mut distinct: Vec<Point2> = Vec::with_capacity(points.len());
        for (index, pixel) in points.iter().enumerate() {
            let place = match (places.last(), distinct.last()) {
                (Some((before, _)), Some(last)) => {
                    let next = before + (pixel.point() - last).norm();
                    if next <= *before {
                        continue;
                    }
                    next
                }
                _ => 0.0,
            };
            places.push((place, index));
            distinct.push(pixel.point());
        }
        if distinct.len() < 2 {
            return Err(GeomError::TooFewPoints { found: distinct.len(), needed: 2 });
        }
        // A cubic needs four points; midpoints add nothing to a polyline of two or three.
        while distinct.len() < 4 {
            distinct = with_midpoints(&distinct);
        }
        let curve = Curve2::smoothing(&distinct, sigma_px)?;
        let pieces = pieces(&curve)?;
        Ok(Self { curve, pieces, places, view: PhantomData })
    }

    pub(crate) fn length_px(&self) -> f64 {
        self.curve.domain().1
    }

    pub(crate) fn pixel(&self, u: f64) -> Pixel<V> {
        self.curve.at(u).into()
    }

    /// At least two evenly spaced places from end to end, `step_px` apart or somewhat less; farther apart only
    /// where there would be more than `most`.
    pub(crate) fn samples(&self, step_px: f64, most: usize) -> Vec<f64> {
        let wanted = (self.length_px() / step_px).ceil();
        // The conversion saturates.
        let steps = (wanted as usize).clamp(1, most.clamp(2, MAX_SAMPLES) - 1);
        (0..=steps).map(|k| self.length_px() * (k as f64 / steps as f64)).collect()
    }

    /// Places where the track meets the line, ascending.
    pub(crate) fn crossings(&self, line: &EpipolarLine<V>) -> Vec<f64> {
        let l = line.coefficients();
        let near = self.pieces.iter().filter(|piece| piece.comes_within(0.0, line));
        let mut found: Vec<f64> =
            near.flat_map(|piece| piece.curve.intersect_line(l.x, l.y, l.z)).collect();
        // A crossing at a knot belongs to both pieces.
        found.dedup();
        found
    }

    /// Places, ascending, where the track turns back before it reaches the line, at most `within_px`
    /// from it. A turning point beyond the line has a crossing on either side, and is none of these;
    /// neither is one exactly at a knot.
    pub(crate) fn near_touches(&self, within_px: f64, line: &EpipolarLine<V>) -> Vec<f64> {
        let l = line.coefficients();
        let mut found = Vec::new();
        for piece in self.pieces.iter().filter(|piece| piece.comes_within(within_px, line)) {
            for u in piece.curve.line_extrema(l.x, l.y, l.z) {
                let value = line.signed_distance(self.pixel(u));
                let bend = self.curve.second_derivative(u);
                let bends_away = (l.x * bend.x + l.y * bend.y) * value > 0.0;
                if value.abs() <= within_px && bends_away {
                    found.push(u);
                }
            }
        }
        found
    }

    /// Index of the input point nearest to `u` along the track.
    pub(crate) fn nearest_input(&self, u: f64) -> usize {
        let after = self.places.partition_point(|p| p.0 < u).min(self.places.len() - 1);
        let before = after.saturating_sub(1);
        let (left, right) = (self.places[before], self.places[after]);
        if u - left.0 < right.0 - u { left.1 } else { right.1 }
    }
}

/// One polynomial piece in Bézier form.
#[derive(Debug, Clone)]
struct Piece {
    curve: Curve2,
    hull: [Point2; 4],
}

impl Piece {
    /// Whether the hull, which holds the piece, comes within `px` of the line.
    fn comes_within<V: View>(&self, px: f64, line: &EpipolarLine<V>) -> bool {
        let values = self.hull.map(|p| line.signed_distance(p.into()));
        // Written so that a value that is not a number lets the piece pass: the curve decides.
        !(values.iter().all(|v| *v > px) || values.iter().all(|v| *v < -px))
    }
}

fn pieces(curve: &Curve2) -> Result<Vec<Piece>, GeomError> {
    let ends = curve.breakpoints();
    let mut pieces = Vec::with_capacity(ends.len());
    let mut jet = curve.jet(ends[0]);
    for pair in ends.windows(2) {
        let third = (pair[1] - pair[0]) / 3.0;
        let next = curve.jet(pair[1]);
        let inner = [jet.point + jet.first * third, next.point - next.first * third];
        let hull = [jet.point, inner[0], inner[1], next.point];
        let mut knots = vec![pair[0]; 4];
        knots.extend([pair[1]; 4]);
        pieces.push(Piece { curve: Curve2::new(knots, hull.to_vec())?, hull });
        jet = next;
    }
    Ok(pieces)
}

fn with_midpoints(points: &[Point2]) -> Vec<Point2> {
    let mut denser = vec![points[0]];
    for pair in points.windows(2) {
        // Halved before the sum: coordinates may be as large as numbers go.
        denser.push(Point2::from(pair[0].coords * 0.5 + pair[1].coords * 0.5));
        denser.push(pair[1]);
    }
    denser
}

#[cfg(test)]
mod tests {
    use super::*;
    use accurate_geom::nalgebra::Matrix3;
    use accurate_geom::{Fundamental, View1, View2};
    use proptest::prelude::*;

    fn pixels(points: &[(f64, f64)]) -> Vec<Pixel<View1>> {
        points.iter().map(|&(x, y)| Pixel::new(x, y)).collect()
    }

    proptest! {
        #[test]
        fn an_interpolating_track_goes_through_its_points(
            steps in prop::collection::vec((0.5..3.0f64, -2.0..2.0f64), 1..60),
        ) {
            let (mut x, mut y) = (0.0, 0.0);
            let mut points = vec![(x, y)];
            for (dx, dy) in steps {
                x += dx;
                y += dy;
                points.push((x, y));
            }
            let points = pixels(&points);
            let track = Track::new(&points, 0.0).unwrap();
            for (index, point) in points.iter().enumerate() {
                let (place, input) = track.places[index];
                // Coordinates up to 180 px; a cubic of uneven chords (1 : 7) loses some digits.
                prop_assert!(track.pixel(place).distance(*point) < 1e-9);
                prop_assert_eq!(input, index);
                prop_assert_eq!(track.nearest_input(place), index);
            }
        }
    }

    proptest! {
        #[test]
        fn pieces_cross_a_line_where_the_whole_curve_does(
            points in prop::collection::vec((0.0..50.0f64, 0.0..50.0f64), 2..20),
            level in 0.0..50.0f64,
        ) {
            let track = Track::new(&pixels(&points), 0.0).unwrap();
            let f = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
            let f = Fundamental::<View1, View2>::from_matrix(f).unwrap();
            let line = f.line(Pixel::new(0.0, level)).unwrap();
            let l = line.coefficients();
            let whole = track.curve.intersect_line(l.x, l.y, l.z);
            let found = track.crossings(&line);
            prop_assert_eq!(found.len(), whole.len());
            for u in found {
                // Near a double root the place is the square root of the value's rounding.
                prop_assert!(line.distance(track.pixel(u)) < 1e-9);
            }
            for u in track.near_touches(0.5, &line) {
                prop_assert!(line.distance(track.pixel(u)) <= 0.5);
            }
        }
    }

    #[test]
    fn a_touch_short_of_the_line_is_near_and_one_beyond_it_is_not() {
        // The vertex lies between two points: at a knot it would belong to neither piece.
        let arch: Vec<_> =
            (-20..=20).map(|x| f64::from(x) + 0.3).map(|x| (x, 0.1 * x * x)).collect();
        let track = Track::new(&pixels(&arch), 0.0).unwrap();
        let f = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
        let f = Fundamental::<View1, View2>::from_matrix(f).unwrap();
        let touches = |y: f64| track.near_touches(0.5, &f.line(Pixel::new(0.0, y)).unwrap()).len();
        assert_eq!([touches(-0.4), touches(-0.6), touches(0.4)], [1, 0, 0]);
    }

    #[test]
    fn two_points_make_a_straight_track() {
        let track = Track::new(&pixels(&[(0.0, 0.0), (0.0, 0.0), (30.0, 40.0)]), 0.0).unwrap();
        // Straight to rounding.
        assert!(track.pixel(25.0).distance(Pixel::new(15.0, 20.0)) < 1e-12);
        assert_eq!((track.nearest_input(10.0), track.nearest_input(40.0)), (0, 2));
        assert_eq!(track.samples(12.5, 100), [0.0, 12.5, 25.0, 37.5, 50.0]);
        assert_eq!(track.samples(20.0, 100).len(), 4);
        assert_eq!(track.samples(1e-12, 3).len(), 3);
    }

    #[test]
    fn one_point_makes_no_track() {
        let one = Track::new(&pixels(&[(3.0, 4.0), (3.0, 4.0)]), 0.0);
        assert_eq!(one.unwrap_err(), GeomError::TooFewPoints { found: 1, needed: 2 });
    }
}
