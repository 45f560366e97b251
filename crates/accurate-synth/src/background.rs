//! What lies behind a wire: no patient, but the same kinds of edges, bands, tubes and shades, so
//! that a segmenter cannot live on contrast alone.

use std::f64::consts::TAU;

use accurate_geom::ImageSize;
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Pixels per cell of the grid that the anatomy is drawn on: its finest edges are this soft.
const CELL_PX: usize = 2;

/// Optical depth of soft tissue, spine, ribs and vessels, on a coarse grid.
pub(crate) struct Background {
    grid: Array2<f64>,
}

impl Background {
    pub fn draw(rng: &mut ChaCha8Rng, size: ImageSize) -> Self {
        let rows = size.height as usize / CELL_PX + 2;
        let columns = size.width as usize / CELL_PX + 2;
        // Lengths are in units of the image's width: a tall image shows more of the same patient.
        let scale = CELL_PX as f64 / f64::from(size.width);
        let tall = rows as f64 * scale;
        let tissue = Tissue::draw(rng, tall);
        let spine = Spine::draw(rng);
        let ribs = Ribs::draw(rng, spine.x);
        let mut grid = Array2::from_shape_fn((rows, columns), |(row, column)| {
            let (x, y) = (column as f64 * scale, row as f64 * scale);
            tissue.depth(x, y) + spine.depth(x, y) + ribs.depth(x, y)
        });
        for _ in 0..rng.random_range(5..=9) {
            add_vessel(rng, &mut grid, scale, tall);
        }
        Self { grid }
    }

    /// The grid itself, two pixels a cell.
    pub fn into_grid(self) -> Array2<f64> {
        self.grid
    }

    /// Bilinear, at full resolution; shape (height, width).
    pub fn upsampled(&self, size: ImageSize) -> Array2<f64> {
        let cell = CELL_PX as f64;
        Array2::from_shape_fn((size.height as usize, size.width as usize), |(row, column)| {
            bilinear(&self.grid, column as f64 / cell, row as f64 / cell)
        })
    }
}

/// Value of a grid (2 x 2 or larger) between its nodes; past its last nodes it goes on linearly.
pub(crate) fn bilinear(grid: &Array2<f64>, x: f64, y: f64) -> f64 {
    let column = (x as usize).min(grid.ncols() - 2);
    let row = (y as usize).min(grid.nrows() - 2);
    let (u, v) = (x - column as f64, y - row as f64);
    let top = grid[[row, column]] * (1.0 - u) + grid[[row, column + 1]] * u;
    let bottom = grid[[row + 1, column]] * (1.0 - u) + grid[[row + 1, column + 1]] * u;
    top * (1.0 - v) + bottom * v
}

/// 0 far below, 1 far above, soft over `width` about 0.
fn step(x: f64, width: f64) -> f64 {
    1.0 / (1.0 + (-x / width).exp())
}

/// Uneven soft tissue with the edge of a lung and a diaphragm.
struct Tissue {
    tilt: (f64, f64),
    /// Value noise, coarse to fine: nodes per unit and values (uniform in ±amplitude).
    octaves: Vec<(f64, Array2<f64>)>,
    diaphragm: (f64, f64, f64),
    lung: (f64, f64, f64),
}

impl Tissue {
    fn draw(rng: &mut ChaCha8Rng, tall: f64) -> Self {
        let tilt = (rng.random_range(-0.35..0.35), rng.random_range(-0.2..0.2));
        let octaves = [(3.0, 0.22), (7.0, 0.12), (16.0, 0.06), (40.0, 0.03)]
            .into_iter()
            .map(|(nodes, amplitude)| {
                let shape = ((tall * nodes) as usize + 3, nodes as usize + 3);
                let values =
                    Array2::from_shape_simple_fn(shape, || rng.random_range(-amplitude..amplitude));
                (nodes, values)
            })
            .collect();
        let diaphragm = (
            rng.random_range(0.65..1.15) * tall.max(1.0),
            rng.random_range(0.2..0.8),
            rng.random_range(0.3..0.6),
        );
        let lung =
            (rng.random_range(0.0..1.0), rng.random_range(0.1..0.3), rng.random_range(0.15..0.35));
        Self { tilt, octaves, diaphragm, lung }
    }

    fn depth(&self, x: f64, y: f64) -> f64 {
        let mut depth = 0.25 + self.tilt.0 * (x - 0.5) + self.tilt.1 * (y - 0.5);
        for (nodes, values) in &self.octaves {
            // Smoothed coordinates hide the lattice of the value noise.
            let smooth = |c: f64| {
                let whole = (c * nodes).floor();
                let part = c * nodes - whole;
                whole + part * part * (3.0 - 2.0 * part)
            };
            depth += bilinear(values, smooth(x), smooth(y));
        }
        let (dome, middle, strength) = self.diaphragm;
        depth += strength * step(y - dome - 0.8 * (x - middle).powi(2), 0.012);
        let (edge, bulge, strength) = self.lung;
        depth += strength * step(x - edge - bulge * (2.5 * y + 0.4).sin() * 0.3, 0.02);
        depth.max(0.0)
    }
}

/// A column of vertebrae with brighter discs between them, pedicles and spinous processes.
struct Spine {
    x: f64,
    lean: f64,
    half_width: f64,
    pitch: f64,
    phase: f64,
    strength: f64,
}

impl Spine {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            x: rng.random_range(0.15..0.85),
            lean: rng.random_range(-0.08..0.08),
            half_width: rng.random_range(0.07..0.1),
            pitch: rng.random_range(0.15..0.2),
            phase: rng.random_range(0.0..1.0),
            strength: rng.random_range(0.35..0.6),
        }
    }

    fn depth(&self, x: f64, y: f64) -> f64 {
        let across = (x - self.x - self.lean * (y - 0.5)) / self.half_width;
        if across.abs() > 2.0 {
            return 0.0;
        }
        let along = (y / self.pitch + self.phase).rem_euclid(1.0) - 0.5;
        // Bodies are waisted: wider at their end plates, which are denser too.
        let half = 0.92 + 0.3 * along * along;
        let sides = step(half - across.abs(), 0.06);
        let body = step(0.42 - along.abs(), 0.02);
        let end_plate = (-((along.abs() - 0.39) / 0.04).powi(2)).exp();
        let spot = |dx: f64, dy: f64, rx: f64, ry: f64| {
            let (u, v) = ((across.abs() - dx) / rx, (along - dy) / ry);
            (-(u * u + v * v)).exp()
        };
        let pedicles = spot(0.55, -0.12, 0.16, 0.13) - 0.5 * spot(0.55, -0.12, 0.08, 0.07);
        let process = spot(0.0, 0.15, 0.12, 0.2);
        let bone = sides * (0.35 + 0.5 * body + 0.25 * end_plate) + 0.3 * pedicles + 0.3 * process;
        self.strength * bone
    }
}

/// Curved bands on both sides of the spine, dense at their rims as hollow bones are.
struct Ribs {
    x: f64,
    pitch: f64,
    phase: f64,
    slope: f64,
    bend: f64,
    half_width: f64,
    strength: f64,
}

impl Ribs {
    fn draw(rng: &mut ChaCha8Rng, spine_x: f64) -> Self {
        Self {
            x: spine_x,
            pitch: rng.random_range(0.2..0.27),
            phase: rng.random_range(0.0..1.0),
            slope: rng.random_range(0.1..0.45),
            bend: rng.random_range(0.2..0.7),
            half_width: rng.random_range(0.022..0.034),
            strength: rng.random_range(0.1..0.2),
        }
    }

    fn depth(&self, x: f64, y: f64) -> f64 {
        let out = (x - self.x).abs();
        let centre = self.slope * out - self.bend * out * out;
        let from = ((y - centre) / self.pitch + self.phase).rem_euclid(1.0) - 0.5;
        let tilt = (self.slope - 2.0 * self.bend * out).hypot(1.0);
        let q = from * self.pitch / (self.half_width * tilt);
        let chord = |half: f64| (half * half - q * q).max(0.0).sqrt();
        // A shell: the outer solid less most of the marrow; they fade where the spine begins.
        self.strength * (1.6 * chord(1.0) - 1.1 * chord(0.8)) * step(out - 0.08, 0.01)
    }
}

/// A faint tube along a random curve, as a vessel or a catheter's shadow: what a wire is mistaken
/// for.
fn add_vessel(rng: &mut ChaCha8Rng, grid: &mut Array2<f64>, scale: f64, tall: f64) {
    let (mut x, mut y) = (rng.random_range(0.0..1.0), rng.random_range(0.0..tall));
    let mut heading = rng.random_range(0.0..TAU);
    let mut turning = rng.random_range(-3.0..3.0);
    let mut radius = rng.random_range(0.004..0.016);
    let strength = rng.random_range(0.05..0.16);
    let length = rng.random_range(0.3..1.0);
    let ds = 0.5 * scale;
    // A tube is the largest, not the sum, of its discs.
    let mut tube = Array2::<f64>::zeros(grid.dim());
    for _ in 0..(length / ds) as usize {
        heading += turning * ds;
        turning += rng.random_range(-1.0..1.0) * 40.0 * ds;
        x += heading.cos() * ds;
        y += heading.sin() * ds;
        radius = (radius * (1.0 - 0.4 * ds)).max(0.003);
        let reach = (radius / scale).ceil() as isize + 1;
        let (column, row) = ((x / scale).floor() as isize, (y / scale).floor() as isize);
        for r in row - reach..=row + reach {
            for c in column - reach..=column + reach {
                let Ok(index) = usize::try_from(r).and_then(|r| Ok([r, usize::try_from(c)?]))
                else {
                    continue;
                };
                if let Some(value) = tube.get_mut(index) {
                    let d = (c as f64 * scale - x).hypot(r as f64 * scale - y) / radius;
                    *value = value.max((1.0 - d * d).max(0.0).sqrt());
                }
            }
        }
    }
    grid.zip_mut_with(&tube, |depth, tube| *depth += strength * tube);
}

/// Blades that darken the border, never the wire.
pub(crate) struct Collimator {
    /// Left, top, right, bottom edges, px.
    edges: [f64; 4],
}

impl Collimator {
    /// `free_px` is how far from the border the blades may reach.
    pub fn draw(rng: &mut ChaCha8Rng, size: ImageSize, free_px: f64) -> Self {
        // The numbers are drawn whatever the room, so that later draws do not depend on it.
        let [left, top, right, bottom]: [f64; 4] =
            std::array::from_fn(|_| rng.random_range(-0.02..0.05) * f64::from(size.width));
        let inset = |px: f64| px.min(free_px).max(-20.0);
        Self {
            edges: [
                inset(left),
                inset(top),
                f64::from(size.width) - 1.0 - inset(right),
                f64::from(size.height) - 1.0 - inset(bottom),
            ],
        }
    }

    /// Optical depth at a pixel.
    pub fn depth(&self, x: f64, y: f64) -> f64 {
        let [left, top, right, bottom] = self.edges;
        let inside = (x - left).min(y - top).min(right - x).min(bottom - y);
        // Softer than the blur: blades are nearer to the tube than the patient is.
        if inside > 12.0 { 0.0 } else { 2.2 * step(-inside, 1.2) }
    }
}
