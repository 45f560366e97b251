//! What must hold for the walks of every graph.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use accurate_geom::View1;
use accurate_traverse::{
    GraphParams, SkeletonGraph, TraverseError, Walk, WalkEnd, WalkParams, k_best_walks,
};
use ndarray::Array2;
use proptest::prelude::*;

const SIDE: i32 = 90;
/// No walk of so few edges is left out for want of room.
const ALL: WalkParams = WalkParams { beam: 20_000, ..WalkParams::DEFAULT };

/// The graph of digital strokes and of rings that stand on a corner, one pixel wide.
fn graph(strokes: &[[i32; 5]], rings: &[[i32; 3]]) -> Result<SkeletonGraph<View1>, TraverseError> {
    let mut skeleton = Array2::from_elem((SIDE as usize, SIDE as usize), false);
    let mut set = |x: i32, y: i32| {
        if (0..SIDE).contains(&x) && (0..SIDE).contains(&y) {
            skeleton[[y as usize, x as usize]] = true;
        }
    };
    for &[x, y, dx, dy, length] in strokes {
        (0..length).for_each(|k| set(x + k * dx, y + k * dy));
    }
    for &[x, y, r] in rings {
        for k in 0..r {
            set(x + k, y - r + k);
            set(x + r - k, y + k);
            set(x - k, y + r - k);
            set(x - r + k, y - k);
        }
    }
    let radii = skeleton.mapv(|set| if set { 1.5 } else { 0.0 });
    SkeletonGraph::new(&skeleton, &radii, 3.0, &GraphParams::DEFAULT)
}

fn graphs() -> impl Strategy<Value = SkeletonGraph<View1>> {
    let stroke = (5..85, 5..85, -1..=1, -1..=1, 12..70)
        .prop_filter("it goes somewhere", |(_, _, dx, dy, _)| dx != &0 || dy != &0)
        .prop_map(|(x, y, dx, dy, length)| [x, y, dx, dy, length]);
    let ring = (25..65, 25..65, 10..24).prop_map(|(x, y, r)| [x, y, r]);
    (prop::collection::vec(stroke, 0..3), prop::collection::vec(ring, 0..3))
        .prop_filter_map("a graph of few strands", |(strokes, rings)| {
            graph(&strokes, &rings).ok().filter(|graph| graph.edges().len() <= 5)
        })
}

fn best(graph: &SkeletonGraph<View1>, walks: usize) -> Vec<Walk<View1>> {
    k_best_walks(graph, &WalkParams { walks, ..ALL }).unwrap()
}

fn totals(walks: &[Walk<View1>]) -> Vec<f64> {
    walks.iter().map(|walk| walk.cost.total()).collect()
}

/// The same for a walk and its reverse, and for every start of a closed walk.
fn canonical(walk: &Walk<View1>) -> Vec<(usize, bool)> {
    let ahead: Vec<_> = walk.halves.iter().map(|h| (h.edge, h.reversed)).collect();
    let back: Vec<_> = ahead.iter().rev().map(|&(edge, reversed)| (edge, !reversed)).collect();
    let starts = if walk.is_closed() { ahead.len() } else { 1 };
    (0..starts)
        .flat_map(|k| [&ahead, &back].map(|walk| [&walk[k..], &walk[..k]].concat()))
        .min()
        .unwrap()
}

proptest! {
    /// What is asked for besides changes nothing: the pruning is by a true bound, and what is found twice
    /// takes no one's place.
    #[test]
    fn the_cheapest_few_are_the_first_of_the_cheapest_many(graph in graphs()) {
        let many = totals(&best(&graph, 400));
        for walks in [1, 2, 8, 64] {
            let few = totals(&best(&graph, walks));
            prop_assert_eq!(few.len(), walks.min(many.len()));
            for (a, b) in few.iter().zip(&many) {
                // Sums of some ten prices below 10, in another order.
                prop_assert!((a - b).abs() < 1e-9, "{few:?} {:?}", &many[..few.len()]);
            }
        }
    }

    #[test]
    fn every_turn_is_paid_for_and_no_walk_stands_twice(graph in graphs()) {
        let walks = best(&graph, 64);
        let mut known: Vec<_> = walks.iter().map(canonical).collect();
        known.sort();
        known.dedup();
        prop_assert_eq!(known.len(), walks.len());
        for walk in &walks {
            let turns: f64 = walk.decisions.iter().map(|decision| decision.price).sum();
            prop_assert!((turns - walk.cost.bending - walk.cost.u_turns).abs() < 1e-9);
            let closing = usize::from(walk.is_closed());
            prop_assert_eq!(walk.decisions.len(), walk.halves.len() - 1 + closing);
            prop_assert_eq!(walk.ends[0] == WalkEnd::Closed, walk.ends[1] == WalkEnd::Closed);
            prop_assert!(walk.points.len() >= 2 && walk.points.len() == walk.flags.len());
            let longest = walk.points.windows(2).map(|p| p[0].distance(p[1])).fold(0.0, f64::max);
            prop_assert!(longest < 1.0 + 1e-9, "{longest}");
        }
    }
}

/// Two rings that touch: their one node is passed straight on, or round either ring alone.
#[test]
fn a_figure_of_eight_is_walked_whole_though_ends_are_dear() {
    let graph = graph(&[], &[[30, 45, 15], [60, 45, 15]]).unwrap();
    let dear = WalkParams { inner_end: 20.0, walks: 1, ..ALL };
    let walk = &k_best_walks(&graph, &dear).unwrap()[0];
    assert!(walk.is_closed() && walk.coverage > 0.99, "{} {:?}", walk.coverage, walk.cost);
    assert!(best(&graph, 64).len() == 64);
}

#[test]
fn an_edge_is_never_cut_at_its_own_end() {
    let params = GraphParams { snap_px: 0.0, ..GraphParams::DEFAULT };
    let skeleton = Array2::from_shape_fn((9, 40), |(y, _)| y == 4);
    let radii = skeleton.mapv(|set| if set { 1.5 } else { 0.0 });
    assert!(matches!(
        SkeletonGraph::<View1>::new(&skeleton, &radii, 3.0, &params),
        Err(TraverseError::InvalidParameter { name: "snap_px", .. })
    ));
}
