use accurate_geom::nalgebra::{Matrix3, Rotation3};
use accurate_geom::{Camera, Point2, nearest_rotation};
use proptest::prelude::*;

use crate::generators::{projection_rounding_px, scenes, scenes_with_points, unit_vectors};

proptest! {
    #[test]
    fn every_point_of_a_ray_projects_to_its_pixel(
        scene in scenes(), x in -500.0..1500.0f64, y in -500.0..1500.0f64, depth in 1.0..2000.0f64,
    ) {
        let camera = scene.rig.camera1();
        let p = Point2::new(x, y);
        let point = camera.centre() + depth * camera.ray(&p);
        prop_assert!((camera.depth(&point) - depth).abs()
            <= 16.0 * f64::EPSILON * (depth + point.coords.norm() + camera.t().norm()));
        let image = camera.project(&point).unwrap();
        prop_assert!((image - p).norm() <= 8.0 * projection_rounding_px(camera, &point));
    }

    #[test]
    fn a_camera_survives_its_projection_matrix(
        (scene, [x]) in scenes_with_points::<1>(), exponent in -8..8i32,
    ) {
        let camera = scene.rig.camera1();
        let matrix = camera.projection_matrix() * 10f64.powi(exponent);
        let found = Camera::from_projection_matrix(&matrix, camera.size()).unwrap();
        // Entries of K R: f times a unit vector plus (cx, cy) times another, so that a component
        // of relative size f / (f + c) is found by subtraction.
        let k = camera.k();
        let tolerance = 64.0 * f64::EPSILON * k.amax();
        prop_assert!((found.k() - k).amax() <= tolerance);
        prop_assert!((found.r() - camera.r()).amax() <= tolerance / 300.0);
        let image = camera.project(&x).unwrap();
        prop_assert!((found.project(&x).unwrap() - image).norm()
            <= 8.0 * projection_rounding_px(camera, &x));
    }

    #[test]
    fn the_nearest_rotation_is_a_rotation_and_nearer_than_the_original(
        axis in unit_vectors(), angle in -3.1..3.1f64, noise in proptest::array::uniform9(-1e-3..1e-3f64),
    ) {
        let original = Rotation3::from_axis_angle(&axis, angle).into_inner();
        let rounded = original + Matrix3::from_row_slice(&noise);
        let found = nearest_rotation(&rounded).unwrap();
        prop_assert!((found.transpose() * found - Matrix3::identity()).amax() < 1e-14);
        prop_assert!((found.determinant() - 1.0).abs() < 1e-14);
        prop_assert!((found - rounded).norm() <= (original - rounded).norm() + 1e-14);
    }

    #[test]
    fn a_rounded_rotation_still_has_consistent_rays_and_epipolar_lines(
        (scene, [x]) in scenes_with_points::<1>(), noise in proptest::array::uniform9(-1e-6..1e-6f64),
    ) {
        let camera1 = scene.rig.camera1();
        let rounded = camera1.r() + Matrix3::from_row_slice(&noise);
        let camera1 = Camera::new(*camera1.k(), rounded, *camera1.t(), camera1.size()).unwrap();
        let rig = accurate_geom::Rig::new(
            camera1.clone(), scene.rig.camera2().clone(), scene.rig.unit(),
        ).unwrap();
        let (p1, p2) = rig.project(&x).unwrap();
        // With the transpose in place of the inverse these would be off by 1e-6 f, about 1e-3 px.
        let distance = accurate_geom::epipolar_distance(rig.fundamental(), p1, p2).unwrap();
        prop_assert!(distance < 1e-8, "{distance:e}");
        let along = camera1.ray(&p1.point()).normalize();
        let offset = x - camera1.centre();
        let miss = (offset - along * offset.dot(&along)).norm();
        prop_assert!(miss < 1e-9 * offset.norm(), "{miss:e}");
    }
}
