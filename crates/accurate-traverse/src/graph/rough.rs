//! The graph of pixel chains before smoothing, and what is dropped from it.

use accurate_geom::Point2;

use super::GraphParams;

/// A chain of pixels between two nodes. The first and the last point are the nodes.
#[derive(Debug, Clone)]
pub(super) struct RoughEdge {
    pub ends: [usize; 2],
    pub points: Vec<Point2>,
    /// Distance to the background at each point, px.
    pub radii: Vec<f64>,
    pub length: f64,
}

impl RoughEdge {
    pub fn new(ends: [usize; 2], points: Vec<Point2>, radii: Vec<f64>) -> Self {
        let length = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        Self { ends, points, radii, length }
    }

    fn reversed(mut self) -> Self {
        self.ends.reverse();
        self.points.reverse();
        self.radii.reverse();
        self
    }

    /// Direction in which the edge leaves its end `side`, over at most `reach` px.
    fn leaving(&self, side: usize, reach: f64) -> nalgebra::Vector2<f64> {
        let n = self.points.len();
        let at = |k: usize| if side == 0 { self.points[k] } else { self.points[n - 1 - k] };
        let far = (1..n).find(|&k| (at(k) - at(0)).norm() >= reach).unwrap_or(n - 1);
        (at(far) - at(0)).try_normalize(0.0).unwrap_or_default()
    }
}

/// Nodes that no edge uses do not count.
#[derive(Debug, Clone)]
pub(super) struct RoughGraph {
    pub nodes: Vec<Point2>,
    pub edges: Vec<RoughEdge>,
}

/// What to do next with the graph.
enum Step {
    Drop(usize),
    Contract(usize),
    Merge(usize),
}

impl RoughGraph {
    /// Drops spurs, small loops and small pieces, joins junctions that touch, and merges the edges
    /// at nodes of degree 2, until nothing is left to do. Shortest first.
    pub fn simplify(&mut self, mask_thickness_px: f64, params: &GraphParams) {
        let spur = params.spur_length_px(mask_thickness_px);
        loop {
            let incident = self.incident();
            // Merging first: it makes edges longer, so that fewer are too short. A loop is no two edges.
            let merge = incident.iter().position(|edges| matches!(edges[..], [a, b] if a != b));
            let step = merge.map(Step::Merge).or_else(|| self.shortest(&incident, spur, params));
            match step {
                Some(Step::Drop(edge)) => {
                    self.edges.swap_remove(edge);
                }
                Some(Step::Contract(edge)) => self.contract(edge),
                Some(Step::Merge(node)) => self.merge(node),
                None => return,
            }
        }
    }

    /// The edges at each node, a loop twice.
    pub fn incident(&self) -> Vec<Vec<usize>> {
        let mut incident = vec![Vec::new(); self.nodes.len()];
        for (index, edge) in self.edges.iter().enumerate() {
            edge.ends.iter().for_each(|&node| incident[node].push(index));
        }
        incident
    }

    /// The shortest edge that has no right to exist.
    fn shortest(&self, incident: &[Vec<usize>], spur: f64, params: &GraphParams) -> Option<Step> {
        let degree = |node: usize| incident[node].len();
        let longest = self.edges.iter().map(|e| e.length).fold(0.0, f64::max);
        let mut best: Option<(f64, f64, Step)> = None;
        for (index, edge) in self.edges.iter().enumerate() {
            let [a, b] = edge.ends;
            let (low, high) = (degree(a).min(degree(b)), degree(a).max(degree(b)));
            let (limit, contract) = if a == b {
                // A loop on its own is a piece, not an appendix.
                (if degree(a) == 2 { params.piece_px } else { params.loop_per_spur * spur }, false)
            } else if low == 1 {
                (if high == 1 { params.piece_px } else { spur }, false)
            } else {
                (params.contract_px, true)
            };
            let whole_piece = high == 1 || (a == b && degree(a) == 2);
            if edge.length >= limit || (whole_piece && edge.length >= longest) {
                continue;
            }
            // Of two spurs of one length the one that continues the body less straight goes first.
            let bend = if low == 1 && high > 1 { self.straightness(index, incident) } else { 0.0 };
            let better = best.as_ref().is_none_or(|(length, b, _)| {
                (edge.length, bend) < (*length - 1e-9, *b)
                    || (edge.length < *length + 1e-9 && bend < *b - 1e-9)
            });
            if better {
                let step = if contract { Step::Contract(index) } else { Step::Drop(index) };
                best = Some((edge.length, bend, step));
            }
        }
        best.map(|(_, _, step)| step)
    }

    /// Largest cosine between the spur's direction and that of a body that goes on into it.
    fn straightness(&self, spur: usize, incident: &[Vec<usize>]) -> f64 {
        let edge = &self.edges[spur];
        let side = usize::from(incident[edge.ends[0]].len() == 1);
        let (node, away) = (edge.ends[side], edge.leaving(side, 6.0));
        let others = incident[node].iter().filter(|&&index| index != spur);
        others
            .map(|&index| &self.edges[index])
            .flat_map(|e| {
                (0..2)
                    .filter(move |&s| e.ends[s] == node)
                    .map(move |s| -e.leaving(s, 10.0).dot(&away))
            })
            .fold(-1.0, f64::max)
    }

    /// Makes one node of the two ends of an edge, at its middle.
    fn contract(&mut self, edge: usize) {
        let RoughEdge { ends: [a, b], points, .. } = self.edges.swap_remove(edge);
        let middle = points[0] + (points[points.len() - 1] - points[0]) * 0.5;
        self.nodes[a] = middle;
        for edge in &mut self.edges {
            if !edge.ends.iter().any(|&node| node == a || node == b) {
                continue;
            }
            let last = edge.points.len() - 1;
            for (side, at) in [(0, 0), (1, last)] {
                if edge.ends[side] == a || edge.ends[side] == b {
                    edge.ends[side] = a;
                    edge.points[at] = middle;
                }
            }
            edge.length = edge.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        }
    }

    /// Makes one edge of the two at a node of degree 2.
    fn merge(&mut self, node: usize) {
        let mut take = || {
            let index = self.edges.iter().position(|e| e.ends.contains(&node))?;
            Some(self.edges.swap_remove(index))
        };
        let (Some(one), Some(two)) = (take(), take()) else { return };
        let mut first = if one.ends[1] == node { one } else { one.reversed() };
        let second = if two.ends[0] == node { two } else { two.reversed() };
        first.points.extend_from_slice(&second.points[1..]);
        first.radii.extend_from_slice(&second.radii[1..]);
        self.edges.push(RoughEdge::new([first.ends[0], second.ends[1]], first.points, first.radii));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PARAMS: GraphParams = GraphParams::DEFAULT;

    /// Any edges between any nodes: loops, parallel edges and pieces on their own among them.
    fn graphs() -> impl Strategy<Value = RoughGraph> {
        let at = || (0.0..12.0_f64, 0.0..12.0_f64).prop_map(|(x, y)| Point2::new(x, y));
        let edges = prop::collection::vec((0..8_usize, 0..8_usize, at()), 1..14);
        (prop::collection::vec(at(), 8), edges).prop_map(|(nodes, edges)| {
            let edge =
                |(a, b, by)| RoughEdge::new([a, b], vec![nodes[a], by, nodes[b]], vec![1.0; 3]);
            let edges = edges.into_iter().map(edge).collect();
            RoughGraph { nodes, edges }
        })
    }

    fn lengths(graph: &RoughGraph) -> Vec<f64> {
        let mut lengths: Vec<f64> = graph.edges.iter().map(|e| e.length).collect();
        lengths.sort_by(f64::total_cmp);
        lengths
    }

    fn near(a: &[f64], b: &[f64]) -> bool {
        // Sums of a few lengths below 1000 px, in another order.
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    proptest! {
        #[test]
        fn what_is_left_may_stay_and_its_order_did_not_matter(given in graphs(), thickness in 1.0..8.0_f64) {
            let mut graph = given.clone();
            graph.simplify(thickness, &PARAMS);
            let spur = 0.8 * thickness + 1.0;
            let degree = |node: usize| {
                graph.edges.iter().flat_map(|e| e.ends).filter(|&end| end == node).count()
            };
            let longest = lengths(&graph).last().copied();
            prop_assert!(longest.is_some());
            for edge in &graph.edges {
                let [a, b] = edge.ends;
                let degrees = [degree(a), degree(b)];
                let alone = if a == b { degrees[0] == 2 } else { degrees == [1, 1] };
                let least = match (alone, a == b) {
                    (true, _) => 6.0_f64.min(longest.unwrap()),
                    (false, true) => 1.5 * spur,
                    (false, false) if degrees.contains(&1) => spur,
                    _ => 3.0,
                };
                prop_assert!(edge.length >= least, "{} of {:?}", edge.length, degrees);
                prop_assert!(a == b || !degrees.contains(&2), "{:?} could be merged", edge.ends);
                let (first, last) = (edge.points[0], edge.points[edge.points.len() - 1]);
                prop_assert_eq!([first, last], edge.ends.map(|node| graph.nodes[node]));
                prop_assert_eq!(edge.radii.len(), edge.points.len());
                let sum: f64 = edge.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
                prop_assert_eq!(edge.length, sum);
            }
            let mut again = graph.clone();
            again.simplify(thickness, &PARAMS);
            prop_assert_eq!(format!("{:?}", again), format!("{:?}", graph));
            let edges = given.edges.into_iter().rev().map(RoughEdge::reversed).collect();
            let mut other = RoughGraph { nodes: given.nodes, edges };
            other.simplify(thickness, &PARAMS);
            prop_assert!(near(&lengths(&other), &lengths(&graph)));
        }

        /// A body with teeth 20 px apart, farther than any tooth is long; a tooth may be a loop.
        #[test]
        fn of_a_comb_the_long_teeth_stay_and_the_body_is_one_between_them(
            teeth in prop::collection::vec((1.0..15.0_f64, any::<bool>()), 0..8), thickness in 1.0..12.0_f64,
        ) {
            let count = teeth.len();
            let foot = |k: usize| Point2::new(20.0 * k as f64, 0.0);
            let mut nodes: Vec<_> = (0..count + 2).map(foot).collect();
            let body = |k| RoughEdge::new([k, k + 1], vec![foot(k), foot(k + 1)], vec![1.0; 2]);
            let mut edges: Vec<_> = (0..=count).map(body).collect();
            let (mut expected, mut from) = (Vec::new(), 0);
            for (k, &(length, is_loop)) in (1..).zip(&teeth) {
                nodes.push(Point2::new(foot(k).x, length));
                let (end, to) = if is_loop { (k, foot(k)) } else { (count + 1 + k, nodes[count + 1 + k]) };
                let half = Point2::new(foot(k).x, 0.5 * length);
                edges.push(RoughEdge::new([k, end], vec![foot(k), half, to], vec![1.0; 3]));
                if length >= (0.8 * thickness + 1.0) * if is_loop { 1.5 } else { 1.0 } {
                    expected.extend([length, 20.0 * (k - from) as f64]);
                    from = k;
                }
            }
            expected.push(20.0 * (count + 1 - from) as f64);
            expected.sort_by(f64::total_cmp);
            let mut graph = RoughGraph { nodes, edges };
            graph.simplify(thickness, &PARAMS);
            prop_assert!(near(&lengths(&graph), &expected), "{:?} {:?}", lengths(&graph), expected);
        }
    }

    /// Straight edges from node 0: length, px, and direction, degrees.
    fn star(arms: &[(f64, f64)]) -> RoughGraph {
        let tip = |&(length, degrees): &(f64, f64)| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            Point2::new(length * cos, length * sin)
        };
        let nodes: Vec<_> = std::iter::once(Point2::origin()).chain(arms.iter().map(tip)).collect();
        let edge = |k: usize| RoughEdge::new([0, k], vec![nodes[0], nodes[k]], vec![1.0; 2]);
        RoughGraph { edges: (1..nodes.len()).map(edge).collect(), nodes }
    }

    #[test]
    fn of_two_equal_spurs_the_straighter_one_goes_on_the_body() {
        for (first, second, kept) in [(10.0, -60.0, [1, 2]), (-60.0, 10.0, [1, 3])] {
            let mut graph = star(&[(30.0, 180.0), (4.0, first), (4.0, second)]);
            graph.simplify(5.0, &PARAMS);
            let mut ends = graph.edges[0].ends;
            ends.sort_unstable();
            assert_eq!((graph.edges.len(), ends), (1, kept));
        }
    }

    #[test]
    fn junctions_less_than_3_px_apart_are_one_half_way() {
        for (apart, expected) in [(2.9, vec![1.45]), (3.1, vec![0.0, 3.1])] {
            let mut graph = star(&[(apart, 0.0), (30.0, 120.0), (30.0, 240.0)]);
            for end in [Point2::new(20.0, 20.0), Point2::new(20.0, -20.0)] {
                graph.nodes.push(end);
                let ends = [1, graph.nodes.len() - 1];
                graph.edges.push(RoughEdge::new(ends, vec![graph.nodes[1], end], vec![1.0; 2]));
            }
            graph.simplify(5.0, &PARAMS);
            let mut junctions: Vec<_> = graph.edges.iter().map(|e| e.points[0].x).collect();
            junctions.sort_by(f64::total_cmp);
            junctions.dedup();
            assert_eq!(junctions, expected);
        }
    }
}
