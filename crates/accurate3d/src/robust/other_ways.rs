use accurate_geom::Point2;
use accurate_geom::nalgebra::Vector2;

/// Strands run side by side if they are parallel, by this cosine.
const PARALLEL: f64 = 0.8;
/// Strands lie on each other where they are no farther apart than this, px.
const ON_EACH_OTHER_PX: f64 = 1.3;
/// What is shorter is a crossing, px.
const SHORTEST_PX: usize = 8;
/// Longer loops are left to the walks, px.
const LONGEST_LOOP_PX: usize = 300;
/// A loop promises as much as a stretch side by side that is so long, px ...
const LOOP_PROMISE_PX: f64 = 25.0;
/// ... and one whose ends touch but do not cross, px.
const TOUCH_PROMISE_PX: f64 = 24.0;
/// Touches no farther apart along either strand are one, px.
const ONE_TOUCH_PX: usize = 8;

/// Another way that a curve may take through a view, with nearly the same outline.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OtherWay {
    /// With as many vertices as the given path.
    pub(crate) path: Vec<Point2>,
    /// First and last vertex that are elsewhere.
    pub(crate) range: [usize; 2],
    /// What promises more is more often right.
    pub(crate) promise_px: f64,
}

/// The other ways of a path whose vertices are 1 px apart: two strands side by side, whose bodies are
/// one in the image (no farther apart than `reach_px`), change places, along the whole stretch or where
/// they lie on each other; a loop, whose ends cross or touch, is run through the other way.
///
/// O(vertices²), about 0.2 ms for 450.
pub(crate) fn other_ways(path: &[Point2], reach_px: f64) -> Vec<OtherWay> {
    let swaps = side_by_side(path, reach_px).into_iter().map(|pairs| exchanged(path, &pairs));
    let crossings = loops(path);
    let touches = touches(path, &crossings);
    let turned = |promise_px| {
        move |[from, to]: [usize; 2]| {
            let mut path = path.to_vec();
            path[from..=to].reverse();
            OtherWay { path, range: [from, to], promise_px }
        }
    };
    swaps
        .chain(crossings.into_iter().map(turned(LOOP_PROMISE_PX)))
        .chain(touches.into_iter().map(turned(TOUCH_PROMISE_PX)))
        .collect()
}

/// A vertex and its neighbour on another strand, later in the path.
#[derive(Debug, Clone, Copy)]
struct Pair {
    i: usize,
    j: usize,
    /// How far `j` lies to the left of `i`, px.
    left: f64,
}

/// Stretches of pairs, cut where the strands cross, and the parts where they lie on each other.
fn side_by_side(path: &[Point2], reach_px: f64) -> Vec<Vec<Pair>> {
    let n = path.len();
    let along = |k: usize| {
        let chord: Vector2<f64> = path[(k + 2).min(n - 1)] - path[k.saturating_sub(2)];
        chord.try_normalize(0.0)
    };
    // Neighbours along the path are near each other too.
    let own = (1.5 * reach_px).ceil() as usize + 2;
    let (mut open, mut done) = (Vec::<Vec<Pair>>::new(), Vec::new());
    for i in 0..n {
        let Some(way) = along(i) else { continue };
        let squared = |j: usize| (path[j] - path[i]).norm_squared();
        let mut next: Vec<Vec<Pair>> = Vec::new();
        for j in i + own..n {
            let is_nearest = squared(j) < reach_px * reach_px
                && squared(j) <= squared(j - 1)
                && (j + 1 == n || squared(j) < squared(j + 1));
            if !is_nearest || along(j).is_none_or(|other| other.dot(&way).abs() < PARALLEL) {
                continue;
            }
            let off = path[j] - path[i];
            let pair = Pair { i, j, left: way.x * off.y - way.y * off.x };
            let before = open.iter().position(|stretch| {
                let last = stretch[stretch.len() - 1];
                last.j.abs_diff(j) <= 4 && last.left * pair.left >= 0.0
            });
            let mut stretch = before.map(|k| open.swap_remove(k)).unwrap_or_default();
            stretch.push(pair);
            next.push(stretch);
        }
        done.append(&mut open);
        open = next;
    }
    done.append(&mut open);
    let on_each_other = |pair: &Pair| pair.left.abs() <= ON_EACH_OTHER_PX;
    let with_parts = |whole: Vec<Pair>| {
        let mut all: Vec<Vec<Pair>> = whole
            .chunk_by(|a, b| on_each_other(a) == on_each_other(b))
            .filter(|part| on_each_other(&part[0]) && part.len() < whole.len())
            .map(<[Pair]>::to_vec)
            .collect();
        all.push(whole);
        all
    };
    done.into_iter().flat_map(with_parts).filter(|part| part.len() >= SHORTEST_PX).collect()
}

/// The path with both strands where the other is.
fn exchanged(path: &[Point2], pairs: &[Pair]) -> OtherWay {
    let mut changed = path.to_vec();
    let mut theirs: Vec<usize> = pairs.iter().map(|pair| pair.j).collect();
    theirs.sort_unstable();
    theirs.dedup();
    for &Pair { i, j, .. } in pairs {
        changed[i] = path[j];
        changed[j] = path[i];
    }
    // Vertices that are no one's nearest go with their neighbours.
    for pair in theirs.windows(2) {
        let (from, to) = (changed[pair[0]], changed[pair[1]]);
        for j in pair[0] + 1..pair[1] {
            changed[j] = from + (to - from) * ((j - pair[0]) as f64 / (pair[1] - pair[0]) as f64);
        }
    }
    let range = [pairs[0].i, theirs[theirs.len() - 1]];
    OtherWay { path: changed, range, promise_px: pairs.len() as f64 }
}

/// Where the path crosses itself: the vertices between first and second passage.
fn loops(path: &[Point2]) -> Vec<[usize; 2]> {
    let n = path.len();
    let side = |a: Point2, b: Point2, p: Point2| (b - a).perp(&(p - a));
    let mut all: Vec<[usize; 2]> = Vec::new();
    for i in 0..n.saturating_sub(1) {
        let (a, b) = (path[i], path[i + 1]);
        for j in i + SHORTEST_PX..(i + LONGEST_LOOP_PX).min(n - 1) {
            let (c, d) = (path[j], path[j + 1]);
            // Steps of 1 px that cross are not farther apart.
            if (c - a).norm_squared() < 9.0
                && side(a, b, c) * side(a, b, d) <= 0.0
                && side(c, d, a) * side(c, d, b) <= 0.0
                // A crossing in a vertex is one of both its segments.
                && all.iter().all(|known| known[0].abs_diff(i + 1) > 1 || known[1].abs_diff(j) > 1)
            {
                all.push([i + 1, j]);
            }
        }
    }
    all
}

/// Where the path touches itself beside its `crossings`: the vertices between.
fn touches(path: &[Point2], crossings: &[[usize; 2]]) -> Vec<[usize; 2]> {
    let last = path.len().saturating_sub(1);
    let squared = |i: usize, j: usize| (path[i] - path[j]).norm_squared();
    let is_one = |a: &[usize; 2], b: &[usize; 2]| {
        a[0].abs_diff(b[0]) <= ONE_TOUCH_PX && a[1].abs_diff(b[1]) <= ONE_TOUCH_PX
    };
    let mut all: Vec<([usize; 2], f64)> = Vec::new();
    for i in 1..last {
        for j in i + 2 * SHORTEST_PX..(i + LONGEST_LOOP_PX).min(last) {
            let apart = squared(i, j);
            let is_least =
                || (i - 1..=i + 1).all(|i| (j - 1..=j + 1).all(|j| apart <= squared(i, j)));
            if apart < ON_EACH_OTHER_PX * ON_EACH_OTHER_PX && is_least() {
                all.push(([i + 1, j], apart));
            }
        }
    }
    // Of one touch the nearest vertices.
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut kept: Vec<[usize; 2]> = Vec::new();
    for (touch, _) in all {
        if crossings.iter().chain(&kept).all(|known| !is_one(known, &touch)) {
            kept.push(touch);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use accurate_geom::Polyline;

    use super::*;

    fn path(corners: &[[f64; 2]]) -> Vec<Point2> {
        let corners = corners.iter().map(|[x, y]| Point2::new(*x, *y)).collect();
        Polyline::<2>::new(corners).unwrap().resample(1.0).unwrap().points().to_vec()
    }

    /// Out along y = 0 and back along y = 2 at first, y = -2 after.
    #[test]
    fn a_hairpin_runs_back_on_its_other_side() {
        let there = path(&[[0.0, 0.0], [60.0, 0.0], [60.0, 2.0], [0.0, 2.0]]);
        let ways = other_ways(&there, 4.0);
        assert_eq!(ways.len(), 1, "{ways:?}");
        let [way] = &ways[..] else { unreachable!() };
        assert!(way.promise_px > 50.0);
        // Half way both strands are where the other was.
        let (k, n) = (25, there.len());
        assert!((way.path[k].y - 2.0).abs() < 1e-9 && way.path[n - 1 - k].y.abs() < 1e-9);
        assert!((way.path[k].x - there[k].x).abs() < 1.0);
        assert_eq!(way.path.len(), n);
    }

    #[test]
    fn strands_that_cross_change_places_on_either_side() {
        // Both cross at x = 30, at an angle of 3 degrees.
        let there = path(&[
            [0.0, 1.5],
            [60.0, -1.5],
            [90.0, 60.0],
            [-30.0, 60.0],
            [0.0, -1.5],
            [60.0, 1.5],
        ]);
        let ways = other_ways(&there, 4.0);
        let swaps: Vec<_> = ways.iter().filter(|way| way.promise_px != LOOP_PROMISE_PX).collect();
        assert!(swaps.len() >= 2, "{ways:?}");
        // None changes places on both sides: that is the same as going on straight.
        for way in swaps {
            let moved = |x: f64| {
                let (before, after) =
                    there.iter().zip(&way.path).find(|(p, _)| (p.x - x).abs() < 0.6).unwrap();
                (before - after).norm() > 1.0
            };
            assert!(!(moved(5.0) && moved(55.0)));
        }
    }

    #[test]
    fn a_loop_is_run_through_the_other_way() {
        let there = path(&[[0.0, 0.0], [40.0, 0.0], [40.0, 20.0], [20.0, 20.0], [20.0, -30.0]]);
        let ways = other_ways(&there, 4.0);
        assert_eq!(ways.len(), 1, "{ways:?}");
        let way = &ways[0];
        // Beyond the crossing it goes up first, along x = 20.
        assert!((way.path[30] - Point2::new(20.0, 10.0)).norm() < 1.5, "{:?}", way.path[30]);
        // What is outside of the loop stays.
        assert_eq!(way.path[..20], there[..20]);
        assert_eq!(way.path[way.path.len() - 25..], there[there.len() - 25..]);
    }

    /// Out, around and back to where it came by, without crossing.
    #[test]
    fn a_loop_whose_ends_touch_is_run_through_the_other_way_too() {
        let there = path(&[
            [0.0, 0.0],
            [40.0, 0.0],
            [40.0, 40.0],
            [20.0, 40.0],
            [20.0, 0.3],
            [-30.0, 40.0],
        ]);
        let ways = other_ways(&there, 2.0);
        assert_eq!(ways.len(), 1, "{ways:?}");
        let OtherWay { path, range: [from, to], promise_px } = &ways[0];
        assert_eq!(*promise_px, TOUCH_PROMISE_PX);
        // Up along x = 20 first, and back along y = 0 at last.
        assert!((path[from + 15] - Point2::new(20.0, 15.0)).norm() < 2.5, "{:?}", path[from + 15]);
        assert!((path[to - 10] - Point2::new(30.0, 0.0)).norm() < 2.5, "{:?}", path[to - 10]);
        assert_eq!(path[..*from], there[..*from]);
        assert_eq!(path[to + 1..], there[to + 1..]);
    }

    #[test]
    fn a_curve_by_itself_has_no_other_way() {
        assert!(other_ways(&path(&[[0.0, 0.0], [50.0, 10.0], [90.0, 80.0]]), 4.0).is_empty());
        assert!(other_ways(&[Point2::new(1.0, 2.0)], 4.0).is_empty());
        // A right angle is no hairpin.
        assert!(other_ways(&path(&[[0.0, 0.0], [40.0, 0.0], [40.0, 40.0]]), 4.0).is_empty());
    }
}
