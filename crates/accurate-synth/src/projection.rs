use accurate_geom::{Camera, GeomError, Point2, Point3};

use crate::polyline::{arc_lengths, locate};

/// The exact image of a 3D polyline: straight segments stay straight, so nothing is approximated.
#[derive(Debug, Clone)]
pub(crate) struct Projection {
    /// Projected vertices, px.
    pub points: Vec<Point2>,
    /// Depth of each vertex, world unit.
    pub depth: Vec<f64>,
    /// Arc length in the image at each vertex, px.
    pub arc: Vec<f64>,
}

impl Projection {
    pub fn new(camera: &Camera, curve: &[Point3]) -> Result<Self, GeomError> {
        let points = curve.iter().map(|x| camera.project(x)).collect::<Result<Vec<_>, _>>()?;
        let depth = curve.iter().map(|x| camera.depth(x)).collect();
        let arc = arc_lengths(&points);
        Ok(Self { points, depth, arc })
    }

    /// Length in the image, px.
    pub fn length(&self) -> f64 {
        self.arc.last().copied().unwrap_or(0.0)
    }

    /// The point at arc length `s`, px (clamped to the ends).
    pub fn at(&self, s: f64) -> Point2 {
        let (k, along) = locate(&self.arc, s);
        self.points[k] + (self.points[k + 1] - self.points[k]) * along
    }

    /// The segment that holds image arc length `s`, and how far along the *3D* segment the point
    /// lies: the image parameter `a` belongs to the 3D parameter `a z0 / (a z0 + (1 - a) z1)`.
    pub fn locate_in_3d(&self, s: f64) -> (usize, f64) {
        let (k, a) = locate(&self.arc, s);
        let near = a * self.depth[k];
        (k, near / (near + (1.0 - a) * self.depth[k + 1]))
    }

    /// Mean depth of the vertices, world unit.
    pub fn mean_depth(&self) -> f64 {
        self.depth.iter().sum::<f64>() / self.depth.len() as f64
    }

    /// The part between two arc lengths (px), cut exactly.
    pub fn piece(&self, from: f64, to: f64) -> Vec<Point2> {
        let mut piece = vec![self.at(from)];
        let first = self.arc.partition_point(|&a| a <= from);
        let last = self.arc.partition_point(|&a| a < to);
        if first < last {
            piece.extend_from_slice(&self.points[first..last]);
        }
        piece.push(self.at(to));
        piece
    }

    /// What is left of the curve without `gaps` (sorted, disjoint arc-length intervals, px).
    pub fn visible(&self, gaps: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let mut left = Vec::with_capacity(gaps.len() + 1);
        let mut from = 0.0;
        for &(start, end) in gaps {
            left.push((from, start));
            from = end;
        }
        left.push((from, self.length()));
        left
    }
}
