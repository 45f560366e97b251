use accurate_fit::side_by_side;
use accurate_geom::nalgebra::Vector2;
use accurate_geom::{Camera, Curve3, Point2, Point3, Rig};

use super::fitting::PLAIN;
use super::score::Candidate;
use super::search::Search;
use super::shape::{dense, image_of, px_per_unit};
use super::start::through;

/// A hairpin turns by more than this cosine ...
const TURN: f64 = -0.4;
/// ... between stretches of this length before and after it, px.
const ARM_PX: usize = 6;
/// What is left of a curve that is cut at its hairpins is tried if it is at least this part of it.
const LEAST_PART: f64 = 0.25;
/// Pieces of one curve that are tried, the longest first.
const MOST_PIECES: usize = 3;

/// Radius of the sharpest bend that a wire takes without a kink, px: wires in pictures are some 2 px wide,
/// and the J tips of the generated ones bend at 4 px.
const LEAST_RADIUS_PX: f64 = 4.0;
/// What a radian of turn costs that is sharper than a wire bends, of images.
pub(super) const KINKS: f64 = 4.0;
/// Turns this much sharper than a wire bends call for a harder look, radians; alone they are no reason for
/// doubt: of pictures of `medium` one in twenty right curves has them.
pub(super) const KINKED: f64 = 0.7;
/// What a px costs along which a curve runs back over itself in both views, of images: more than the outline
/// of something else that a curve without it leaves unexplained.
pub(super) const DOUBLED: f64 = 1.0;
/// So many of them cost nothing: of 340 curves of the generated families one is doubled by more.
pub(super) const DOUBLED_PX: f64 = 12.0;

/// How a curve turns where hardly any body does.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turns {
    /// By how much in all where it bends more sharply than the radius of 4 px allows, radians: a half turn
    /// within a pixel or two counts nearly in full.
    pub(crate) kinks: f64,
    /// Length along which it lies upon itself in both views and runs back, px: a body may in one view, but
    /// hardly in both.
    pub(crate) doubled_px: f64,
}

impl Turns {
    /// Kinks are 0 where they have no price.
    pub(crate) fn of(curve: &Curve3, rig: &Rig, [kink_weight, _]: [f64; 2]) -> Self {
        let points = dense(curve, rig);
        Self {
            kinks: if kink_weight > 0.0 { kinks(&points, rig) } else { 0.0 },
            doubled_px: doubled_px(&points, rig),
        }
    }

    /// At these prices of a radian and of a px.
    pub(crate) fn price(self, [kink_weight, doubled_weight]: [f64; 2]) -> f64 {
        kink_weight * self.kinks + doubled_weight * (self.doubled_px - DOUBLED_PX).max(0.0)
    }

    pub(crate) fn are_back(self) -> bool {
        self.kinks > KINKED || self.doubled_px > DOUBLED_PX
    }
}

impl Search<'_> {
    /// The finalists with the pieces of those that turn back on themselves among them: where something else
    /// hangs on the body, or crosses it, a curve may run along it, turn round at its end, and come back over
    /// the body. One of the pieces between its turns is the body then. Also how many were fitted.
    pub(crate) fn cut_at_hairpins(&self, mut finalists: Vec<Candidate>) -> (Vec<Candidate>, usize) {
        let cut = |candidate: &Candidate| -> Vec<Candidate> {
            if !candidate.turns.are_back() {
                return Vec::new();
            }
            let points = dense(&candidate.fit.curve, self.rig);
            let px_per_unit = px_per_unit(&points, self.rig);
            pieces(&points)
                .into_iter()
                .filter_map(|piece| {
                    let start = through(&points[piece[0]..piece[1]], px_per_unit)?;
                    self.anew(candidate, &start, &PLAIN, candidate.settings)
                })
                .collect()
        };
        let mut cut = side_by_side(&finalists, cut).concat();
        let count = cut.len();
        if count == 0 {
            return (finalists, 0);
        }
        cut.append(&mut finalists);
        (self.finalists(cut), count)
    }
}

/// Half-open ranges between hairpins, the longest first; none of a curve without hairpins.
fn pieces(points: &[Point3]) -> Vec<[usize; 2]> {
    let turns = hairpins(points);
    if turns.is_empty() {
        return Vec::new();
    }
    let from = std::iter::once(0).chain(turns.iter().copied());
    let to = turns.iter().map(|turn| turn + 1).chain([points.len()]);
    let least = (LEAST_PART * points.len() as f64) as usize;
    let mut pieces: Vec<_> =
        from.zip(to).map(|(from, to)| [from, to]).filter(|[from, to]| to - from > least).collect();
    pieces.sort_by_key(|[from, to]| std::cmp::Reverse(to - from));
    pieces.truncate(MOST_PIECES);
    pieces
}

/// Where points about 1 px apart turn back.
fn hairpins(points: &[Point3]) -> Vec<usize> {
    let cosine = |k: usize| {
        let (before, after) = (points[k] - points[k - ARM_PX], points[k + ARM_PX] - points[k]);
        before.dot(&after) / (before.norm() * after.norm()).max(f64::MIN_POSITIVE)
    };
    let inner = ARM_PX..points.len().saturating_sub(ARM_PX);
    let cosines: Vec<f64> = inner.map(cosine).collect();
    let is_sharpest = |k: usize| {
        let near = k.saturating_sub(ARM_PX)..(k + ARM_PX + 1).min(cosines.len());
        near.clone().all(|j| cosines[k] < cosines[j] || (j >= k && cosines[k] <= cosines[j]))
    };
    (0..cosines.len())
        .filter(|&k| cosines[k] < TURN && is_sharpest(k))
        .map(|k| k + ARM_PX)
        .collect()
}

/// [`Turns::kinks`] of points about 1 px apart.
fn kinks(points: &[Point3], rig: &Rig) -> f64 {
    let chords: Vec<_> = points.windows(2).map(|w| w[1] - w[0]).collect();
    let allowed = px_per_unit(points, rig) * chords[0].norm() / LEAST_RADIUS_PX;
    chords.windows(2).map(|w| (w[0].angle(&w[1]) - allowed).max(0.0)).sum()
}

/// [`Turns::doubled_px`] of points about 1 px apart; 0 where a camera does not see all of them.
fn doubled_px(points: &[Point3], rig: &Rig) -> f64 {
    /// Every so many px.
    const STEP: usize = 3;
    const NEAR_PX: f64 = 2.5;
    /// Cosine of the directions of what runs back.
    const BACK: f64 = -0.7;
    /// Nearer along the curve it is the turn itself, px.
    const TURN_PX: usize = 9;
    if hairpins(points).is_empty() {
        return 0.0;
    }
    let sparse: Vec<Point3> = points.iter().step_by(STEP).copied().collect();
    let directed = |camera: &Camera| -> Option<Vec<(Point2, Vector2<f64>)>> {
        let image = image_of(camera, &sparse)?;
        let last = image.len() - 1;
        let along = |k: usize| image[(k + 1).min(last)] - image[k.saturating_sub(1)];
        let way = |k: usize| along(k).try_normalize(0.0).unwrap_or_default();
        Some(image.iter().enumerate().map(|(k, at)| (*at, way(k))).collect())
    };
    let (Some(view1), Some(view2)) = (directed(rig.camera1()), directed(rig.camera2())) else {
        return 0.0;
    };
    let runs_back = |view: &[(Point2, Vector2<f64>)], i: usize, j: usize| {
        let ((a, way_a), (b, way_b)) = (view[i], view[j]);
        (a - b).norm_squared() < NEAR_PX * NEAR_PX && way_a.dot(&way_b) < BACK
    };
    let doubled = (0..sparse.len()).filter(|&i| {
        (0..sparse.len()).any(|j| {
            i.abs_diff(j) * STEP > TURN_PX && runs_back(&view1, i, j) && runs_back(&view2, i, j)
        })
    });
    // Both strands were counted.
    0.5 * (STEP * doubled.count()) as f64
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use accurate_geom::nalgebra::Vector3;

    use super::super::shape::tests::rig;
    use super::*;

    fn turns(points: &[Point3]) -> Turns {
        Turns::of(&Curve3::interpolate(points).unwrap(), &rig(), [1.0; 2])
    }

    /// Down by 100, back up by `back`, `apart` beside it in the direction `aside`.
    fn hairpin(back: f64, apart: f64, aside: Vector3<f64>) -> Vec<Point3> {
        let down = (0..100).map(|k| Point3::new(0.0, f64::from(k) - 50.0, 0.0));
        let turn = (0..=8).map(|k| {
            let a = PI * f64::from(k) / 8.0;
            Point3::new(0.0, 50.0 + 0.5 * apart * a.sin(), 0.0)
                + aside * (0.5 * apart * (1.0 - a.cos()))
        });
        let up =
            (1..=back as usize).map(|k| Point3::new(0.0, 50.0 - k as f64, 0.0) + aside * apart);
        down.chain(turn).chain(up).collect()
    }

    fn arc(radius: f64, angle: f64) -> Vec<Point3> {
        let count = (radius * angle) as usize;
        (0..=count)
            .map(|k| {
                let a = angle * k as f64 / count as f64;
                Point3::new(radius * a.cos(), radius * a.sin(), 0.3 * k as f64)
            })
            .collect()
    }

    #[test]
    fn a_hairpin_is_cut_where_it_turns_and_a_bend_is_not() {
        let points =
            dense(&Curve3::interpolate(&hairpin(60.0, 1.0, Vector3::x())).unwrap(), &rig());
        let turns = hairpins(&points);
        assert_eq!(turns.len(), 1);
        assert!((points[turns[0]].y - 50.0).abs() < 2.0, "{}", points[turns[0]]);
        let [long, short] = pieces(&points)[..] else { panic!("{:?}", pieces(&points)) };
        assert_eq!((long[0], short[1]), (0, points.len()));
        assert_eq!(long[1], short[0] + 1);
        // What comes back over less than a quarter is no piece.
        let little =
            dense(&Curve3::interpolate(&hairpin(20.0, 1.0, Vector3::x())).unwrap(), &rig());
        assert_eq!(pieces(&little).len(), 1);
        let bend = dense(&Curve3::interpolate(&arc(8.0, 1.9 * PI)).unwrap(), &rig());
        assert!(hairpins(&bend).is_empty() && pieces(&bend).is_empty());
        assert!(hairpins(&bend[..5]).is_empty());
    }

    #[test]
    fn doubled_is_what_runs_back_over_itself_in_both_views() {
        let doubled = |points: &[Point3]| turns(points).doubled_px;
        // Samples are 3 px apart, and those next to the turn are the turn's.
        let found = doubled(&hairpin(60.0, 1.0, Vector3::x()));
        assert!((found - 60.0).abs() < 9.0, "{found}");
        // 30 apart in the depth of view 1: one line there, two in view 2.
        assert_eq!(doubled(&hairpin(60.0, 30.0, Vector3::z())), 0.0);
        assert_eq!(doubled(&arc(8.0, 1.9 * PI)), 0.0);
        let line: Vec<_> = (0..80).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect();
        assert_eq!(doubled(&line), 0.0);
    }

    #[test]
    fn kinks_are_turns_beyond_the_sharpest_bend() {
        let of = |points: &[Point3]| turns(points).kinks;
        // A quarter of a radian a px is allowed: half a turn over a px or two counts nearly in full.
        let found = of(&hairpin(60.0, 1.0, Vector3::x()));
        assert!(found > 0.6 * PI && found < PI, "{found}");
        assert_eq!(of(&arc(8.0, 1.9 * PI)), 0.0);
        // Half as wide as allowed: half of its turn.
        let tight =
            of(&arc(2.0, PI).iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect::<Vec<_>>());
        assert!((tight - PI / 2.0).abs() < 0.5, "{tight}");
    }
}
