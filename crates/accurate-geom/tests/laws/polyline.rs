use accurate_geom::nalgebra::Point;
use accurate_geom::{GeomError, Pixel, Point2, Point3, Polyline, Polyline2, Polyline3, View1};
use proptest::prelude::*;

use crate::generators::wandering;

fn ulps<const D: usize>(line: &Polyline<D>) -> f64 {
    let reach = line.points().iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
    f64::EPSILON * (line.length() + reach) * line.points().len() as f64
}

fn at_least_brute_force<const D: usize>(
    points: Vec<Point<f64, D>>,
    query: Point<f64, D>,
) -> Result<(), TestCaseError> {
    let line = Polyline::new(points.clone()).unwrap();
    let found = line.closest(&query);
    prop_assert!(((found.point - query).norm() - found.distance).abs() < 1e-12);
    let steps = 200;
    let mut brute = f64::INFINITY;
    for ends in points.windows(2) {
        for i in 0..=steps {
            let p = ends[0] + (ends[1] - ends[0]) * (f64::from(i) / f64::from(steps));
            brute = brute.min((p - query).norm());
        }
    }
    // Brute force misses by at most half a step of a segment no longer than 2.1.
    prop_assert!(found.distance <= brute + 1e-12);
    prop_assert!(found.distance >= brute - 2.1 / f64::from(steps));
    let ends = &points[found.segment..found.segment + 2];
    prop_assert!((ends[0] + (ends[1] - ends[0]) * found.t - found.point).norm() < 1e-12);
    Ok(())
}

proptest! {
    #[test]
    fn the_closest_point_is_that_of_brute_force_in_2d(
        points in wandering::<2>(1..20), x in -20.0..20.0f64, y in -20.0..20.0f64,
    ) {
        at_least_brute_force(points, Point2::new(x, y))?;
    }

    #[test]
    fn the_closest_point_is_that_of_brute_force_in_3d(
        points in wandering::<3>(1..20), x in -20.0..20.0f64, y in -20.0..20.0f64,
    ) {
        at_least_brute_force(points, Point3::new(x, y, 0.3 * x))?;
    }

    #[test]
    fn resampling_never_lengthens_keeps_the_ends_and_the_spacing(
        points in wandering::<3>(1..40), spacing in 0.05..30.0f64,
    ) {
        let line = Polyline3::new(points).unwrap();
        let resampled = line.resample(spacing).unwrap();
        let slack = ulps(&line) + ulps(&resampled);
        prop_assert!(resampled.length() <= line.length() + slack);
        prop_assert_eq!(resampled.points()[0], line.points()[0]);
        prop_assert_eq!(resampled.points().last(), line.points().last());
        for pair in resampled.points().windows(2) {
            prop_assert!((pair[1] - pair[0]).norm() <= spacing + slack);
        }
        for point in resampled.points() {
            prop_assert!(line.closest(point).distance <= slack);
        }
        // Fine sampling cuts corners of at most one spacing each.
        let corners = line.points().len() as f64;
        prop_assert!(resampled.length() >= line.length() - corners * spacing - slack);
    }

    #[test]
    fn the_point_at_an_arc_length_is_that_far_along(
        points in wandering::<2>(1..40), share in 0.0..1.0f64,
    ) {
        let line = Polyline2::new(points).unwrap();
        let s = share * line.length();
        let found = line.closest(&line.at(s));
        prop_assert!(found.distance <= ulps(&line));
        prop_assert_eq!(line.at(-1.0), line.points()[0]);
        prop_assert_eq!(Some(&line.at(line.length() + 1.0)), line.points().last());
        let back = line.reversed();
        prop_assert!((back.at(line.length() - s) - line.at(s)).norm() <= ulps(&line));
        let again = back.reversed();
        prop_assert_eq!(again.points(), line.points());
    }
}

#[test]
fn an_empty_or_infinite_polyline_is_refused() {
    assert_eq!(Polyline2::new(vec![]), Err(GeomError::TooFewPoints { found: 0, needed: 1 }));
    let nan = Polyline2::new(vec![Point2::origin(), Point2::new(0.0, f64::NAN)]).unwrap_err();
    assert!(nan.to_string().starts_with("point 1 is not finite"));
    let huge = Polyline2::new(vec![Point2::new(-1e308, 0.0), Point2::new(1e308, 0.0)]);
    assert!(matches!(huge, Err(GeomError::NotFinite { .. })));
}

#[test]
fn one_point_and_repeated_points_are_polylines() {
    let one = Polyline2::from_pixels(&[Pixel::<View1>::new(3.0, 4.0)]).unwrap();
    assert_eq!(one.length(), 0.0);
    assert_eq!(one.resample(1.0).unwrap(), one);
    assert_eq!(one.closest(&Point2::origin()).distance, 5.0);
    assert_eq!(one.at(7.0), one.points()[0]);
    assert_eq!(one.bounding_box_diagonal(), 0.0);
    let twice = Polyline2::new(vec![Point2::origin(); 3]).unwrap();
    assert_eq!(twice.resample(0.5).unwrap().points().len(), 1);
    assert_eq!(twice.at(0.0), Point2::origin());
}

#[test]
fn a_spacing_without_sense_is_refused() {
    let line = Polyline2::new(vec![Point2::origin(), Point2::new(3.0, 4.0)]).unwrap();
    for spacing in [0.0, -1.0, f64::NAN, 1e-300] {
        assert!(matches!(line.resample(spacing), Err(GeomError::OutOfRange { .. })), "{spacing}");
    }
    assert_eq!(line.resample(1.0).unwrap().points().len(), 6);
    assert_eq!(line.bounding_box_diagonal(), 5.0);
    assert_eq!(line.to_pixels::<View1>()[1], Pixel::new(3.0, 4.0));
}
