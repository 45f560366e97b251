use accurate_geom::nalgebra::Vector2;

use crate::outline_problem::{Evaluation, OutlineProblem};

/// How well a curve explains both outlines.
///
/// At the truth, `unexplained = outside = 0` and [`Judgement::chi_per_point`] is 1/18 px²: the
/// midpoint of two neighbouring pixels is off along their axis by U(-1/2, 1/2) px, so off the outline
/// by that times `|n|`, the axis' share of the normal; a line meets such pairs in proportion to
/// `|n|`, and `mean of |cos|³ / mean of |cos| / 12 = (2/3) / 12 = 1/18`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judgement {
    /// Outline that the curve does not explain: each boundary point's misfit beyond 0.8 px, at most
    /// 4, times how sure a probability map is of the body there, summed and divided by 10 px. Zero at
    /// the truth.
    pub unexplained: f64,
    /// Curve that the masks do not show: the distance outside beyond 1 px, at most 4, times how sure
    /// a probability map is that there is no body, summed along the body in steps that are 1 px long on
    /// average in each view, and divided by 10 px: a stretch towards the camera counts like any other.
    /// Zero at the truth.
    pub outside: f64,
    /// Sum of squared residuals, each at most 4 px², of the boundary points used; those of a
    /// probability map in units of 1/18 px² per variance of the point.
    pub chi: f64,
    /// Boundary points used, by view.
    pub used: [usize; 2],
    /// Boundary points, by view.
    pub points: [usize; 2],
    /// The largest mean of squared residuals, each at most 4 px², over five knot spans in either view:
    /// a stretch that follows the wrong strand shows here before it shows in the sum.
    pub worst_chi_per_point: f64,
    /// `∫ κ² ds`, 1/px.
    pub bending: f64,
}

impl Judgement {
    /// `chi` per used point, px²: about 1/18 for a right curve on a rendered mask. 4 (the largest
    /// possible) if no point is used.
    pub fn chi_per_point(&self) -> f64 {
        let used = self.used[0] + self.used[1];
        if used == 0 { 4.0 } else { self.chi / used as f64 }
    }

    /// Boundary points of both views.
    pub fn boundary_points(&self) -> usize {
        self.points[0] + self.points[1]
    }

    /// [`unexplained`](Self::unexplained) in parts of what a curve far from all of the outlines leaves: 0
    /// to 1.
    pub fn unexplained_share(&self) -> f64 {
        self.unexplained / (MOST_EXCESS_PX / 10.0 * self.boundary_points().max(1) as f64)
    }

    /// One number, smaller is better, to compare fits to the same outlines:
    /// `unexplained + outside + chi / 2 + 5 bending`.
    pub fn score(&self) -> f64 {
        self.unexplained + self.outside + 0.5 * self.chi + 5.0 * self.bending
    }
}

/// A connected stretch of outline that the fitted curve does not explain.
#[derive(Debug, Clone, PartialEq)]
pub struct UnexplainedStretch {
    /// 1 or 2.
    pub view: u8,
    /// The boundary points, `[x, y]`, px.
    pub points: Vec<[f64; 2]>,
    /// Their share of [`Judgement::unexplained`].
    pub unexplained: f64,
    /// Whether no explained outline is near: a piece by itself.
    pub isolated: bool,
    /// Whether the outline was read off a probability map.
    pub from_map: bool,
}

/// The misfit of an outline point counts no more than this, px.
const MOST_EXCESS_PX: f64 = 4.0;

/// Misfit of outline point `i` beyond what digitisation explains, px, as far as the body is sure
/// there.
fn excess(problem: &OutlineProblem<'_>, e: &Evaluation, view: usize, i: usize) -> f64 {
    let trust = problem.outlines[view].map.as_ref().map_or(1.0, |map| map.trust[i]);
    trust * (residual(e, view, i).abs() - 0.8).clamp(0.0, MOST_EXCESS_PX)
}

/// Residual of outline point `i` against the nearest point of the curve, whatever the gates say.
fn residual(e: &Evaluation, view: usize, i: usize) -> f64 {
    e.nearest[view].squared()[i].sqrt() - e.state.half_px[view]
}

/// `e` must have been evaluated with stride 1.
pub(crate) fn judge(problem: &OutlineProblem<'_>, e: &Evaluation) -> Judgement {
    let mut unexplained = 0.0;
    let mut outside = 0.0;
    let mut points = [0; 2];
    for view in 0..2 {
        points[view] = e.nearest[view].len();
        for i in 0..points[view] {
            unexplained += excess(problem, e, view, i) / 10.0;
        }
        let chords = &e.chords[view];
        let step_px = chords.length_px() / (chords.points.len() - 1) as f64;
        for p in &chords.points {
            if let Some((distance, _)) = problem.outside(view, p) {
                let doubt = problem.doubt(view, p);
                outside += doubt * (distance - 1.0).clamp(0.0, 4.0) / 10.0 * step_px;
            }
        }
    }
    let mut chi = 0.0;
    let mut used = [0; 2];
    let mut by_span = [(); 2].map(|()| vec![(0.0, 0usize); e.state.spline.spans()]);
    for row in e.rows.iter().filter(|row| row.passes && !row.outside) {
        let r = row.distance - e.state.half_px[row.view];
        // Points of a map differ in what they are worth; those of a mask differ by direction only.
        let worth = if problem.outlines[row.view].map.is_some() { row.precision } else { 1.0 };
        let squared = (worth * r * r).min(4.0);
        chi += squared;
        used[row.view] += 1;
        let (sum, count) = &mut by_span[row.view][row.span];
        *sum += squared;
        *count += 1;
    }
    let bending = e.state.spline.bending() / problem.px_per_unit;
    let worst_chi_per_point = by_span.iter().map(|spans| worst_window(spans)).fold(0.0, f64::max);
    Judgement { unexplained, outside, chi, used, points, worst_chi_per_point, bending }
}

/// The largest mean over five spans in a row, given the sum and the number of each; windows of a few
/// points do not count.
fn worst_window(spans: &[(f64, usize)]) -> f64 {
    const SPANS: usize = 5;
    const FEWEST: usize = 20;
    let mean = |window: &[(f64, usize)]| {
        let (sum, count) = window.iter().fold((0.0, 0), |(s, n), w| (s + w.0, n + w.1));
        if count < FEWEST { 0.0 } else { sum / count as f64 }
    };
    spans.windows(SPANS.min(spans.len().max(1))).map(mean).fold(0.0, f64::max)
}

/// Clusters of boundary points with a misfit beyond 0.8 px; points within 3 px are one cluster.
/// Longest first.
pub(crate) fn unexplained_stretches(
    problem: &OutlineProblem<'_>,
    e: &Evaluation,
) -> Vec<UnexplainedStretch> {
    const LINK_PX: f64 = 3.0;
    let mut stretches = Vec::new();
    for view in 0..2 {
        let outline = problem.outlines[view];
        let mut open: Vec<bool> =
            (0..outline.points.len()).map(|i| excess(problem, e, view, i) > 0.0).collect();
        let unexplained = open.clone();
        let mut queue = Vec::new();
        for seed in 0..open.len() {
            if !open[seed] {
                continue;
            }
            open[seed] = false;
            queue.push(seed);
            let mut stretch = UnexplainedStretch {
                view: view as u8 + 1,
                points: Vec::new(),
                unexplained: 0.0,
                isolated: true,
                from_map: outline.map.is_some(),
            };
            while let Some(i) = queue.pop() {
                let [x, y, ..] = outline.points[i];
                stretch.points.push([x, y]);
                stretch.unexplained += excess(problem, e, view, i) / 10.0;
                let bounds = [x - LINK_PX, y - LINK_PX, x + LINK_PX, y + LINK_PX];
                outline.grid.for_box(bounds, |range| {
                    for j in range {
                        let [qx, qy, ..] = outline.points[j];
                        if (Vector2::new(qx - x, qy - y)).norm() > LINK_PX {
                            continue;
                        }
                        stretch.isolated &= unexplained[j];
                        if open[j] {
                            open[j] = false;
                            queue.push(j);
                        }
                    }
                });
            }
            stretches.push(stretch);
        }
    }
    stretches.sort_by(|a, b| b.unexplained.total_cmp(&a.unexplained));
    stretches
}
