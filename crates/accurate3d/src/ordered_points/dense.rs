use accurate_geom::{Pixel, View};

/// Median distance of neighbours beyond which a curve counts as vertices of a polyline, px. Rounded points
/// are no farther apart than 1.42.
const SPARSE_PX: f64 = 2.0;

/// Fewer points draw no body.
const FEWEST: usize = 4;

/// Longest curve that is filled, px: no image shows a longer one.
const LONGEST_PX: f64 = 1e6;

/// Vertices farther apart than the matcher's steps, with points at most 1 px apart put between them along
/// the chords; `None` if they are near enough, too few, or longer than any image shows.
pub(super) fn densified<V: View>(points: &[Pixel<V>]) -> Option<Vec<Pixel<V>>> {
    if points.len() < FEWEST {
        return None;
    }
    let mut lengths: Vec<f64> = points.windows(2).map(|w| w[0].distance(w[1])).collect();
    // A point that is not finite is refused by the matcher.
    let length: f64 = lengths.iter().sum();
    if !(length <= LONGEST_PX) {
        return None;
    }
    lengths.sort_unstable_by(f64::total_cmp);
    if lengths.get(lengths.len() / 2).is_none_or(|median| *median <= SPARSE_PX) {
        return None;
    }
    let mut dense = Vec::new();
    for pair in points.windows(2) {
        let steps = pair[0].distance(pair[1]).ceil().max(1.0) as usize;
        let at = |k: usize| {
            let t = k as f64 / steps as f64;
            Pixel::new(
                pair[0].x + t * (pair[1].x - pair[0].x),
                pair[0].y + t * (pair[1].y - pair[0].y),
            )
        };
        dense.extend((0..steps).map(at));
    }
    dense.extend(points.last());
    Some(dense)
}

#[cfg(test)]
mod tests {
    use accurate_geom::View1;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn vertices_stay_in_order_and_what_is_between_lies_on_the_chords(
            steps in prop::collection::vec((2.1..40.0_f64, 0.0..6.3_f64), 3..30),
        ) {
            let mut at = Pixel::<View1>::new(0.0, 0.0);
            let mut vertices = vec![at];
            for (length, direction) in steps {
                at = Pixel::new(at.x + length * direction.cos(), at.y + length * direction.sin());
                vertices.push(at);
            }
            let dense = densified(&vertices).unwrap();
            let length = |points: &[Pixel<View1>]| -> f64 {
                points.windows(2).map(|w| w[0].distance(w[1])).sum()
            };
            prop_assert!((length(&dense) - length(&vertices)).abs() < 1e-9);
            prop_assert!(dense.windows(2).all(|w| w[0].distance(w[1]) <= 1.0 + 1e-9));
            let mut rest = dense.iter();
            for vertex in &vertices {
                prop_assert!(rest.any(|point| point == vertex), "{vertex:?} is lost");
            }
        }
    }

    #[test]
    fn dense_points_and_few_stay_as_they_are() {
        let row: Vec<Pixel<View1>> = (0..20).map(|k| Pixel::new(f64::from(k) * 1.4, 3.0)).collect();
        assert!(densified(&row).is_none());
        let few: Vec<Pixel<View1>> = (0..3).map(|k| Pixel::new(f64::from(k) * 50.0, 3.0)).collect();
        assert!(densified(&row[..1]).is_none() && densified(&few).is_none());
    }

    #[test]
    fn points_that_no_image_shows_are_left_to_the_matcher() {
        for far in [f64::INFINITY, f64::NAN, 1e12] {
            let xs = [0.0, 5.0, 10.0, far];
            let points: Vec<Pixel<View1>> = xs.iter().map(|x| Pixel::new(*x, 0.0)).collect();
            assert!(densified(&points).is_none(), "{far}");
        }
    }
}
