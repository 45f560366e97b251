//! Every constructor names its own degenerate input.

use accurate_geom::nalgebra::{Matrix3, Matrix3x4, Vector3};
use accurate_geom::{
    Camera, Distortion, Fundamental, GeomError, ImageSize, LengthUnit, Pixel, Point2, Point3, Rig,
    View1, View2, nearest_rotation, sampson_distance,
};

const SIZE: ImageSize = ImageSize { width: 512, height: 512 };

fn k() -> Matrix3<f64> {
    Matrix3::new(1200.0, 0.0, 256.0, 0.0, -1200.0, 256.0, 0.0, 0.0, 1.0)
}

fn camera(t: Vector3<f64>) -> Camera {
    Camera::new(k(), Matrix3::identity(), t, SIZE).unwrap()
}

fn camera_error(k: Matrix3<f64>, r: Matrix3<f64>, t: Vector3<f64>, size: ImageSize) -> GeomError {
    Camera::new(k, r, t, size).unwrap_err()
}

#[test]
fn a_camera_names_the_entry_that_is_not_finite() {
    let (r, t) = (Matrix3::identity(), Vector3::zeros());
    let mut bad = k();
    bad[(0, 2)] = f64::NAN;
    assert!(camera_error(bad, r, t, SIZE).to_string().starts_with("K[0][2] is not finite"));
    let mut bad = r;
    bad[(2, 1)] = f64::INFINITY;
    assert!(camera_error(k(), bad, t, SIZE).to_string().starts_with("R[2][1] is not finite"));
    let bad = Vector3::new(0.0, f64::NAN, 0.0);
    assert!(camera_error(k(), r, bad, SIZE).to_string().starts_with("t[1] is not finite"));
}

#[test]
fn a_camera_refuses_a_bad_intrinsic_matrix() {
    let (r, t) = (Matrix3::identity(), Vector3::zeros());
    let mut lower = k();
    lower[(1, 0)] = 0.5;
    assert_eq!(
        camera_error(lower, r, t, SIZE),
        GeomError::NotUpperTriangular { row: 1, column: 0, value: 0.5 }
    );
    for index in 0..2 {
        let mut flat = k();
        flat[(index, index)] = 0.0;
        assert_eq!(camera_error(flat, r, t, SIZE), GeomError::ZeroFocalLength { index });
    }
    let mut tiny = k();
    (tiny[(0, 0)], tiny[(1, 1)]) = (1e-170, 1e-170);
    assert!(matches!(camera_error(tiny, r, t, SIZE), GeomError::NotFinite { .. }));
}

#[test]
fn a_camera_refuses_what_is_no_rotation() {
    let t = Vector3::zeros();
    let reflection = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let sheared = Matrix3::new(1.0, 1e-3, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for r in [reflection, sheared, Matrix3::zeros(), 2.0 * Matrix3::identity()] {
        assert!(matches!(camera_error(k(), r, t, SIZE), GeomError::NotARotation { .. }));
    }
    assert!(nearest_rotation(&sheared).is_some());
    assert_eq!(nearest_rotation(&reflection), None);
    assert_eq!(nearest_rotation(&Matrix3::zeros()), None);
    assert_eq!(nearest_rotation(&Matrix3::repeat(f64::NAN)), None);
}

#[test]
fn a_camera_refuses_an_empty_image() {
    for (width, height) in [(0, 512), (512, 0)] {
        let error =
            camera_error(k(), Matrix3::identity(), Vector3::zeros(), ImageSize { width, height });
        assert_eq!(error, GeomError::EmptyImage { width, height });
    }
}

#[test]
fn a_rig_refuses_a_zero_baseline() {
    let t = Vector3::new(0.0, 0.0, 720.0);
    let error = Rig::new(camera(t), camera(t), LengthUnit::Millimetre).unwrap_err();
    assert!(matches!(error, GeomError::ZeroBaseline { distance: 0.0, .. }));
    let origin = camera(Vector3::zeros());
    assert!(Rig::new(origin.clone(), origin, LengthUnit::Unit).is_err());
}

#[test]
fn a_rig_refuses_focal_lengths_without_a_fundamental_matrix() {
    let k = Matrix3::new(1e165, 0.0, 0.0, 0.0, 1e165, 0.0, 0.0, 0.0, 1.0);
    let camera =
        |x: f64| Camera::new(k, Matrix3::identity(), Vector3::new(x, 0.0, 0.0), SIZE).unwrap();
    let error = Rig::new(camera(0.0), camera(50.0), LengthUnit::Unit).unwrap_err();
    assert!(matches!(error, GeomError::NotFinite { .. }), "{error}");
}

#[test]
fn a_point_behind_a_camera_has_no_image() {
    let camera = camera(Vector3::zeros());
    for z in [-1.0, 0.0, f64::NAN] {
        let error = camera.project(&Point3::new(0.0, 0.0, z)).unwrap_err();
        assert!(matches!(error, GeomError::NotInFront { .. }));
    }
}

#[test]
fn the_epipole_has_no_line() {
    // One camera straight behind the other: the epipoles are the principal points.
    let rig = Rig::new(
        camera(Vector3::zeros()),
        camera(Vector3::new(0.0, 0.0, 50.0)),
        LengthUnit::Millimetre,
    )
    .unwrap();
    let f = rig.fundamental();
    let (e1, e2) = (Pixel::<View1>::new(256.0, 256.0), Pixel::<View2>::new(256.0, 256.0));
    assert!(matches!(f.line(e2), Err(GeomError::AtEpipole { view: 2, .. })));
    assert!(matches!(f.transpose().line(e1), Err(GeomError::AtEpipole { view: 1, .. })));
    assert!(matches!(sampson_distance(f, e1, e2), Err(GeomError::AtEpipole { .. })));
    assert!(f.line(Pixel::new(257.0, 256.0)).is_ok());
    assert!(f.line(Pixel::new(f64::NAN, 256.0)).is_err());
}

#[test]
fn a_fundamental_matrix_must_have_a_finite_norm() {
    for bad in [Matrix3::zeros(), Matrix3::repeat(f64::NAN), Matrix3::repeat(f64::INFINITY)] {
        assert!(Fundamental::<View1, View2>::from_matrix(bad).is_err());
    }
}

#[test]
fn a_projection_matrix_must_have_a_regular_left_block() {
    let mut p = camera(Vector3::new(1.0, 2.0, 3.0)).projection_matrix();
    let good = p;
    p.set_row(1, &(2.0 * good.row(2)));
    assert_eq!(
        Camera::from_projection_matrix(&p, SIZE),
        Err(GeomError::SingularProjection { row: 1 })
    );
    p = good;
    p.set_row(0, &(good.row(1) + good.row(2)));
    assert_eq!(
        Camera::from_projection_matrix(&p, SIZE),
        Err(GeomError::SingularProjection { row: 0 })
    );
    assert_eq!(
        Camera::from_projection_matrix(&Matrix3x4::zeros(), SIZE),
        Err(GeomError::SingularProjection { row: 2 })
    );
    p = good;
    p[(1, 3)] = f64::NAN;
    let error = Camera::from_projection_matrix(&p, SIZE).unwrap_err();
    assert!(error.to_string().starts_with("P[1][3]"));
}

#[test]
fn a_lens_refuses_coefficients_that_are_not_finite() {
    let lens = Distortion { p2: f64::NAN, ..Distortion::default() };
    let error = camera(Vector3::zeros()).with_distortion(lens).unwrap_err();
    assert!(error.to_string().starts_with("p2 is not finite"));
    let plain = camera(Vector3::zeros());
    assert!(plain.undistort(&Point2::new(f64::NAN, 0.0)).is_err());
    assert!(plain.distort(&Point2::new(0.0, f64::INFINITY)).is_err());
}
