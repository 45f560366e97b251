use std::f64::consts::PI;

use accurate_geom::{EpipolarAngle, GeomError, Pixel, sampson_distance};
use proptest::prelude::*;

use crate::generators::{projection_rounding_px, scenes_with_points, turntable_rig};

proptest! {
    #[test]
    fn corresponding_pixels_have_equal_angles_far_from_the_wrap(
        (scene, [x]) in scenes_with_points::<1>(),
    ) {
        let rig = &scene.rig;
        let (p1, p2) = rig.project(&x).unwrap();
        let angle = EpipolarAngle::new(rig);
        let (a, b) = (angle.view1(p1).unwrap(), angle.view2(p2).unwrap());
        let rounding_px = projection_rounding_px(rig.camera1(), &x)
            .max(projection_rounding_px(rig.camera2(), &x));
        let tolerance = 4.0 * rounding_px * (a.gradient_per_px + b.gradient_per_px)
            + 8.0 * f64::EPSILON;
        prop_assert!((a.phi - b.phi).abs() <= tolerance, "{} {}", a.phi, b.phi);
        prop_assert!(a.phi.abs() < 0.5 * PI);
    }

    #[test]
    fn the_gradient_is_that_of_finite_differences((scene, [x]) in scenes_with_points::<1>()) {
        let rig = &scene.rig;
        let (p1, _) = rig.project(&x).unwrap();
        let angle = EpipolarAngle::new(rig);
        let at = |dx: f64, dy: f64| angle.view1(Pixel::new(p1.x + dx, p1.y + dy)).unwrap().phi;
        let h = 1e-3;
        let found = angle.view1(p1).unwrap();
        let differences = [(at(h, 0.0) - at(-h, 0.0)) / (2.0 * h),
            (at(0.0, h) - at(0.0, -h)) / (2.0 * h)];
        // The third derivative is about 6 g³ (phi is an arc tangent of quotients with slope g);
        // phi itself is known to the rounding of a ray.
        let g = found.gradient_per_px;
        let rounding = projection_rounding_px(rig.camera1(), &x) * g + 2.0 * f64::EPSILON;
        let tolerance = 6.0 * g.powi(3) * h * h + rounding / h;
        for (a, b) in found.gradient.iter().zip(differences) {
            prop_assert!((a - b).abs() <= tolerance, "{a:e} {b:e} {tolerance:e}");
        }
        prop_assert_eq!(found.gradient.norm(), g);
    }

    #[test]
    fn the_angle_between_a_pair_is_its_sampson_distance_to_first_order(
        (scene, [x]) in scenes_with_points::<1>(), (dx, dy) in (-0.5..0.5f64, -0.5..0.5f64),
    ) {
        let rig = &scene.rig;
        let (p1, p2) = rig.project(&x).unwrap();
        let p1 = Pixel::new(p1.x + dx, p1.y + dy);
        let angle = EpipolarAngle::new(rig);
        let (a, b) = (angle.view1(p1).unwrap(), angle.view2(p2).unwrap());
        let gradient = a.gradient_per_px.hypot(b.gradient_per_px);
        let from_angle = (a.phi - b.phi).abs() / gradient;
        let sampson = sampson_distance(rig.fundamental(), p1, p2).unwrap();
        // Second order: the pair is less than 1 px apart, the gradient turns by itself per px.
        let worst = a.gradient_per_px.max(b.gradient_per_px);
        let tolerance = 1e-9 + 4.0 * worst * worst / gradient;
        prop_assert!((from_angle - sampson).abs() <= tolerance, "{from_angle} {sampson}");
    }
}

#[test]
fn the_epipole_has_no_angle() {
    let rig = turntable_rig();
    let angle = EpipolarAngle::new(&rig);
    let camera = rig.camera1();
    let h = camera.k() * (camera.r() * rig.camera2().centre().coords + camera.t());
    let epipole = Pixel::new(h.x / h.z, h.y / h.z);
    // A rounded epipole is off by less than 1e-10 px of about 3000; either answer is honest.
    match angle.view1(epipole) {
        Err(error) => assert!(matches!(error, GeomError::AtEpipole { view: 1, .. })),
        Ok(sample) => assert!(sample.gradient_per_px > 1e6 && sample.phi.is_finite()),
    }
    assert!(angle.view2(Pixel::new(f64::NAN, 0.0)).is_err());
}

/// The square of its length would overflow, and an infinite ray runs along anything.
#[test]
fn a_pixel_too_far_away_is_no_epipole() {
    let angle = EpipolarAngle::new(&turntable_rig());
    for far in [1e160, -1e300] {
        let error = angle.view1(Pixel::new(far, 0.0)).unwrap_err();
        assert!(matches!(error, GeomError::NotFinite { .. }), "{error}");
        let error = angle.view2(Pixel::new(0.0, far)).unwrap_err();
        assert!(matches!(error, GeomError::NotFinite { .. }), "{error}");
    }
}

/// Both cameras look along the baseline: no direction is better than another, none may be NaN.
#[test]
fn forward_motion_still_has_angles() {
    use accurate_geom::nalgebra::{Matrix3, Vector3};
    use accurate_geom::{Camera, ImageSize, LengthUnit, Point3, Rig};
    let k = Matrix3::new(800.0, 0.0, 256.0, 0.0, 800.0, 256.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 512, height: 512 };
    let camera =
        |z: f64| Camera::new(k, Matrix3::identity(), Vector3::new(0.0, 0.0, z), size).unwrap();
    let rig = Rig::new(camera(0.0), camera(50.0), LengthUnit::Millimetre).unwrap();
    let angle = EpipolarAngle::new(&rig);
    let (p1, p2) = rig.project(&Point3::new(3.0, 4.0, 200.0)).unwrap();
    let (a, b) = (angle.view1(p1).unwrap(), angle.view2(p2).unwrap());
    assert!((a.phi - b.phi).abs() < 1e-13);
    let error = angle.view1(Pixel::new(256.0, 256.0)).unwrap_err();
    assert!(matches!(error, GeomError::AtEpipole { view: 1, .. }));
}
