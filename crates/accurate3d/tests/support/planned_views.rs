//! The error that second views really give, by simulation.

use accurate_eval::curve_scores;
use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, ImageSize, LengthUnit, Pixel, Point3, Polyline3, Rig, View};
use accurate_synth::{CaseOptions, Family, generate};
use accurate3d::plan::{PlanParams, plan_views, second_camera};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};

/// Standard deviation of the noise in every pixel coordinate, px.
pub const SIGMA_PX: f64 = 0.5;

/// Normal numbers from a SplitMix64 stream: the same on every machine.
struct Noise(u64);

impl Noise {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (u, v) = (self.unit().max(1e-300), self.unit());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// A wire of a family, 120 mm across, about the isocentre of a C-arm at (-20, 5) degrees.
pub fn scene(family: Family, seed: u64, index: u64) -> (Vec<Point3>, Camera) {
    let case = generate(family, seed, index, &CaseOptions::default()).unwrap();
    let n = case.truth.len() as f64;
    let centre = case.truth.iter().map(|x| x.coords).sum::<Vector3<f64>>() / n;
    let reach = case.truth.iter().map(|x| (x.coords - centre).norm()).fold(0.0, f64::max);
    let shape = case
        .truth
        .iter()
        .step_by(4)
        .map(|x| Point3::from((x.coords - centre) * (60.0 / reach)))
        .collect();
    let (a, b) = ((-20f64).to_radians(), 5f64.to_radians());
    let u = Vector3::new(a.cos(), a.sin(), 0.0);
    let d = Vector3::new(a.sin() * b.cos(), -a.cos() * b.cos(), b.sin());
    let r = Matrix3::from_rows(&[u.transpose(), d.cross(&u).transpose(), d.transpose()]);
    let k = Matrix3::new(2400.0, 0.0, 256.0, 0.0, -2400.0, 256.0, 0.0, 0.0, 1.0);
    let size = ImageSize { width: 512, height: 512 };
    (shape, Camera::new(k, r, Vector3::new(0.0, 0.0, 750.0), size).unwrap())
}

fn seen<V: View>(shape: &Polyline3, camera: &Camera, noise: &mut Noise) -> Vec<Pixel<V>> {
    let mut points: Vec<Pixel<V>> = Vec::new();
    let mut last = None;
    for x in shape.resample(0.02).unwrap().points() {
        let p = camera.project(x).unwrap();
        // About a point a pixel.
        if last.is_none_or(|last: accurate_geom::Point2| (p - last).norm() >= 1.0) {
            last = Some(p);
            points
                .push(Pixel::new(p.x + SIGMA_PX * noise.normal(), p.y + SIGMA_PX * noise.normal()));
        }
    }
    points
}

/// Expected errors of second views on a grid and those measured with each draw of the noise, mm: the
/// mean distance of reconstructions from ordered points.
pub fn expected_and_draws(
    shape: &[Point3],
    first: &Camera,
    step_deg: f64,
    draws: usize,
) -> Vec<(f64, Vec<f64>)> {
    let params = PlanParams {
        step_deg,
        sigma_px: SIGMA_PX,
        primary_deg: [-80.0, 80.0],
        secondary_deg: [-40.0, 40.0],
        ..PlanParams::DEFAULT
    };
    let plan = plan_views(shape, first, &params).unwrap();
    let line = Polyline3::new(shape.to_vec()).unwrap();
    let mut pairs = Vec::new();
    for (index, view) in plan.views.iter().enumerate() {
        let Some(expected) = view.expected_mean else { continue };
        let second = second_camera(shape, first, [view.primary_deg, view.secondary_deg]).unwrap();
        let rig = Rig::new(first.clone(), second, LengthUnit::Millimetre).unwrap();
        let mut errors = Vec::with_capacity(draws);
        for draw in 0..draws {
            let mut noise = Noise(1000 + 7919 * (index * draws + draw) as u64);
            let points =
                (seen(&line, rig.camera1(), &mut noise), seen(&line, rig.camera2(), &mut noise));
            let pair = ViewPair { points: Some(points), ..ViewPair::new("planned", rig.clone()) };
            let params = Params::new(InputKind::Points, Method::Accurate);
            let curve = reconstruct(&pair, &params).unwrap();
            errors.push(curve_scores(&curve.positions(), shape, 0.2).unwrap().overall);
        }
        pairs.push((expected, errors));
    }
    pairs
}

/// The median of errors, mm: a draw that goes wrong in one view is none of the plan's.
pub fn median(errors: &[f64]) -> f64 {
    let mut errors = errors.to_vec();
    errors.sort_by(f64::total_cmp);
    errors[errors.len() / 2]
}

/// Spearman's rank correlation. Ties do not occur among measured numbers.
pub fn rank_correlation(pairs: &[(f64, f64)]) -> f64 {
    let ranks = |value: &dyn Fn(&(f64, f64)) -> f64| {
        let mut order: Vec<usize> = (0..pairs.len()).collect();
        order.sort_by(|a, b| value(&pairs[*a]).total_cmp(&value(&pairs[*b])));
        let mut ranks = vec![0.0; pairs.len()];
        for (rank, index) in order.into_iter().enumerate() {
            ranks[index] = rank as f64;
        }
        ranks
    };
    let (a, b) = (ranks(&|p| p.0), ranks(&|p| p.1));
    let squares: f64 = a.iter().zip(&b).map(|(x, y)| (x - y) * (x - y)).sum();
    let n = pairs.len() as f64;
    1.0 - 6.0 * squares / (n * (n * n - 1.0))
}
