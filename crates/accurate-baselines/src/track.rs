use std::marker::PhantomData;

use accurate_geom::{Curve2, EpipolarLine, GeomError, Pixel, Point2, View};

/// Most samples along a track: a stray far point must not fill the memory.
const MAX_SAMPLES: usize = 20_000;

/// One view's curve as a cubic spline over its chord length in px, from 0 to
/// [`length_px`](Self::length_px).
#[derive(Debug, Clone)]
pub(crate) struct Track<V> {
    curve: Curve2,
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
        Ok(Self { curve, places, view: PhantomData })
    }

    pub(crate) fn length_px(&self) -> f64 {
        self.curve.domain().1
    }

    pub(crate) fn pixel(&self, u: f64) -> Pixel<V> {
        self.curve.at(u).into()
    }

    /// Evenly spaced places from end to end, `step_px` apart or somewhat less; farther apart only
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
        self.curve.intersect_line(l.x, l.y, l.z)
    }

    /// Places where the distance to the line turns, ascending.
    pub(crate) fn turning_points(&self, line: &EpipolarLine<V>) -> Vec<f64> {
        let l = line.coefficients();
        self.curve.line_extrema(l.x, l.y, l.z)
    }

    /// Index of the input point nearest to `u` along the track.
    pub(crate) fn nearest_input(&self, u: f64) -> usize {
        let after = self.places.partition_point(|p| p.0 < u).min(self.places.len() - 1);
        let before = after.saturating_sub(1);
        let (left, right) = (self.places[before], self.places[after]);
        if u - left.0 < right.0 - u { left.1 } else { right.1 }
    }
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
    use accurate_geom::View1;
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
