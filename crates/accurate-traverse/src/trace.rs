use accurate_geom::{Pixel, View};

use crate::skeleton::Skeleton;

/// A step of a trace that is longer than the distance of neighbouring pixels explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// The step leads from point `index` to point `index + 1`.
    pub index: usize,
    /// Euclidean length, px.
    pub length_px: f64,
}

/// The pixels of one view in order along the body, and how far to trust the order.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace<V: View> {
    /// Skeleton pixels in order, each at most once; never empty.
    pub points: Vec<Pixel<V>>,
    /// Part of the skeleton pixels that are visited or within 1.5 px of a visited one, in (0, 1].
    pub coverage: f64,
    /// Steps longer than [`Trace::JUMP_PX`], in order.
    pub jumps: Vec<Jump>,
    /// Those of `jumps` that connect different 8-connected pieces of the skeleton: the body is
    /// hidden there. The other jumps stay on one piece, so the walk left the body: distrust them.
    pub gaps: Vec<Jump>,
    /// Skeleton pixels that were not visited.
    pub left: usize,
}

impl<V: View> Trace<V> {
    /// A step longer than this is a jump, px. Pixels passed over by a shorter straight step lie
    /// within 1.5 px of its ends, so only a jump can lose a part of the body.
    pub const JUMP_PX: f64 = 3.0;

    pub(crate) fn new(skeleton: &Skeleton<V>, order: &[usize]) -> Self {
        let mut visited = vec![false; skeleton.len()];
        for &id in order {
            visited[id] = true;
        }
        // Between whole coordinates, "within 1.5 px" and "8-neighbour or same" are one.
        let covered = (0..skeleton.len())
            .filter(|&id| visited[id] || skeleton.square(id, 1).any(|near| visited[near]))
            .count();
        let points: Vec<_> = order.iter().map(|&id| skeleton.pixel(id)).collect();
        let piece = skeleton.pieces();
        let mut jumps = Vec::new();
        let mut gaps = Vec::new();
        for (index, step) in points.windows(2).enumerate() {
            let length_px = step[0].distance(step[1]);
            if length_px > Self::JUMP_PX {
                let jump = Jump { index, length_px };
                jumps.push(jump);
                if piece[order[index]] != piece[order[index + 1]] {
                    gaps.push(jump);
                }
            }
        }
        Self {
            coverage: covered as f64 / skeleton.len() as f64,
            jumps,
            gaps,
            left: skeleton.len() - points.len(),
            points,
        }
    }

    /// Length of the polyline through the points, px.
    pub fn length_px(&self) -> f64 {
        self.points.windows(2).map(|step| step[0].distance(step[1])).sum()
    }
}
