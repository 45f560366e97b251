use std::ops::Range;

use accurate_geom::{Fundamental, GeomError, Pixel, View, View1, View2};
use pulp::{Arch, NullaryFnOnce};

use crate::MatchError;
use crate::ray_image::{RayImage, RayImager};

/// How far two pixels are from lying on one epipolar plane, px.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DistanceKind {
    /// In view 1, from `p1` to the epipolar line of `p2`: the paper's `d(n1, n2)`.
    View1,
    /// In view 2, from `p2` to the epipolar line of `p1`.
    View2,
    /// Root mean square of the two.
    Symmetric,
    /// To first order the length of the least correction of both pixels that makes the rays meet;
    /// the maximum likelihood cost for equal noise in both views (Hartley and Zisserman, 2nd ed.,
    /// eq. 11.9).
    Sampson,
}

/// The cost matrix `D` of two curves, never stored: each cell takes O(1) from lines computed once
/// per point.
///
/// A pixel at its epipole (within 1e-9 of the epipole's distance from the pixel origin) has no
/// epipolar line: its ray is the baseline, which every epipolar plane contains. The other view sees
/// that ray as a single point, its own epipole, so the cost of such a cell is the distance of the
/// partner to that epipole, for whichever view the [`DistanceKind`] measures in ([`Sampson`]
/// measures in the partner's view).
///
/// [`Sampson`]: DistanceKind::Sampson
#[derive(Debug, Clone)]
pub struct CostModel {
    kind: DistanceKind,
    curve1: Vec<Pixel<View1>>,
    curve2: Vec<Pixel<View2>>,
    /// Per point of view 2, what view 1 sees of its ray. `None` only where `kind` does not need it.
    images1: Vec<Option<RayImage<View1>>>,
    /// Per point of view 1, what view 2 sees of its ray.
    images2: Vec<Option<RayImage<View2>>>,
    /// `images1` again as columns of coefficients, for sweeps; 0 where there is no line.
    lines1: [Vec<f64>; 3],
    /// Indices of view 2 whose `images1` is no line.
    lineless2: Vec<usize>,
    /// Squared gradient of `p1ᵀ F p2` by `p1`, per point of view 2; by `p2`, per point of view 1.
    gradients1: Vec<f64>,
    gradients2: Vec<f64>,
}

impl CostModel {
    /// The costs of matching `curve1` with `curve2` (undistorted px, any length above 0).
    ///
    /// # Errors
    /// [`MatchError::Empty`] or [`MatchError::NotFinite`] for an unusable curve;
    /// [`MatchError::Geometry`] if a pixel's ray cannot be seen in a view that `kind` measures in
    /// (its epipolar plane is parallel to that image, or the pixel is too far away for a number).
    ///
    /// # Cost
    /// O(n1 + n2) time and memory.
    pub fn new(
        f: &Fundamental<View1, View2>,
        curve1: &[Pixel<View1>],
        curve2: &[Pixel<View2>],
        kind: DistanceKind,
    ) -> Result<Self, MatchError> {
        validate_curve(curve1)?;
        validate_curve(curve2)?;
        let gradients1 = squared_gradients(f, curve2, kind)?;
        let gradients2 = squared_gradients(&f.transpose(), curve1, kind)?;
        let images1 = images(f, curve2, kind != DistanceKind::View2)?;
        let images2 = images(&f.transpose(), curve1, kind != DistanceKind::View1)?;
        let mut lines1 =
            [vec![0.0; curve2.len()], vec![0.0; curve2.len()], vec![0.0; curve2.len()]];
        let mut lineless2 = Vec::new();
        for (j, image) in images1.iter().enumerate() {
            if let Some(RayImage::Line(line)) = image {
                for (column, coefficient) in lines1.iter_mut().zip(line.coefficients().iter()) {
                    column[j] = *coefficient;
                }
            } else {
                lineless2.push(j);
            }
        }
        Ok(Self {
            kind,
            images1,
            images2,
            lines1,
            lineless2,
            gradients1,
            gradients2,
            curve1: curve1.to_vec(),
            curve2: curve2.to_vec(),
        })
    }

    /// Points of view 1: the rows of `D`.
    pub fn n1(&self) -> usize {
        self.curve1.len()
    }

    /// Points of view 2: the columns of `D`.
    pub fn n2(&self) -> usize {
        self.curve2.len()
    }

    /// Which distance this is.
    pub fn kind(&self) -> DistanceKind {
        self.kind
    }

    /// The curve of view 1.
    pub fn curve1(&self) -> &[Pixel<View1>] {
        &self.curve1
    }

    /// The curve of view 2.
    pub fn curve2(&self) -> &[Pixel<View2>] {
        &self.curve2
    }

    /// `D_ij`, px, for `i < n1` and `j < n2`: never NaN, never negative.
    pub fn cost(&self, i: usize, j: usize) -> f64 {
        match self.kind {
            DistanceKind::View1 => self.distance_in_view1(i, j),
            DistanceKind::View2 => self.distance_in_view2(i, j),
            DistanceKind::Symmetric => {
                rms(self.distance_in_view1(i, j), self.distance_in_view2(i, j))
            }
            DistanceKind::Sampson => match (&self.images1[j], &self.images2[i]) {
                (Some(RayImage::Line(line)), Some(RayImage::Line(_))) => {
                    let d1 = line.distance(self.curve1[i]);
                    sampson(d1, self.gradients1[j], self.gradients2[i])
                }
                (Some(RayImage::Point(_)), Some(RayImage::Point(_))) => {
                    rms(self.distance_in_view1(i, j), self.distance_in_view2(i, j))
                }
                (_, Some(RayImage::Point(_))) => self.distance_in_view2(i, j),
                _ => self.distance_in_view1(i, j),
            },
        }
    }

    /// `D_ij` with the side of the line on which the point of view 1 lies; where there is no line, without
    /// a side.
    pub(crate) fn signed_cost(&self, i: usize, j: usize) -> f64 {
        let cost = self.cost(i, j);
        match self.signed_distance_in_view1(i, j) {
            Some(side) => cost.copysign(side),
            None => cost,
        }
    }

    /// Writes row `i` of `D`: the same numbers as [`cost`](Self::cost), bit by bit, in one sweep.
    /// `row` has `n2` elements.
    pub fn fill_row(&self, i: usize, row: &mut [f64]) {
        self.fill_part(i, 0..row.len().min(self.n2()), row);
    }

    /// Writes some columns of row `i` of `D`; `part` has as many elements.
    pub fn fill_part(&self, i: usize, columns: Range<usize>, part: &mut [f64]) {
        // No operation is fused: the same numbers on every machine.
        Arch::new().dispatch(Sweep { costs: self, i, columns, part });
    }

    #[inline(always)]
    fn sweep(&self, i: usize, columns: Range<usize>, part: &mut [f64]) {
        let p1 = self.curve1[i];
        let [a, b, c] = self.lines1.each_ref().map(|column| &column[columns.clone()]);
        let curve2 = &self.curve2[columns.clone()];
        let distances1 =
            || a.iter().zip(b).zip(c).map(|((a, b), c)| (a * p1.x + b * p1.y + c).abs());
        match (self.kind, &self.images2[i]) {
            (DistanceKind::View1, _) => {
                part.iter_mut().zip(distances1()).for_each(|(cell, d1)| *cell = d1);
            }
            (DistanceKind::View2, Some(RayImage::Line(line))) => {
                part.iter_mut().zip(curve2).for_each(|(cell, p2)| *cell = line.distance(*p2));
                return; // the line of view 2 suffices
            }
            (DistanceKind::Symmetric, Some(RayImage::Line(line))) => {
                for ((cell, d1), p2) in part.iter_mut().zip(distances1()).zip(curve2) {
                    *cell = rms(d1, line.distance(*p2));
                }
            }
            (DistanceKind::Sampson, Some(RayImage::Line(_))) => {
                let gradient2 = self.gradients2[i];
                let gradients1 = &self.gradients1[columns.clone()];
                for ((cell, d1), gradient1) in part.iter_mut().zip(distances1()).zip(gradients1) {
                    *cell = sampson(d1, *gradient1, gradient2);
                }
            }
            _ => {
                part.iter_mut().zip(columns).for_each(|(cell, j)| *cell = self.cost(i, j));
                return;
            }
        }
        for &j in &self.lineless2 {
            if columns.contains(&j) {
                part[j - columns.start] = self.cost(i, j);
            }
        }
    }

    /// Distance in view 1, px, of point `i` to the epipolar line of point `j`, whatever the
    /// [`kind`](Self::kind); infinite if the ray of point `j` cannot be seen there.
    pub fn distance_in_view1(&self, i: usize, j: usize) -> f64 {
        self.images1[j].map_or(f64::INFINITY, |image| image.distance(self.curve1[i]))
    }

    /// Distance in view 2, px, of point `j` to the epipolar line of point `i`; as
    /// [`distance_in_view1`](Self::distance_in_view1).
    pub fn distance_in_view2(&self, i: usize, j: usize) -> f64 {
        self.images2[i].map_or(f64::INFINITY, |image| image.distance(self.curve2[j]))
    }

    /// Signed distance in view 1, px: along a fixed column `j` its sign tells the side of the line.
    /// `None` where there is no line.
    pub fn signed_distance_in_view1(&self, i: usize, j: usize) -> Option<f64> {
        self.images1[j].and_then(|image| image.signed_distance(self.curve1[i]))
    }

    /// Signed distance in view 2, px: along a fixed row `i` its sign tells the side of the line.
    /// `None` where there is no line.
    pub fn signed_distance_in_view2(&self, i: usize, j: usize) -> Option<f64> {
        self.images2[i].and_then(|image| image.signed_distance(self.curve2[j]))
    }

    /// Whether every ray has a line in every view that the kind measures in.
    pub(crate) fn all_lines(&self) -> bool {
        let all = |lines: bool, needed: bool| lines || !needed;
        let in_view1 = self.lineless2.is_empty();
        let in_view2 = self.images2.iter().all(|image| matches!(image, Some(RayImage::Line(_))));
        all(in_view1, self.kind != DistanceKind::View2)
            && all(in_view2, self.kind != DistanceKind::View1)
    }

    /// Coefficients of the line of point `j` in view 1.
    pub(crate) fn line1(&self, j: usize) -> Option<[f64; 3]> {
        coefficients(self.images1[j].as_ref())
    }

    /// Coefficients of the line of point `i` in view 2.
    pub(crate) fn line2(&self, i: usize) -> Option<[f64; 3]> {
        coefficients(self.images2[i].as_ref())
    }

    /// Squared gradient of `p1ᵀ F p2` by `p1` at point `j` of view 2.
    pub(crate) fn gradient1(&self, j: usize) -> f64 {
        self.gradients1[j]
    }

    /// Squared gradient of `p1ᵀ F p2` by `p2` at point `i` of view 1.
    pub(crate) fn gradient2(&self, i: usize) -> f64 {
        self.gradients2[i]
    }
}

fn coefficients<V: View>(image: Option<&RayImage<V>>) -> Option<[f64; 3]> {
    match image? {
        RayImage::Line(line) => Some((*line.coefficients()).into()),
        RayImage::Point(_) => None,
    }
}

/// Refuses an empty curve and a point that is not finite, naming it.
///
/// # Errors
/// [`MatchError::Empty`], [`MatchError::NotFinite`].
pub fn validate_curve<V: View>(curve: &[Pixel<V>]) -> Result<(), MatchError> {
    if curve.is_empty() {
        return Err(MatchError::Empty { view: V::NUMBER });
    }
    match curve.iter().position(|p| !p.is_finite()) {
        Some(index) => {
            let (x, y) = (curve[index].x, curve[index].y);
            Err(MatchError::NotFinite { view: V::NUMBER, index, x, y })
        }
        None => Ok(()),
    }
}

fn images<A: View, B: View>(
    f: &Fundamental<A, B>,
    curve: &[Pixel<B>],
    required: bool,
) -> Result<Vec<Option<RayImage<A>>>, MatchError> {
    let imager = RayImager::new(f);
    let image = |&pixel| match imager.image(pixel) {
        Err(error) if required => Err(error.into()),
        result => Ok(result.ok()),
    };
    curve.iter().map(image).collect()
}

/// Refuses, where `kind` needs them, those of which two do not add up to a number.
fn squared_gradients<A: View, B: View>(
    f: &Fundamental<A, B>,
    curve: &[Pixel<B>],
    kind: DistanceKind,
) -> Result<Vec<f64>, GeomError> {
    let squared = |pixel: &Pixel<B>| {
        let value = (f.matrix() * pixel.homogeneous()).xy().norm_squared();
        if kind == DistanceKind::Sampson && !(2.0 * value).is_finite() {
            let what = format!("squared gradient at the pixel ({}, {})", pixel.x, pixel.y);
            return Err(GeomError::NotFinite { what, value });
        }
        Ok(value)
    };
    curve.iter().map(squared).collect()
}

fn rms(d1: f64, d2: f64) -> f64 {
    ((d1 * d1 + d2 * d2) * 0.5).sqrt()
}

/// [`CostModel::sweep`] with the instructions of the machine at hand.
struct Sweep<'a> {
    costs: &'a CostModel,
    i: usize,
    columns: Range<usize>,
    part: &'a mut [f64],
}

impl NullaryFnOnce for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.costs.sweep(self.i, self.columns, self.part);
    }
}

/// `|p1ᵀ F p2| / sqrt(g1 + g2)` from the distance in view 1, `d1 = |p1ᵀ F p2| / sqrt(g1)`. Only the
/// ratio of the gradients enters, hence the scale of `F` does not.
#[inline(always)]
fn sampson(d1: f64, gradient1: f64, gradient2: f64) -> f64 {
    d1 * (gradient1 / (gradient1 + gradient2)).sqrt()
}
