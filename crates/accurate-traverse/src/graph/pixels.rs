//! Skeleton pixels to nodes and chains.

use accurate_geom::Point2;
use ndarray::Array2;

use super::rough::{RoughEdge, RoughGraph};

const NONE: u32 = u32::MAX;

/// Ring of the 8-neighbours: even entries share a side, odd ones a corner.
const RING: [(isize, isize); 8] =
    [(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)];

/// Adjacency of skeleton pixels: by a side, or by a corner if no pixel is next to both. A staircase
/// is then a path and the pixel of a T is the only one with three neighbours; turning or mirroring
/// the image changes nothing.
struct Pixels {
    at: Vec<(usize, usize)>,
    id: Array2<u32>,
}

impl Pixels {
    fn new(skeleton: &Array2<bool>) -> Self {
        let mut id = Array2::from_elem(skeleton.dim(), NONE);
        let mut at = Vec::new();
        for (index, &set) in skeleton.indexed_iter() {
            if set {
                id[index] = at.len() as u32;
                at.push(index);
            }
        }
        Self { at, id }
    }

    /// The 8-neighbours in ring order, `NONE` where there is none.
    fn ring(&self, pixel: u32) -> [u32; 8] {
        let (row, col) = self.at[pixel as usize];
        RING.map(|(down, right)| {
            let at = (row.wrapping_add_signed(down), col.wrapping_add_signed(right));
            self.id.get(at).copied().unwrap_or(NONE)
        })
    }

    fn neighbours(&self, pixel: u32) -> impl Iterator<Item = u32> {
        let ring = self.ring(pixel);
        (0..8).filter_map(move |k| {
            let beside = k % 2 == 1 && (ring[k - 1] != NONE || ring[(k + 1) % 8] != NONE);
            (ring[k] != NONE && !beside).then_some(ring[k])
        })
    }

    /// Whether the pixel is part of a full square of four.
    fn in_block(&self, pixel: u32) -> bool {
        let ring = self.ring(pixel);
        (1..8).step_by(2).any(|k| [k - 1, k, (k + 1) % 8].iter().all(|&j| ring[j] != NONE))
    }
}

/// Nodes are tips and clusters of branching pixels, edges the chains between them. A chain without
/// a node gets one at its first pixel. Pixels on their own are left out.
pub(super) fn trace(skeleton: &Array2<bool>, radii: &Array2<f64>) -> RoughGraph {
    let pixels = Pixels::new(skeleton);
    let count = pixels.at.len();
    let mut node_of = vec![NONE; count];
    let mut nodes: Vec<Point2> = Vec::new();

    let degree: Vec<usize> = (0..count as u32).map(|p| pixels.neighbours(p).count()).collect();
    let branches: Vec<bool> =
        (0..count as u32).map(|p| degree[p as usize] >= 3 || pixels.in_block(p)).collect();
    for seed in 0..count as u32 {
        if !branches[seed as usize] || node_of[seed as usize] != NONE {
            continue;
        }
        let node = nodes.len() as u32;
        let mut cluster = vec![seed];
        node_of[seed as usize] = node;
        let mut next = 0;
        while let Some(&pixel) = cluster.get(next) {
            next += 1;
            for near in pixels.neighbours(pixel) {
                if branches[near as usize] && node_of[near as usize] == NONE {
                    node_of[near as usize] = node;
                    cluster.push(near);
                }
            }
        }
        let sum = cluster.iter().fold((0.0, 0.0), |sum, &p| {
            let (row, col) = pixels.at[p as usize];
            (sum.0 + col as f64, sum.1 + row as f64)
        });
        let n = cluster.len() as f64;
        nodes.push(Point2::new(sum.0 / n, sum.1 / n));
    }
    let position = |pixel: u32| {
        let (row, col) = pixels.at[pixel as usize];
        Point2::new(col as f64, row as f64)
    };
    for pixel in 0..count as u32 {
        if degree[pixel as usize] == 1 && node_of[pixel as usize] == NONE {
            node_of[pixel as usize] = nodes.len() as u32;
            nodes.push(position(pixel));
        }
    }

    let radius = |pixel: u32| radii[pixels.at[pixel as usize]];
    let mut edges = Vec::new();
    let mut used = vec![false; count];
    // From a node's pixel along a chain to the next node.
    let follow = |from: u32, first: u32, used: &mut Vec<bool>| {
        let mut path = vec![from, first];
        let (mut before, mut here) = (from, first);
        while node_of[here as usize] == NONE {
            used[here as usize] = true;
            let Some(next) = pixels.neighbours(here).find(|&p| p != before) else { break };
            (before, here) = (here, next);
            path.push(here);
        }
        path
    };
    let edge = |path: &[u32], a: u32, b: u32| {
        let (mut points, mut radii): (Vec<_>, Vec<_>) =
            path.iter().map(|&p| (position(p), radius(p))).unzip();
        points.insert(0, nodes[a as usize]);
        points.push(nodes[b as usize]);
        radii.insert(0, radii[0]);
        radii.push(radii[radii.len() - 1]);
        RoughEdge::new([a as usize, b as usize], points, radii)
    };
    for pixel in 0..count as u32 {
        let node = node_of[pixel as usize];
        if node == NONE {
            continue;
        }
        for near in pixels.neighbours(pixel) {
            let other = node_of[near as usize];
            if other == NONE {
                if !used[near as usize] {
                    let path = follow(pixel, near, &mut used);
                    edges.push(edge(&path, node, node_of[path[path.len() - 1] as usize]));
                }
            } else if other != node && pixel < near {
                edges.push(edge(&[pixel, near], node, other));
            }
        }
    }
    // What is left are closed chains.
    for pixel in 0..count as u32 {
        if node_of[pixel as usize] != NONE || used[pixel as usize] || degree[pixel as usize] == 0 {
            continue;
        }
        let mut path = vec![pixel];
        used[pixel as usize] = true;
        while let Some(next) = pixels.neighbours(path[path.len() - 1]).find(|&p| !used[p as usize])
        {
            used[next as usize] = true;
            path.push(next);
        }
        path.push(pixel);
        let (points, radii) = path.iter().map(|&p| (position(p), radius(p))).unzip();
        nodes.push(position(pixel));
        let node = nodes.len() - 1;
        edges.push(RoughEdge::new([node, node], points, radii));
    }
    RoughGraph { nodes, edges }
}
