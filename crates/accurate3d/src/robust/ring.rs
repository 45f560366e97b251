use accurate_fit::OutlineFitParams;
use accurate_geom::{View, View1, View2};
use accurate_match::{FreeEnds, FreeMatchParams, FreeMatcher};
use accurate_traverse::Walk;

use super::candidates::ViewCandidates;
use super::score::{Candidate, Origin};
use super::search::Search;
use super::start::{PRICES, start_from};
use crate::Error;
use crate::unrolled::Unrolled;

/// Closed walks of each view that are paired, the cheapest first.
const CLOSED_WALKS: usize = 4;
/// Every fourth point of a walk is matched around; the start of a fit is matched with all of them.
const STRIDE: usize = 4;

impl Search<'_> {
    /// The closed walks of both views, every pair matched around in both directions, cut open where
    /// the match is surest, and fitted as open curves that go somewhat more than once around
    /// ([`sampled_ring`](crate::sampled_curve::sampled_ring) closes them). Returns the number of
    /// pairs and adds to `found`, unsorted.
    ///
    /// # Errors
    /// [`Error::NotClosed`] if a view has no closed walk.
    pub(crate) fn fit_rings(
        &self,
        view1: &ViewCandidates<View1>,
        view2: &ViewCandidates<View2>,
        found: &mut Vec<Candidate>,
    ) -> Result<usize, Error> {
        let closed = [closed_walks(view1, self.case)?, closed_walks(view2, self.case)?];
        let matcher =
            FreeMatcher::new(FreeMatchParams { prices: PRICES, ..FreeMatchParams::DEFAULT });
        for &i in &closed[0] {
            for &j in &closed[1] {
                let (walk1, walk2) = (&view1.walks[i], &view2.walks[j]);
                let Ok(directions) = Unrolled::in_both_directions(
                    &walk1.points,
                    &walk2.points,
                    STRIDE,
                    &matcher,
                    self.rig,
                ) else {
                    continue;
                };
                for unrolled in &directions {
                    let origin = Origin {
                        walks: [i, j],
                        cuts: [view1.cut_ends(i), view2.cut_ends(j)],
                        reversed: unrolled.matched.reversed,
                        walks_cost: walk1.cost.total() + walk2.cost.total(),
                        mean_distance_px: 0.0,
                        proposal_score: 0.0,
                    };
                    found.extend(self.ring(unrolled, origin));
                }
            }
        }
        Ok(closed[0].len() * closed[1].len())
    }

    fn ring(&self, unrolled: &Unrolled, origin: Origin) -> Option<Candidate> {
        let settings = OutlineFitParams::DEFAULT;
        let walk1 = (&unrolled.points1[..], FreeEnds::NONE);
        let walk2 = (&unrolled.points2[..], FreeEnds::NONE);
        let knots = settings.knot_spacing_px;
        let (start, mean_distance_px) = start_from(&PRICES, walk1, walk2, false, self.rig, knots)?;
        let fit = self.fit(&start, &settings)?;
        let origin = Origin { mean_distance_px, ..origin };
        let mut candidate = Candidate::new(fit, &origin, self.rig, self.params);
        candidate.good = candidate.is_good(self.params);
        Some(candidate)
    }
}

/// A closed walk goes back over no more of the body than this share: else it is there and back, or
/// twice around.
const MOST_REUSED: f64 = 0.25;

/// Numbers of the cheapest walks of a view that come back to where they began, be it through a sharp
/// turn: a ring seen on edge has one at either end.
fn closed_walks<V: View>(view: &ViewCandidates<V>, case: &str) -> Result<Vec<usize>, Error> {
    let comes_back = |walk: &Walk<V>| {
        let reused = walk.flags.iter().filter(|flag| flag.reused).count();
        (walk.is_closed() || walk.points.first() == walk.points.last())
            && reused as f64 <= MOST_REUSED * walk.flags.len() as f64
    };
    let closed: Vec<_> = (0..view.walks.len())
        .filter(|walk| comes_back(&view.walks[*walk]))
        .take(CLOSED_WALKS)
        .collect();
    if closed.is_empty() {
        return Err(Error::NotClosed { case: case.to_owned(), view: V::NUMBER, tips: view.tips() });
    }
    Ok(closed)
}
