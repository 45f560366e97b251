//! Which second view to take: the error to expect in 3D, for a rough shape and a first view, over the
//! angles that the second view may have.
//!
//! Two views measure a curve only across its images. Where both measure the same direction, the plane
//! through both sources and the tangent, depth is not seen at all. How much of a given shape lies so
//! differs from one second view to the next by factors; the angle between the views alone does not
//! tell.

mod expected_error;
mod heat_map;

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, GeomError, Point3, Polyline3};
use thiserror::Error;

use crate::c_arm::{ArmPlace, arm};
use expected_error::expected_error;
pub use heat_map::heat_map_svg;

/// What a plan is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanParams {
    /// Standard deviation of a traced centreline across the body, px. 0.5.
    pub sigma_px: f64,
    /// Length of body over which a reconstruction carries depth across stretches that do not show
    /// it, as a share of the body's length. 0.03.
    pub smoothing_share: f64,
    /// Least and greatest primary angle, degrees.
    pub primary_deg: [f64; 2],
    /// Least and greatest secondary angle, degrees.
    pub secondary_deg: [f64; 2],
    /// Step of both, degrees.
    pub step_deg: f64,
}

impl PlanParams {
    /// Primary -90 to 90, secondary -45 to 45, in steps of 5 degrees.
    pub const DEFAULT: Self = Self {
        sigma_px: 0.5,
        smoothing_share: 0.03,
        primary_deg: [-90.0, 90.0],
        secondary_deg: [-45.0, 45.0],
        step_deg: 5.0,
    };
}

impl Default for PlanParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// A second view that could be taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedView {
    /// Primary angle, degrees; LAO positive.
    pub primary_deg: f64,
    /// Secondary angle, degrees; cranial positive.
    pub secondary_deg: f64,
    /// Angle between the central rays of the two views, degrees.
    pub apart_deg: f64,
    /// Share of the shape that the second image shows.
    pub seen: f64,
    /// Expected error of the curve across its tangent, mean along it, world unit; `None` where not all of
    /// the shape is seen, or all of it looks the same from both views.
    pub expected_mean: Option<f64>,
    /// The greatest along the curve.
    pub expected_max: Option<f64>,
}

/// The second views of a grid, secondary angle by secondary angle.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewPlan {
    /// Angles of the first view, degrees.
    pub first_deg: [f64; 2],
    /// Whether the angles are a C-arm's own. Otherwise the first view is at (0, 0) and the second
    /// turns about the middle of the shape.
    pub is_c_arm: bool,
    /// Primary angles of the columns, degrees.
    pub primary_deg: Vec<f64>,
    /// Secondary angles of the rows, degrees.
    pub secondary_deg: Vec<f64>,
    /// Row by row.
    pub views: Vec<PlannedView>,
}

impl ViewPlan {
    /// The views with an expected error, best first.
    pub fn ranked(&self) -> Vec<PlannedView> {
        let mut ranked: Vec<_> =
            self.views.iter().copied().filter(|v| v.expected_mean.is_some()).collect();
        let error = |v: &PlannedView| v.expected_mean.unwrap_or(f64::INFINITY);
        ranked.sort_by(|a, b| error(a).total_cmp(&error(b)));
        ranked
    }
}

/// Why there is no plan.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A parameter that makes no sense.
    #[error("{name} is {value}: expected {expected}")]
    BadParameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
    /// The first view does not see the shape.
    #[error("{seen} of {of} points of the shape lie in front of the first view and in its image")]
    NotInFirstView {
        /// Points seen.
        seen: usize,
        /// Points of the shape.
        of: usize,
    },
    /// The shape is no curve.
    #[error("the shape has no length")]
    NoLength,
    /// What geometry refuses.
    #[error(transparent)]
    Geometry(#[from] GeomError),
}

/// Samples of the shape.
const SAMPLES: usize = 240;
/// Share of the shape that the first image must show, and the second for a view to count.
const LEAST_SEEN: f64 = 0.98;
/// Most views of a grid.
const MOST_VIEWS: f64 = 1e6;

/// The error to expect for every second view of a grid.
///
/// `shape` is the body as far as it is known, points in order, in the world of `first`. The second
/// view has the optics and distance of the first. A C-arm (a camera that looks at the world's origin,
/// DICOM's axes) turns about its isocentre; any other camera about the middle of the shape.
///
/// # Errors
/// [`PlanError`] for parameters out of range, or a shape that the first view does not see.
///
/// # Cost
/// O(samples · window) per view, some 0.1 ms.
pub fn plan_views(
    shape: &[Point3],
    first: &Camera,
    params: &PlanParams,
) -> Result<ViewPlan, PlanError> {
    let primary_deg = steps("primary angle", params.primary_deg, params.step_deg)?;
    let secondary_deg = steps("secondary angle", params.secondary_deg, params.step_deg)?;
    positive("sigma_px", params.sigma_px)?;
    positive("smoothing_share", params.smoothing_share)?;
    let cells = primary_deg.len() as f64 * secondary_deg.len() as f64;
    if cells > MOST_VIEWS {
        let expected = "a grid of at most a million views";
        return Err(PlanError::BadParameter { name: "views", value: cells, expected });
    }
    let shape = evenly(shape)?;
    let shape = shape.points();
    let seen = shape.iter().filter(|x| sees(first, x)).count();
    if (seen as f64) < LEAST_SEEN * shape.len() as f64 {
        return Err(PlanError::NotInFirstView { seen, of: shape.len() });
    }
    let orbit = Orbit::of(first, shape);
    let mut views = Vec::with_capacity(primary_deg.len() * secondary_deg.len());
    for &secondary in &secondary_deg {
        for &primary in &primary_deg {
            views.push(planned(shape, first, &orbit, [primary, secondary], params)?);
        }
    }
    Ok(ViewPlan {
        first_deg: orbit.first_deg,
        is_c_arm: orbit.is_c_arm,
        primary_deg,
        secondary_deg,
        views,
    })
}

/// The camera of the second view at these angles, degrees; what [`plan_views`] reckons with.
///
/// # Errors
/// [`PlanError`] for a shape without two points apart.
pub fn second_camera(
    shape: &[Point3],
    first: &Camera,
    angles_deg: [f64; 2],
) -> Result<Camera, PlanError> {
    let shape = evenly(shape)?;
    Ok(Orbit::of(first, shape.points()).camera(first, angles_deg)?)
}

/// The shape in steps of equal length: where its vertices crowd says nothing.
fn evenly(shape: &[Point3]) -> Result<Polyline3, PlanError> {
    let line = Polyline3::new(shape.to_vec())?;
    if !(line.length() > 0.0) {
        return Err(PlanError::NoLength);
    }
    Ok(line.resample_to(SAMPLES)?)
}

fn planned(
    shape: &[Point3],
    first: &Camera,
    orbit: &Orbit,
    angles_deg: [f64; 2],
    params: &PlanParams,
) -> Result<PlannedView, PlanError> {
    let second = orbit.camera(first, angles_deg)?;
    let (d1, d2) = (first.r().row(2), second.r().row(2));
    let seen = shape.iter().filter(|x| sees(&second, x)).count() as f64 / shape.len() as f64;
    let error =
        (seen >= LEAST_SEEN).then(|| expected_error(shape, [first, &second], params)).flatten();
    Ok(PlannedView {
        primary_deg: angles_deg[0],
        secondary_deg: angles_deg[1],
        apart_deg: d1.dot(&d2).clamp(-1.0, 1.0).acos().to_degrees(),
        seen,
        expected_mean: error.map(|e| e.mean),
        expected_max: error.map(|e| e.max),
    })
}

/// How the second camera turns.
struct Orbit {
    first_deg: [f64; 2],
    is_c_arm: bool,
    image_from_arm: Matrix3<f64>,
    arm_from_world: Matrix3<f64>,
    pivot: Vector3<f64>,
}

impl Orbit {
    fn of(first: &Camera, shape: &[Point3]) -> Self {
        if let Some(place) = ArmPlace::of(first) {
            return Self {
                first_deg: [place.primary_rad.to_degrees(), place.secondary_rad.to_degrees()],
                is_c_arm: true,
                image_from_arm: place.image_from_arm,
                arm_from_world: Matrix3::identity(),
                pivot: Vector3::zeros(),
            };
        }
        let sum: Vector3<f64> = shape.iter().map(|x| x.coords).sum();
        Self {
            first_deg: [0.0; 2],
            is_c_arm: false,
            image_from_arm: Matrix3::identity(),
            arm_from_world: arm(0.0, 0.0).transpose() * first.r(),
            pivot: sum / shape.len().max(1) as f64,
        }
    }

    fn camera(&self, first: &Camera, [primary, secondary]: [f64; 2]) -> Result<Camera, GeomError> {
        let turned = arm(primary.to_radians(), secondary.to_radians());
        let r = self.image_from_arm * turned * self.arm_from_world;
        let t = first.t() + (first.r() - r) * self.pivot;
        Camera::new(*first.k(), r, t, first.size())
    }
}

fn sees(camera: &Camera, x: &Point3) -> bool {
    let size = camera.size();
    camera.project(x).is_ok_and(|p| {
        (-0.5..=f64::from(size.width) - 0.5).contains(&p.x)
            && (-0.5..=f64::from(size.height) - 0.5).contains(&p.y)
    })
}

fn positive(name: &'static str, value: f64) -> Result<(), PlanError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(PlanError::BadParameter { name, value, expected: "a positive number" })
}

fn steps(name: &'static str, [low, high]: [f64; 2], step: f64) -> Result<Vec<f64>, PlanError> {
    positive("step_deg", step)?;
    for value in [low, high] {
        if !(value.abs() <= 180.0) {
            let expected = "degrees from -180 to 180";
            return Err(PlanError::BadParameter { name, value, expected });
        }
    }
    if low > high {
        let expected = "a range from its least to its greatest value";
        return Err(PlanError::BadParameter { name, value: high - low, expected });
    }
    let count = ((high - low) / step + 1e-9).floor();
    if count > MOST_VIEWS {
        let expected = "steps that give a grid of at most a million views";
        return Err(PlanError::BadParameter { name: "step_deg", value: step, expected });
    }
    Ok((0..=count as u32).map(|i| low + step * f64::from(i)).collect())
}

#[cfg(test)]
mod tests {
    use accurate_geom::ImageSize;

    use super::*;

    fn c_arm(a: f64, b: f64) -> Camera {
        let k = Matrix3::new(1800.0, 0.0, 256.0, 0.0, -1800.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        Camera::new(k, arm(a, b), Vector3::new(0.0, 0.0, 750.0), size).unwrap()
    }

    fn bow() -> Vec<Point3> {
        (0..60)
            .map(|i| {
                let s = f64::from(i) / 59.0;
                Point3::new(30.0 * (3.0 * s).sin(), 25.0 * s * s, 80.0 * (s - 0.5))
            })
            .collect()
    }

    #[test]
    fn where_vertices_crowd_is_no_matter_to_where_a_camera_turns() {
        let k = Matrix3::new(1800.0, 0.0, 256.0, 0.0, 1800.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        // Looks at no isocentre.
        let first =
            Camera::new(k, Matrix3::identity(), Vector3::new(7.0, 3.0, 900.0), size).unwrap();
        let even: Vec<Point3> = (0..=100).map(|x| Point3::new(f64::from(x), 0.0, 0.0)).collect();
        let mut crowded: Vec<Point3> =
            (0..200).map(|k| Point3::new(f64::from(k) * 0.005, 0.0, 0.0)).collect();
        crowded.push(Point3::new(100.0, 0.0, 0.0));
        let centre =
            |shape: &[Point3]| second_camera(shape, &first, [30.0, 10.0]).unwrap().centre();
        assert!((centre(&even) - centre(&crowded)).norm() < 1e-9);
        let point = [Point3::origin(); 3];
        assert!(second_camera(&point, &first, [30.0, 10.0]).is_err());
    }

    #[test]
    fn any_share_of_smoothing_gives_an_error_and_a_step_that_is_too_fine_is_named() {
        let (shape, first) = (bow(), c_arm(0.0, 0.0));
        let coarse = PlanParams { step_deg: 45.0, ..PlanParams::DEFAULT };
        let wide = PlanParams { smoothing_share: 1e20, ..coarse };
        let plan = plan_views(&shape, &first, &wide).unwrap();
        assert!(plan.views.iter().any(|view| view.expected_mean.is_some()));
        let fine = PlanParams { step_deg: 1e-5, ..coarse };
        let refused = plan_views(&shape, &first, &fine).unwrap_err().to_string();
        assert!(refused.contains("step_deg"), "{refused}");
    }

    #[test]
    fn the_second_camera_is_the_c_arm_at_those_angles() {
        let first = c_arm(0.4, -0.2);
        let second = second_camera(&bow(), &first, [-50.0, 20.0]).unwrap();
        let expected = c_arm((-50f64).to_radians(), 20f64.to_radians());
        // Angles there and back through degrees, and two products.
        assert!((second.projection_matrix() - expected.projection_matrix()).amax() < 1e-9);
    }

    #[test]
    fn the_same_view_twice_expects_no_finite_error_and_a_free_camera_turns_about_the_shape() {
        let first = c_arm(0.0, 0.0);
        let plan = plan_views(&bow(), &first, &PlanParams::DEFAULT).unwrap();
        let at = |a: f64, b: f64| {
            *plan.views.iter().find(|v| v.primary_deg == a && v.secondary_deg == b).unwrap()
        };
        assert_eq!(at(0.0, 0.0).expected_mean, None);
        assert!(at(60.0, 0.0).expected_mean.unwrap() < at(10.0, 0.0).expected_mean.unwrap());
        let shift = Vector3::new(40.0, -90.0, 10.0);
        let moved =
            Camera::new(*first.k(), *first.r(), first.t() - first.r() * shift, first.size());
        let shape: Vec<Point3> = bow().iter().map(|x| x + shift).collect();
        let centre = shape.iter().map(|x| x.coords).sum::<Vector3<f64>>() / shape.len() as f64;
        let second = second_camera(&shape, &moved.unwrap(), [70.0, -10.0]).unwrap();
        let seen = second.project(&Point3::from(centre)).unwrap();
        assert!((seen.x - 256.0).abs() < 60.0 && (seen.y - 256.0).abs() < 60.0, "{seen}");
    }

    #[test]
    fn senseless_parameters_and_shapes_are_named() {
        let first = c_arm(0.0, 0.0);
        let bad = |params: PlanParams| plan_views(&bow(), &first, &params).unwrap_err().to_string();
        let default = PlanParams::DEFAULT;
        assert!(bad(PlanParams { sigma_px: 0.0, ..default }).contains("sigma_px is 0"));
        assert!(bad(PlanParams { step_deg: f64::NAN, ..default }).contains("step_deg"));
        assert!(bad(PlanParams { primary_deg: [10.0, -10.0], ..default }).contains("primary"));
        let far: Vec<Point3> = bow().iter().map(|x| x + Vector3::new(900.0, 0.0, 0.0)).collect();
        let error = plan_views(&far, &first, &default).unwrap_err().to_string();
        assert!(error.contains("0 of 240 points"), "{error}");
        let dot = vec![Point3::origin(); 3];
        assert!(matches!(plan_views(&dot, &first, &default), Err(PlanError::NoLength)));
    }
}
