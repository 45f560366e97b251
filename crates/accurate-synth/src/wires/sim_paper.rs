use accurate_geom::{GeomError, ImageSize, LengthUnit, Point3, Rig};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Draft;
use crate::rigs::{intrinsics, orbit};

/// The simulator of the ACCURATE paper, from its parameters.
///
/// Deviation: curves that leave the image are drawn again (the cone of a long wire can).
pub(super) fn draw(curve: &mut ChaCha8Rng, rig: &mut ChaCha8Rng) -> Result<Draft, GeomError> {
    let length = curve.random_range(50.0..120.0);
    let mut control = control_points(curve, length);
    add_j_tip(curve, &mut control);
    let curve = bezier_polyline(&control);

    let (low, high) = bounding_box(&curve);
    let centre = Point3::from((low + high) / 2.0);
    let distance = 2.0 * (high - low).max();
    let k = intrinsics(1988.0, 1988.0, 256.0, 1024.0);
    let size = ImageSize { width: 512, height: 2048 };
    let angle_deg = rig.random_range(30.0..50.0);
    let rig = Rig::new(
        orbit(k, size, &centre, distance, 0.0, 0.0)?,
        orbit(k, size, &centre, distance, angle_deg, 0.0)?,
        LengthUnit::Unit,
    )?;
    // The picture's tube has diameter 0.4, about 4 px; the mask's has 0.1, about 1 px.
    Ok(Draft { curve, rig, wire_radius: 0.2, mask_diameter: Some(0.1), margin_px: 2.0 })
}

/// The shaft: 10 points below length 80, `floor(length / 10) + 10` from there on; the first is the
/// origin. `length` is the nominal height; noise in z may exceed it.
fn control_points(rng: &mut ChaCha8Rng, length: f64) -> Vec<Point3> {
    let mut within = |half: f64| rng.random_range(-half..=half);
    let mut points = vec![Point3::origin()];
    if length < 80.0 {
        let n = 10;
        for i in 1..n {
            let z = length * i as f64 / (n - 1) as f64;
            points.push(Point3::new(within(5.0), within(5.0), z + within(5.0)));
        }
        return points;
    }
    let n = (length / 10.0).floor() as usize + 10;
    for i in 1..n {
        let tau = (i as f64 / (n - 1) as f64).powf(0.7);
        let (x, y, dz) = if i <= 3 {
            (within(3.0), within(3.0), within(2.0))
        } else if i >= n - 4 {
            (within(4.0), within(3.0), within(2.0))
        } else {
            let m = 18.0 * tau;
            let (x, y) = (within(m), within(m));
            // Now and then the middle of the wire folds back; the coin is only thrown there.
            let folds = 0.3 < tau && tau < 0.7 && within(0.5) + 0.5 > 0.85;
            (x, y, if folds { -0.6 * m + within(0.4 * m) } else { within(0.7 * m) })
        };
        points.push(Point3::new(x, y, tau * length + dz));
    }
    points
}

/// Five more points along a hook of length 3, bent to +x or -x.
fn add_j_tip(rng: &mut ChaCha8Rng, control: &mut Vec<Point3>) {
    const LENGTH: f64 = 3.0;
    let end = control[control.len() - 1];
    let along = (end - control[control.len() - 2]).normalize();
    let bend = Vector3::x() * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    for j in 0..5 {
        let t = f64::from(j + 1) / 6.0;
        control.push(
            end + along * (LENGTH * t * 0.6) + bend * (LENGTH * t * t * 0.8)
                - Vector3::z() * (LENGTH * t * t * 0.2),
        );
    }
}

/// Cubic Bézier segments through all points with Blender's automatic handles, 12 chords each.
///
/// The handles of a point lie along the sum of the unit directions from and to its neighbours, at
/// `segment length / (2.5614 |sum|)` times that sum; the missing neighbour of an end is the mirror
/// image of the other.
fn bezier_polyline(control: &[Point3]) -> Vec<Point3> {
    const STEPS: usize = 12;
    let n = control.len();
    let unit = |v: Vector3<f64>| v.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    // Per unit of segment length; zero where the curve turns straight back.
    let handle = |i: usize| {
        let next =
            if i + 1 < n { control[i + 1] - control[i] } else { control[i] - control[i - 1] };
        let last = if i > 0 { control[i] - control[i - 1] } else { next };
        let sum = unit(next) + unit(last);
        unit(sum) / 2.5614
    };
    let mut polyline = Vec::with_capacity(STEPS * (n - 1) + 1);
    for i in 0..n - 1 {
        let (a, d) = (control[i], control[i + 1]);
        let length = (d - a).norm();
        let (b, c) = (a + handle(i) * length, d - handle(i + 1) * length);
        for k in 0..STEPS {
            let t = k as f64 / STEPS as f64;
            let u = 1.0 - t;
            polyline.push(Point3::from(
                a.coords * (u * u * u)
                    + b.coords * (3.0 * u * u * t)
                    + c.coords * (3.0 * u * t * t)
                    + d.coords * (t * t * t),
            ));
        }
    }
    polyline.push(control[n - 1]);
    polyline
}

fn bounding_box(points: &[Point3]) -> (Vector3<f64>, Vector3<f64>) {
    let first = points[0].coords;
    points.iter().fold((first, first), |(low, high), p| (low.inf(&p.coords), high.sup(&p.coords)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::SeedableRng;

    use super::*;

    proptest! {
        #[test]
        fn control_points_are_as_many_and_as_wide_as_the_paper_draws_them(
            seed: u64, length in 50.0..120.0_f64,
        ) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut points = control_points(&mut rng, length);
            let n = points.len();
            prop_assert_eq!(points[0], Point3::origin());
            if length < 80.0 {
                prop_assert_eq!(n, 10);
                prop_assert!(points.iter().all(|p| p.x.abs() <= 5.0 && p.y.abs() <= 5.0));
                let off = |(i, p): (usize, &Point3)| (p.z - length * i as f64 / 9.0).abs();
                prop_assert!(points.iter().enumerate().map(off).all(|dz| dz <= 5.0));
            } else {
                prop_assert_eq!(n, (length / 10.0) as usize + 10);
                prop_assert!((18..=21).contains(&n));
                for (i, p) in points.iter().enumerate() {
                    let tau = (i as f64 / (n - 1) as f64).powf(0.7);
                    let half = if i <= 3 { 3.0 } else if i >= n - 4 { 4.0 } else { 18.0 * tau };
                    let fold = if i <= 3 || i >= n - 4 { 2.0 } else { 18.0 * tau };
                    prop_assert!(p.x.abs() <= half && p.y.abs() <= half);
                    prop_assert!((p.z - tau * length).abs() <= fold + 1e-12);
                }
            }
            add_j_tip(&mut rng, &mut points);
            prop_assert_eq!(points.len(), n + 5);
            // The hook's last point, t = 5/6: at most 3 (0.6 t + 0.8 t² + 0.2 t²) away.
            let reach = (points[n + 4] - points[n - 1]).norm();
            prop_assert!(reach <= 3.0 * (0.5 + 25.0 / 36.0));
            prop_assert_eq!(bezier_polyline(&points).len(), 12 * (n + 4) + 1);
        }
    }

    #[test]
    fn automatic_handles_make_a_straight_line_of_collinear_points() {
        let points: Vec<_> = [0.0, 1.0, 4.0, 5.5].map(|z| Point3::new(1.0, 2.0, z)).to_vec();
        let polyline = bezier_polyline(&points);
        assert!(polyline.iter().all(|p| (p.x - 1.0).abs() < 1e-15 && (p.y - 2.0).abs() < 1e-15));
        assert!(polyline.windows(2).all(|w| w[1].z > w[0].z));
    }

    #[test]
    fn a_quarter_of_a_circle_is_nearly_round() {
        // 2.5614 is Blender's choice for circles: four points on a circle give one to 0.1 %.
        let points: Vec<_> = (0..=8)
            .map(|k| {
                let (s, c) = (f64::from(k) * std::f64::consts::FRAC_PI_2).sin_cos();
                Point3::new(c, s, 0.0)
            })
            .collect();
        for p in &bezier_polyline(&points)[12..=84] {
            // Vertices lie on the Bézier curve itself, the chords do not matter.
            assert!((p.coords.norm() - 1.0).abs() < 2e-3, "{}", p.coords.norm());
        }
    }
}
