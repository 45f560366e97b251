use accurate_geom::{
    Camera, GeomError, Pixel, Point2, Point3, Rig, Triangulation, Triangulator,
    UnknownTriangulation, View1, View2,
};
use proptest::prelude::*;

use crate::generators::{Scene, projection_rounding_px, scenes, scenes_with_points};

fn solve(
    rig: &Rig,
    method: Triangulation,
    (p1, p2): (Pixel<View1>, Pixel<View2>),
) -> Result<Point3, GeomError> {
    Triangulator::new(rig, method).triangulate(p1, p2)
}

/// Sum of squared reprojection errors, px².
fn cost(rig: &Rig, x: &Point3, (p1, p2): (Pixel<View1>, Pixel<View2>)) -> f64 {
    let (q1, q2) = rig.project(x).unwrap();
    p1.distance(q1).powi(2) + p2.distance(q2).powi(2)
}

/// World length of one pixel of error at `x`: depth / f across the ray, stretched by the parallax.
fn world_per_px(rig: &Rig, x: &Point3) -> f64 {
    let across = [rig.camera1(), rig.camera2()]
        .map(|c| c.depth(x) / c.k()[(0, 0)].abs().min(c.k()[(1, 1)].abs()))
        .into_iter()
        .fold(0.0, f64::max);
    let (d1, d2) = (x - rig.camera1().centre(), x - rig.camera2().centre());
    across / d1.normalize().cross(&d2.normalize()).norm()
}

/// The images of the other centre, behind the camera or not.
fn epipoles(rig: &Rig) -> (Pixel<View1>, Pixel<View2>) {
    let image = |camera: &Camera, c: Point3| {
        let h = camera.k() * (camera.r() * c.coords + camera.t());
        Point2::new(h.x / h.z, h.y / h.z)
    };
    let (camera1, camera2) = (rig.camera1(), rig.camera2());
    (image(camera1, camera2.centre()).into(), image(camera2, camera1.centre()).into())
}

fn noisy(rig: &Rig, x: &Point3, noise: [f64; 4]) -> (Pixel<View1>, Pixel<View2>) {
    let (p1, p2) = rig.project(x).unwrap();
    (Pixel::new(p1.x + noise[0], p1.y + noise[1]), Pixel::new(p2.x + noise[2], p2.y + noise[3]))
}

fn noise(px: f64) -> impl Strategy<Value = [f64; 4]> {
    [-px..px, -px..px, -px..px, -px..px]
}

proptest! {
    #[test]
    fn projection_then_triangulation_is_the_identity((scene, [x]) in scenes_with_points::<1>()) {
        let Scene { rig, .. } = &scene;
        let pixels = rig.project(&x).unwrap();
        let rounding_px = projection_rounding_px(rig.camera1(), &x)
            .max(projection_rounding_px(rig.camera2(), &x));
        // Four coordinates enter; the solver rounds about as much as the projection did.
        let tolerance = 8.0 * rounding_px * world_per_px(rig, &x);
        for method in Triangulation::ALL {
            let found = solve(rig, method, pixels).unwrap();
            prop_assert!((found - x).norm() <= tolerance,
                "{method}: off by {:e}, tolerance {tolerance:e}", (found - x).norm());
        }
    }

    #[test]
    fn swapping_the_views_does_not_move_the_point(
        (scene, [x]) in scenes_with_points::<1>(),
        noise in noise(3.0),
    ) {
        let rig = &scene.rig;
        let (p1, p2) = noisy(rig, &x, noise);
        let rounding_px = projection_rounding_px(rig.camera1(), &x)
            .max(projection_rounding_px(rig.camera2(), &x));
        for method in Triangulation::ALL {
            let straight = solve(rig, method, (p1, p2)).unwrap();
            let swapped = solve(
                &rig.swapped(), method, (Pixel::new(p2.x, p2.y), Pixel::new(p1.x, p1.y)),
            ).unwrap();
            // A minimum of the cost is only known to the root of its rounding.
            let px = if method == Triangulation::GaussNewton { 1e-6 } else { 16.0 * rounding_px };
            prop_assert!((straight - swapped).norm() <= px * world_per_px(rig, &x),
                "{method}: {:e} apart", (straight - swapped).norm());
        }
    }

    #[test]
    fn lindstrom_and_gauss_newton_agree_and_never_reproject_worse_than_dlt(
        (scene, [x]) in scenes_with_points::<1>(),
        noise in noise(3.0),
    ) {
        let rig = &scene.rig;
        let pixels = noisy(rig, &x, noise);
        let dlt = cost(rig, &solve(rig, Triangulation::Dlt, pixels).unwrap(), pixels);
        let gn = solve(rig, Triangulation::GaussNewton, pixels).unwrap();
        let lindstrom = solve(rig, Triangulation::LindstromNiter2, pixels).unwrap();
        let (gn_cost, lindstrom_cost) = (cost(rig, &gn, pixels), cost(rig, &lindstrom, pixels));
        let rounding_px = projection_rounding_px(rig.camera1(), &x)
            .max(projection_rounding_px(rig.camera2(), &x));
        // Cost r² with r known to the rounding of a projection.
        let slack = 16.0 * rounding_px * (dlt.sqrt() + rounding_px);
        prop_assert!(gn_cost <= dlt + slack);
        // The first step follows normals that are off by r / L, where L is how far a pixel moves
        // until its partner's epipolar line has turned: the epipolar plane ends up r² / L away
        // from the best one, and the cost, which is flat there, (r² / L)² above the least.
        let f = rig.fundamental().matrix();
        let n1 = (f * pixels.1.homogeneous()).xy().norm();
        let n2 = (f.transpose() * pixels.0.homogeneous()).xy().norm();
        let length_px = n1.min(n2) / f.fixed_view::<2, 2>(0, 0).norm();
        let off_px = gn_cost / length_px;
        let slack = slack + off_px.powi(2);
        prop_assert!(lindstrom_cost <= dlt + slack, "{lindstrom_cost} > {dlt}");
        prop_assert!((lindstrom_cost - gn_cost).abs() <= slack, "{lindstrom_cost} {gn_cost}");
        // A minimum is only known to the root of the cost's rounding, hence the 1e-6 px.
        prop_assert!((gn - lindstrom).norm() <= (off_px + 1e-6) * world_per_px(rig, &x));
    }

    #[test]
    fn triangulation_is_finite_or_a_typed_error(
        scene in scenes(),
        p in [-1e4..1e4f64, -1e4..1e4f64, -1e4..1e4f64, -1e4..1e4f64],
        exponent in 0..300i32,
    ) {
        let grow = 10f64.powi(exponent);
        for scale in [1.0, grow] {
            let pixels = (Pixel::new(p[0] * scale, p[1]), Pixel::new(p[2], p[3] * scale));
            for method in Triangulation::ALL {
                if let Ok(x) = solve(&scene.rig, method, pixels) {
                    prop_assert!(x.iter().all(|v| v.is_finite()));
                }
            }
        }
    }

    #[test]
    fn all_at_once_gives_the_bits_of_one_by_one(
        (scene, points) in scenes_with_points::<9>(),
        noise in prop::collection::vec(noise(30.0), 0..150),
        spoilt in prop::collection::vec((0..150usize, 0..4usize, prop::sample::select(vec![
            f64::NAN, f64::INFINITY, 1e300, -1e160, 1e12,
        ])), 0..4),
    ) {
        let rig = &scene.rig;
        let mut pairs: Vec<_> = noise.iter().enumerate()
            .map(|(k, &noise)| noisy(rig, &points[k % 9], noise))
            .collect();
        for (at, which, value) in spoilt {
            if let Some((p1, p2)) = pairs.get_mut(at) {
                *[&mut p1.x, &mut p1.y, &mut p2.x, &mut p2.y][which] = value;
            }
        }
        // And what no method accepts.
        pairs.insert(pairs.len() / 2, epipoles(rig));
        for method in Triangulation::ALL {
            let triangulator = Triangulator::new(rig, method);
            let together = triangulator.triangulate_all(pairs.iter().copied());
            prop_assert_eq!(together.results().count(), pairs.len());
            for (found, &(p1, p2)) in together.results().zip(&pairs) {
                // Their text tells NaN from NaN and every f64 from its neighbours.
                let alone = triangulator.triangulate(p1, p2);
                prop_assert_eq!(format!("{found:?}"), format!("{alone:?}"), "{}", method);
            }
            // What was there before does not matter.
            let mut again = triangulator.triangulate_all(pairs.iter().rev().copied());
            triangulator.triangulate_into(pairs.iter().copied(), &mut again);
            prop_assert_eq!(format!("{again:?}"), format!("{together:?}"), "{}", method);
        }
    }

    #[test]
    fn pixels_at_the_epipoles_are_refused((scene, [x]) in scenes_with_points::<1>()) {
        let rig = &scene.rig;
        let (c1, c2) = (rig.camera1().centre(), rig.camera2().centre());
        let both = epipoles(rig);
        // Epipoles near infinity (baseline across an axis) have no digits left.
        prop_assume!(both.0.point().coords.norm().max(both.1.point().coords.norm()) < 1e5);
        let (_, p2) = rig.project(&x).unwrap();
        for method in Triangulation::ALL {
            let parallel =
                matches!(solve(rig, method, both), Err(GeomError::ParallelRays { .. }));
            prop_assert!(parallel, "{method}");
            // Reprojection is undefined at the centre and flat beside it: Gauss-Newton may roam.
            if method == Triangulation::GaussNewton {
                continue;
            }
            if let Ok(found) = solve(rig, method, (both.0, p2)) {
                // Not told from the centre only by rounding of the epipole itself.
                prop_assert!((found - c2).norm() < 1e-6 * (c2 - c1).norm(), "{method}");
            }
        }
    }
}

#[test]
fn a_pixel_that_is_not_finite_is_named() {
    let scene = fixed_scene();
    for method in Triangulation::ALL {
        let error =
            solve(&scene, method, (Pixel::new(1.0, f64::NAN), Pixel::new(1.0, 2.0))).unwrap_err();
        assert!(matches!(error, GeomError::NotFinite { ref what, .. } if what == "y1"));
    }
}

#[test]
fn names_of_methods_round_trip() {
    for method in Triangulation::ALL {
        assert_eq!(method.to_string().parse(), Ok(method));
    }
    assert_eq!("best".parse::<Triangulation>(), Err(UnknownTriangulation("best".into())));
}

proptest! {
    /// One camera straight behind the other: the rays of the epipoles, the principal points, meet every
    /// other ray in a camera centre.
    #[test]
    fn the_epipole_shows_no_point(x in 0.0..512.0_f64, y in 0.0..512.0_f64) {
        use accurate_geom::nalgebra::{Matrix3, Vector3};
        use accurate_geom::{Camera, ImageSize, LengthUnit};
        prop_assume!((x - 256.0).hypot(y - 256.0) > 1e-3);
        let k = Matrix3::new(1200.0, 0.0, 256.0, 0.0, -1200.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        let camera =
            |z| Camera::new(k, Matrix3::identity(), Vector3::new(0.0, 0.0, z), size).unwrap();
        let rig = Rig::new(camera(0.0), camera(50.0), LengthUnit::Millimetre).unwrap();
        let pairs = [
            (Pixel::new(256.0, 256.0), Pixel::new(x, y)),
            (Pixel::new(x, y), Pixel::new(256.0, 256.0)),
        ];
        let refused = [1, 2].map(|view| GeomError::AtEpipole { view, x: 256.0, y: 256.0 });
        // Gauss-Newton asks for a start, and gets none either.
        for method in Triangulation::ALL {
            let triangulator = Triangulator::new(&rig, method);
            for (k, (p1, p2)) in pairs.into_iter().enumerate() {
                prop_assert_eq!(triangulator.triangulate(p1, p2), Err(refused[k].clone()), "{}", method);
            }
            let found = triangulator.triangulate_all(pairs);
            prop_assert!(found.points.is_empty());
            let failures: Vec<_> = refused.iter().cloned().enumerate().collect();
            prop_assert_eq!(found.failures, failures, "{}", method);
        }
    }
}

/// Two parallel cameras: the simplest rig with rays that do not meet.
fn fixed_scene() -> Rig {
    use accurate_geom::nalgebra::{Matrix3, Vector3};
    use accurate_geom::{Camera, ImageSize, LengthUnit};
    let k = Matrix3::new(1000.0, 0.0, 256.0, 0.0, -1000.0, 256.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 512, height: 512 };
    let camera1 = Camera::new(k, Matrix3::identity(), Vector3::zeros(), size).unwrap();
    let camera2 =
        Camera::new(k, Matrix3::identity(), Vector3::new(-100.0, 0.0, 0.0), size).unwrap();
    Rig::new(camera1, camera2, LengthUnit::Millimetre).unwrap()
}

#[test]
fn parallel_rays_are_refused_by_every_method() {
    for method in Triangulation::ALL {
        let error =
            solve(&fixed_scene(), method, (Pixel::new(300.0, 200.0), Pixel::new(300.0, 200.0)))
                .unwrap_err();
        assert!(matches!(error, GeomError::ParallelRays { .. }), "{method}: {error}");
    }
}
