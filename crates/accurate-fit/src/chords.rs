use accurate_geom::nalgebra::Vector2;

use crate::FitError;
use crate::projector::Projector;
use crate::uniform_spline::{UniformSpline, basis};

/// A projected spline as a polyline of `steps` chords per span.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chords {
    steps: usize,
    pub(crate) points: Vec<Vector2<f64>>,
    /// Length of the polyline up to each point, px; only if measured.
    arc: Vec<f64>,
}

impl Chords {
    /// Projects `spline` anew with `steps` chords per span, reusing memory.
    pub(crate) fn rebuild(
        &mut self,
        spline: &UniformSpline,
        projector: &Projector,
        view: u8,
        steps: usize,
    ) -> Result<(), FitError> {
        self.steps = steps;
        self.points.clear();
        self.points.reserve(spline.spans() * steps + 1);
        let weights: Vec<[f64; 4]> = (0..=steps).map(|k| basis(k as f64 / steps as f64)).collect();
        for span in 0..spline.spans() {
            let last = if span + 1 == spline.spans() { steps + 1 } else { steps };
            for w in &weights[..last] {
                let x = spline.combine(span, *w);
                let depth = projector.depth(&x);
                // Refuses NaN too.
                if !(depth > 0.0) {
                    return Err(FitError::NotInFront { view, depth });
                }
                self.points.push(projector.project(&x));
            }
        }
        Ok(())
    }

    /// Parameter of the `k`-th point.
    #[inline]
    pub(crate) fn parameter(&self, k: usize) -> f64 {
        k as f64 / self.steps as f64
    }

    /// Length of the polyline, px.
    pub(crate) fn length_px(&self) -> f64 {
        self.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
    }

    /// Measures arc lengths, for [`Chords::follow`].
    pub(crate) fn measure(&mut self) {
        self.arc.clear();
        let mut total = 0.0;
        self.arc.push(total);
        for pair in self.points.windows(2) {
            total += (pair[1] - pair[0]).norm();
            self.arc.push(total);
        }
    }

    /// Length of the polyline up to the parameter `u`, px.
    pub(crate) fn arc_at(&self, u: f64) -> f64 {
        let place = u * self.steps as f64;
        let k = (place as usize).min(self.points.len() - 2);
        self.arc[k] + (self.arc[k + 1] - self.arc[k]) * (place - k as f64)
    }

    /// Parameter of the point of the stretch `[from, to]` of parameters that is nearest to `q`, where
    /// being off the expected arc length `expected_px` counts as `along` times being off sideways.
    ///
    /// The expectation decides where the nearest point does not: at a cusp of the projected curve,
    /// and where it crosses or touches itself within the stretch.
    pub(crate) fn follow(
        &self,
        q: &Vector2<f64>,
        from: f64,
        to: f64,
        expected_px: f64,
        along: f64,
    ) -> f64 {
        let steps = self.steps as f64;
        let last = self.points.len() - 2;
        let first_chord = ((from * steps) as usize).min(last);
        let last_chord = ((to * steps) as usize).min(last);
        let (mut best, mut u) = (f64::INFINITY, from);
        for k in first_chord..=last_chord {
            let (a, b) = (self.points[k], self.points[k + 1]);
            let e = b - a;
            let d = q - a;
            let t = (d.dot(&e) / e.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            let early = self.arc[k] + (self.arc[k + 1] - self.arc[k]) * t - expected_px;
            let squared = (d - e * t).norm_squared() + (along * early).powi(2);
            if squared < best {
                (best, u) = (squared, (k as f64 + t) / steps);
            }
        }
        u.clamp(from, to)
    }
}
