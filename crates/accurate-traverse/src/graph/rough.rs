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
