use accurate_geom::{Pixel, View};

/// A list whose points lie nearer to others than to their neighbours in it in more than this part is in no
/// order. Of ordered ones up to 0.05 do, where strands cross; of skeleton pixels row by row 0.14 to 0.7.
const MOST: f64 = 0.1;
/// So many points are asked at most.
const ASKED: usize = 500;
/// Neighbours in the list that are no farther apart do not jump, px: points may be as near as noise allows.
const STEP_PX: f64 = 3.0;
/// Nearer to another than this part of the step, a point is beside the wrong ones.
const NEARER: f64 = 0.25;
/// Fewer points show no order.
const FEWEST: usize = 8;

/// Whether points that should be in order along a curve are not, as the pixels of a skeleton row by row.
///
/// O(points), at most 500 of them times all.
pub(crate) fn is_disordered<V: View>(points: &[Pixel<V>]) -> bool {
    if points.len() < FEWEST {
        return false;
    }
    let asked = ASKED.min(points.len());
    let jumps = |&k: &usize| {
        let next = |j: Option<&Pixel<V>>| j.map_or(0.0, |p| p.distance(points[k]));
        let before = k.checked_sub(1).and_then(|j| points.get(j));
        let step = next(before).max(next(points.get(k + 1)));
        step > STEP_PX
            && points
                .iter()
                .enumerate()
                .any(|(j, p)| j.abs_diff(k) > 1 && p.distance(points[k]) < NEARER * step)
    };
    let jumping = (0..asked).map(|k| k * points.len() / asked).filter(jumps).count();
    jumping as f64 > MOST * asked as f64
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;
    use accurate_synth::{CaseOptions, Family, generate};

    use super::*;

    /// The same points row by row, from left to right.
    fn row_by_row(points: &[Pixel<View1>]) -> Vec<Pixel<View1>> {
        let mut sorted = points.to_vec();
        sorted.sort_by(|a, b| (a.y.round(), a.x).partial_cmp(&(b.y.round(), b.x)).unwrap());
        sorted
    }

    #[test]
    fn curves_are_in_order_and_their_pixels_row_by_row_are_not() {
        for family in [Family::Medium, Family::Hard, Family::Carm, Family::Helix] {
            for index in 0..6 {
                let case = generate(family, 1905, index, &CaseOptions::default()).unwrap();
                let points = &case.rounded_points.0;
                assert!(!is_disordered(points), "{}", case.id);
                let vertices: Vec<_> = points.iter().step_by(8).copied().collect();
                assert!(!is_disordered(&vertices), "{}", case.id);
                if matches!(family, Family::Medium | Family::Hard) {
                    assert!(is_disordered(&row_by_row(points)), "{}", case.id);
                }
            }
        }
    }

    #[test]
    fn few_points_and_one_place_are_no_disorder() {
        let at = |x: f64| Pixel::<View1>::new(x, 0.0);
        assert!(!is_disordered::<View1>(&[]));
        assert!(!is_disordered(&[at(0.0), at(50.0), at(1.0), at(51.0)]));
        assert!(!is_disordered(&vec![at(3.0); 40]));
        // Noise of half a px on points a tenth of a px apart.
        let noisy: Vec<_> = (0..600)
            .map(|k| at(0.1 * f64::from(k) + 0.5 * f64::from(k * 7919 % 13) / 6.0 - 0.5))
            .collect();
        assert!(!is_disordered(&noisy));
    }
}
