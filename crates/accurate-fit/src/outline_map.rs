use ndarray::{Array2, ArrayView2};

/// What a probability map says about an outline besides where it runs.
#[derive(Debug, Clone)]
pub(crate) struct OutlineMap {
    probability: Array2<f32>,
    /// Least probability in the mask: where the map is cut.
    level: f32,
    /// Variance of each boundary point along its normal, px².
    pub(crate) variance: Vec<f64>,
    /// How sure it is, for each boundary point, that there is body behind it; 0 to 1.
    pub(crate) trust: Vec<f64>,
}

/// Logits beyond this are not told apart: float16 weights and rare pixels say no more.
const MOST_LOGIT: f32 = 6.0;
/// The level is at most this, where a calibrated map has the body's edge ...
const MOST_LEVEL: f32 = 0.5;
/// ... and at least this, whatever a mask that was edited by hand has.
const LEAST_LEVEL: f32 = 0.05;
/// Part of the blur of an edge that is error. Maps are calibrated pixel by pixel: the blur holds what
/// differs from image to image at a place, which is mostly common to both sides of the body and to
/// neighbours along it.
const BLUR_THAT_ERRS: f64 = 0.5;
/// Error of an edge that is not blurred at all, px: that of digitisation, 1 / sqrt(18), for all that
/// is known of it is between which pixels it lies.
const LEAST_SIGMA_PX: f64 = 0.235_702_260_395_515_84;
/// Error of an edge without a slope, px.
const MOST_SIGMA_PX: f64 = 1.5;
/// A normal distribution's logit grows by this per standard deviation at its middle: 4 / sqrt(2 pi).
const LOGIT_PER_SIGMA: f64 = 1.595_769_121_605_731;
/// How far into the body the map is looked up for its trust, px.
const BEHIND_PX: usize = 3;

impl OutlineMap {
    /// `probability` from 0 to 1, of the shape of the mask.
    pub(crate) fn new(probability: ArrayView2<'_, f32>, mask: ArrayView2<'_, bool>) -> Self {
        let least = probability
            .iter()
            .zip(&mask)
            .filter_map(|(p, set)| set.then_some(*p))
            .fold(MOST_LEVEL, f32::min);
        Self {
            probability: probability.to_owned(),
            level: least.clamp(LEAST_LEVEL, MOST_LEVEL),
            variance: Vec::new(),
            trust: Vec::new(),
        }
    }

    /// Logit of the level that the outline follows.
    pub(crate) fn level_logit(&self) -> f32 {
        logit(self.level)
    }

    /// The map as logits, in which the edge of a blurred body is a ramp.
    pub(crate) fn logits(&self) -> Array2<f32> {
        self.probability.mapv(logit)
    }

    /// Notes what the map says about `[x, y, inward x, inward y]` points.
    pub(crate) fn describe(&mut self, points: &[[f64; 4]]) {
        self.variance = points.iter().map(|p| self.variance_at(p)).collect();
        self.trust = points.iter().map(|p| self.trust_at(p)).collect();
    }

    /// From the slope of the logit across the edge, over 1.5 px.
    fn variance_at(&self, &[x, y, nx, ny]: &[f64; 4]) -> f64 {
        const HALF_PX: f64 = 0.75;
        let at = |s: f64| self.between(x + s * nx, y + s * ny, logit);
        let slope = (at(HALF_PX) - at(-HALF_PX)) / (2.0 * HALF_PX);
        let blur_px = LOGIT_PER_SIGMA / slope.max(f64::MIN_POSITIVE);
        (BLUR_THAT_ERRS * blur_px).clamp(LEAST_SIGMA_PX, MOST_SIGMA_PX).powi(2)
    }

    /// How far the map rises above the level behind the edge.
    fn trust_at(&self, &[x, y, nx, ny]: &[f64; 4]) -> f64 {
        let level = f64::from(self.level);
        let most = (0..=2 * BEHIND_PX)
            .map(|k| 0.5 * k as f64)
            .map(|s| self.between(x + s * nx, y + s * ny, |p| p))
            .fold(0.0, f64::max);
        ((most - level) / (1.0 - level)).clamp(0.0, 1.0)
    }

    /// How sure the map is that there is no body around a position; 0 to 1.
    pub(crate) fn doubt(&self, x: f64, y: f64) -> f64 {
        let most = (-1..=1)
            .flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)))
            .map(|(dx, dy)| self.between(x + f64::from(dx), y + f64::from(dy), |p| p))
            .fold(0.0, f64::max);
        (1.0 - most / f64::from(self.level)).clamp(0.0, 1.0)
    }

    /// Of the values of four pixels, bilinear; beyond the border the map goes on as at the border.
    fn between(&self, x: f64, y: f64, value_of: impl Fn(f32) -> f32) -> f64 {
        let (rows, columns) = self.probability.dim();
        let (x, y) = (x.clamp(0.0, (columns - 1) as f64), y.clamp(0.0, (rows - 1) as f64));
        let (c, r) = (x as usize, y as usize);
        let (c1, r1) = ((c + 1).min(columns - 1), (r + 1).min(rows - 1));
        let (fx, fy) = (x - c as f64, y - r as f64);
        let value = |r: usize, c: usize| f64::from(value_of(self.probability[[r, c]]));
        (1.0 - fy) * ((1.0 - fx) * value(r, c) + fx * value(r, c1))
            + fy * ((1.0 - fx) * value(r1, c) + fx * value(r1, c1))
    }
}

/// Of a probability, or of what rounding made of one.
fn logit(p: f32) -> f32 {
    let p = p.clamp(0.0, 1.0);
    (p / (1.0 - p)).ln().clamp(-MOST_LOGIT, MOST_LOGIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An edge at column `edge` blurred by `sigma` px: the logistic curve with the slope of a normal
    /// distribution.
    fn edge(edge: f64, sigma: f64) -> (Array2<f32>, Array2<bool>) {
        let map = Array2::from_shape_fn((5, 30), |(_, x)| {
            (1.0 / (1.0 + (-(x as f64 - edge) * LOGIT_PER_SIGMA / sigma).exp())) as f32
        });
        let mask = map.mapv(|p| p > 0.5);
        (map, mask)
    }

    #[test]
    fn the_variance_is_that_of_the_blur() {
        for sigma in [0.6, 1.0, 2.0] {
            let (map, mask) = edge(14.3, sigma);
            let mut found = OutlineMap::new(map.view(), mask.view());
            found.describe(&[[14.3, 2.0, 1.0, 0.0]]);
            // A ramp in the logit: exact up to the rounding of probabilities, 6e-8, which a logit of
            // 5 magnifies by 150.
            let expected = (BLUR_THAT_ERRS * sigma).powi(2);
            assert!((found.variance[0] / expected - 1.0).abs() < 1e-4, "{sigma} {found:?}");
        }
    }

    #[test]
    fn a_flat_map_is_worth_little_and_finite() {
        let map = Array2::from_elem((4, 6), 0.7_f32);
        let mask = Array2::from_elem((4, 6), true);
        let mut found = OutlineMap::new(map.view(), mask.view());
        found.describe(&[[2.0, 2.0, 1.0, 0.0]]);
        assert_eq!(found.variance, [MOST_SIGMA_PX * MOST_SIGMA_PX]);
        assert!((found.trust[0] - 0.4).abs() < 1e-6);
    }

    #[test]
    fn doubt_falls_from_one_to_nothing_as_the_map_rises_to_its_level() {
        let map = Array2::from_shape_fn((3, 101), |(_, x)| x as f32 / 100.0);
        let mask = map.mapv(|p| p > 0.4);
        let found = OutlineMap::new(map.view(), mask.view());
        assert_eq!(found.doubt(-5.0, 1.0), 1.0);
        assert!((found.doubt(19.0, 1.0) - (1.0 - 0.2 / f64::from(found.level))).abs() < 1e-6);
        assert_eq!(found.doubt(60.0, 1.0), 0.0);
        assert!(found.level >= 0.4 && found.level < 0.42);
    }
}
