//! Input that is no skeleton gets a typed error that names the value.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Fundamental, Pixel, View1, View2};
use accurate_traverse::{
    TraverseError, TraverseParams, endpoints, start_pair, trace_from, trace_pair, trace_single,
};

const PAPER: TraverseParams = TraverseParams::PAPER;

fn pixels<V: accurate_geom::View>(xy: &[(f64, f64)]) -> Vec<Pixel<V>> {
    xy.iter().map(|&(x, y)| Pixel::new(x, y)).collect()
}

fn line() -> Vec<(f64, f64)> {
    (0..12).map(|x| (f64::from(x), 3.0)).collect()
}

/// Epipoles at `e1` and, by the homography, at `e2`.
fn fundamental(e1: (f64, f64), e2: (f64, f64)) -> Fundamental<View1, View2> {
    let shift = Matrix3::new(1.0, 0.0, e1.0 - e2.0, 0.0, 1.0, e1.1 - e2.1, 0.0, 0.0, 1.0);
    Fundamental::from_matrix(Vector3::new(e1.0, e1.1, 1.0).cross_matrix() * shift).unwrap()
}

#[test]
fn an_empty_skeleton_and_a_single_pixel_are_refused() {
    let far = fundamental((-500.0, 40.0), (700.0, 10.0));
    let good1 = pixels::<View1>(&line());
    assert_eq!(trace_pair(&good1, &[], &far, &PAPER), Err(TraverseError::Empty { view: 2 }));
    assert_eq!(
        trace_pair(&good1, &pixels(&[(1.0, 1.0)]), &far, &PAPER),
        Err(TraverseError::TooSmall { view: 2, pixels: 1 })
    );
    assert_eq!(endpoints::<View1>(&[]), Err(TraverseError::Empty { view: 1 }));
}

#[test]
fn a_closed_curve_has_no_endpoint_and_the_message_says_what_it_needs() {
    let ring = [(0., 0.), (1., -1.), (2., -1.), (3., 0.), (3., 1.), (2., 2.), (1., 2.), (0., 1.)];
    let error = trace_single(&pixels::<View2>(&ring), &PAPER).unwrap_err();
    assert_eq!(error, TraverseError::NoEndpoint { view: 2, found: 8 });
    assert!(error.to_string().contains("closed curve"), "{error}");
    // It can still be walked from a given pixel.
    let skeleton = pixels::<View2>(&ring);
    assert_eq!(trace_from(&skeleton, skeleton[0], &PAPER).unwrap().points.len(), 8);
}

#[test]
fn coordinates_that_are_no_pixels_are_refused_by_name() {
    let with = |x: f64, y: f64| {
        let mut xy = line();
        xy[4] = (x, y);
        trace_single(&pixels::<View1>(&xy), &PAPER).unwrap_err()
    };
    assert!(matches!(with(f64::NAN, 0.0), TraverseError::NotFinite { index: 4, .. }));
    assert!(matches!(with(0.0, f64::INFINITY), TraverseError::NotFinite { index: 4, .. }));
    assert!(matches!(with(0.5, 0.0), TraverseError::NotInteger { index: 4, .. }));
    assert!(matches!(with(0.0, 1e300), TraverseError::SizeTooLarge { index: 4, .. }));
    assert!(matches!(with(-1_048_577.0, 0.0), TraverseError::SizeTooLarge { index: 4, .. }));
    assert_eq!(with(7.0, 3.0), TraverseError::Duplicate { view: 1, x: 7.0, y: 3.0 });
}

#[test]
fn the_largest_accepted_image_needs_no_memory_of_its_area() {
    let limit = 1_048_576.0;
    let skeleton = pixels::<View1>(&[
        (-limit, -limit),
        (1.0 - limit, -limit),
        (limit, limit),
        (limit - 1.0, limit),
    ]);
    let trace = trace_single(&skeleton, &PAPER).unwrap();
    assert_eq!((trace.points.len(), trace.left), (2, 2));
    let whole = TraverseParams { max_gap_px: u32::MAX, ..PAPER };
    let trace = trace_single(&skeleton, &whole).unwrap();
    assert_eq!((trace.left, trace.gaps.len()), (0, 1));
}

#[test]
fn a_start_off_the_skeleton_is_refused() {
    let skeleton = pixels::<View1>(&line());
    for (x, y) in [(3.0, 4.0), (3.0, 2.0), (3.5, 3.0), (-1.0, 3.0), (f64::NAN, 3.0), (3.0, 1e300)] {
        let error = trace_from(&skeleton, Pixel::new(x, y), &PAPER).unwrap_err();
        assert!(matches!(error, TraverseError::StartNotOnSkeleton { view: 1, .. }), "{error}");
    }
}

#[test]
fn an_endpoint_at_the_epipole_is_left_out() {
    let (xy1, xy2) = (line(), line());
    // View 2: the endpoint (0, 3) is the epipole. View 1: (11, 3) is.
    let f = fundamental((11.0, 3.0), (0.0, 3.0));
    let (t1, t2) = trace_pair(&pixels(&xy1), &pixels(&xy2), &f, &PAPER).unwrap();
    assert_eq!(t1.points[0], Pixel::new(0.0, 3.0));
    assert_eq!(t2.points[0], Pixel::new(11.0, 3.0));
}

#[test]
fn endpoints_that_all_lie_at_the_epipole_are_an_error() {
    let f = fundamental((11.0, 3.0), (0.0, 3.0));
    let good1 = pixels::<View1>(&[(0.0, 0.0)]);
    assert_eq!(
        start_pair(&good1, &pixels(&[(0.0, 3.0)]), &f),
        Err(TraverseError::EndpointsAtEpipole { view: 2, found: 1 })
    );
    assert_eq!(
        start_pair(&pixels(&[(11.0, 3.0)]), &pixels(&[(5.0, 5.0)]), &f),
        Err(TraverseError::EndpointsAtEpipole { view: 1, found: 1 })
    );
    assert_eq!(start_pair(&good1, &[], &f), Err(TraverseError::Empty { view: 2 }));
    let lost = start_pair(&pixels(&[(f64::NAN, 0.0)]), &pixels(&[(5.0, 5.0)]), &f);
    assert!(matches!(lost, Err(TraverseError::NotFinite { view: 1, index: 0, .. })));
}

#[test]
fn of_equal_endpoint_pairs_the_first_wins() {
    // Rectified views: lines are rows, and both ends of both curves lie in row 3.
    let f = Fundamental::from_matrix(Vector3::new(1.0, 0.0, 0.0).cross_matrix()).unwrap();
    let (t1, t2) = trace_pair(&pixels(&line()), &pixels(&line()), &f, &PAPER).unwrap();
    assert_eq!((t1.points[0].x, t2.points[0].x), (0.0, 0.0));
}

#[test]
fn parameters_outside_their_range_are_refused_by_name() {
    let skeleton = pixels::<View1>(&line());
    let cases = [
        ("curvature_window", TraverseParams { curvature_window: usize::MAX, ..PAPER }),
        ("radius_min_px", TraverseParams { radius_min_px: 0, ..PAPER }),
        ("max_gap_px", TraverseParams { max_gap_px: 9, ..PAPER }),
        ("angle_weight", TraverseParams { angle_weight: f64::NAN, ..PAPER }),
        ("distance_weight", TraverseParams { distance_weight: -1.0, ..PAPER }),
    ];
    for (expected, params) in cases {
        match trace_single(&skeleton, &params) {
            Err(TraverseError::InvalidParameter { name, .. }) => assert_eq!(name, expected),
            other => panic!("{expected}: {other:?}"),
        }
    }
}

#[test]
fn a_jump_back_within_one_piece_is_a_jump_but_no_gap() {
    // A T: the walk along the bar passes the stem, then comes back for it.
    let mut xy: Vec<(f64, f64)> = (0..40).map(|x| (f64::from(x), 0.0)).collect();
    xy.extend((1..30).map(|y| (20.0, f64::from(y))));
    let skeleton = pixels::<View1>(&xy);
    let trace = trace_from(&skeleton, skeleton[0], &PAPER).unwrap();
    assert_eq!(trace.left, 0);
    assert!(!trace.jumps.is_empty());
    assert!(trace.gaps.is_empty());
    assert!(trace.length_px() > 70.0);
}
