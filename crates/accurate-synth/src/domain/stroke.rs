use accurate_geom::Point2;
use ndarray::Array2;

use crate::mask::covered;
use crate::xray::mean_chord;

/// What a ray meets across a long thin body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Profile {
    /// A full cylinder: the chord of a circle.
    Solid,
    /// A tube whose bore has this part of the outer radius (0 to 1): dark walls, a brighter middle.
    Hollow(f64),
}

/// A body along a polyline in the image.
pub(crate) struct Stroke<'a> {
    /// Vertices, px, at most about 1 px apart.
    pub points: &'a [Point2],
    /// Radius at a vertex, px, by arc length (px).
    pub radius_px: &'a dyn Fn(f64) -> f64,
    /// Optical depth across one diameter of a full cylinder, by arc length (px).
    pub depth: &'a dyn Fn(f64) -> f64,
    /// The cross-section.
    pub profile: Profile,
}

/// The nearest vertex run of one strand at a pixel.
#[derive(Clone, Copy)]
struct Run {
    last_arc: f64,
    distance2: f64,
    radius: f64,
    depth: f64,
}

const NO_RUN: Run =
    Run { last_arc: f64::NEG_INFINITY, distance2: f64::INFINITY, radius: 1.0, depth: 0.0 };

/// Adds the optical depth of a stroke. Strands that cross add up; a strand counts once a pixel.
///
/// # Cost
/// Length times width squared, plus one pass over the bounding box of the stroke.
pub(crate) fn add_stroke(total: &mut Array2<f64>, stroke: &Stroke) {
    let (height, width) = total.dim();
    let Some((low, high)) = bounds(stroke) else { return };
    let rows = covered(low.y, high.y, height as u32);
    let columns = covered(low.x, high.x, width as u32);
    if rows.is_empty() || columns.is_empty() {
        return;
    }
    let mut open = Array2::from_elem((rows.len(), columns.len()), NO_RUN);
    let mut arc = 0.0;
    for ends in stroke.points.windows(2) {
        let (a, b) = (ends[0], ends[1]);
        let along = b - a;
        let length2 = along.norm_squared();
        let length = length2.sqrt();
        let (radius, depth) = ((stroke.radius_px)(arc), (stroke.depth)(arc));
        arc += length;
        let reach = radius + 0.5;
        let inverse = if length2 > 0.0 { 1.0 / length2 } else { 0.0 };
        let segment_columns = covered(a.x.min(b.x) - reach, a.x.max(b.x) + reach, width as u32);
        for row in covered(a.y.min(b.y) - reach, a.y.max(b.y) + reach, height as u32) {
            for column in segment_columns.clone() {
                let (dx, dy) = (column as f64 - a.x, row as f64 - a.y);
                let t = ((dx * along.x + dy * along.y) * inverse).clamp(0.0, 1.0);
                let (ex, ey) = (dx - t * along.x, dy - t * along.y);
                let distance2 = ex * ex + ey * ey;
                if distance2 > reach * reach {
                    continue;
                }
                let run = &mut open[[row - rows.start, column - columns.start]];
                if arc - run.last_arc > 4.0 * reach {
                    total[[row, column]] += closed(run, stroke.profile);
                    *run = Run { last_arc: arc, distance2, radius, depth };
                } else {
                    run.last_arc = arc;
                    if distance2 < run.distance2 {
                        (run.distance2, run.radius, run.depth) = (distance2, radius, depth);
                    }
                }
            }
        }
    }
    for ((row, column), run) in open.indexed_iter() {
        if run.distance2.is_finite() {
            total[[row + rows.start, column + columns.start]] += closed(run, stroke.profile);
        }
    }
}

/// Optical depth of one strand at the distance where it came nearest.
fn closed(run: &Run, profile: Profile) -> f64 {
    if !run.distance2.is_finite() {
        return 0.0;
    }
    let distance = run.distance2.sqrt();
    let outer = mean_chord(distance, run.radius);
    let chord = match profile {
        Profile::Solid => outer,
        Profile::Hollow(bore) if bore > 0.0 => {
            (outer - bore * mean_chord(distance, bore * run.radius)).max(0.0)
        }
        Profile::Hollow(_) => outer,
    };
    run.depth * chord
}

/// Bounding box of what a stroke may touch; `None` without a segment.
fn bounds(stroke: &Stroke) -> Option<(Point2, Point2)> {
    let first = *stroke.points.first()?;
    if stroke.points.len() < 2 {
        return None;
    }
    let (mut low, mut high, mut arc, mut widest) = (first, first, 0.0, 0.0_f64);
    for ends in stroke.points.windows(2) {
        widest = widest.max((stroke.radius_px)(arc));
        arc += (ends[1] - ends[0]).norm();
        low = Point2::new(low.x.min(ends[1].x), low.y.min(ends[1].y));
        high = Point2::new(high.x.max(ends[1].x), high.y.max(ends[1].y));
    }
    let reach = widest + 1.0;
    Some((Point2::new(low.x - reach, low.y - reach), Point2::new(high.x + reach, high.y + reach)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(from: Point2, to: Point2) -> Vec<Point2> {
        (0..=100).map(|k| from + (to - from) * (f64::from(k) / 100.0)).collect()
    }

    #[test]
    fn a_solid_strand_has_the_mass_of_its_cylinder() {
        // Across a horizontal wire the mean chords sum to the area of the circle in units of its
        // diameter, exactly (see `mean_chord`), whatever the place between pixels.
        for (radius, offset) in [(0.5, 0.0), (1.3, 0.37), (4.0, 0.5)] {
            let points = line(Point2::new(0.0, 20.0 + offset), Point2::new(40.0, 20.0 + offset));
            let mut total = Array2::zeros((41, 41));
            add_stroke(
                &mut total,
                &Stroke {
                    points: &points,
                    radius_px: &|_| radius,
                    depth: &|_| 0.7,
                    profile: Profile::Solid,
                },
            );
            let mass: f64 = total.column(20).sum();
            let expected = 0.7 * std::f64::consts::FRAC_PI_2 * radius;
            assert!((mass - expected).abs() < 1e-9, "{radius}: {mass} {expected}");
        }
    }

    #[test]
    fn strands_that_cross_add_up_and_a_hollow_one_is_brighter_inside() {
        let mut points = line(Point2::new(2.0, 20.0), Point2::new(38.0, 20.0));
        points.extend(line(Point2::new(38.0, 38.0), Point2::new(20.0, 38.0)));
        points.extend(line(Point2::new(20.0, 38.0), Point2::new(20.0, 2.0)));
        let mut total = Array2::zeros((41, 41));
        let stroke =
            |profile| Stroke { points: &points, radius_px: &|_| 3.0, depth: &|_| 1.0, profile };
        add_stroke(&mut total, &stroke(Profile::Solid));
        assert!((total[[20, 20]] - 2.0 * total[[20, 10]]).abs() < 1e-12);
        let mut hollow = Array2::zeros((41, 41));
        add_stroke(&mut hollow, &stroke(Profile::Hollow(0.7)));
        assert!(hollow[[20, 10]] < 0.6 * hollow[[22, 10]]);
    }

    #[test]
    fn a_stroke_outside_the_image_changes_nothing() {
        let mut total = Array2::zeros((20, 20));
        let points = line(Point2::new(-90.0, -50.0), Point2::new(-40.0, 60.0));
        add_stroke(
            &mut total,
            &Stroke {
                points: &points,
                radius_px: &|_| 5.0,
                depth: &|_| 1.0,
                profile: Profile::Solid,
            },
        );
        assert!(total.iter().all(|v: &f64| *v == 0.0));
    }
}
