//! Random sound rigs with beads seen in both views, and the same with one mistake in them.

use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use accurate_geom::{Camera, Distortion, ImageSize, Point2, Point3};
use accurate3d::doctor::{LensCentre, Mistake, Which};

pub const BEADS: usize = 100;

/// A SplitMix64 stream: the same numbers on every machine.
pub struct Stream(u64);

impl Stream {
    pub fn of(seed: u64, index: u64) -> Self {
        let mut stream = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (index << 20));
        stream.next();
        stream
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn either(&mut self, low: f64, high: f64) -> f64 {
        let sign = if self.next() & 1 == 0 { 1.0 } else { -1.0 };
        sign * self.between(low, high)
    }

    fn normal(&mut self) -> f64 {
        let (u, v) = (self.between(1e-12, 1.0), self.between(0.0, 1.0));
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// Two cameras and what they saw.
#[derive(Debug, Clone)]
pub struct Scene {
    pub cameras: [Camera; 2],
    pub beads: Vec<[Point2; 2]>,
    /// The middle of what both see, in the world of `cameras` as they really are.
    pub middle: Point3,
    /// Half the width of what both see, mm.
    pub reach: f64,
}

/// World to camera of a C-arm about the world's origin, DICOM's axes.
fn arm(a: f64, b: f64) -> Matrix3<f64> {
    let u = Vector3::new(a.cos(), a.sin(), 0.0);
    let d = Vector3::new(a.sin() * b.cos(), -a.cos() * b.cos(), b.sin());
    Matrix3::from_rows(&[u.transpose(), d.cross(&u).transpose(), d.transpose()])
}

/// A sound rig, 25 to 110 degrees between the views, mm: by turns a C-arm, two free cameras, and a
/// stereo calibration that has camera 1 at the world's origin. Beads fill the field of view; noise of
/// 0.05 to 0.4 px in each coordinate.
pub fn sound(seed: u64, index: u64) -> Scene {
    let mut stream = Stream::of(seed, index);
    let kind = index % 3;
    let field_mm = stream.between(80.0, 400.0);
    let distance = stream.between(550.0, 1000.0);
    let target = match kind {
        0 => Vector3::zeros(),
        _ => Vector3::from_fn(|_, _| stream.either(20.0, 400.0)),
    };
    let mut directions = [Vector3::zeros(); 2];
    let mut arms = [(0.0, 0.0); 2];
    let apart = loop {
        for (direction, angles) in directions.iter_mut().zip(&mut arms) {
            *angles = (stream.either(0.08, 1.2), stream.either(0.08, 0.6));
            *direction = arm(angles.0, angles.1).row(2).transpose();
        }
        let apart = directions[0].dot(&directions[1]).acos().to_degrees();
        if (25.0..110.0).contains(&apart) {
            break apart;
        }
    };
    debug_assert!(apart > 0.0);
    let mut cameras = [0, 1].map(|view| {
        let side = if stream.next() & 1 == 0 { 512 } else { 1024 };
        let size = ImageSize { width: side, height: side };
        let px = f64::from(side);
        let distance = distance * stream.between(0.94, 1.06);
        let focal = px * distance / (field_mm * stream.between(0.93, 1.07));
        let (a, b) = arms[view];
        let (k, r) = if kind == 0 {
            let k = [focal, 0.5 * px, -focal, 0.5 * px];
            (k, arm(a, b))
        } else {
            let middle = |stream: &mut Stream| px * (0.5 + stream.either(0.005, 0.04));
            let k = [focal, middle(&mut stream), focal * 1.01, middle(&mut stream)];
            let roll = stream.either(0.15, 2.9);
            (k, Rotation3::from_axis_angle(&Vector3::z_axis(), roll).matrix() * arm(a, b))
        };
        let k = Matrix3::new(k[0], 0.0, k[1], 0.0, k[2], k[3], 0.0, 0.0, 1.0);
        let t = Vector3::new(0.0, 0.0, distance) - r * target;
        Camera::new(k, r, t, size).unwrap()
    });
    let mut target = Point3::from(target);
    if kind == 2 {
        let (r1, t1) = (*cameras[0].r(), *cameras[0].t());
        let r21 = cameras[1].r() * r1.transpose();
        let t21 = cameras[1].t() - r21 * t1;
        target = Point3::from(r1 * target.coords + t1);
        let moved = |c: &Camera, r, t| Camera::new(*c.k(), r, t, c.size()).unwrap();
        cameras = [
            moved(&cameras[0], Matrix3::identity(), Vector3::zeros()),
            moved(&cameras[1], r21, t21),
        ];
    }
    let noise_px = stream.between(0.05, 0.4);
    let beads = (0..BEADS)
        .map(|_| {
            let away = Vector3::from_fn(|_, _| stream.between(-0.33, 0.33) * field_mm);
            cameras.each_ref().map(|camera| {
                let p = camera.project(&(target + away)).unwrap();
                Point2::new(p.x + noise_px * stream.normal(), p.y + noise_px * stream.normal())
            })
        })
        .collect();
    Scene { cameras, beads, middle: target, reach: 0.33 * field_mm }
}

/// A wire in space, and its curves as traced in two views.
pub struct Wire {
    /// Every point in both views, without errors.
    pub exact: Vec<[Point2; 2]>,
    pub traced: [Vec<Point2>; 2],
}

/// Wires of a sound scene, each traced about 2 px apart with errors of 0.1 to 0.5 px that go on for
/// some 10 px, in either direction, and with up to a tenth missing at each end in each view.
pub fn wires(scene: &Scene, count: usize, seed: u64, index: u64) -> Vec<Wire> {
    let mut stream = Stream::of(seed ^ 0x3173, index);
    let error_px = stream.between(0.1, 0.5);
    (0..count)
        .map(|_| {
            let waves: Vec<(Vector3<f64>, f64)> = (1..=4)
                .map(|k| {
                    let share = scene.reach / f64::from(k);
                    let size = Vector3::from_fn(|_, _| stream.between(-share, share));
                    (size, stream.between(0.0, std::f64::consts::PI))
                })
                .collect();
            let points = 400;
            let exact: Vec<[Point2; 2]> = (0..points)
                .map(|i| {
                    let s = std::f64::consts::PI * i as f64 / points as f64;
                    let away: Vector3<f64> = (1..)
                        .zip(&waves)
                        .map(|(k, (size, phase))| size * (f64::from(k) * s + phase).cos())
                        .sum();
                    scene.cameras.each_ref().map(|c| {
                        let p = c.project(&(scene.middle + away)).unwrap();
                        Point2::new(p.x, p.y)
                    })
                })
                .collect();
            let traced = [0, 1].map(|view| {
                let cut = [0, 1].map(|_| stream.between(0.0, 0.1 * points as f64) as usize);
                let mut error = Vector2::zeros();
                let mut curve: Vec<Point2> = exact[cut[0]..points - cut[1]]
                    .iter()
                    .map(|p| {
                        // 0.8² + 0.6² = 1: the size of the errors stays.
                        let fresh = Vector2::new(stream.normal(), stream.normal());
                        error = 0.8 * error + 0.6 * error_px * fresh;
                        p[view] + error
                    })
                    .collect();
                if view == 1 && stream.next() & 1 == 0 {
                    curve.reverse();
                }
                curve
            });
            Wire { exact, traced }
        })
        .collect()
}

/// The pixels of one view as they are before the lens is removed; `share` is the displacement at the
/// image's corner over the radius.
pub fn through_lens(camera: &Camera, share: f64, point: &Point2) -> Point2 {
    let lens = Distortion { k1: share / corner(camera), ..Distortion::default() };
    camera.clone().with_distortion(lens).unwrap().distort(point).unwrap()
}

/// Every mistake, each with a number of its own for a rig.
pub fn mistakes(seed: u64, index: u64) -> Vec<Mistake> {
    let mut stream = Stream::of(seed ^ 0x5eed, index);
    let unit = [10.0, 0.1, 1000.0, 0.001][(index % 4) as usize];
    let scale = [2.0, 0.5][(index % 2) as usize];
    let half = [0.5, -0.5][(index % 2) as usize];
    let factor = stream.between(1.15, 1.6);
    let factor = if index.is_multiple_of(2) { factor } else { 1.0 / factor };
    // Displacement of 3 to 12 % of the radius at the corner; `through_lens` makes k1 of it.
    let lens = stream.either(0.03, 0.12);
    vec![
        Mistake::ViewsSwapped,
        Mistake::InverseExtrinsics,
        Mistake::TransposedRotation,
        Mistake::CentreAsTranslation,
        Mistake::GraphicsAxes,
        Mistake::WorldAxes,
        Mistake::MirroredColumns,
        Mistake::MirroredRows,
        Mistake::HalfTurn,
        Mistake::RowsAsColumns,
        Mistake::PrimarySign,
        Mistake::SecondarySign,
        Mistake::BothAngleSigns,
        Mistake::AnglesExchanged,
        Mistake::UnitOfView(unit),
        Mistake::ImageScale(scale),
        Mistake::PixelOrigin(half),
        Mistake::Magnification(factor),
        Mistake::LensNotRemoved { share: lens, about: LensCentre::PrincipalPoint },
        Mistake::LensRemovedTwice,
    ]
}

/// The scene as it is handed over with a mistake in it, and the mistake with the right number; `None`
/// where it cannot be made: a camera that is no C-arm has no angles.
pub fn spoiled(scene: &Scene, mistake: Mistake, which: Which) -> Option<(Scene, Mistake)> {
    let in_view = |index: usize| {
        matches!((which, index), (Which::Both, _) | (Which::View1, 0) | (Which::View2, 1))
    };
    let with_lens = |camera: &Camera, share: f64| {
        let lens = Distortion { k1: share / corner(camera), ..Distortion::default() };
        camera.clone().with_distortion(lens).unwrap()
    };
    let mut spoiled = scene.clone();
    match mistake {
        Mistake::LensNotRemoved { share, .. } => {
            for (index, camera) in scene.cameras.iter().enumerate().filter(|(i, _)| in_view(*i)) {
                for bead in &mut spoiled.beads {
                    bead[index] = through_lens(camera, share, &bead[index]);
                }
            }
            Some((spoiled, mistake))
        }
        Mistake::LensRemovedTwice => {
            for (index, camera) in spoiled.cameras.iter_mut().enumerate() {
                if in_view(index) {
                    *camera = with_lens(camera, -0.06);
                }
            }
            Some((spoiled, mistake))
        }
        // The camera that has its centre where `t` belongs.
        Mistake::CentreAsTranslation => {
            for (index, camera) in spoiled.cameras.iter_mut().enumerate() {
                if in_view(index) {
                    let centre = camera.centre().coords;
                    *camera = Camera::new(*camera.k(), *camera.r(), centre, camera.size()).unwrap();
                }
            }
            Some((spoiled, mistake))
        }
        _ => {
            let made = match mistake {
                Mistake::UnitOfView(factor) => Mistake::UnitOfView(1.0 / factor),
                Mistake::ImageScale(factor) => Mistake::ImageScale(1.0 / factor),
                Mistake::Magnification(factor) => Mistake::Magnification(1.0 / factor),
                Mistake::PixelOrigin(shift) => Mistake::PixelOrigin(-shift),
                // Undone and made alike.
                other => other,
            };
            spoiled.cameras = made.mend(which, &scene.cameras)?;
            Some((spoiled, mistake))
        }
    }
}

/// Whether a diagnosis means the mistake that was made: the same, with the same number where it is one
/// of a few, and within 10 % where it was searched for. Of a lens only one coefficient is estimated.
pub fn means(found: &Mistake, made: &Mistake) -> bool {
    match (found, made) {
        (Mistake::UnitOfView(a), Mistake::UnitOfView(b))
        | (Mistake::ImageScale(a), Mistake::ImageScale(b))
        | (Mistake::PixelOrigin(a), Mistake::PixelOrigin(b)) => a == b,
        (Mistake::Magnification(a), Mistake::Magnification(b)) => (a / b).ln().abs() < 0.1,
        _ => found.same_kind(made),
    }
}

fn corner(camera: &Camera) -> f64 {
    let (k, size) = (camera.k(), camera.size());
    let x = 0.5 * f64::from(size.width) / k[(0, 0)];
    let y = 0.5 * f64::from(size.height) / k[(1, 1)];
    x * x + y * y
}
