//! Laws of the refinement operator R.
#![allow(clippy::unwrap_used, clippy::panic)]

mod scenes;

use accurate_geom::{Pixel, Rig, View, View1, View2};
use accurate_match::{
    CostModel, DistanceKind, ON_LINE_PX, PixelPair, RefineDirections, RefineRule, horizontal_runs,
    longest_run, refine, vertical_runs,
};
use proptest::prelude::*;
use scenes::{DISTANCE_TOLERANCE_PX, curves, relabelled, rig, rigs};

type Path = Vec<(usize, usize)>;

/// Any monotone path: 0 is a step along view 1, 1 along view 2, 2 along both.
fn paths() -> impl Strategy<Value = Path> {
    prop::collection::vec(0..3_u8, 0..60).prop_map(|steps| {
        let (mut i, mut j) = (0, 0);
        let mut path = vec![(0, 0)];
        for step in steps {
            i += usize::from(step != 1);
            j += usize::from(step != 0);
            path.push((i, j));
        }
        path
    })
}

#[derive(Debug)]
struct Case {
    rig: Rig,
    path: Path,
    curve1: Vec<Pixel<View1>>,
    curve2: Vec<Pixel<View2>>,
}

impl Case {
    fn costs(&self) -> CostModel {
        CostModel::new(self.rig.fundamental(), &self.curve1, &self.curve2, DistanceKind::View1)
            .unwrap()
    }
}

/// A random path over random curves of its size. (R does not ask whether the path is optimal.)
fn cases() -> impl Strategy<Value = Case> {
    (rigs(), paths()).prop_flat_map(|(rig, path)| {
        let &(i, j) = path.last().unwrap();
        (curves(i + 1..=i + 1), curves(j + 1..=j + 1)).prop_map(move |(curve1, curve2)| {
            // Shift the second curve so that its middle lies on the epipolar line of the first's:
            // distances then are of both signs and of the size of the curve.
            let line = rig.fundamental().transpose().line(curve1[curve1.len() / 2]).unwrap();
            let d = line.signed_distance(curve2[curve2.len() / 2]);
            let (a, b) = (line.coefficients().x, line.coefficients().y);
            let shifted = curve2.iter().map(|p| Pixel::new(p.x - d * a, p.y - d * b)).collect();
            Case { rig: rig.clone(), path: path.clone(), curve1, curve2: shifted }
        })
    })
}

const RULES: [RefineRule; 2] = [RefineRule::Paper, RefineRule::Signed];

/// Distance of `p` to the segment from `a` to `b`, px.
fn to_segment<V: View>(p: Pixel<V>, a: Pixel<V>, b: Pixel<V>) -> f64 {
    let length = a.distance(b);
    let t = ((p.x - a.x) * (b.x - a.x) + (p.y - a.y) * (b.y - a.y)) / (length * length);
    let t = t.clamp(0.0, 1.0);
    p.distance(Pixel::new(a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)))
}

/// Whether `p` lies between point `k` of `curve` and one of its neighbours.
fn beside<V: View>(p: Pixel<V>, curve: &[Pixel<V>], k: usize) -> bool {
    let neighbours = [k.checked_sub(1), Some(k + 1)];
    // A few roundings of coordinates of this size.
    let tolerance = 8.0 * f64::EPSILON * scenes::REACH_PX;
    p == curve[k]
        || neighbours
            .into_iter()
            .flatten()
            .filter_map(|n| curve.get(n))
            .any(|&n| to_segment(p, curve[k], n) <= tolerance)
}

fn cells(pairs: &[PixelPair]) -> Path {
    pairs.iter().map(|pair| pair.cell).collect()
}

proptest! {
    #[test]
    fn off_gives_the_points_of_the_curves(case in cases()) {
        for directions in [RefineDirections::Horizontal, RefineDirections::Both] {
            for pair in refine(&case.path, &case.costs(), RefineRule::Off, directions) {
                prop_assert_eq!(pair.pixel1, case.curve1[pair.cell.0]);
                prop_assert_eq!(pair.pixel2, case.curve2[pair.cell.1]);
            }
        }
    }

    #[test]
    fn refined_points_stay_on_the_segments_beside_their_point(case in cases()) {
        for rule in RULES {
            let pairs = refine(&case.path, &case.costs(), rule, RefineDirections::Both);
            prop_assert_eq!(cells(&pairs), case.path.clone());
            for pair in pairs {
                let (i, j) = pair.cell;
                prop_assert!(beside(pair.pixel1, &case.curve1, i));
                prop_assert!(beside(pair.pixel2, &case.curve2, j));
                prop_assert!(pair.pixel1 == case.curve1[i] || pair.pixel2 == case.curve2[j]);
            }
        }
    }

    #[test]
    fn only_cells_of_runs_move(case in cases()) {
        let in_a_run = |k: usize, runs: &[std::ops::Range<usize>]| runs.iter().any(|run| run.contains(&k));
        let (horizontal, vertical) = (horizontal_runs(&case.path), vertical_runs(&case.path));
        for rule in RULES {
            let pairs = refine(&case.path, &case.costs(), rule, RefineDirections::Both);
            for (k, pair) in pairs.iter().enumerate() {
                let (i, j) = pair.cell;
                prop_assert!(pair.pixel1 == case.curve1[i] || in_a_run(k, &horizontal));
                prop_assert!(pair.pixel2 == case.curve2[j] || in_a_run(k, &vertical));
            }
            let horizontal_only = refine(&case.path, &case.costs(), rule, RefineDirections::Horizontal);
            for (both, one) in pairs.iter().zip(&horizontal_only) {
                prop_assert_eq!(both.pixel1, one.pixel1);
                prop_assert_eq!(one.pixel2, case.curve2[one.cell.1]);
            }
        }
    }

    #[test]
    fn the_paper_rule_is_the_printed_formula(case in cases()) {
        let costs = case.costs();
        let d = |i: usize, j: usize| costs.cost(i, j); // the paper's D
        let s = &case.curve1;
        let pairs = refine(&case.path, &costs, RefineRule::Paper, RefineDirections::Horizontal);
        for run in horizontal_runs(&case.path) {
            let i = case.path[run.start].0;
            let mut anchor = case.path[run.start].1;
            for &(_, j) in &case.path[run.clone()] {
                if d(i, j) < d(i, anchor) {
                    anchor = j;
                }
            }
            for pair in &pairs[run] {
                let j = pair.cell.1;
                let mix = |n: usize| {
                    let (here, there) = (d(i, j), d(n, j));
                    let sum = here + there;
                    Pixel::new(
                        (here * s[n].x + there * s[i].x) / sum,
                        (here * s[n].y + there * s[i].y) / sum,
                    )
                };
                let expected = if d(i, j) <= ON_LINE_PX {
                    s[i]
                } else if j < anchor && i > 0 {
                    mix(i - 1)
                } else if j > anchor && i + 1 < s.len() {
                    mix(i + 1)
                } else {
                    s[i]
                };
                prop_assert!(pair.pixel1.distance(expected) <= 16.0 * f64::EPSILON * scenes::REACH_PX);
            }
        }
    }

    #[test]
    fn the_signed_rule_never_increases_a_distance(case in cases()) {
        let costs = case.costs();
        let f = case.rig.fundamental();
        for pair in refine(&case.path, &costs, RefineRule::Signed, RefineDirections::Both) {
            let (i, j) = pair.cell;
            let d1 = f.line(case.curve2[j]).unwrap().distance(pair.pixel1);
            let d2 = f.transpose().line(case.curve1[i]).unwrap().distance(pair.pixel2);
            prop_assert!(d1 <= costs.distance_in_view1(i, j) + DISTANCE_TOLERANCE_PX);
            prop_assert!(d2 <= costs.distance_in_view2(i, j) + DISTANCE_TOLERANCE_PX);
            // Where it moves a point it puts it on the line.
            prop_assert!(pair.pixel1 == case.curve1[i] || d1 <= DISTANCE_TOLERANCE_PX);
            prop_assert!(pair.pixel2 == case.curve2[j] || d2 <= DISTANCE_TOLERANCE_PX);
        }
    }

    #[test]
    fn the_signed_rule_is_the_papers_where_the_neighbour_lies_beyond_the_line(case in cases()) {
        let costs = case.costs();
        let direction = RefineDirections::Horizontal;
        let paper = refine(&case.path, &costs, RefineRule::Paper, direction);
        let signed = refine(&case.path, &costs, RefineRule::Signed, direction);
        for run in horizontal_runs(&case.path) {
            let i = case.path[run.start].0;
            let at = |i: usize, k: usize| costs.signed_distance_in_view1(i, case.path[k].1).unwrap();
            let mut anchor = run.start;
            for k in run.clone() {
                if at(i, k).abs() < at(i, anchor).abs() {
                    anchor = k;
                }
            }
            for k in run {
                let neighbour = if k < anchor { i.checked_sub(1) } else { Some(i + 1) };
                let neighbour = neighbour.filter(|&n| k != anchor && n < case.curve1.len());
                let unmoved = case.curve1[i];
                match neighbour {
                    Some(n) if at(i, k).abs() > ON_LINE_PX && at(i, k) * at(n, k) <= 0.0 => {
                        prop_assert_eq!(signed[k].pixel1, paper[k].pixel1);
                        prop_assert!(signed[k].pixel1 != unmoved);
                    }
                    _ => prop_assert_eq!(signed[k].pixel1, unmoved),
                }
            }
        }
    }

    #[test]
    fn vertical_is_horizontal_with_the_views_exchanged(case in cases()) {
        // Without horizontal runs, so that none goes first.
        let path: Path = (0..case.curve1.len()).map(|i| (i, (i / 3).min(case.curve2.len() - 1))).collect();
        prop_assume!(horizontal_runs(&path).is_empty());
        let transposed: Path = path.iter().map(|&(i, j)| (j, i)).collect();
        let swapped = case.rig.swapped();
        let (s1, s2) = (relabelled(&case.curve2), relabelled(&case.curve1));
        let exchanged = CostModel::new(swapped.fundamental(), &s1, &s2, DistanceKind::View1).unwrap();
        for rule in RULES {
            let vertical = refine(&path, &case.costs(), rule, RefineDirections::Both);
            let horizontal = refine(&transposed, &exchanged, rule, RefineDirections::Horizontal);
            for (v, h) in vertical.iter().zip(&horizontal) {
                // Neighbours are about 1 px apart. The weight is a ratio of distances: compare only
                // where they are far above their rounding, else the guard decides by a hair.
                let (i, j) = v.cell;
                let neighbour_distances = [j.checked_sub(1), Some(j), Some(j + 1)]
                    .into_iter().flatten().filter(|&n| n < case.curve2.len())
                    .map(|n| case.costs().distance_in_view2(i, n));
                let least = neighbour_distances.fold(f64::INFINITY, f64::min);
                if least > 1e-3 {
                    let tolerance = 4.0 * DISTANCE_TOLERANCE_PX / least;
                    prop_assert!(v.pixel2.distance(Pixel::new(h.pixel1.x, h.pixel1.y)) <= tolerance);
                }
            }
        }
    }

    #[test]
    fn runs_are_maximal_and_cover_what_stands_still(path in paths()) {
        for (runs, key) in [
            (horizontal_runs(&path), (|c: &(usize, usize)| c.0) as fn(&(usize, usize)) -> usize),
            (vertical_runs(&path), |c| c.1),
        ] {
            let mut covered = vec![false; path.len()];
            for run in &runs {
                prop_assert!(run.len() >= 2);
                prop_assert!(path[run.clone()].iter().all(|c| key(c) == key(&path[run.start])));
                covered[run.clone()].fill(true);
            }
            for (k, cell) in path.iter().enumerate() {
                let repeats = |n: Option<&(usize, usize)>| n.is_some_and(|n| key(n) == key(cell));
                let stands = repeats(path.get(k + 1)) || k > 0 && repeats(path.get(k - 1));
                prop_assert_eq!(covered[k], stands);
            }
        }
        let all = horizontal_runs(&path).into_iter().chain(vertical_runs(&path));
        prop_assert_eq!(longest_run(&path), all.map(|run| run.len()).max().unwrap_or(1));
    }
}

/// Turntable views at one height: the principal row is an epipolar line in both.
fn turntable() -> Rig {
    rig(0.7, 0.0, 1500.0, 1500.0)
}

#[test]
fn curves_along_one_epipolar_line_are_left_alone_and_finite() {
    let curve1: Vec<_> = (0..12).map(|k| Pixel::new(400.0 + f64::from(k), 512.0)).collect();
    let curve2: Vec<_> = (0..12).map(|k| Pixel::new(600.0 - f64::from(k), 512.0)).collect();
    let costs =
        CostModel::new(turntable().fundamental(), &curve1, &curve2, DistanceKind::View1).unwrap();
    // The whole matrix is 0 up to rounding.
    for i in 0..12 {
        assert!((0..12).all(|j| costs.cost(i, j) < ON_LINE_PX));
    }
    let path: Path = (0..12).map(|j| (3, j)).chain((4..12).map(|i| (i, 11))).collect();
    for rule in RULES {
        for pair in refine(&path, &costs, rule, RefineDirections::Both) {
            assert_eq!(pair.pixel1, curve1[pair.cell.0]);
            assert_eq!(pair.pixel2, curve2[pair.cell.1]);
        }
    }
}

#[test]
fn a_point_on_the_line_stays_even_if_it_is_not_the_anchor() {
    let rig = turntable();
    let line = |p2| rig.fundamental().line(p2).unwrap();
    // The point of view 1 lies on the lines of the first two points of view 2.
    let curve1 = [Pixel::new(500.0, 511.0), Pixel::new(500.0, 512.0), Pixel::new(500.0, 513.0)];
    let curve2 = [Pixel::new(450.0, 512.0), Pixel::new(451.0, 512.0), Pixel::new(452.0, 512.6)];
    assert!(line(curve2[0]).distance(curve1[1]) <= ON_LINE_PX);
    assert!(line(curve2[1]).distance(curve1[1]) <= ON_LINE_PX);
    let costs = CostModel::new(rig.fundamental(), &curve1, &curve2, DistanceKind::View1).unwrap();
    let pairs =
        refine(&[(1, 0), (1, 1), (1, 2)], &costs, RefineRule::Paper, RefineDirections::Horizontal);
    assert_eq!(pairs[0].pixel1, curve1[1]);
    assert_eq!(pairs[1].pixel1, curve1[1]);
    assert!(pairs[2].pixel1 != curve1[1]);
}

#[test]
fn the_signed_rule_moves_a_point_whose_neighbour_lies_beyond_the_line() {
    let rig = turntable();
    let curve1 = [Pixel::new(500.0, 511.0), Pixel::new(500.0, 512.0), Pixel::new(500.0, 513.0)];
    // The line of the second point of view 2 passes between the last two of view 1.
    let curve2 = [Pixel::new(451.0, 512.0), Pixel::new(452.0, 511.4)];
    let costs = CostModel::new(rig.fundamental(), &curve1, &curve2, DistanceKind::View1).unwrap();
    let signed = |i| costs.signed_distance_in_view1(i, 1).unwrap();
    assert!(signed(1) * signed(2) < 0.0);
    let [paper, signed] = RULES.map(|rule| {
        refine(&[(1, 0), (1, 1)], &costs, rule, RefineDirections::Horizontal)[1].pixel1
    });
    assert_eq!(signed, paper);
    assert!(signed != curve1[1]);
}

#[test]
fn of_equally_distant_cells_the_first_is_the_anchor() {
    let curve1 = [Pixel::new(500.0, 539.0), Pixel::new(500.0, 540.0), Pixel::new(500.0, 541.0)];
    let curve2 = [Pixel::new(450.0, 480.0), Pixel::new(450.0, 480.0)];
    let rig = turntable();
    let costs = CostModel::new(rig.fundamental(), &curve1, &curve2, DistanceKind::View1).unwrap();
    let path = [(1, 0), (1, 1)];
    let pairs = refine(&path, &costs, RefineRule::Paper, RefineDirections::Horizontal);
    assert_eq!(pairs[0].pixel1, curve1[1]);
    assert!(pairs[1].pixel1 != curve1[1]);
}

#[test]
fn the_first_and_last_point_have_no_neighbour_to_move_to() {
    let rig = turntable();
    let curve1 = [Pixel::new(500.0, 540.0)];
    let curve2 = [Pixel::new(450.0, 480.0), Pixel::new(451.0, 485.0), Pixel::new(452.0, 490.0)];
    let costs = CostModel::new(rig.fundamental(), &curve1, &curve2, DistanceKind::View1).unwrap();
    let path = [(0, 0), (0, 1), (0, 2)];
    for pair in refine(&path, &costs, RefineRule::Paper, RefineDirections::Both) {
        assert_eq!(pair.pixel1, curve1[0]);
    }
}

#[test]
fn cells_outside_the_curves_and_empty_paths_do_no_harm() {
    let costs = CostModel::new(
        turntable().fundamental(),
        &[Pixel::new(1.0, 2.0)],
        &[Pixel::new(3.0, 4.0)],
        DistanceKind::Sampson,
    )
    .unwrap();
    assert!(refine(&[], &costs, RefineRule::Paper, RefineDirections::Both).is_empty());
    let pairs =
        refine(&[(0, 0), (5, 0), (0, 7)], &costs, RefineRule::Signed, RefineDirections::Both);
    assert_eq!(cells(&pairs), [(0, 0)]);
    assert_eq!(longest_run(&[]), 0);
}
