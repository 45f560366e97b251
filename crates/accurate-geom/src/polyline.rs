use nalgebra::{Point, SVector};

use crate::error::finite;
use crate::{GeomError, Pixel, View};

/// An open polygonal line in `D` dimensions: at least one point, all finite. Repeated points are
/// allowed.
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline<const D: usize> {
    points: Vec<Point<f64, D>>,
    /// Arc length from the first point to each point.
    cumulative: Vec<f64>,
}

/// A polyline in an image, px.
pub type Polyline2 = Polyline<2>;
/// A polyline in the world, in the rig's unit.
pub type Polyline3 = Polyline<3>;

/// The point of a polyline nearest to a given one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestOnPolyline<const D: usize> {
    /// Index of the segment (and of its first point); 0 for a polyline of one point.
    pub segment: usize,
    /// Where on the segment, 0 at its first and 1 at its second point.
    pub t: f64,
    /// The nearest point.
    pub point: Point<f64, D>,
    /// Its distance.
    pub distance: f64,
}

/// More points than any use of a resampled line; refused before the memory is asked for.
const MAX_RESAMPLED: f64 = 1e8;

impl<const D: usize> Polyline<D> {
    /// A polyline through `points`, in order.
    ///
    /// # Errors
    /// [`GeomError::TooFewPoints`] if there are none, [`GeomError::NotFinite`] for a coordinate or
    /// a total length that is not finite.
    pub fn new(points: Vec<Point<f64, D>>) -> Result<Self, GeomError> {
        let Some(mut last) = points.first().copied() else {
            return Err(GeomError::TooFewPoints { found: 0, needed: 1 });
        };
        let mut cumulative = Vec::with_capacity(points.len());
        let mut length = 0.0;
        for (index, point) in points.iter().enumerate() {
            for &value in &point.coords {
                finite(value, || format!("point {index}"))?;
            }
            length += (point - last).norm();
            cumulative.push(finite(length, || format!("length up to point {index}"))?);
            last = *point;
        }
        Ok(Self { points, cumulative })
    }

    /// The points.
    pub fn points(&self) -> &[Point<f64, D>] {
        &self.points
    }

    /// Arc length from the first point to each point.
    pub fn cumulative_lengths(&self) -> &[f64] {
        &self.cumulative
    }

    /// Total length.
    pub fn length(&self) -> f64 {
        self.cumulative[self.cumulative.len() - 1]
    }

    /// The point at arc length `s` from the first point; the ends outside `[0, length]`.
    pub fn at(&self, s: f64) -> Point<f64, D> {
        let after = self.cumulative.partition_point(|length| *length <= s);
        if after == 0 || self.length() == 0.0 {
            return self.points[0];
        }
        if after == self.points.len() {
            return self.points[after - 1];
        }
        let (from, to) = (self.cumulative[after - 1], self.cumulative[after]);
        let (a, b) = (self.points[after - 1], self.points[after]);
        a + (b - a) * ((s - from) / (to - from))
    }

    /// The polyline of equally spaced points (by arc length) from the first to the last point, at
    /// most `spacing` apart. Cutting corners, it is never longer than this one. A polyline of no
    /// length gives its first point.
    ///
    /// # Errors
    /// [`GeomError::OutOfRange`] if `spacing` is not positive or asks for more than 10⁸ points.
    pub fn resample(&self, spacing: f64) -> Result<Self, GeomError> {
        let length = self.length();
        // A rounding error above a whole number of steps adds no step.
        let steps = (length / spacing * (1.0 - 4.0 * f64::EPSILON)).ceil();
        if !(spacing > 0.0 && steps <= MAX_RESAMPLED) {
            let expected = "a positive spacing that gives at most 1e8 points";
            return Err(GeomError::OutOfRange { what: "spacing", value: spacing, expected });
        }
        if length == 0.0 {
            return Self::new(vec![self.points[0]]);
        }
        let steps = steps.max(1.0) as usize;
        self.resample_to(steps + 1)
    }

    /// As [`resample`](Self::resample), with `count` points; a `count` below 2 gives the first
    /// point only.
    ///
    /// # Errors
    /// [`GeomError::OutOfRange`] for a `count` above 10⁸.
    pub fn resample_to(&self, count: usize) -> Result<Self, GeomError> {
        if count > MAX_RESAMPLED as usize + 1 {
            let (what, expected) = ("count", "at most 1e8 points");
            return Err(GeomError::OutOfRange { what, value: count as f64, expected });
        }
        if count < 2 {
            return Self::new(vec![self.points[0]]);
        }
        let mut points = Vec::with_capacity(count);
        let mut segment = 0;
        for index in 0..count - 1 {
            let s = self.length() * (index as f64 / (count - 1) as f64);
            while segment + 2 < self.points.len() && self.cumulative[segment + 1] <= s {
                segment += 1;
            }
            points.push(self.on_segment(segment, s));
        }
        points.push(self.points[self.points.len() - 1]);
        Self::new(points)
    }

    fn on_segment(&self, segment: usize, s: f64) -> Point<f64, D> {
        let a = self.points[segment];
        let Some(b) = self.points.get(segment + 1) else { return a };
        let (from, to) = (self.cumulative[segment], self.cumulative[segment + 1]);
        if to > from { a + (b - a) * ((s - from) / (to - from)).clamp(0.0, 1.0) } else { a }
    }

    /// The nearest point; the first of equally near ones.
    ///
    /// # Cost
    /// O(n).
    pub fn closest(&self, query: &Point<f64, D>) -> ClosestOnPolyline<D> {
        let first = self.points[0];
        let distance = (first - query).norm();
        let mut best = ClosestOnPolyline { segment: 0, t: 0.0, point: first, distance };
        for (segment, ends) in self.points.windows(2).enumerate() {
            let t = segment_parameter(&ends[0], &ends[1], query);
            // The far end exactly, not within rounding: equal to the next segment's near end.
            let point = if t == 1.0 { ends[1] } else { ends[0] + (ends[1] - ends[0]) * t };
            let distance = (point - query).norm();
            if distance < best.distance {
                best = ClosestOnPolyline { segment, t, point, distance };
            }
        }
        best
    }

    /// The same line from its last to its first point.
    pub fn reversed(&self) -> Self {
        let length = self.length();
        Self {
            points: self.points.iter().rev().copied().collect(),
            cumulative: self.cumulative.iter().rev().map(|s| length - s).collect(),
        }
    }

    /// Smallest and largest value of every coordinate.
    pub fn bounding_box(&self) -> (Point<f64, D>, Point<f64, D>) {
        let mut low = self.points[0];
        let mut high = low;
        for point in &self.points {
            for axis in 0..D {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        (low, high)
    }

    /// Diagonal of the bounding box: the scale of the line.
    pub fn bounding_box_diagonal(&self) -> f64 {
        let (low, high) = self.bounding_box();
        (high - low).norm()
    }
}

impl Polyline<2> {
    /// A polyline through the pixels of one view.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn from_pixels<V: View>(pixels: &[Pixel<V>]) -> Result<Self, GeomError> {
        Self::new(pixels.iter().map(|p| p.point()).collect())
    }

    /// The points as pixels of view `V`.
    pub fn to_pixels<V: View>(&self) -> Vec<Pixel<V>> {
        self.points.iter().map(|p| Pixel::from(*p)).collect()
    }
}

fn segment_parameter<const D: usize>(
    a: &Point<f64, D>,
    b: &Point<f64, D>,
    query: &Point<f64, D>,
) -> f64 {
    let along: SVector<f64, D> = b - a;
    let squared = along.norm_squared();
    if squared > 0.0 { ((query - a).dot(&along) / squared).clamp(0.0, 1.0) } else { 0.0 }
}
