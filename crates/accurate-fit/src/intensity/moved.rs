use accurate_geom::{Point2, Polyline2};

/// What of an end may move without counting as moved, px.
const FREE_END_PX: f64 = 8.0;

/// Largest distance of a point of one line from the other one, the last [`FREE_END_PX`] at their ends aside.
pub(super) fn farthest_apart(before: &Polyline2, after: &Polyline2) -> f64 {
    farthest(without_ends(after), before).max(farthest(without_ends(before), after))
}

/// The points without those of the last [`FREE_END_PX`] at both ends.
fn without_ends(line: &Polyline2) -> &[Point2] {
    let arc_px = line.cumulative_lengths();
    let first = arc_px.partition_point(|arc| *arc < FREE_END_PX);
    let end = arc_px.partition_point(|arc| *arc <= line.length() - FREE_END_PX);
    &line.points()[first.min(end)..end]
}

/// Largest distance of a point from a line.
fn farthest(points: &[Point2], line: &Polyline2) -> f64 {
    /// Vertices to both sides of the one that was nearest to the point before.
    const NEAR: usize = 8;
    let vertices = line.points();
    let (mut most, mut nearest) = (0.0_f64, 0_usize);
    for point in points {
        let from = nearest.saturating_sub(NEAR);
        let near = &vertices[from..(nearest + NEAR).min(vertices.len())];
        let to = |k: usize| (near[k] - point).norm_squared();
        let best = (0..near.len()).min_by(|&a, &b| to(a).total_cmp(&to(b))).unwrap_or(0);
        nearest = from + best;
        // As near as that at least, and mostly that is near enough.
        if to(best) > most * most {
            let closest = line.closest(point);
            (most, nearest) = (most.max(closest.distance), closest.segment);
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::Vector2;

    use super::*;

    #[test]
    fn what_lies_on_a_line_between_its_vertices_has_not_moved() {
        let line = Polyline2::new(vec![Point2::new(0.0, 0.0), Point2::new(100.0, 0.0)]).unwrap();
        let points = [20.0, 50.0, 77.0].map(|x| Point2::new(x, 0.0));
        assert_eq!(farthest(&points, &line), 0.0);
        assert_eq!(farthest(&[Point2::new(40.0, 3.0), points[0]], &line), 3.0);
    }

    #[test]
    fn the_farthest_point_is_found_whatever_the_order() {
        let at = |k: usize| (0.05 * k as f64).sin_cos();
        let round = |k| Point2::new(30.0 * at(k).0 + 0.1 * k as f64, 30.0 * at(k).1);
        let line = Polyline2::new((0..400).map(round).collect()).unwrap();
        for step in [1, 7, 150, 399] {
            let points: Vec<_> = (0..400)
                .map(|k| round(k * step % 400) + Vector2::new(0.01 * (k % 90) as f64, 0.3))
                .collect();
            let expected = points.iter().map(|p| line.closest(p).distance).fold(0.0, f64::max);
            assert_eq!(farthest(&points, &line), expected, "{step}");
        }
    }
}
