use std::marker::PhantomData;

use accurate_geom::{ImageSize, Pixel, View};
use ndarray::{Array2, ArrayView2};

use crate::FitError;
use crate::bucket_grid::BucketGrid;
use crate::distance_map::DistanceMap;
use crate::nearest::PointLanes;
use crate::outline_map::OutlineMap;

/// How far around the mask a curve that left it still learns where the mask is, px.
const MARGIN_PX: usize = 32;

/// By how much rounding may carry a probability beyond 0 or 1.
const PROBABILITY_ROUNDING: f32 = 1e-5;

/// Pixels of a row that are looked at together whether any is set: most of an image is empty.
const STRETCH: usize = 64;

/// The outline of a thin body in view `V`: points between body and background, each with the
/// direction into the body.
#[derive(Debug, Clone)]
pub struct Outline<V> {
    pub(crate) data: OutlineData,
    view: PhantomData<V>,
}

/// One point of an [`Outline`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundaryPoint<V: View> {
    /// Where body and background meet, px.
    pub position: Pixel<V>,
    /// Unit direction into the body, `[x, y]`.
    pub inward: [f64; 2],
}

/// An outline that has forgotten its view: what the fit works on.
#[derive(Debug, Clone)]
pub(crate) struct OutlineData {
    /// `[x, y, inward x, inward y]`, in the order of the bucket grid.
    pub(crate) points: Vec<[f64; 4]>,
    pub(crate) lanes: PointLanes,
    pub(crate) grid: BucketGrid,
    pub(crate) outside: DistanceMap,
    pub(crate) size: ImageSize,
    pub(crate) half_thickness_px: f64,
    /// Whether the points are midpoints of pixel pairs.
    pub(crate) digitised: bool,
    /// The probability map that the outline was read off, if it was.
    pub(crate) map: Option<OutlineMap>,
}

impl<V: View> Outline<V> {
    /// From a binary mask (`height x width`, row = y): every pair of 4-neighbours of which one is
    /// inside gives their midpoint. A body cut by the image border has no outline there.
    ///
    /// # Errors
    /// [`FitError::EmptyOutline`] if no pixel, or every pixel, is set.
    ///
    /// # Cost
    /// O(pixels of the image) time; memory for the mask's bounding box.
    pub fn from_mask(mask: ArrayView2<'_, bool>) -> Result<Self, FitError> {
        Self::build(&mask, true, |[x, y], [inner_x, inner_y]| {
            let (dx, dy) = (inner_x as f64 - x as f64, inner_y as f64 - y as f64);
            [x as f64 + 0.5 * dx, y as f64 + 0.5 * dy, dx, dy]
        })
    }

    /// From an image of probabilities or grey levels (`height x width`, row = y) that is at least
    /// `level` in the body: the sub-pixel crossings of `level` between 4-neighbours, by linear
    /// interpolation, and the gradient there as inward direction.
    ///
    /// # Errors
    /// [`FitError::NotFinite`] for a pixel (index in row-major order) or the level;
    /// [`FitError::EmptyOutline`] if no pixel, or every pixel, reaches the level.
    ///
    /// # Cost
    /// As [`Outline::from_mask`].
    pub fn from_level_set(image: ArrayView2<'_, f32>, level: f32) -> Result<Self, FitError> {
        if !level.is_finite() {
            return Err(FitError::NotFinite { what: "level", index: 0 });
        }
        if let Some(index) = image.iter().position(|v| !v.is_finite()) {
            return Err(FitError::NotFinite { what: "pixel", index });
        }
        let mask: Array2<bool> = image.mapv(|v| v >= level);
        Self::build(&mask.view(), false, crossing(&image, level))
    }

    /// From a probability map (`height x width`, row = y) and the mask that was made of it: around
    /// the mask, sub-pixel, where the map crosses the least probability that the mask holds, or 0.05 or
    /// 0.5 if that is lower or higher. Where the mask ends though the map goes on, the point lies between
    /// the two pixels.
    ///
    /// Crossings are interpolated in the logit: the edge of a body that is known up to a normal error
    /// is a ramp there. The slope of the ramp gives each point's variance; how far the map rises
    /// behind it, how much an unexplained point counts; and a curve that leaves the mask is blamed
    /// the less, the higher the map still is.
    ///
    /// # Errors
    /// [`FitError::NotFinite`] for a pixel (index in row-major order), [`FitError::NotAProbability`] for one
    /// that is not in 0 to 1 (beyond 1e-5 for rounding), [`FitError::ShapeMismatch`],
    /// [`FitError::EmptyOutline`] if no pixel, or every pixel, of the mask is set.
    ///
    /// # Cost
    /// As [`Outline::from_mask`], and three images in memory.
    pub fn from_probability(
        probability: ArrayView2<'_, f32>,
        mask: ArrayView2<'_, bool>,
    ) -> Result<Self, FitError> {
        if probability.dim() != mask.dim() {
            let (expected, found) = (mask.dim(), probability.dim());
            return Err(FitError::ShapeMismatch { view: V::NUMBER, expected, found });
        }
        for (index, value) in probability.iter().copied().enumerate() {
            if !value.is_finite() {
                return Err(FitError::NotFinite { what: "probability", index });
            }
            if !(-PROBABILITY_ROUNDING..=1.0 + PROBABILITY_ROUNDING).contains(&value) {
                return Err(FitError::NotAProbability { view: V::NUMBER, index, value });
            }
        }
        let mut map = OutlineMap::new(probability, mask);
        let logits = map.logits();
        let mut outline = Self::build(&mask, false, crossing(&logits.view(), map.level_logit()))?;
        map.describe(&outline.data.points);
        outline.data.map = Some(map);
        Ok(outline)
    }

    fn build(
        mask: &ArrayView2<'_, bool>,
        digitised: bool,
        point_between: impl Fn([usize; 2], [usize; 2]) -> [f64; 4],
    ) -> Result<Self, FitError> {
        let (rows, columns) = mask.dim();
        let standard = mask.as_standard_layout();
        let pixels = standard.as_slice().unwrap_or_default();
        let row = |y: usize| &pixels[y * columns..(y + 1) * columns];
        let mut points = Vec::new();
        let mut area = 0usize;
        let mut bounds = [usize::MAX, usize::MAX, 0, 0];
        for y in 0..rows {
            let here = row(y);
            let below = if y + 1 < rows { row(y + 1) } else { here };
            for first in (0..columns).step_by(STRETCH) {
                let end = (first + STRETCH).min(columns);
                let beyond = (end + 1).min(columns);
                if !any(&here[first..beyond]) && !any(&below[first..end]) {
                    continue;
                }
                for x in first..end {
                    let inside = here[x];
                    if inside {
                        area += 1;
                        let [x0, y0, x1, y1] = bounds;
                        bounds = [x0.min(x), y0.min(y), x1.max(x), y1.max(y)];
                    }
                    let mut pair = |nx: usize, ny: usize, other: bool| {
                        if other != inside {
                            let (at, next) = ([x, y], [nx, ny]);
                            let (outer, inner) = if inside { (next, at) } else { (at, next) };
                            points.push(point_between(outer, inner));
                        }
                    };
                    if x + 1 < columns {
                        pair(x + 1, y, here[x + 1]);
                    }
                    pair(x, y + 1, below[x]);
                }
            }
        }
        if points.is_empty() {
            return Err(FitError::EmptyOutline { view: V::NUMBER, foreground: area });
        }
        // A line of any direction meets (|n_x| + |n_y|) pixel pairs per px: 4/pi on average. A strip
        // of half thickness h with round caps has area h P - pi h² for an outline of length P.
        let perimeter = points.len() as f64 * std::f64::consts::FRAC_PI_4;
        let root = (perimeter * perimeter - 4.0 * std::f64::consts::PI * area as f64).max(0.0);
        let half_thickness_px = (perimeter - root.sqrt()) / std::f64::consts::TAU;
        let outside = DistanceMap::new(mask, bounds, MARGIN_PX);
        let (grid, points) = BucketGrid::sort(points);
        let size = ImageSize { width: columns as u32, height: rows as u32 };
        let data = OutlineData {
            lanes: PointLanes::new(&points),
            points,
            grid,
            outside,
            size,
            half_thickness_px,
            digitised,
            map: None,
        };
        Ok(Self { data, view: PhantomData })
    }

    /// Number of boundary points, at least 1.
    #[allow(clippy::len_without_is_empty, reason = "an outline is never empty")]
    pub fn len(&self) -> usize {
        self.data.points.len()
    }

    /// The boundary points, in a fixed order.
    pub fn points(&self) -> impl ExactSizeIterator<Item = BoundaryPoint<V>> + '_ {
        self.data
            .points
            .iter()
            .map(|&[x, y, nx, ny]| BoundaryPoint { position: Pixel::new(x, y), inward: [nx, ny] })
    }

    /// Half thickness of the body, px, from area and outline alone: a first guess.
    pub fn half_thickness_px(&self) -> f64 {
        self.data.half_thickness_px
    }

    /// Size of the image the outline came from.
    pub fn size(&self) -> ImageSize {
        self.data.size
    }
}

/// Whether a pixel is set, without a branch for each.
fn any(pixels: &[bool]) -> bool {
    pixels.iter().fold(false, |any, &set| any | set)
}

/// The point between two pixels, `[x, y]` outside and inside, where `image` crosses `level`, and the
/// gradient there. If it does not cross it, the point is in the middle.
fn crossing<'i>(
    image: &'i ArrayView2<'_, f32>,
    level: f32,
) -> impl Fn([usize; 2], [usize; 2]) -> [f64; 4] + 'i {
    let (rows, columns) = image.dim();
    // One-sided at the image border.
    let gradient = move |x: usize, y: usize| {
        let (left, right) = (x.saturating_sub(1), (x + 1).min(columns - 1));
        let (up, down) = (y.saturating_sub(1), (y + 1).min(rows - 1));
        let across = f64::from(image[[y, right]] - image[[y, left]]);
        let along = f64::from(image[[down, x]] - image[[up, x]]);
        [across / (right - left).max(1) as f64, along / (down - up).max(1) as f64]
    };
    move |[x, y], [inner_x, inner_y]| {
        let (outer, inner) = (image[[y, x]], image[[inner_y, inner_x]]);
        let fraction = if outer <= level && inner >= level && outer < inner {
            f64::from((level - outer) / (inner - outer))
        } else {
            0.5
        };
        let (dx, dy) = (inner_x as f64 - x as f64, inner_y as f64 - y as f64);
        let (g0, g1) = (gradient(x, y), gradient(inner_x, inner_y));
        let g = [
            (1.0 - fraction) * g0[0] + fraction * g1[0],
            (1.0 - fraction) * g0[1] + fraction * g1[1],
        ];
        let norm = g[0].hypot(g[1]);
        // A gradient that points out of the body is noise: the pair itself knows better.
        let [nx, ny] = if norm > 0.0 && g[0] * dx + g[1] * dy > 0.0 {
            [g[0] / norm, g[1] / norm]
        } else {
            [dx, dy]
        };
        [x as f64 + fraction * dx, y as f64 + fraction * dy, nx, ny]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use accurate_geom::View1;

    #[test]
    fn one_pixel_has_four_boundary_points_that_look_inward() {
        let mut mask = Array2::from_elem((5, 7), false);
        mask[[2, 3]] = true;
        let outline = Outline::<View1>::from_mask(mask.view()).unwrap();
        assert_eq!(outline.len(), 4);
        for p in outline.points() {
            assert_eq!(p.position.x + 0.5 * p.inward[0], 3.0);
            assert_eq!(p.position.y + 0.5 * p.inward[1], 2.0);
        }
    }

    #[test]
    fn a_level_set_of_a_ramp_lies_where_the_ramp_crosses_the_level() {
        let image = Array2::from_shape_fn((6, 9), |(_, x)| (9 - x) as f32 * 0.1);
        let outline = Outline::<View1>::from_level_set(image.view(), 0.33).unwrap();
        assert_eq!(outline.len(), 6);
        for p in outline.points() {
            // f32 ramp values of order 1 with slope 0.1: 1e-7 / 0.1.
            assert!((p.position.x - 5.7).abs() < 1e-5, "{p:?}");
            assert!((p.inward[0] + 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_strip_has_about_its_own_half_thickness() {
        // The formula is exact on average over directions and off by |n_x| + |n_y| against 4/pi at
        // one: at 22.5 degrees 1.307 / 1.273 = 3 %.
        let mask = Array2::from_shape_fn((200, 200), |(y, x)| {
            let (s, c) = std::f64::consts::FRAC_PI_8.sin_cos();
            let (dx, dy) = (x as f64 - 100.0, y as f64 - 100.0);
            let along = (dx * c + dy * s).clamp(-70.0, 70.0);
            (dx - along * c).hypot(dy - along * s) < 2.5
        });
        let outline = Outline::<View1>::from_mask(mask.view()).unwrap();
        assert!((outline.half_thickness_px() - 2.5).abs() < 0.05 * 2.5);
    }

    #[test]
    fn masks_without_an_outline_are_refused() {
        for value in [false, true] {
            let mask = Array2::from_elem((3, 4), value);
            let found = Outline::<View1>::from_mask(mask.view());
            let foreground = if value { 12 } else { 0 };
            assert_eq!(found.unwrap_err(), FitError::EmptyOutline { view: 1, foreground });
        }
        let empty = Array2::from_elem((0, 0), true);
        assert!(Outline::<View1>::from_mask(empty.view()).is_err());
        let nan = Array2::from_elem((3, 3), f32::NAN);
        assert!(Outline::<View1>::from_level_set(nan.view(), 0.5).is_err());
    }

    #[test]
    fn a_blurred_strip_is_found_between_the_pixels_and_knows_its_blur() {
        // Edges at columns 10.3 and 15.3, logit 4 per px: 1.6 / 4 = 0.4 px of blur.
        let distance = |x: usize| 2.5 - (x as f64 - 12.8).abs();
        let map = Array2::from_shape_fn((30, 30), |(_, x)| {
            (1.0 / (1.0 + (-4.0 * distance(x)).exp())) as f32
        });
        let mask = map.mapv(|p| p > 0.5);
        let outline = Outline::<View1>::from_probability(map.view(), mask.view()).unwrap();
        assert_eq!(outline.len(), 60);
        for p in outline.points() {
            // A ramp in the logit: exact up to the rounding of probabilities, 6e-8, which a logit of
            // 4 magnifies by 60, over the slope.
            let out = (p.position.x - 12.8).abs() - 2.5;
            assert!(out.abs() < 1e-5, "{p:?}");
            assert!(p.inward[1].abs() < 1e-6);
        }
        let data = outline.data.map.as_ref().unwrap();
        assert!(data.trust.iter().all(|t| *t > 0.99));
        assert!(data.variance.iter().all(|v| (0.02..0.08).contains(v)), "{:?}", data.variance);
    }

    #[test]
    fn another_shape_and_nan_in_a_map_are_refused() {
        let mask = Array2::from_shape_fn((6, 6), |(y, _)| y == 3);
        let other = Array2::zeros((6, 7));
        assert!(matches!(
            Outline::<View1>::from_probability(other.view(), mask.view()),
            Err(FitError::ShapeMismatch { view: 1, expected: (6, 6), found: (6, 7) })
        ));
        let mut map = Array2::zeros((6, 6));
        map[[1, 2]] = f32::NAN;
        assert!(matches!(
            Outline::<View1>::from_probability(map.view(), mask.view()),
            Err(FitError::NotFinite { what: "probability", index: 8 })
        ));
        map[[1, 2]] = 255.0;
        assert!(matches!(
            Outline::<View1>::from_probability(map.view(), mask.view()),
            Err(FitError::NotAProbability { view: 1, index: 8, value: 255.0 })
        ));
    }

    /// An edge between 1 and 0.2 does not jump by a third of a pixel where the 1 is one and a bit.
    #[test]
    fn a_probability_that_rounding_left_above_one_is_one() {
        let mask = Array2::from_shape_fn((6, 6), |(y, _)| y == 3);
        let at = |most: f32| {
            let map = mask.mapv(|set| if set { most } else { 0.2 });
            Outline::<View1>::from_probability(map.view(), mask.view()).unwrap()
        };
        let (one, above) = (at(1.0), at(1.0 + f32::EPSILON));
        for (a, b) in one.points().zip(above.points()) {
            assert_eq!((a.position, a.inward), (b.position, b.inward));
        }
        let variances =
            |outline: &Outline<View1>| outline.data.map.as_ref().unwrap().variance.clone();
        assert_eq!(variances(&one), variances(&above));
    }
}
