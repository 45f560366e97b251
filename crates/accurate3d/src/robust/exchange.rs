use accurate_fit::side_by_side;
use accurate_geom::Point3;
use accurate_match::longest_chain;

use super::finalists::SAME_PX;
use super::fitting::PLAIN;
use super::restart::BRIDGED_PX;
use super::score::Candidate;
use super::search::{Effort, Search};
use super::shape::{dense, px_per_unit};
use super::start::through;

/// Curves run together where they are no farther apart than this, px ...
const TOGETHER_PX: f64 = 1.5;
/// ... and parallel, by this cosine.
const PARALLEL: f64 = 0.7;
/// A stretch apart is longer than this, px.
const APART_PX: usize = 6;
/// Stretches that are exchanged between two curves, the longest first.
const MOST: usize = 3;
/// Rounds, and curves that the best is crossed with in each, at most.
const QUICKLY: [usize; 2] = [1, 2];
const THOROUGHLY: [usize; 2] = [3, usize::MAX];

impl Search<'_> {
    /// The finalists with crosses of the best and the others among them: where two differ in several
    /// stretches, each may be right in one of them, and no pair of walks need be right in all. Also
    /// how many crosses were fitted.
    pub(crate) fn exchanged(&self, mut finalists: Vec<Candidate>) -> (Vec<Candidate>, usize) {
        let [rounds, others] = match self.effort {
            Effort::Quick => QUICKLY,
            Effort::Thorough => THOROUGHLY,
        };
        let mut fits = 0;
        for _ in 0..rounds {
            let mut crosses = self.crosses(&finalists, others);
            if crosses.is_empty() {
                break;
            }
            fits += crosses.len();
            let before = finalists[0].score;
            crosses.append(&mut finalists);
            finalists = self.finalists(crosses);
            // Else the same would be crossed again.
            if finalists[0].score >= before {
                break;
            }
        }
        (finalists, fits)
    }

    /// Not where a walk takes a bridge: there the likelier stretch may be the one that the rim of what
    /// hides the body draws aside.
    fn crosses(&self, finalists: &[Candidate], others: usize) -> Vec<Candidate> {
        let Some((best, rest)) = finalists.split_first().filter(|(_, rest)| !rest.is_empty())
        else {
            return Vec::new();
        };
        let points = dense(&best.fit.curve, self.rig);
        let px_per_unit = px_per_unit(&points, self.rig);
        let cross = |other: &Candidate| {
            let theirs = dense(&other.fit.curve, self.rig);
            let is_seen = |point: &Point3| {
                let [_, reach_px] = BRIDGED_PX;
                [best, other].iter().all(|c| !self.is_near(&c.cuts, point, reach_px))
            };
            let mut crosses = Vec::new();
            for points in crossed(&points, &theirs, px_per_unit, is_seen) {
                let start = through(&points, px_per_unit);
                let fit = start.and_then(|start| self.fit(&start, &PLAIN));
                crosses.extend(fit.map(|fit| best.crossed(other, fit, self.rig, self.params)));
            }
            crosses
        };
        side_by_side(&rest[..rest.len().min(others)], cross).concat()
    }
}

/// The first curve with one stretch of the second, and, where that is something else, the second
/// with one of the first; stretches that are seen from end to end. None where they differ in one
/// stretch only. Points about 1 px apart.
fn crossed(
    ours: &[Point3],
    theirs: &[Point3],
    px_per_unit: f64,
    is_seen: impl Fn(&Point3) -> bool,
) -> Vec<Vec<Point3>> {
    let reversed: Vec<Point3> = theirs.iter().rev().copied().collect();
    let [straight, back] = partners(ours, theirs, TOGETHER_PX / px_per_unit);
    let (theirs, partners) =
        if back.len() > straight.len() { (&reversed[..], back) } else { (theirs, straight) };
    let mut apart = stretches_apart(ours, theirs, &partners, SAME_PX / px_per_unit);
    let count = apart.len();
    if count < 2 {
        return Vec::new();
    }
    apart.retain(|s| {
        let (a, b) = (&ours[s.ours[0]..s.ours[1]], &theirs[s.theirs[0]..s.theirs[1]]);
        a.iter().chain(b).all(&is_seen)
    });
    apart
        .sort_by_key(|s| std::cmp::Reverse((s.ours[1] - s.ours[0]).max(s.theirs[1] - s.theirs[0])));
    apart.truncate(MOST);
    let with = |into: &[Point3], at: [usize; 2], of: &[Point3], from: [usize; 2]| {
        [&into[..at[0]], &of[from[0]..from[1]], &into[at[1]..]].concat()
    };
    let mut all: Vec<_> = apart.iter().map(|s| with(ours, s.ours, theirs, s.theirs)).collect();
    if count > 2 {
        all.extend(apart.iter().map(|s| with(theirs, s.theirs, ours, s.ours)));
    }
    all
}

/// Where two curves go different ways: half-open ranges of the points of each.
struct Stretch {
    ours: [usize; 2],
    theirs: [usize; 2],
}

/// The gaps between partners, if any point there is farther than `least` from the other curve.
fn stretches_apart(
    ours: &[Point3],
    theirs: &[Point3],
    partners: &[(usize, usize)],
    least: f64,
) -> Vec<Stretch> {
    let before = partners.iter().map(|&(i, j)| (i + 1, j + 1));
    let from = std::iter::once((0, 0)).chain(before);
    let to = partners.iter().copied().chain([(ours.len(), theirs.len())]);
    from.zip(to)
        .map(|((i0, j0), (i1, j1))| Stretch { ours: [i0, i1], theirs: [j0, j1] })
        .filter(|s| {
            let long = |[from, to]: [usize; 2]| to - from > APART_PX;
            let far = |p: &Point3| theirs.iter().all(|q| (p - q).norm() > least);
            let far_back = |q: &Point3| ours.iter().all(|p| (p - q).norm() > least);
            (long(s.ours) || long(s.theirs))
                && (ours[s.ours[0]..s.ours[1]].iter().any(far)
                    || theirs[s.theirs[0]..s.theirs[1]].iter().any(far_back))
        })
        .collect()
}

/// The longest sequence of points of both curves, rising in both, that are near and parallel: with the
/// second as it is, and with it reversed.
fn partners(ours: &[Point3], theirs: &[Point3], near: f64) -> [Vec<(usize, usize)>; 2] {
    let along = |points: &[Point3], k: usize| {
        points[(k + 1).min(points.len() - 1)] - points[k.saturating_sub(1)]
    };
    let [mut straight, mut back] = [Vec::new(), Vec::new()];
    for (i, p) in ours.iter().enumerate() {
        let distances = theirs.iter().enumerate().map(|(j, q)| (j, (p - q).norm_squared()));
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((j, _)) = nearest.filter(|(_, squared)| *squared < near * near) else { continue };
        let (a, b) = (along(ours, i), along(theirs, j));
        let (cosine, parallel) = (a.dot(&b), PARALLEL * a.norm() * b.norm());
        if cosine > parallel {
            straight.push((i, j));
        } else if -cosine > parallel {
            back.push((i, theirs.len() - 1 - j));
        }
    }
    [straight, back].map(|pairs| longest_chain(&pairs, |a, b| a.1 < b.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight line along x, 1 unit per px, that leaves it upwards over some ranges.
    fn line(bumps: &[[usize; 2]]) -> Vec<Point3> {
        let up = |k: usize| bumps.iter().any(|[from, to]| (*from..*to).contains(&k));
        (0..200).map(|k| Point3::new(k as f64, if up(k) { 9.0 } else { 0.0 }, 0.0)).collect()
    }

    #[test]
    fn curves_that_are_wrong_in_different_stretches_give_the_one_that_is_right() {
        let (ours, right) = (line(&[[40, 60]]), line(&[]));
        for theirs in [line(&[[120, 150]]), line(&[[120, 150]]).into_iter().rev().collect()] {
            let crosses = crossed(&ours, &theirs, 1.0, |_| true);
            assert_eq!(crosses.len(), 2);
            assert!(crosses.contains(&right));
            assert!(crosses.contains(&line(&[[40, 60], [120, 150]])));
        }
    }

    #[test]
    fn ends_are_stretches_too_and_one_alone_is_nothing_new() {
        let (ours, theirs) = (line(&[[0, 20]]), line(&[[180, 200]]));
        assert!(crossed(&ours, &theirs, 1.0, |_| true).contains(&line(&[])));
        assert!(crossed(&ours, &line(&[]), 1.0, |_| true).is_empty());
        assert!(crossed(&ours, &ours, 1.0, |_| true).is_empty());
        // What is not seen is left alone.
        let crosses = crossed(&ours, &theirs, 1.0, |p| p.x > 30.0);
        assert_eq!(crosses, [line(&[[0, 20], [180, 200]])]);
        // Nothing in common: one stretch, from end to end.
        let elsewhere: Vec<_> = ours.iter().map(|p| Point3::new(p.x, p.y, 50.0)).collect();
        assert!(crossed(&ours, &elsewhere, 1.0, |_| true).is_empty());
    }
}
