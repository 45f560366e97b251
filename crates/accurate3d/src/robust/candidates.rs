use std::borrow::Cow;

use accurate_fit::Outline;
use accurate_geom::{Pixel, View};
use accurate_match::{FreeEnds, SignalCurve};
use accurate_seg::{
    GapHint, GapParams, Mask, distance_to_background, gap_hints, median_width_px, zhang_suen,
};
use accurate_traverse::{
    GraphEdge, GraphParams, HalfEdge, NodeKind, PointFlags, SkeletonGraph, Walk, WalkEnd,
    WalkParams, fill_small_holes, k_best_walks_with_reward,
};
use ndarray::{Array2, Axis, Slice};

use super::frame::{Frame, Turn};
use crate::explanation::Alternative;
use crate::{Error, JunctionDecision};

/// Background kept around the body when the image is cut down to it, px.
const MARGIN_PX: usize = 3;

/// Everything that one view says: its outline, and the walks that could be the body.
pub(crate) struct ViewCandidates<V: View> {
    pub(crate) outline: Outline<V>,
    pub(crate) walks: Vec<Walk<V>>,
    /// Bridges over what was not seen, as straight stretches.
    pub(crate) bridges: Vec<(Pixel<V>, Pixel<V>)>,
    /// In the frame of the cut and turned image.
    graph: SkeletonGraph<V>,
    frame: Frame,
    /// Both ends of every gap that the probability map leads over.
    hinted_ends: Vec<[f64; 2]>,
}

impl<V: View> ViewCandidates<V> {
    /// # Errors
    /// [`Error::Segmentation`], [`Error::Traversal`] or [`Error::Fitting`] for a mask that shows no
    /// curve.
    pub(crate) fn of(
        array: &Array2<bool>,
        probability: Option<&Array2<f32>>,
        params: &WalkParams,
        turn: Turn,
        case: &str,
    ) -> Result<Self, Error> {
        let segmentation =
            |source| Error::Segmentation { case: case.to_owned(), view: V::NUMBER, source };
        let traversal = |source| Error::Traversal { case: case.to_owned(), source };
        let fitting = |source| Error::Fitting { case: case.to_owned(), source };
        let whole = Mask::from_array(array.clone()).map_err(segmentation)?;
        whole.require_thin_body().map_err(segmentation)?;
        let outline = match probability {
            Some(map) => Outline::from_probability(map.view(), array.view()),
            None => Outline::from_mask(array.view()),
        }
        .map_err(fitting)?;

        let hints = match probability {
            Some(map) => gap_hints(map, &whole, &GapParams::DEFAULT).map_err(segmentation)?,
            None => Vec::new(),
        };
        let mut shown = Cow::Borrowed(array);
        if !hints.is_empty() {
            // The graph alone walks over hints; the fit judges by what the map shows.
            let half_px = 0.5 * median_width_px(&whole).map_err(segmentation)?;
            let drawn = shown.to_mut();
            hints.iter().for_each(|hint| draw(drawn, hint, half_px));
        }
        let (cut, origin) = cut_to_body(&shown);
        let frame = Frame::new(turn, origin, &cut);
        let mask = Mask::from_array(turn.array(&cut)).map_err(segmentation)?;
        let mut thin = zhang_suen(&mask);
        let mut radii = distance_to_background(&mask).map_err(segmentation)?;
        let thickness = median_width(&thin, &radii);
        // The holes of near-tangent overlaps would make dozens of nodes; only the graph loses them,
        // the fit sees the mask as it is.
        let filled = fill_small_holes(mask.as_array(), GraphParams::hole_area_px(thickness));
        if filled != *mask.as_array() {
            let filled = Mask::from_array(filled).map_err(segmentation)?;
            thin = zhang_suen(&filled);
            radii = distance_to_background(&filled).map_err(segmentation)?;
        }
        let graph = SkeletonGraph::new(thin.as_array(), &radii, thickness, &GraphParams::DEFAULT)
            .map_err(traversal)?;
        let mut bridges: Vec<_> = graph
            .edges()
            .iter()
            .filter(|edge| edge.link)
            .flat_map(|edge| {
                edge.points.windows(2).map(|w| (w[0], w[1])).chain(hidden_turn(&graph, edge))
            })
            .map(|(a, b)| (frame.in_image(a), frame.in_image(b)))
            .collect();
        let mut hinted_ends = Vec::new();
        for hint in &hints {
            let line = stations::<V>(hint);
            hinted_ends.extend(line.first().iter().chain(&line.last()).map(|p| [p.x, p.y]));
            bridges.extend(line.windows(2).map(|w| (w[0], w[1])));
        }
        let mut view = Self { outline, walks: Vec::new(), bridges, graph, frame, hinted_ends };
        view.walk(params, &[], case)?;
        Ok(view)
    }

    /// Tips of the skeleton.
    pub(crate) fn tips(&self) -> usize {
        self.graph.nodes().iter().filter(|node| node.kind == NodeKind::Tip).count()
    }

    /// Adds the walks that want to pass twice near the `rewards` (positions and weights); those
    /// that are there already stay where they are.
    pub(crate) fn walk(
        &mut self,
        params: &WalkParams,
        rewards: &[([f64; 2], f64)],
        case: &str,
    ) -> Result<(), Error> {
        let rewards: Vec<_> =
            rewards.iter().map(|&([x, y], w)| (self.frame.in_part(Pixel::new(x, y)), w)).collect();
        let mut walks = k_best_walks_with_reward(&self.graph, params, &rewards)
            .map_err(|source| Error::Traversal { case: case.to_owned(), source })?;
        walks.retain(|walk| self.walks.iter().all(|known| known.halves != walk.halves));
        for walk in &mut walks {
            // What a walk is worth without the reward.
            walk.cost.missed_reward = 0.0;
            for point in &mut walk.points {
                *point = self.frame.in_image(*point);
            }
        }
        self.walks.append(&mut walks);
        Ok(())
    }

    /// Adds the walks that are best where turning round at a tip is dear, at what they are worth where it
    /// is not.
    pub(crate) fn walk_without_turning(
        &mut self,
        params: &WalkParams,
        case: &str,
    ) -> Result<(), Error> {
        const DEARER: f64 = 2.0;
        let known = self.walks.len();
        self.walk(&WalkParams { u_turn: params.u_turn + DEARER, ..*params }, &[], case)?;
        for k in known..self.walks.len() {
            let turns = self.turns_at_tips(&self.walks[k]);
            self.walks[k].cost.u_turns -= DEARER * turns as f64;
        }
        Ok(())
    }

    fn turns_at_tips(&self, walk: &Walk<V>) -> usize {
        let turns = |pair: &[HalfEdge]| {
            let [half, next] = [pair[0], pair[1]];
            let node = self.graph.edges()[half.edge].ends[usize::from(!half.reversed)];
            half.edge == next.edge
                && half.reversed != next.reversed
                && self.graph.nodes()[node].kind == NodeKind::Tip
        };
        walk.halves.windows(2).filter(|pair| turns(pair)).count()
    }

    /// Where a walk takes bridges, and where the map leads over gaps: both ends of each.
    pub(crate) fn cut_ends(&self, walk: usize) -> Vec<[f64; 2]> {
        let edges = self.graph.edges();
        self.walks[walk]
            .halves
            .iter()
            .map(|half| &edges[half.edge])
            .filter(|edge| edge.link)
            .flat_map(|edge| [edge.points.first(), edge.points.last()])
            .flatten()
            .map(|p| self.frame.in_image(*p))
            .map(|p| [p.x, p.y])
            .chain(self.hinted_ends.iter().copied())
            .collect()
    }

    /// What a walk did where it could have gone on otherwise; places in the image that this view's lies
    /// in as the frame says.
    pub(crate) fn junctions(&self, walk: usize, given: &Frame) -> Vec<JunctionDecision> {
        let way = |half: &HalfEdge| self.way(half, given);
        self.walks[walk]
            .decisions
            .iter()
            .filter(|decision| !decision.alternatives.is_empty())
            .map(|decision| (given.in_image(self.frame.in_image(decision.at)), decision))
            .map(|(at, decision)| JunctionDecision {
                at: [at.x, at.y],
                taken: way(&decision.left_along),
                price: decision.price,
                // Where turning round is not allowed at all, it is no alternative.
                alternatives: decision
                    .alternatives
                    .iter()
                    .filter(|(_, price)| price.is_finite())
                    .map(|(half, price)| Alternative { way: way(half), price: *price })
                    .collect(),
            })
            .collect()
    }

    /// A half-edge in words: where it has led after a few pixels.
    fn way(&self, half: &HalfEdge, given: &Frame) -> String {
        const AHEAD: usize = 10;
        let points = &self.graph.edges()[half.edge].points;
        let last = points.len().saturating_sub(1);
        let at = if half.reversed { last.saturating_sub(AHEAD) } else { AHEAD.min(last) };
        match points.get(at).map(|p| given.in_image(self.frame.in_image(*p))) {
            Some(p) => format!("to {:.0}, {:.0}", p.x, p.y),
            None => format!("along edge {}", half.edge),
        }
    }

    /// The walks from number `from` on as candidates for pairing.
    pub(crate) fn signals(&self, from: usize) -> Vec<SignalCurve<'_, V>> {
        self.walks[from..]
            .iter()
            .map(|walk| SignalCurve {
                points: &walk.points,
                cost: walk.cost.total(),
                free: free_ends(walk),
                doubled_px: doubled_px(walk),
            })
            .collect()
    }
}

/// Where the body may turn out of sight: straight on from both ends of a link whose strands run side
/// by side, and across. A hairpin's turn hidden by something lies farther off than the link.
fn hidden_turn<V: View>(
    graph: &SkeletonGraph<V>,
    link: &GraphEdge<V>,
) -> Vec<(Pixel<V>, Pixel<V>)> {
    /// No farther ahead, px: what hides the body hides no more of it.
    const AHEAD_PX: f64 = 14.0;
    /// Over so many points the direction of an end is taken.
    const OVER: usize = 10;
    /// Strands that point away from each other, by this cosine and less, are joined by the link itself.
    const APART: f64 = -0.3;
    let ahead = |node: usize| {
        let mut strands =
            graph.edges().iter().filter(|edge| !edge.link && edge.ends.contains(&node));
        let (strand, None) = (strands.next()?, strands.next()) else { return None };
        let side = usize::from(strand.ends[0] != node);
        let (tip, before) = (strand.near_end(side, 0), strand.near_end(side, OVER));
        (tip - before).try_normalize(0.0).map(|way| (tip, way))
    };
    let (Some((tip1, way1)), Some((tip2, way2))) = (ahead(link.ends[0]), ahead(link.ends[1]))
    else {
        return Vec::new();
    };
    if way1.dot(&way2) < APART {
        return Vec::new();
    }
    let (far1, far2) = (tip1 + way1 * AHEAD_PX, tip2 + way2 * AHEAD_PX);
    [(tip1, far1), (tip2, far2), (far1, far2), (tip1, far2), (far1, tip2)]
        .map(|(from, to)| (from.into(), to.into()))
        .to_vec()
}

/// A hint as a polyline with a vertex every few pixels, in the whole image.
fn stations<V: View>(hint: &GapHint) -> Vec<Pixel<V>> {
    const EVERY: usize = 6;
    let last = hint.path.len().saturating_sub(1);
    (0..=last)
        .step_by(EVERY)
        .filter(|k| last - k >= EVERY || *k == 0)
        .chain([last])
        .map(|k| Pixel::new(hint.path[k].1 as f64, hint.path[k].0 as f64))
        .collect()
}

/// Draws the body over a gap into the mask.
fn draw(mask: &mut Array2<bool>, hint: &GapHint, half_px: f64) {
    let reach = half_px.ceil() as isize;
    for &(row, column) in &hint.path {
        let (y, x) = (row as isize, column as isize);
        for (dy, dx) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dy, dx))) {
            let near = ((dy * dy + dx * dx) as f64).sqrt() <= half_px;
            let at = (usize::try_from(y + dy), usize::try_from(x + dx));
            if let (true, (Ok(y), Ok(x))) = (near, at)
                && let Some(pixel) = mask.get_mut([y, x])
            {
                *pixel = true;
            }
        }
    }
}

/// The part of the image that shows the body, and its first column and row.
pub(crate) fn cut_to_body(array: &Array2<bool>) -> (Array2<bool>, [f64; 2]) {
    let (rows, columns) = array.dim();
    let (mut top, mut bottom, mut left, mut right) = (rows, 0, columns, 0);
    for (y, row) in array.rows().into_iter().enumerate() {
        // Most rows are empty or begin in vain: without a branch for each pixel first.
        if !row.iter().fold(false, |any, set| any | set) {
            continue;
        }
        let mut set = row.iter().enumerate().filter(|(_, set)| **set).map(|(x, _)| x);
        if let Some(first) = set.next() {
            (top, bottom) = (top.min(y), bottom.max(y));
            (left, right) = (left.min(first), right.max(set.next_back().unwrap_or(first)));
        }
    }
    let (top, left) = (top.saturating_sub(MARGIN_PX), left.saturating_sub(MARGIN_PX));
    let (bottom, right) =
        ((bottom + 1 + MARGIN_PX).min(rows), (right + 1 + MARGIN_PX).min(columns));
    let band = array.slice_axis(Axis(0), Slice::from(top..bottom));
    let cut = band.slice_axis(Axis(1), Slice::from(left..right)).to_owned();
    (cut, [left as f64, top as f64])
}

/// As [`accurate_seg::median_width_px`], from what is at hand.
fn median_width(thin: &Mask, radii: &Array2<f64>) -> f64 {
    let mut on_skeleton: Vec<f64> = thin.foreground().map(|at| radii[at]).collect();
    on_skeleton.sort_unstable_by(f64::total_cmp);
    let n = on_skeleton.len();
    // Thinning never erases a component.
    if n == 0 { 1.0 } else { on_skeleton[n / 2] + on_skeleton[(n - 1) / 2] - 1.0 }
}

/// How much of a walk's ends may be wrong: a tip on an edge that is used twice lies anywhere on it,
/// a walk that ends at a junction may be off by its node.
pub(crate) fn free_ends<V: View>(walk: &Walk<V>) -> FreeEnds {
    const JUNCTION_PX: f64 = 4.0;
    let free = |end: WalkEnd, flags: &mut dyn Iterator<Item = &PointFlags>| match end {
        WalkEnd::Tip | WalkEnd::Closed => 0.0,
        WalkEnd::Junction => JUNCTION_PX,
        WalkEnd::OnReusedEdge => flags.take_while(|f| f.reused).count() as f64 * spacing_px(walk),
    };
    let begin_px = free(walk.ends[0], &mut walk.flags.iter());
    FreeEnds { begin_px, end_px: free(walk.ends[1], &mut walk.flags.iter().rev()) }
}

/// The length that a walk passes twice, px.
fn doubled_px<V: View>(walk: &Walk<V>) -> f64 {
    0.5 * walk.flags.iter().filter(|flag| flag.reused).count() as f64 * spacing_px(walk)
}

fn spacing_px<V: View>(walk: &Walk<V>) -> f64 {
    walk.length_px() / (walk.points.len().max(2) - 1) as f64
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;

    use super::*;

    /// The top of an arch, where the map is faint, lies outside of what the mask shows.
    #[test]
    fn a_gap_at_the_outermost_bend_is_walked_over() {
        const CENTRE: f64 = 60.0;
        const RADIUS: f64 = 30.0;
        const GAP_RAD: f64 = 0.8;
        let body = |row: usize, column: usize| {
            let (x, y) = (column as f64 - CENTRE, row as f64 - CENTRE);
            let (off, from_top) = if y > 0.0 {
                (x.abs() - RADIUS, std::f64::consts::FRAC_PI_2)
            } else {
                (x.hypot(y) - RADIUS, x.abs().atan2(-y))
            };
            (off.abs() <= 1.5 && row <= 100).then_some(from_top < GAP_RAD)
        };
        let shape = (120, 120);
        let map = Array2::from_shape_fn(shape, |(row, column)| match body(row, column) {
            None => 0.0,
            Some(true) => 0.2_f32,
            Some(false) => 0.9,
        });
        let mask = map.mapv(|p| p > 0.5);
        let view = ViewCandidates::<View1>::of(
            &mask,
            Some(&map),
            &WalkParams::DEFAULT,
            Turn::NONE,
            "arch",
        )
        .unwrap();
        let top = Pixel::new(CENTRE, CENTRE - RADIUS);
        let passes = |walk: &Walk<View1>| {
            let ends = [walk.points[0], walk.points[walk.points.len() - 1]];
            walk.points.iter().any(|p| p.distance(top) < 2.0) && ends.iter().all(|p| p.y > 95.0)
        };
        assert!(view.walks.iter().any(passes), "{}", view.walks.len());
    }

    /// A ring on a stem: whatever the price of a turn while walks are sought, the same walk costs the
    /// same, those that turn at the stem's tip among them.
    #[test]
    fn a_walk_is_worth_the_same_however_it_was_found() {
        let on_ring = |x: f64, y: f64| (x.hypot(y) - 30.0).abs() <= 1.5;
        let on_stem = |x: f64, y: f64| x.abs() <= 1.5 && (28.0..=90.0).contains(&y);
        let mask = Array2::from_shape_fn((180, 120), |(row, column)| {
            let (x, y) = (column as f64 - 60.0, row as f64 - 60.0);
            on_ring(x, y) || on_stem(x, y)
        });
        let view = |params: &WalkParams| {
            ViewCandidates::<View1>::of(&mask, None, params, Turn::NONE, "ring").unwrap()
        };
        let usual = view(&WalkParams::DEFAULT);
        let mut found = view(&WalkParams { walks: 1, ..WalkParams::DEFAULT });
        found.walk_without_turning(&WalkParams::DEFAULT, "ring").unwrap();
        let mut turned = 0;
        for walk in &usual.walks {
            let Some(again) = found.walks.iter().find(|w| w.halves == walk.halves) else {
                continue;
            };
            let (once, twice) = (walk.cost.total(), again.cost.total());
            assert!((once - twice).abs() < 1e-12, "{once} {twice} {:?}", walk.halves);
            turned += found.turns_at_tips(again);
        }
        assert!(turned > 0);
        // And what does not turn comes first.
        assert_eq!(found.turns_at_tips(&found.walks[1]), 0);
    }
}
