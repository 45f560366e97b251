use std::ops::Range;

use accurate_geom::{Pixel, View};

use crate::{CostModel, PixelPair};

/// At or below this distance, px, a point is on the epipolar line and stays where it is. It is far
/// below any measurement, far above rounding (about 1e-12 px for images of some 1000 px), and it
/// keeps every denominator of the operator away from 0.
pub const ON_LINE_PX: f64 = 1e-9;

/// Whether and how one-to-many matches are made unique by interpolation between neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum RefineRule {
    /// Every cell keeps its pixels.
    #[default]
    Off,
    /// The paper's operator R. It weights by unsigned distances, hence moves a point towards its
    /// neighbour even when both lie on the same side of the line, and then away from the zero.
    Paper,
    /// Ours: R where point and neighbour lie on opposite sides of the line (then it is the exact
    /// intersection), the point itself elsewhere. Never increases a distance.
    Signed,
}

/// Which runs of the path [`refine`] looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum RefineDirections {
    /// Runs with one point of view 1 for several points of view 2, as in the paper: the point of
    /// view 1 moves.
    Horizontal,
    /// Also runs with one point of view 2 for several of view 1, with the roles of the views
    /// exchanged: the point of view 2 moves. Horizontal first; a cell moved there is left alone.
    #[default]
    Both,
}

/// Turns the cells of a path into pairs of pixels, refined by the operator R: one pair per cell, in
/// the order of the path.
///
/// For a horizontal run `(i*, j1..=j2)` of at least two cells, `j*` is the first of its cells with
/// the least distance. The cell `j*` keeps `s_{i*}`; a cell before it moves towards `s_{i*-1}`, one
/// after it towards `s_{i*+1}`, to the zero of the distance linearly interpolated between the two.
/// The distances are those of the view whose point moves (view 1 for horizontal, view 2 for
/// vertical runs), whatever the kind of `costs`; with [`DistanceKind::View1`](crate::DistanceKind)
/// they are the paper's `D`.
///
/// A point stays where it is if it lies on the line within [`ON_LINE_PX`], if the neighbour does
/// not exist (curve ends), or if there is no line (epipole).
///
/// Cells of `path` must be indices into the curves of `costs`; others are left out.
///
/// # Source
/// ACCURATE, section 2.3, eq. of R. The paper leaves open zero denominators, curve ends, ties of
/// `j*` and vertical runs. Its set of refined pairs is unique for each point of view 2, not
/// one-to-one: several refined points may lie on one segment of view 1.
///
/// # Cost
/// O(length of the path).
pub fn refine(
    path: &[(usize, usize)],
    costs: &CostModel,
    rule: RefineRule,
    directions: RefineDirections,
) -> Vec<PixelPair> {
    let (curve1, curve2) = (costs.curve1(), costs.curve2());
    let inside = |&&(i, j): &&(usize, usize)| i < curve1.len() && j < curve2.len();
    let mut pairs: Vec<PixelPair> = path
        .iter()
        .filter(inside)
        .map(|&(i, j)| PixelPair { cell: (i, j), pixel1: curve1[i], pixel2: curve2[j] })
        .collect();
    if rule == RefineRule::Off {
        return pairs;
    }
    let path: Vec<_> = pairs.iter().map(|pair| pair.cell).collect();
    let mut moved = vec![false; path.len()];
    for run in horizontal_runs(&path) {
        let signed = |i: usize, k: usize| costs.signed_distance_in_view1(i, path[k].1);
        for (k, pixel) in moves(curve1, path[run.start].0, run, signed, rule) {
            moved[k] = pixel != pairs[k].pixel1;
            pairs[k].pixel1 = pixel;
        }
    }
    if directions == RefineDirections::Both {
        for run in vertical_runs(&path) {
            let signed = |j: usize, k: usize| costs.signed_distance_in_view2(path[k].0, j);
            for (k, pixel) in moves(curve2, path[run.start].1, run, signed, rule) {
                if !moved[k] {
                    pairs[k].pixel2 = pixel;
                }
            }
        }
    }
    pairs
}

/// The refined positions of the point `own[fixed]` over the cells `run` of the path.
/// `signed(n, k)` is the signed distance of `own[n]` to the line that belongs to cell `k`.
fn moves<V: View>(
    own: &[Pixel<V>],
    fixed: usize,
    run: Range<usize>,
    signed: impl Fn(usize, usize) -> Option<f64>,
    rule: RefineRule,
) -> Vec<(usize, Pixel<V>)> {
    let mut anchor = run.start;
    let mut least = f64::INFINITY;
    for k in run.clone() {
        let distance = signed(fixed, k).map_or(f64::INFINITY, f64::abs);
        if distance < least {
            (anchor, least) = (k, distance);
        }
    }
    let refined = |k: usize| {
        let neighbour = match k.cmp(&anchor) {
            std::cmp::Ordering::Less => fixed.checked_sub(1)?,
            std::cmp::Ordering::Equal => return None,
            std::cmp::Ordering::Greater => fixed + 1,
        };
        let towards = own.get(neighbour)?;
        interpolate(own[fixed], *towards, signed(fixed, k)?, signed(neighbour, k)?, rule)
    };
    run.map(|k| (k, refined(k).unwrap_or(own[fixed]))).collect()
}

/// `(d_from · to + d_to · from) / (d_from + d_to)` for unsigned distances: the zero between the two
/// points. `None` where `from` stays.
fn interpolate<V: View>(
    from: Pixel<V>,
    to: Pixel<V>,
    signed_from: f64,
    signed_to: f64,
    rule: RefineRule,
) -> Option<Pixel<V>> {
    let (d_from, d_to) = (signed_from.abs(), signed_to.abs());
    // The paper divides by the sum. Both are 0 on exact data and along lines that both curves
    // follow; with this guard the sum is above ON_LINE_PX.
    if d_from <= ON_LINE_PX {
        return None;
    }
    let opposite = d_to == 0.0 || (signed_from > 0.0) != (signed_to > 0.0);
    if rule == RefineRule::Signed && !opposite {
        return None;
    }
    let weight = d_from / (d_from + d_to);
    let pixel = Pixel::new(from.x + weight * (to.x - from.x), from.y + weight * (to.y - from.y));
    // Distances and differences of finite pixels may overflow; then there is nothing to gain here.
    pixel.is_finite().then_some(pixel)
}

/// Index ranges of the maximal runs of at least two cells with one `i`: one point of view 1 matched
/// with several of view 2.
pub fn horizontal_runs(path: &[(usize, usize)]) -> Vec<Range<usize>> {
    runs(path, |cell| cell.0)
}

/// Index ranges of the maximal runs of at least two cells with one `j`: one point of view 2 matched
/// with several of view 1.
pub fn vertical_runs(path: &[(usize, usize)]) -> Vec<Range<usize>> {
    runs(path, |cell| cell.1)
}

/// Cells of the longest horizontal or vertical run: how long one curve stood still while the other
/// went on. 1 if there is no run, 0 for an empty path. A long run means a hidden or lost stretch in
/// one view, or a stretch along an epipolar line.
pub fn longest_run(path: &[(usize, usize)]) -> usize {
    let runs = horizontal_runs(path).into_iter().chain(vertical_runs(path));
    runs.map(|run| run.len()).max().unwrap_or(path.len().min(1))
}

fn runs(path: &[(usize, usize)], key: impl Fn(&(usize, usize)) -> usize) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = 0;
    for cells in path.chunk_by(|a, b| key(a) == key(b)) {
        if cells.len() >= 2 {
            runs.push(start..start + cells.len());
        }
        start += cells.len();
    }
    runs
}
