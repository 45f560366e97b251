use nalgebra::{DefaultAllocator, DimName, OPoint, allocator::Allocator};

/// Cumulative length at every vertex; starts with 0. Empty for no points.
pub(crate) fn arc_lengths<D: DimName>(points: &[OPoint<f64, D>]) -> Vec<f64>
where
    DefaultAllocator: Allocator<D>,
{
    let mut arc = Vec::with_capacity(points.len());
    let mut total = 0.0;
    for (k, point) in points.iter().enumerate() {
        if k > 0 {
            total += (point - &points[k - 1]).norm();
        }
        arc.push(total);
    }
    arc
}

/// The segment of `arc` (two or more vertices, non-decreasing) that holds `s`, and where on it:
/// 0 at its start, 1 at its end. Values outside are clamped to the ends.
pub(crate) fn locate(arc: &[f64], s: f64) -> (usize, f64) {
    let last = arc.len().saturating_sub(2);
    let segment = arc.partition_point(|&a| a <= s).saturating_sub(1).min(last);
    let length = arc[segment + 1] - arc[segment];
    let along = if length > 0.0 { ((s - arc[segment]) / length).clamp(0.0, 1.0) } else { 0.0 };
    (segment, along)
}

/// `count` (two or more) points at equal arc length along a polyline of two or more vertices, first
/// and last vertex included.
pub(crate) fn resample<D: DimName>(points: &[OPoint<f64, D>], count: usize) -> Vec<OPoint<f64, D>>
where
    DefaultAllocator: Allocator<D>,
{
    let arc = arc_lengths(points);
    let total = arc[arc.len() - 1];
    let step = total / (count - 1) as f64;
    (0..count)
        .map(|k| {
            let (segment, along) = locate(&arc, step * k as f64);
            &points[segment] + (&points[segment + 1] - &points[segment]) * along
        })
        .collect()
}
