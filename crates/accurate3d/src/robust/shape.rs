use accurate_geom::{Camera, Curve3, Point2, Point3, Rig};

/// Samples by which two curves are compared.
const COMPARED: usize = 48;
/// Curvature beyond which bending grows only in proportion to the turn, 1/px: a cusp in the image of
/// a hairpin must not outweigh the whole outline.
const SHARP_PER_PX: f64 = 0.1;

/// What a curve looks like, to tell it from others without its spline.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    samples: Vec<Point3>,
    px_per_unit: f64,
}

impl Shape {
    pub(crate) fn new(curve: &Curve3, rig: &Rig) -> Self {
        let samples = Evenly::of(curve).points(COMPARED);
        let px_per_unit = px_per_unit(&samples, rig);
        Self { samples, px_per_unit }
    }

    /// Largest distance of a sample from its partner, px.
    pub(crate) fn distance_px(&self, other: &Self) -> f64 {
        let distance = |(a, b): (&Point3, &Point3)| (a - b).norm();
        let largest = self.samples.iter().zip(&other.samples).map(distance).fold(0.0, f64::max);
        largest * self.px_per_unit
    }

    /// Whether no sample is farther than `px` from the other curve wherever that is; the ends may be
    /// off by twice that.
    pub(crate) fn is_along(&self, other: &Self, px: f64) -> bool {
        let limit = px / self.px_per_unit;
        let last = self.samples.len() - 1;
        self.samples.iter().enumerate().all(|(k, p)| {
            let allowed = if k == 0 || k == last { 2.0 * limit } else { limit };
            other.samples.windows(2).any(|w| {
                let e = w[1] - w[0];
                let t = (p - w[0]).dot(&e) / e.norm_squared().max(f64::MIN_POSITIVE);
                (p - w[0] - e * t.clamp(0.0, 1.0)).norm() <= allowed
            })
        })
    }

    /// Whether no sample is farther than `px` from its partner, in the same or the other direction.
    pub(crate) fn is_like(&self, other: &Self, px: f64) -> bool {
        let limit = px / self.px_per_unit;
        let near = |(a, b): (&Point3, &Point3)| (a - b).norm() <= limit;
        self.samples.iter().zip(&other.samples).all(near)
            || self.samples.iter().zip(other.samples.iter().rev()).all(near)
    }
}

/// Mean magnification of both views over the points.
pub(crate) fn px_per_unit(points: &[Point3], rig: &Rig) -> f64 {
    let one = |camera: &Camera| {
        let k = camera.k();
        let focal_px = (k[(0, 0)].abs() + k[(1, 1)].abs()) / 2.0;
        points.iter().map(|p| focal_px / camera.depth(p).abs().max(f64::MIN_POSITIVE)).sum::<f64>()
    };
    (one(rig.camera1()) + one(rig.camera2())) / (2 * points.len().max(1)) as f64
}

/// Mean magnification of both views along a curve.
pub(crate) fn px_per_unit_along(curve: &Curve3, rig: &Rig) -> f64 {
    px_per_unit(&Evenly::of(curve).points(16), rig)
}

/// `∫ min(κ, 0.1 / px) |dθ|`, 1/px: bending energy of a curve that may have cusps.
pub(crate) fn bending(curve: &Curve3, rig: &Rig) -> f64 {
    const PER_SPAN: usize = 6;
    let px_per_unit = px_per_unit_along(curve, rig);
    let breakpoints = curve.breakpoints();
    let mut sum = 0.0;
    for pair in breakpoints.windows(2) {
        let width = (pair[1] - pair[0]) / PER_SPAN as f64;
        for k in 0..PER_SPAN {
            let jet = curve.jet(pair[0] + (k as f64 + 0.5) * width);
            let speed = jet.first.norm();
            let across = jet.first.cross(&jet.second).norm();
            if speed > 0.0 {
                let per_px = across / speed.powi(3) / px_per_unit;
                let turn = (across / (speed * speed) * width).min(std::f64::consts::FRAC_PI_2);
                sum += per_px.min(SHARP_PER_PX) * turn;
            }
        }
    }
    sum
}

/// Points about 1 px apart along a curve.
pub(crate) fn dense(curve: &Curve3, rig: &Rig) -> Vec<Point3> {
    let evenly = Evenly::of(curve);
    let length_px = evenly.length() * px_per_unit(&evenly.points(16), rig);
    evenly.points(length_px.ceil().clamp(8.0, 65_536.0) as usize + 1)
}

/// Where a camera shows points; `None` if it does not see all of them.
pub(crate) fn image_of(camera: &Camera, points: &[Point3]) -> Option<Vec<Point2>> {
    points.iter().map(|p| camera.project(p).ok()).collect()
}

/// Points at nearly equal arc lengths, for comparisons: exact ones, whose integrals are found to
/// rounding, take ten times as long.
struct Evenly<'a> {
    curve: &'a Curve3,
    /// Some places along the curve: parameter, and length of the chords up to there.
    places: Vec<(f64, f64)>,
}

impl<'a> Evenly<'a> {
    fn of(curve: &'a Curve3) -> Self {
        const PER_SPAN: usize = 4;
        let breakpoints = curve.breakpoints();
        let between = breakpoints.windows(2).flat_map(|pair| {
            let width = (pair[1] - pair[0]) / PER_SPAN as f64;
            (0..PER_SPAN).map(move |k| pair[0] + k as f64 * width)
        });
        let (mut length, mut last) = (0.0, None::<Point3>);
        let places = between
            .chain([curve.domain().1])
            .map(|t| {
                let here = curve.at(t);
                length += last.map_or(0.0, |last| (here - last).norm());
                last = Some(here);
                (t, length)
            })
            .collect();
        Self { curve, places }
    }

    fn length(&self) -> f64 {
        self.places[self.places.len() - 1].1
    }

    /// So many points, at least 2, both ends among them.
    fn points(&self, count: usize) -> Vec<Point3> {
        let (length, mut k) = (self.length(), 0);
        (0..count)
            .map(|index| {
                let target = length * index as f64 / (count - 1) as f64;
                while k + 2 < self.places.len() && self.places[k + 1].1 < target {
                    k += 1;
                }
                let ((from, before), (to, beyond)) = (self.places[k], self.places[k + 1]);
                let part =
                    if beyond > before { (target - before) / (beyond - before) } else { 0.0 };
                self.curve.at(from + (to - from) * part.min(1.0))
            })
            .collect()
    }
}

/// Whether a camera shows a point nearer than `reach_px` to one of some pixels, `[x, y]`.
pub(crate) fn is_shown_near(
    camera: &Camera,
    point: &Point3,
    pixels: &[[f64; 2]],
    reach_px: f64,
) -> bool {
    camera
        .project(point)
        .is_ok_and(|at| pixels.iter().any(|[x, y]| (at.x - x).hypot(at.y - y) < reach_px))
}

/// Length of the polyline up to each of its points, px.
pub(crate) fn arc_lengths_px(points: &[Point3], px_per_unit: f64) -> Vec<f64> {
    let steps = points.windows(2).map(|w| (w[1] - w[0]).norm() * px_per_unit);
    let lengths = steps.scan(0.0, |length, step| {
        *length += step;
        Some(*length)
    });
    std::iter::once(0.0).chain(lengths).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use accurate_geom::{
        ImageSize, LengthUnit, nalgebra::Matrix3, nalgebra::Rotation3, nalgebra::Vector3,
    };

    /// One px a unit at the world's middle, 69 degrees between the views.
    pub(in crate::robust) fn rig() -> Rig {
        let k = Matrix3::new(1000.0, 0.0, 256.0, 0.0, 1000.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        let t = Vector3::new(0.0, 0.0, 1000.0);
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), 1.2);
        let camera = |r: Matrix3<f64>| Camera::new(k, r, t, size).unwrap();
        Rig::new(camera(Matrix3::identity()), camera(*turn.matrix()), LengthUnit::Unit).unwrap()
    }

    #[test]
    fn points_are_nearly_even_and_on_the_curve() {
        // Knots far apart, and uneven.
        let at = |t: f64| Point3::new(40.0 * t.cos(), 40.0 * t.sin(), 5.0 * t * t);
        let points: Vec<_> =
            (0..=12).map(|k| at(0.25 * f64::from(k) + 0.02 * f64::from(k * k))).collect();
        let curve = Curve3::interpolate(&points).unwrap();
        let (found, exact) = (Evenly::of(&curve).points(48), curve.sample(48));
        let step = curve.arc_length() / 47.0;
        for (found, exact) in found.iter().zip(&exact) {
            assert!((found - exact).norm() < 0.05 * step, "{found} {exact}");
        }
        assert_eq!((found[0], found[47]), (exact[0], exact[47]));
        assert!((Evenly::of(&curve).length() / curve.arc_length() - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_circle_bends_by_its_angle_over_its_radius() {
        let radius = 40.0;
        let points: Vec<_> = (0..=60)
            .map(|k| {
                let a = std::f64::consts::PI * k as f64 / 60.0;
                Point3::new(radius * a.cos(), radius * a.sin(), 0.0)
            })
            .collect();
        let curve = Curve3::interpolate(&points).unwrap();
        // One px per unit at the centre, within 4 % over the circle; natural ends add less than that.
        let found = bending(&curve, &rig());
        assert!((found / (std::f64::consts::PI / radius) - 1.0).abs() < 0.1, "{found}");
    }

    #[test]
    fn a_cusp_costs_no_more_than_its_turn_at_the_sharpest_curvature() {
        let points: Vec<_> = (0..=40)
            .map(|k| Point3::new((f64::from(k) - 20.0).abs() * 5.0, 0.01 * f64::from(k), 0.0))
            .collect();
        let curve = Curve3::interpolate(&points).unwrap();
        let found = bending(&curve, &rig());
        // Half a turn, and at most as much again where the spline rings.
        assert!(found < 2.0 * std::f64::consts::PI * SHARP_PER_PX, "{found}");
    }

    #[test]
    fn a_shorter_curve_runs_along_the_longer_one_but_is_not_like_it() {
        let line = |from: f64, y: f64| {
            let points: Vec<_> = (0..30)
                .map(|k| Point3::new(from + (200.0 - from) * f64::from(k) / 29.0, y, 3.0))
                .collect();
            Shape::new(&Curve3::interpolate(&points).unwrap(), &rig())
        };
        let (whole, part, beside) = (line(0.0, 0.0), line(50.0, 0.0), line(0.0, 6.0));
        assert!(part.is_along(&whole, 2.0));
        assert!(!part.is_like(&whole, 2.0));
        // The begin is 50 px away from the part's.
        assert!(!whole.is_along(&part, 2.0));
        assert!(!beside.is_along(&whole, 2.0));
    }

    #[test]
    fn a_curve_is_like_itself_reversed_and_unlike_one_that_is_moved() {
        let curve = |x: f64| {
            let points: Vec<_> = (0..30)
                .map(|k| Point3::new(x + f64::from(k), f64::from(k * k) * 0.1, 3.0))
                .collect();
            Curve3::interpolate(&points).unwrap()
        };
        let rig = rig();
        let here = Shape::new(&curve(0.0), &rig);
        assert_eq!(here.distance_px(&here), 0.0);
        // 9 units at one px a unit, within the few percent by which its depth differs.
        let moved = here.distance_px(&Shape::new(&curve(9.0), &rig));
        assert!((moved - 9.0).abs() < 0.9, "{moved}");
        assert!(here.is_like(&Shape::new(&curve(0.0).reversed(), &rig), 0.1));
        assert!(!here.is_like(&Shape::new(&curve(9.0), &rig), 3.0));
    }
}
