use accurate_geom::{Pixel, Rig, View1, View2};
use accurate_match::{CostModel, DistanceKind, MatchError, TieOrder, align_rows};

/// Points of each curve that the direction is decided on; enough for curves of any length.
const SAMPLES: usize = 400;

/// Whether the curve of view 2 runs against that of view 1.
///
/// Both readings are aligned corner to corner, on a subsample, and the cheaper mean wins; a tie
/// keeps the order as given. Annotators click either end first, and a reversed curve matches with
/// tens of pixels where the right one has a few.
///
/// # Errors
/// As [`align_rows`].
pub(crate) fn runs_against(
    points1: &[Pixel<View1>],
    points2: &[Pixel<View2>],
    rig: &Rig,
) -> Result<bool, MatchError> {
    let points1 = subsample(points1);
    let mut points2 = subsample(points2);
    let as_given = mean_cost(&points1, &points2, rig)?;
    points2.reverse();
    Ok(mean_cost(&points1, &points2, rig)? < as_given)
}

fn mean_cost(
    points1: &[Pixel<View1>],
    points2: &[Pixel<View2>],
    rig: &Rig,
) -> Result<f64, MatchError> {
    let model = CostModel::new(rig.fundamental(), points1, points2, DistanceKind::View1)?;
    let fill = |i: usize, row: &mut [f64]| model.fill_row(i, row);
    let alignment = align_rows(points1.len(), points2.len(), fill, TieOrder::DiagonalFirst)?;
    Ok(alignment.mean_cost())
}

/// At most [`SAMPLES`] points, evenly spread, both ends included.
fn subsample<P: Copy>(points: &[P]) -> Vec<P> {
    if points.len() <= SAMPLES {
        return points.to_vec();
    }
    let last = points.len() - 1;
    (0..SAMPLES).map(|k| points[k * last / (SAMPLES - 1)]).collect()
}

#[cfg(test)]
mod tests {
    use accurate_synth::{CaseOptions, Family, generate};

    use super::*;

    #[test]
    fn a_reversed_view_is_noticed_and_a_right_one_kept() {
        for family in Family::ALL {
            for index in 0..5 {
                let case = generate(family, 1000, index, &CaseOptions::default()).unwrap();
                let (p1, mut p2) = case.rounded_points;
                assert!(!runs_against(&p1, &p2, &case.rig).unwrap(), "{family} {index}");
                p2.reverse();
                assert!(runs_against(&p1, &p2, &case.rig).unwrap(), "{family} {index}");
            }
        }
    }

    #[test]
    fn subsampling_keeps_both_ends() {
        let points: Vec<usize> = (0..1777).collect();
        let few = subsample(&points);
        assert_eq!((few.len(), few[0], few[SAMPLES - 1]), (SAMPLES, 0, 1776));
        assert_eq!(subsample(&points[..3]), [0, 1, 2]);
    }
}
