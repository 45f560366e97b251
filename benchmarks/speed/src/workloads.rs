use accurate_geom::{Pixel, Point3, Rig, View1, View2};
use accurate_seg::Mask;
use accurate_synth::{CaseOptions, Family, SynthCase, generate};
use ndarray::Array2;

/// A self-crossing wire seen by two cameras; a tuning seed.
#[derive(Debug)]
pub struct Wire {
    case: SynthCase,
}

/// The images of a wire in both views.
pub type Images = (Vec<Pixel<View1>>, Vec<Pixel<View2>>);

impl Wire {
    /// The case all measurements share.
    ///
    /// # Errors
    /// Those of the generator.
    pub fn new() -> Result<Self, accurate_synth::SynthError> {
        let mut case = generate(Family::Medium, 1000, 0, &CaseOptions::default())?;
        // Images are to be exact: the nominal rig is off by the calibration error.
        case.rig.clone_from(&case.true_rig);
        Ok(Self { case })
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.case.rig
    }

    /// `n >= 2` points at equal steps of arc length.
    pub fn points(&self, n: usize) -> Vec<Point3> {
        let length = self.case.length();
        let last = self.case.truth[self.case.truth.len() - 1];
        (0..n)
            .map(|k| self.case.truth_at(length * k as f64 / (n - 1) as f64).unwrap_or(last))
            .collect()
    }

    /// Their images, exact but for the rounding; with `grid` in whole pixels, like a skeleton.
    ///
    /// # Errors
    /// A point behind a camera.
    pub fn curves(&self, n: usize, grid: bool) -> Result<Images, accurate_geom::GeomError> {
        let (mut one, mut two) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let round = |v: f64| if grid { v.round() } else { v };
        for point in self.points(n) {
            let (p1, p2) = self.rig().project(&point)?;
            one.push(Pixel::new(round(p1.x), round(p1.y)));
            two.push(Pixel::new(round(p2.x), round(p2.y)));
        }
        Ok((one, two))
    }
}

/// A sine of `side` px, 6 px thick, whose ends are in sight.
///
/// # Errors
/// `side` is 0.
pub fn wire_mask(side: usize) -> Result<Mask, accurate_seg::SegError> {
    let s = side as f64;
    let image = Array2::from_shape_fn((side, side), |(row, col)| {
        let phase = col as f64 * 12.0 / s;
        let centre = s / 2.0 + 0.35 * s * phase.sin();
        let slope = 0.35 * 12.0 * phase.cos();
        let inside = 8 <= col && col + 8 < side;
        inside && (row as f64 - centre).abs() / slope.hypot(1.0) < 3.0
    });
    Mask::from_array(image)
}
