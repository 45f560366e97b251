//! How often is the true order among the proposed walks, and at which rank? On generated wires.
//!
//! `cargo run --release -p accurate-traverse --example proposer -- [cases] [seed] [family ...]`
//!
//! A walk is right if its coupling (discrete Fréchet) distance to the exact projection is below 3 px
//! in one direction or the other. `free ends`: an end on an edge used more than once may be cut
//! back, as the matching of two views does; the tip lies somewhere on that edge.
#![allow(clippy::print_stdout, clippy::expect_used)]

use std::time::Instant;

use accurate_geom::{Pixel, View, View1, View2};
use accurate_seg::{Mask, distance_to_background, guo_hall, median_width_px};
use accurate_synth::{CaseOptions, Family, generate};
use accurate_traverse::{
    GraphParams, SkeletonGraph, Walk, WalkEnd, WalkParams, fill_small_holes, k_best_walks,
};
use ndarray::Array2;

const TOLERANCE_PX: f64 = 3.0;

/// Rank (from 1) of the first right walk, strictly and with free ends.
struct Outcome {
    name: String,
    strict: Option<usize>,
    free: Option<usize>,
    walks: usize,
    edges: usize,
    graph_ms: f64,
    walks_ms: f64,
    /// The least of 3, 4, 6, ... px within which a walk (free ends) couples.
    reach: f64,
}

fn main() {
    let mut args = std::env::args().skip(1);
    let cases: u64 = args.next().map_or(100, |a| a.parse().expect("cases"));
    let seed: u64 = args.next().map_or(1000, |a| a.parse().expect("seed"));
    let mut families: Vec<Family> = args.map(|a| a.parse().expect("family")).collect();
    if families.is_empty() {
        families = vec![Family::Easy, Family::Medium, Family::Hard];
    }
    let verbose = std::env::var_os("VERBOSE").is_some();
    let discs = std::env::var_os("DISCS").is_some();
    println!("family  views  strict  free  rank1 free  rank<=8  graph ms  walks ms  (median, max)");
    for family in families {
        let options = CaseOptions {
            occlusion_discs: if discs { 1..=2 } else { 0..=0 },
            ..Default::default()
        };
        let mut outcomes = Vec::new();
        for index in 0..cases {
            let case = generate(family, seed, index, &options).expect("a case");
            let id = &case.id;
            outcomes.push(view(format!("{id}/1"), &case.masks[0], &case.exact_points.0));
            outcomes.push(view::<View2>(format!("{id}/2"), &case.masks[1], &case.exact_points.1));
        }
        report(family, &outcomes);
        if verbose {
            for o in outcomes.iter().filter(|o| o.free.is_none_or(|rank| rank > 16)) {
                println!(
                    "  {} strict {:?} free {:?} walks {} edges {} ms {:.1} reach {}",
                    o.name, o.strict, o.free, o.walks, o.edges, o.walks_ms, o.reach
                );
            }
        }
    }
    let _: Option<View1> = None;
}

fn view<V: View>(name: String, mask: &Array2<bool>, truth: &[Pixel<V>]) -> Outcome {
    let original = Mask::from_array(mask.clone()).expect("a mask");
    let thickness = median_width_px(&original).expect("a width");
    let start = Instant::now();
    let filled = fill_small_holes(mask, GraphParams::hole_area_px(thickness));
    let filled = Mask::from_array(filled).expect("a mask");
    let thin = guo_hall(&filled);
    let radii = distance_to_background(&filled).expect("background");
    let prepared = start.elapsed();
    let graph: SkeletonGraph<V> =
        SkeletonGraph::new(thin.as_array(), &radii, thickness, &GraphParams::DEFAULT)
            .expect("a graph");
    let graph_ms = (start.elapsed() - prepared).as_secs_f64() * 1e3;
    let start = Instant::now();
    let walks = k_best_walks(&graph, &WalkParams::DEFAULT).expect("walks");
    let walks_ms = start.elapsed().as_secs_f64() * 1e3;
    let rank = |free: bool, tol: f64| {
        walks.iter().position(|walk| is_right(walk, truth, free, tol)).map(|r| r + 1)
    };
    let reach = [3.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0]
        .into_iter()
        .find(|&tol| rank(true, tol).is_some())
        .unwrap_or(f64::INFINITY);
    Outcome {
        name,
        strict: rank(false, TOLERANCE_PX),
        free: rank(true, TOLERANCE_PX),
        reach,
        walks: walks.len(),
        edges: graph.edges().len(),
        graph_ms,
        walks_ms,
    }
}

fn is_right<V: View>(walk: &Walk<V>, truth: &[Pixel<V>], free: bool, tol: f64) -> bool {
    let n = walk.points.len();
    let run = |end: WalkEnd, flags: &mut dyn Iterator<Item = bool>| match end {
        _ if !free => 0,
        WalkEnd::OnReusedEdge => flags.take_while(|&reused| reused).count(),
        WalkEnd::Junction => 4,
        _ => 0,
    };
    let head = run(walk.ends[0], &mut walk.flags.iter().map(|f| f.reused));
    let tail = run(walk.ends[1], &mut walk.flags.iter().rev().map(|f| f.reused));
    let backward: Vec<_> = truth.iter().rev().copied().collect();
    couples(&walk.points, truth, head.min(n - 1), tail.min(n - 1), tol)
        || couples(&walk.points, &backward, head.min(n - 1), tail.min(n - 1), tol)
}

/// Whether the walk, cut back by at most `head` and `tail` points, is within the coupling distance.
fn couples<V: View>(
    walk: &[Pixel<V>],
    truth: &[Pixel<V>],
    head: usize,
    tail: usize,
    tol: f64,
) -> bool {
    let near = |i: usize, j: usize| walk[i].distance(truth[j]) < tol;
    let last = truth.len() - 1;
    // Reachable columns of the row before, ascending.
    let mut before: Vec<usize> = Vec::new();
    for i in 0..walk.len() {
        let mut row: Vec<usize> = Vec::new();
        let mut enter: Vec<usize> = before.iter().flat_map(|&j| [j, j + 1]).collect();
        if i <= head {
            enter.insert(0, 0);
        }
        for j in enter {
            let mut j = j.max(row.last().map_or(0, |&last| last + 1));
            if row.last().is_some_and(|&last| last >= j) {
                continue;
            }
            while j <= last && near(i, j) {
                row.push(j);
                j += 1;
            }
        }
        if row.is_empty() && i >= head {
            return false;
        }
        if i + 1 + tail >= walk.len() && row.last() == Some(&last) {
            return true;
        }
        before = row;
    }
    false
}

fn report(family: Family, outcomes: &[Outcome]) {
    let n = outcomes.len() as f64;
    let part =
        |test: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| test(o)).count() as f64 / n;
    let spread = |value: &dyn Fn(&Outcome) -> f64| {
        let mut values: Vec<f64> = outcomes.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        format!("{:6.2} {:6.2}", values[values.len() / 2], values[values.len() - 1])
    };
    println!(
        "{:8} {:4}  {:.3}  {:.3}  {:.3}  {:.3}  {}  {}",
        family.name(),
        outcomes.len(),
        part(&|o| o.strict.is_some()),
        part(&|o| o.free.is_some()),
        part(&|o| o.free == Some(1)),
        part(&|o| o.free.is_some_and(|rank| rank <= 8)),
        spread(&|o| o.graph_ms),
        spread(&|o| o.walks_ms),
    );
}
