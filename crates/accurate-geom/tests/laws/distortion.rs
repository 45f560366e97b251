use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, Distortion, GeomError, ImageSize, Point2};
use proptest::prelude::*;

use crate::generators::intrinsics;

fn camera(k: Matrix3<f64>, lens: Distortion) -> Camera {
    let size = ImageSize { width: 1024, height: 1024 };
    Camera::new(k, Matrix3::identity(), Vector3::zeros(), size)
        .unwrap()
        .with_distortion(lens)
        .unwrap()
}

fn lenses(radial: f64, tangential: f64) -> impl Strategy<Value = Distortion> {
    let (r, t) = (-radial..radial, -tangential..tangential);
    (r.clone(), r.clone(), t.clone(), t, r).prop_map(|(k1, k2, p1, p2, k3)| Distortion {
        k1,
        k2,
        p1,
        p2,
        k3,
    })
}

proptest! {
    #[test]
    fn undistort_inverts_distort(
        k in intrinsics(), lens in lenses(0.02, 0.005), x in -0.8..0.8f64, y in -0.8..0.8f64,
    ) {
        // At r² <= 1.28 the slope of the radius is above 1 - 0.02 (3 r² + 5 r⁴ + 7 r⁶) = 0.47, less
        // 0.05 for the tangential terms: these lenses never fold.
        let camera = camera(k, lens);
        let ideal = Point2::from((k * Vector3::new(x, y, 1.0)).xy());
        let distorted = camera.distort(&ideal).unwrap();
        let back = camera.undistort(&distorted).unwrap();
        // Rounding of the polynomial and of K, through an inverse Jacobian of norm below 10.
        let tolerance = 10.0 * 32.0 * f64::EPSILON * k.amax();
        prop_assert!((back - ideal).norm() <= tolerance, "{:e}", (back - ideal).norm());
    }

    #[test]
    fn any_lens_gives_a_preimage_or_a_typed_error(
        k in intrinsics(), lens in lenses(3.0, 0.5), x in -1e4..1e4f64, y in -1e4..1e4f64,
    ) {
        let camera = camera(k, lens);
        match camera.undistort(&Point2::new(x, y)) {
            Ok(ideal) => {
                let again = camera.distort(&ideal).unwrap();
                let scale = 1.0 + ideal.coords.norm() + x.hypot(y);
                prop_assert!((again - Point2::new(x, y)).norm() <= 1e-9 * scale);
            }
            Err(error) => {
                let typed = matches!(
                    error,
                    GeomError::NoConvergence { .. } | GeomError::DistortionFolds { .. }
                );
                prop_assert!(typed);
            }
        }
    }
}

/// Worked by hand: x = 0.5, y = -0.25, r² = 0.3125, radial = 1 + 0.1 r² - 0.2 r⁴ + 0.3 r⁶.
#[test]
fn distortion_follows_the_opencv_formula() {
    let lens = Distortion { k1: 0.1, k2: -0.2, p1: 0.01, p2: -0.02, k3: 0.3 };
    let found = camera(Matrix3::identity(), lens).distort(&Point2::new(0.5, -0.25)).unwrap();
    let radial = 1.0 + 0.031_25 - 0.019_531_25 + 0.009_155_273_437_5;
    let x = 0.5 * radial + 2.0 * 0.01 * 0.5 * -0.25 - 0.02 * (0.3125 + 0.5);
    let y = -0.25 * radial + 0.01 * (0.3125 + 0.125) + 2.0 * -0.02 * 0.5 * -0.25;
    assert!((found - Point2::new(x, y)).norm() < 4.0 * f64::EPSILON);
}

#[test]
fn without_a_lens_points_stay_where_they_are() {
    let k = Matrix3::new(1000.0, 0.0, 500.0, 0.0, -900.0, 400.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 1024, height: 1024 };
    let camera = Camera::new(k, Matrix3::identity(), Vector3::zeros(), size).unwrap();
    let p = Point2::new(12.5, 700.25);
    assert_eq!(camera.distort(&p), Ok(p));
    assert_eq!(camera.undistort(&p), Ok(p));
    assert_eq!(camera.distortion(), None);
}

/// r (1 - r²) reaches 0.385 at r = 0.577 and turns back: nothing maps to 0.5 on this side.
#[test]
fn a_point_beyond_the_fold_is_refused() {
    let lens = Distortion { k1: -1.0, ..Distortion::default() };
    let camera = camera(Matrix3::identity(), lens);
    assert!(camera.undistort(&Point2::new(0.38, 0.0)).is_ok());
    assert!(camera.undistort(&Point2::new(0.5, 0.0)).is_err());
}

/// 20 (1 - 20²) = -7980: from r = 1 on the image is turned round as well, and nothing looks folded there.
#[test]
fn a_point_beyond_both_folds_is_refused() {
    let lens = Distortion { k1: -1.0, ..Distortion::default() };
    let error =
        camera(Matrix3::identity(), lens).undistort(&Point2::new(-7980.0, 0.0)).unwrap_err();
    assert_eq!(error, GeomError::DistortionFolds { x: -7980.0, y: 0.0 });
}
