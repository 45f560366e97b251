use accurate_geom::{
    AngleSample, Camera, EpipolarAngle, LengthUnit, Pixel, Point2, Rig, View1, View2,
};
use accurate_match::{FreeMatchParams, FreeMatcher};

use super::evidence::{LEAST_MATCHED, freed, scaled};

/// Fewest places at which curves turn round that tell whether pixels are displaced.
pub const LEAST_PLACES: usize = LEAST_MATCHED;
/// A curve has turned round once it has come back this far, px: several times what a traced
/// centreline errs.
const COME_BACK_PX: f64 = 6.0;
/// Partners are looked for this far along the curve, px, from where the match has them: displaced
/// pixels shift the match along the curve by more than they are off.
const ALONG_PX: f64 = 30.0;

/// The places where both curves of a pair turn round at an epipolar line, in recorded pixels.
///
/// Between such places two curves can be matched without any residual whatever the cameras are: each
/// epipolar line crosses both, and the crossings are partners. Where a curve touches an epipolar line
/// and turns back, its partner must touch the same line: these are matched points, and as good as
/// beads across the line. `curves` are samples in units of `px` pixels.
///
/// # Source
/// Frontier points of curves in space: Cipolla, Astrom, Giblin, "Motion from the frontier of curved
/// surfaces", ICCV 1995; there of surfaces.
pub(super) fn of_curves(
    curves: &[[Vec<Point2>; 2]],
    px: f64,
    cameras: &[Camera; 2],
) -> Vec<[Point2; 2]> {
    let [Some(one), Some(two)] = [scaled(&cameras[0], px), scaled(&cameras[1], px)] else {
        return Vec::new();
    };
    let Ok(rig) = Rig::new(one, two, LengthUnit::Unit) else { return Vec::new() };
    curves
        .iter()
        .flat_map(|pair| of_pair(pair, px, &rig).unwrap_or_default())
        .map(|pair| pair.map(|p| Point2::from(p.coords * px)))
        .collect()
}

/// `None` where the curves cannot be matched.
fn of_pair(pair: &[Vec<Point2>; 2], px: f64, rig: &Rig) -> Option<Vec<[Point2; 2]>> {
    let freed1: Vec<Pixel<View1>> =
        pair[0].iter().map(|p| freed(rig.camera1(), p)).collect::<Option<_>>()?;
    let freed2: Vec<Pixel<View2>> =
        pair[1].iter().map(|p| freed(rig.camera2(), p)).collect::<Option<_>>()?;
    let matcher = FreeMatcher::new(FreeMatchParams::DEFAULT);
    let found = matcher.match_best_direction(&freed1, &freed2, rig).ok()?;
    let angles = EpipolarAngle::new(rig);
    let angles1: Vec<AngleSample> =
        freed1.iter().map(|p| angles.view1(*p).ok()).collect::<Option<_>>()?;
    let angles2: Vec<AngleSample> =
        freed2.iter().map(|p| angles.view2(*p).ok()).collect::<Option<_>>()?;
    let turns2 = turns(&angles2, COME_BACK_PX / px);
    let along = (ALONG_PX / px).max(2.0);
    let mut partners: Vec<(Turn, Turn)> = Vec::new();
    for turn in turns(&angles1, COME_BACK_PX / px) {
        let near = found.positions.iter().filter(|(i, _)| (i - turn.index as f64).abs() <= along);
        let (low, high) = near.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, j)| {
            (low.min(j - along), high.max(j + along))
        });
        let mut alike = turns2
            .iter()
            .filter(|t| t.highest == turn.highest && (low..=high).contains(&(t.index as f64)));
        // Where two could be meant, none is taken.
        if let (Some(partner), None) = (alike.next(), alike.next()) {
            partners.push((turn, *partner));
        }
    }
    let alone = |turn: &Turn| partners.iter().filter(|(_, t)| t.index == turn.index).count() == 1;
    let alone: Vec<bool> = partners.iter().map(|(_, turn)| alone(turn)).collect();
    let kept = partners.iter().zip(alone).filter(|(_, alone)| *alone);
    Some(kept.map(|((a, b), _)| [pair[0][a.index], pair[1][b.index]]).collect())
}

/// A sample at which a curve turns round.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Turn {
    index: usize,
    /// Whether the angle is the highest there, or the lowest.
    highest: bool,
}

/// Samples where the angle turns round and comes back by at least `come_back` samples on either side.
fn turns(angles: &[AngleSample], come_back: f64) -> Vec<Turn> {
    let [mut high, mut low] = [0, 0];
    let mut rising: Option<bool> = None;
    let mut found = Vec::new();
    for (index, at) in angles.iter().enumerate() {
        if at.phi > angles[high].phi {
            high = index;
        }
        if at.phi < angles[low].phi {
            low = index;
        }
        let fallen = (angles[high].phi - at.phi) / at.gradient_per_px >= come_back;
        let risen = (at.phi - angles[low].phi) / at.gradient_per_px >= come_back;
        if fallen && rising != Some(false) {
            found.extend(rising.map(|_| Turn { index: high, highest: true }));
            (rising, low) = (Some(false), index);
        } else if risen && rising != Some(true) {
            found.extend(rising.map(|_| Turn { index: low, highest: false }));
            (rising, high) = (Some(true), index);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::Vector2;

    use super::*;

    fn wave(values: &[f64]) -> Vec<AngleSample> {
        let gradient = Vector2::new(0.01, 0.0);
        let sample = |v: &f64| AngleSample { phi: 0.01 * v, gradient, gradient_per_px: 0.01 };
        values.iter().map(sample).collect()
    }

    #[test]
    fn a_curve_turns_where_it_comes_back_far_enough_on_both_sides() {
        // Up to 9, a dent of 1 on the way, down to 2, up again; the ends are no turns.
        let angles = wave(&[0.0, 4.0, 3.0, 9.0, 7.0, 2.0, 3.0, 8.0]);
        let turn = |index, highest| Turn { index, highest };
        assert_eq!(turns(&angles, 3.0), [turn(3, true), turn(5, false)]);
        assert_eq!(turns(&angles, 8.0), [], "it comes back by 7 and 6");
        let upside_down: Vec<f64> = angles.iter().map(|a| -100.0 * a.phi).collect();
        assert_eq!(turns(&wave(&upside_down), 3.0), [turn(3, false), turn(5, true)]);
        assert_eq!(turns(&wave(&[]), 3.0), []);
    }
}
