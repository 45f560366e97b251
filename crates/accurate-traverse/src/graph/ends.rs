//! Thinning stops short of the tips of the body and of the turning points of hairpins. Here the
//! graph gets them back from the mask.

use accurate_geom::{Pixel, Point2, View};
use nalgebra::Vector2;
use ndarray::Array2;

use super::GraphEdge;
use super::rough::RoughGraph;
use crate::body_end::{MAX_STRETCH_PX, free_length};

/// Part of a tip's edge that gives its direction, px.
const TANGENT_PX: usize = 8;

/// Draws every tip out along its tangent until it is half a thickness from where the mask ends.
pub(super) fn extend_tips(graph: &mut RoughGraph, radii: &Array2<f64>, mask_thickness_px: f64) {
    let incident = graph.incident();
    for edge in &mut graph.edges {
        for side in 0..2 {
            let node = edge.ends[side];
            if incident[node].len() != 1 {
                continue;
            }
            if side == 0 {
                edge.points.reverse();
                edge.radii.reverse();
            }
            let last = edge.points.len() - 1;
            let (tip, radius) = (edge.points[last], edge.radii[last]);
            let ahead = tip - edge.points[last.saturating_sub(TANGENT_PX)];
            if let Some(ahead) = ahead.try_normalize(0.0) {
                let stretch = free_length(radii, tip, ahead) - mask_thickness_px / 2.0;
                if stretch > 0.0 {
                    let steps = stretch.ceil() as usize;
                    for k in 1..=steps {
                        let at = tip + ahead * (stretch * k as f64 / steps as f64);
                        edge.points.push(at);
                        edge.radii.push(radius);
                    }
                    graph.nodes[node] = tip + ahead * stretch;
                    edge.length += stretch;
                }
            }
            if side == 0 {
                edge.points.reverse();
                edge.radii.reverse();
            }
        }
    }
}

/// Draws edges out into parts of the mask that lie too far from all of them: the turning points of
/// hairpins, and tips that bend away from their tangent.
///
/// Two merged strands reach at most a thickness from the middle; only what is farther counts.
pub(super) fn stretch<V: View>(
    edges: &mut [GraphEdge<V>],
    tips: &[[bool; 2]],
    radii: &Array2<f64>,
    mask_thickness_px: f64,
) {
    let reach = mask_thickness_px + 0.5;
    'pieces: for piece in far_pieces(edges, radii, reach) {
        // The farthest pixel of the piece and what it is nearest to.
        let mut target: Option<(f64, Point2, usize, usize)> = None;
        for at in piece {
            let Some((distance, edge, index)) = nearest(edges, at) else { continue };
            // Not of this body; a large one would take minutes.
            if distance > MAX_STRETCH_PX {
                continue 'pieces;
            }
            if target.is_none_or(|(farthest, ..)| distance > farthest) {
                target = Some((distance, at, edge, index));
            }
        }
        let Some((distance, pixel, edge, index)) = target else { continue };
        // An edge drawn out to another piece has reached it.
        if distance <= 0.5 * mask_thickness_px {
            continue;
        }
        let line = &mut edges[edge];
        let last = line.points.len() - 1;
        let from = line.points[index].point();
        let to = pixel + (from - pixel) * (0.5 * mask_thickness_px / distance);
        if (index == 0 && tips[edge][0]) || (index == last && tips[edge][1]) {
            draw_out(line, index == 0, to);
        } else if turns_at(line, index, (to - from) / (to - from).norm()) {
            bump(line, index, to - from);
        }
        line.length_px = line.points.windows(2).map(|w| w[0].distance(w[1])).sum();
    }
}

/// 8-connected pieces of the mask farther than `reach` from every point of every edge.
fn far_pieces<V: View>(
    edges: &[GraphEdge<V>],
    radii: &Array2<f64>,
    reach: f64,
) -> Vec<Vec<Point2>> {
    let (height, width) = radii.dim();
    let mut done = Array2::from_elem((height, width), false);
    for point in edges.iter().flat_map(|edge| &edge.points) {
        for y in covered(point.y, reach, height) {
            for x in covered(point.x, reach, width) {
                if (x as f64 - point.x).powi(2) + (y as f64 - point.y).powi(2) <= reach * reach {
                    done[[y, x]] = true;
                }
            }
        }
    }
    let far =
        radii.iter().zip(&done).enumerate().filter(|(_, (radius, done))| **radius > 0.0 && !**done);
    let starts: Vec<usize> = far.map(|(place, _)| place).collect();
    let mut pieces = Vec::new();
    for (y, x) in starts.into_iter().map(|place| (place / width, place % width)) {
        if done[[y, x]] {
            continue;
        }
        let mut piece = vec![(y, x)];
        done[[y, x]] = true;
        let mut next = 0;
        while let Some(&(y, x)) = piece.get(next) {
            next += 1;
            for r in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                for c in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    if radii[[r, c]] > 0.0 && !done[[r, c]] {
                        done[[r, c]] = true;
                        piece.push((r, c));
                    }
                }
            }
        }
        pieces.push(piece.into_iter().map(|(y, x)| Point2::new(x as f64, y as f64)).collect());
    }
    pieces
}

fn covered(centre: f64, reach: f64, count: usize) -> std::ops::Range<usize> {
    let low = (centre - reach).ceil().max(0.0) as usize;
    let high = (centre + reach).floor().max(-1.0) + 1.0;
    low.min(count)..(high as usize).min(count).max(low.min(count))
}

fn nearest<V: View>(edges: &[GraphEdge<V>], at: Point2) -> Option<(f64, usize, usize)> {
    let mut best: Option<(f64, usize, usize)> = None;
    for (edge, line) in edges.iter().enumerate() {
        for (index, point) in line.points.iter().enumerate() {
            let distance = (point.point() - at).norm();
            if best.is_none_or(|(least, ..)| distance < least) {
                best = Some((distance, edge, index));
            }
        }
    }
    best
}

/// Appends a straight piece to a tip.
fn draw_out<V: View>(line: &mut GraphEdge<V>, at_start: bool, to: Point2) {
    if at_start {
        line.points.reverse();
        line.radii.reverse();
    }
    let last = line.points.len() - 1;
    let (from, radius) = (line.points[last].point(), line.radii[last]);
    let steps = (to - from).norm().ceil().max(1.0) as usize;
    for k in 1..=steps {
        line.points.push(Pixel::from(from + (to - from) * (k as f64 / steps as f64)));
        line.radii.push(radius);
    }
    if at_start {
        line.points.reverse();
        line.radii.reverse();
    }
}

/// Whether both arms of the line at `index` point away from `outward`: a hairpin turns there.
fn turns_at<V: View>(line: &GraphEdge<V>, index: usize, outward: Vector2<f64>) -> bool {
    const ARM_PX: usize = 8;
    let last = line.points.len() - 1;
    let at = line.points[index].point();
    let back = |k: usize| {
        let arm = line.points[k].point() - at;
        arm.dot(&outward) < -0.7 * arm.norm()
    };
    index >= ARM_PX && index + ARM_PX <= last && back(index - ARM_PX) && back(index + ARM_PX)
}

/// Moves point `index` by `shift` and its neighbours less and less; the nodes stay.
fn bump<V: View>(line: &mut GraphEdge<V>, index: usize, shift: Vector2<f64>) {
    // As wide as the hairpin is deep, about: then the arms stay apart as the mask has them.
    let sigma = shift.norm().max(2.0);
    let last = line.points.len() - 1;
    for (k, point) in line.points.iter_mut().enumerate() {
        if k == 0 || k == last {
            continue;
        }
        let away = (k as f64 - index as f64) / sigma;
        let moved = point.point() + shift * (-0.5 * away * away).exp();
        *point = moved.into();
    }
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;
    use proptest::prelude::*;

    use super::*;

    const THICKNESS: f64 = 4.0;

    /// The pixels within `half` of any of these points.
    fn mask(middle: &[Point2], half: f64) -> Array2<f64> {
        Array2::from_shape_fn((100, 100), |(y, x)| {
            let at = Point2::new(x as f64, y as f64);
            f64::from(u8::from(middle.iter().any(|p| (at - p).norm() <= half)))
        })
    }

    fn line(from: Point2, direction: f64, length: f64) -> Vec<Point2> {
        let steps = length.ceil().max(1.0);
        let ahead = Vector2::new(direction.cos(), direction.sin());
        (0..=steps as usize).map(|k| from + ahead * (length * k as f64 / steps)).collect()
    }

    fn edge(points: &[Point2]) -> GraphEdge<View1> {
        GraphEdge::body(
            [0, 1],
            points.iter().copied().map(Pixel::from).collect(),
            vec![1.0; points.len()],
        )
    }

    proptest! {
        /// The body bends at its tip, by less than a right angle: the tip is then what is nearest.
        #[test]
        fn a_tip_reaches_to_half_a_thickness_before_the_farthest_pixel_ahead(
            direction in 0.0..6.2_f64, bend in -1.4..1.4_f64, arm in 0.0..13.0_f64, at_start: bool,
            is_tip: bool,
        ) {
            let mut points = line(Point2::new(50.0, 50.0), direction, 25.0);
            let tip = points[25];
            let radii = mask(&[points.clone(), line(tip, direction + bend, arm)].concat(), THICKNESS / 2.0);
            if at_start {
                points.reverse();
            }
            let before = edge(&points);
            let mut edges = [before.clone()];
            stretch(&mut edges, &[[at_start && is_tip, !at_start && is_tip]], &radii, THICKNESS);
            let [after] = edges;
            let far = |at: &Point2| points.iter().map(|p| (at - p).norm()).fold(f64::INFINITY, f64::min);
            let mut set: Vec<_> = radii.indexed_iter().filter(|(_, r)| **r > 0.0)
                .map(|((y, x), _)| Point2::new(x as f64, y as f64)).collect();
            set.sort_by(|a, b| far(b).total_cmp(&far(a)));
            let (farthest, beyond) = (set[0], far(&set[0]) - THICKNESS - 0.5);
            if !is_tip || beyond <= 0.0 {
                prop_assert_eq!(after, before);
                return Ok(());
            }
            // Of less than that, single pixels may be pieces of their own; of two as far either counts.
            prop_assume!(beyond > 1.5 && far(&set[0]) - far(&set[1]) > 1e-9);
            let (kept, end) = if at_start {
                (&after.points[after.points.len() - 26..], after.points[0])
            } else {
                (&after.points[..26], after.points[after.points.len() - 1])
            };
            prop_assert_eq!(kept, &before.points[..]);
            // Roundings of coordinates below 100 px.
            let expected = tip + (farthest - tip) * (1.0 - 0.5 * THICKNESS / far(&farthest));
            prop_assert!((end.point() - expected).norm() < 1e-12, "{} {}", end.point(), expected);
            prop_assert_eq!(after.radii.len(), after.points.len());
            let steps = after.points.windows(2).map(|w| w[0].distance(w[1]));
            prop_assert_eq!(after.length_px, steps.clone().sum::<f64>());
            prop_assert!(steps.fold(0.0, f64::max) <= 1.0 + 1e-12);
        }
    }

    #[test]
    fn the_turn_of_a_hairpin_moves_out_and_its_ends_stay() {
        // Two strands 2 px apart; the body turns 8 px beyond the line, which a tip could not tell.
        let half = line(Point2::new(20.0, 51.0), 0.0, 30.0);
        let back: Vec<_> = half.iter().rev().map(|p| Point2::new(p.x, 49.0)).collect();
        let before = edge(&[half, vec![Point2::new(51.0, 50.0)], back].concat());
        let radii = mask(&line(Point2::new(20.0, 50.0), 0.0, 37.0), 2.0);
        let mut edges = [before.clone()];
        stretch(&mut edges, &[[true, true]], &radii, THICKNESS);
        let after = &edges[0].points;
        // The mask ends at 59; half a thickness before that is where it turns.
        assert_eq!((after.len(), after[31]), (63, Pixel::new(57.0, 50.0)));
        assert_eq!([after[0], after[62]], [before.points[0], before.points[62]]);
    }

    #[test]
    fn what_is_too_far_is_not_of_this_body_and_what_was_reached_is_done() {
        let drawn = |set: &[(usize, usize)]| {
            let pixel = |(y, x)| f64::from(u8::from(set.contains(&(x, y))));
            let mut edges = [edge(&line(Point2::new(60.0, 50.0), 0.0, 20.0))];
            stretch(
                &mut edges,
                &[[true, true]],
                &Array2::from_shape_fn((100, 100), pixel),
                THICKNESS,
            );
            edges[0].points[0]
        };
        let at = |x| Pixel::new(x, 50.0);
        assert_eq!([drawn(&[(44, 50)]), drawn(&[(43, 50)])], [at(46.0), at(60.0)]);
        // The second speck lies at the end that was drawn out to the first, or beside it.
        for second in [(48, 50), (48, 51)] {
            assert_eq!(drawn(&[(46, 50), second]), at(48.0), "{second:?}");
        }
    }
}
