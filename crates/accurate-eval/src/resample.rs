use accurate_geom::Point3;

use crate::{EvalError, check};

/// The most samples of one curve; the coupling distance looks at all pairs.
pub(crate) const MOST_SAMPLES: usize = 1 << 16;

/// Length of the polyline through `points`, world unit.
pub(crate) fn length(points: &[Point3]) -> f64 {
    points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
}

/// Points at equal arc length along the polyline through `points`, both ends included, at most
/// `spacing` (world unit) apart.
pub(crate) fn resample(
    which: &'static str,
    points: &[Point3],
    spacing: f64,
) -> Result<Vec<Point3>, EvalError> {
    check::points(which, points)?;
    let length = length(points);
    if length == 0.0 {
        return Err(EvalError::NoLength { which, points: points.len() });
    }
    let intervals = (length / spacing).ceil().max(1.0);
    if intervals >= MOST_SAMPLES as f64 {
        return Err(EvalError::TooManySamples { which, spacing, length, limit: MOST_SAMPLES });
    }
    let count = intervals as usize;
    let mut samples = Vec::with_capacity(count + 1);
    samples.push(points[0]);
    let mut walked = 0.0;
    for pair in points.windows(2) {
        let step = pair[1] - pair[0];
        let step_length = step.norm();
        // A repeated point is no step: whether a sample falls on it is a matter of rounding.
        if step_length == 0.0 {
            continue;
        }
        // The last sample is the last point itself, not a rounded sum.
        while samples.len() < count {
            let wanted = length * (samples.len() as f64 / intervals) - walked;
            if wanted > step_length {
                break;
            }
            samples.push(pair[0] + step * (wanted / step_length).clamp(0.0, 1.0));
        }
        walked += step_length;
    }
    samples.push(points[points.len() - 1]);
    Ok(samples)
}

/// Refuses a spacing that is not a positive finite number.
pub(crate) fn check_spacing(spacing_world: f64) -> Result<(), EvalError> {
    if spacing_world.is_finite() && spacing_world > 0.0 {
        return Ok(());
    }
    Err(EvalError::InvalidArgument {
        name: "spacing_world",
        value: spacing_world,
        expected: "positive and finite",
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn samples_lie_on_the_polyline_at_equal_arc_length(
            xyz in prop::collection::vec(prop::array::uniform3(-9.0..9.0_f64), 2..20),
            spacing in 0.05..5.0_f64,
        ) {
            let points: Vec<Point3> = xyz.into_iter().map(Point3::from).collect();
            let samples = resample("curve", &points, spacing).unwrap();
            prop_assert_eq!(samples[0], points[0]);
            prop_assert_eq!(samples[samples.len() - 1], points[points.len() - 1]);
            let step = length(&points) / (samples.len() - 1) as f64;
            prop_assert!(step <= spacing * (1.0 + 4.0 * f64::EPSILON));
            prop_assert!(step * samples.len() as f64 >= length(&points));
            for distance in crate::nearest::PolylineIndex::new(&points).distances(&samples) {
                prop_assert!(distance <= 1e-13);
            }
            for pair in samples.windows(2) {
                // A chord is never longer than its arc; 20 segments of length below 32 are summed.
                prop_assert!((pair[1] - pair[0]).norm() <= step + 20.0 * 32.0 * f64::EPSILON * 20.0);
            }
        }
    }

    #[test]
    fn repeated_points_change_nothing() {
        let p = |x: f64| Point3::new(x, 0.0, 0.0);
        let once = resample("c", &[p(0.0), p(1.0), p(3.0)], 0.5).unwrap();
        let twice = resample("c", &[p(0.0), p(0.0), p(1.0), p(1.0), p(3.0), p(3.0)], 0.5).unwrap();
        assert_eq!(once, twice);
        assert_eq!(once.len(), 7);
    }

    #[test]
    fn points_that_stand_twice_give_no_sample_that_is_not_a_number() {
        // Steps whose lengths are rounded: samples fall on vertices, or beside them.
        for thirds in 1..200 {
            let step = 0.1 * f64::from(thirds) / 3.0;
            let p = |k: i32| Point3::new(-2.0, 2.5, 1.0) * (step * f64::from(k));
            let once: Vec<Point3> = (0..16).map(p).collect();
            let twice: Vec<Point3> = (0..32).map(|k| p(k / 2)).collect();
            for spacing in [step, 0.5 * step, 0.1] {
                let (a, b) = (resample("c", &once, spacing), resample("c", &twice, spacing));
                assert_eq!(a, b, "{step} {spacing}");
                assert!(b.unwrap().iter().all(|x| x.coords.iter().all(|v| v.is_finite())));
            }
        }
    }
}
