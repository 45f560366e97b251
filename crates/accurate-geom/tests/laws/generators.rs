//! Random rigs and scene points.

use accurate_geom::nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Point3, Rig};
use proptest::prelude::*;

/// A rig that looks at `target` and the radius of the ball around it where scene points lie.
#[derive(Debug, Clone)]
pub struct Scene {
    pub rig: Rig,
    pub target: Point3,
    pub radius: f64,
}

pub fn intrinsics() -> impl Strategy<Value = Matrix3<f64>> {
    // Both signs of f_y, and skew: nothing may assume f > 0.
    (
        400.0..3000.0f64,
        0.8..1.25f64,
        any::<bool>(),
        -20.0..20.0f64,
        100.0..900.0f64,
        100.0..900.0f64,
    )
        .prop_map(|(fx, aspect, flip, skew, cx, cy)| {
            let fy = if flip { -fx * aspect } else { fx * aspect };
            Matrix3::new(fx, skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0)
        })
}

pub fn unit_vectors() -> impl Strategy<Value = Unit<Vector3<f64>>> {
    (-1.0..1.0f64, -3.1..3.1f64).prop_map(|(z, turn)| {
        let r = (1.0 - z * z).sqrt();
        Unit::new_normalize(Vector3::new(r * turn.cos(), r * turn.sin(), z))
    })
}

/// A camera at `target + distance * direction` that looks at the target, rolled about its axis.
fn looking_at(
    k: Matrix3<f64>,
    target: Point3,
    direction: Vector3<f64>,
    distance: f64,
    roll: f64,
) -> Camera {
    let forward = -direction;
    let helper = if forward.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    let right = forward.cross(&helper).normalize();
    let down = forward.cross(&right);
    let upright = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let r = Rotation3::from_axis_angle(&Vector3::z_axis(), roll).into_inner() * upright;
    let centre = target + distance * direction;
    let t = -(r * centre.coords);
    Camera::new(k, r, t, ImageSize { width: 1024, height: 1024 }).unwrap()
}

/// Two views 20 to 120 degrees apart, at different distances, of a ball that is in front of both.
pub fn scenes() -> impl Strategy<Value = Scene> {
    (
        (intrinsics(), intrinsics()),
        [-500.0..500.0f64, -500.0..500.0f64, -500.0..500.0f64],
        (unit_vectors(), unit_vectors()),
        20.0..120.0f64,
        (300.0..1500.0f64, 300.0..1500.0f64),
        (-3.1..3.1f64, -3.1..3.1f64),
    )
        .prop_filter_map(
            "the axis of the second view is parallel to the first",
            |((k1, k2), target, (direction, other), degrees, (d1, d2), (roll1, roll2))| {
                let axis = Unit::try_new(direction.cross(&other), 0.05)?;
                let direction2 = Rotation3::from_axis_angle(&axis, degrees.to_radians())
                    * direction.into_inner();
                let target = Point3::from(target);
                let camera1 = looking_at(k1, target, direction.into_inner(), d1, roll1);
                let camera2 = looking_at(k2, target, direction2, d2, roll2);
                let rig = Rig::new(camera1, camera2, LengthUnit::Millimetre).ok()?;
                Some(Scene { rig, target, radius: 0.15 * d1.min(d2) })
            },
        )
}

/// A scene and `N` points of its ball.
pub fn scenes_with_points<const N: usize>() -> impl Strategy<Value = (Scene, [Point3; N])> {
    let offsets = proptest::array::uniform::<_, N>((unit_vectors(), 0.0..1.0f64));
    (scenes(), offsets).prop_map(|(scene, offsets)| {
        let points = offsets.map(|(u, r)| scene.target + scene.radius * r * u.into_inner());
        (scene, points)
    })
}

/// Bound on the rounding error of one projected coordinate, px: the products and sums of
/// `K (R X + t)` are each wrong by half an ulp of the largest term, about ten of them per
/// coordinate.
pub fn projection_rounding_px(camera: &Camera, x: &Point3) -> f64 {
    let k = camera.k();
    let in_camera = x.coords.norm() + camera.t().norm();
    10.0 * f64::EPSILON * k.amax() * (1.0 + in_camera / camera.depth(x))
}

/// The geometry of a C-arm that turned by 33.3 degrees, with f_y < 0, and tilted a little.
pub fn turntable_rig() -> Rig {
    let k = Matrix3::new(1493.75, 0.0, 250.0, 0.0, -1493.75, 250.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 500, height: 500 };
    let upright = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    let camera = |degrees: f64, tilt: f64| {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), degrees.to_radians())
            * Rotation3::from_axis_angle(&Vector3::x_axis(), tilt);
        let r = upright * turn.into_inner();
        Camera::new(k, r, Vector3::new(0.0, 0.0, 720.0), size).unwrap()
    };
    Rig::new(camera(-27.2, 0.0), camera(6.1, 0.2), LengthUnit::Millimetre).unwrap()
}

/// Points of a wandering curve: steps of length 0.5 to 2 that turn by at most 0.5 radians in the
/// plane, with a bounded third coordinate where there is one.
pub fn wandering<const D: usize>(
    count: std::ops::Range<usize>,
) -> impl Strategy<Value = Vec<accurate_geom::nalgebra::Point<f64, D>>> {
    proptest::collection::vec((0.5..2.0f64, -0.5..0.5f64, -0.3..0.3f64), count).prop_map(|steps| {
        let mut p = accurate_geom::nalgebra::Point::<f64, D>::origin();
        let mut direction = 0.3f64;
        let mut points = vec![p];
        for (length, turn, rise) in steps {
            direction += turn;
            p[0] += length * direction.cos();
            p[1] += length * direction.sin();
            if D > 2 {
                p[2] += length * rise;
            }
            points.push(p);
        }
        points
    })
}
