use accurate_geom::{EpipolarAngle, Pixel, Rig, View, View1, View2};
use accurate_seg::{
    Components, Mask, PostProcessing, SegError, Skeleton, Strands, Surety, without_faint_pieces,
};
use ndarray::Array2;

use crate::Error;

/// Distance of the epipolar planes at which strands are counted, px in the image.
const PLANE_DISTANCE_PX: f64 = 1.5;
/// A piece or strand is a stray if so much of it disagrees with the other view, and ceases to without it.
const DISAGREEING: f64 = 0.5;
/// A strand of a piece is a stray only if its median logit is this far below that of the surest strand
/// of its view, and the other view shows nothing at all along so much of it ([`ALONE`]): strands of a
/// body that lie one upon the other in one view face more strands in the other, but not none. Of 378
/// strands of wires and 85 of vessels (`carm`, seed 1103) that takes 2 and 49.
const FAINTER_STRAND: f64 = 0.5;
const ALONE: f64 = 0.3;
/// Shorter strands are what thinning leaves around crossings, px of skeleton.
const STRAND_PX: usize = 10;

/// The masks without what is fainter than the rest or what the other view speaks against, and how many
/// pixels of each mask that left out. `maps` are the probabilities that the masks were made of.
///
/// Every epipolar plane cuts the body as often as it cuts either of its images. So the pieces of both
/// masks are chosen, greedily, such that the two images are cut by each plane equally often: the piece
/// goes whose removal brings the counts nearest, as long as half of the piece stood against the other
/// view. A piece of a view that is hidden in the other one goes with the strays; the last piece of a
/// view stays. Then the strands of the pieces that stay are chosen likewise, of those that are fainter:
/// strays may touch or cross the body.
///
/// # Errors
/// [`Error::Segmentation`] for a mask without a pixel.
///
/// # Cost
/// Three thinnings of both masks, and O(strands² · planes).
pub(crate) fn without_strays(
    masks: &[Array2<bool>; 2],
    maps: &[Array2<f32>; 2],
    rig: &Rig,
    case: &str,
) -> Result<([Array2<bool>; 2], [usize; 2]), Error> {
    let angles = EpipolarAngle::new(rig);
    let refuse =
        |view: u8| move |source| Error::Segmentation { case: case.to_owned(), view, source };
    let at1 = |x: f64, y: f64| {
        angles.view1(Pixel::<View1>::new(x, y)).ok().map(|a| (a.phi, a.gradient_per_px))
    };
    let at2 = |x: f64, y: f64| {
        angles.view2(Pixel::<View2>::new(x, y)).ok().map(|a| (a.phi, a.gradient_per_px))
    };
    let without_faint = |view: usize, number: u8| {
        Mask::from_array(masks[view].clone())
            .and_then(|mask| {
                without_faint_pieces(&mask, &maps[view], PostProcessing::FAINTNESS_LOGITS)
            })
            .map(Mask::into_array)
            .map_err(refuse(number))
    };
    let mut kept = [without_faint(0, View1::NUMBER)?, without_faint(1, View2::NUMBER)?];
    for parts_of in [Parts::pieces, Parts::strands] {
        let parts = |view: usize, number: u8| {
            Mask::from_array(kept[view].clone())
                .and_then(|mask| parts_of(&mask, &maps[view]))
                .map_err(refuse(number))
        };
        let (parts1, parts2) = (parts(0, View1::NUMBER)?, parts(1, View2::NUMBER)?);
        let mut views = [PartSteps::of(parts1, &at1), PartSteps::of(parts2, &at2)];
        let planes = Planes::through(&views);
        let counts = views.each_ref().map(|view| view.crossings(&planes));
        while let Some((view, part)) = worst(&views, &counts, &planes) {
            views[view].parts.kept[part] = false;
        }
        for (mask, view) in kept.iter_mut().zip(&views) {
            view.parts.cut(mask);
        }
    }
    let count = |mask: &Array2<bool>| mask.iter().filter(|set| **set).count();
    let left_out = [0, 1].map(|view| count(&masks[view]) - count(&kept[view]));
    Ok((kept, left_out))
}

/// The part that goes next: its view and number.
fn worst(
    views: &[PartSteps; 2],
    counts: &[Vec<Vec<i32>>; 2],
    planes: &Planes,
) -> Option<(usize, usize)> {
    let kept = |view: usize| {
        counts[view].iter().enumerate().filter(move |(part, _)| views[view].parts.kept[*part])
    };
    let totals = [0, 1].map(|view| {
        (0..planes.count).map(|k| kept(view).map(|(_, part)| part[k]).sum()).collect::<Vec<i32>>()
    });
    let mut worst: Option<(i32, usize, usize)> = None;
    for view in [0, 1] {
        let (own, other) = (&totals[view], &totals[1 - view]);
        if kept(view).count() < 2 {
            continue;
        }
        for (number, part) in kept(view) {
            let (mut mass, mut gain, mut cut, mut alone) = (0, 0, 0, 0);
            for ((count, own), other) in
                part.iter().zip(own).zip(other).filter(|((n, _), _)| **n > 0)
            {
                mass += count;
                gain += (own - other).abs() - (own - count - other).abs();
                cut += 1;
                alone += i32::from(*other == 0);
            }
            let parts = &views[view].parts;
            let stray = parts.doubtful[number]
                && f64::from(gain) > DISAGREEING * f64::from(mass)
                && f64::from(alone) >= parts.alone * f64::from(cut);
            if stray && worst.is_none_or(|(most, _, _)| gain > most) {
                worst = Some((gain, view, number));
            }
        }
    }
    worst.map(|(_, view, number)| (view, number))
}

/// What one mask is made of.
struct Parts {
    /// 0 where no part is, and, of strands, around junctions.
    labels: Array2<u32>,
    skeleton: Skeleton,
    kept: Vec<bool>,
    /// What may be left out.
    doubtful: Vec<bool>,
    /// If the other view shows nothing along at least so much of it.
    alone: f64,
}

impl Parts {
    /// The pieces, all of them doubtful.
    fn pieces(mask: &Mask, _: &Array2<f32>) -> Result<Self, SegError> {
        let components = Components::of(mask)?;
        let count = components.sizes().len();
        Ok(Self {
            labels: components.labels().clone(),
            skeleton: Skeleton::of(mask)?,
            kept: vec![true; count],
            doubtful: vec![true; count],
            alone: 0.0,
        })
    }

    /// The strands, all of them; the fainter ones are doubtful.
    fn strands(mask: &Mask, map: &Array2<f32>) -> Result<Self, SegError> {
        let strands = Strands::of(mask)?;
        let (labels, skeleton) = (strands.labels().clone(), strands.skeleton().clone());
        let of_strands = Surety::of_parts(&skeleton, &labels, strands.count(), map);
        let least = Surety::surest(&of_strands, STRAND_PX as f64) - FAINTER_STRAND;
        let doubtful = of_strands
            .iter()
            .map(|strand| strand.length_px >= STRAND_PX && strand.logit < least)
            .collect();
        let kept = vec![true; of_strands.len()];
        Ok(Self { labels, skeleton, kept, doubtful, alone: ALONE })
    }

    /// The number of the part at a pixel, from 0; `None` outside of all.
    fn at(&self, pixel: (usize, usize)) -> Option<usize> {
        self.labels.get(pixel).and_then(|label| (*label as usize).checked_sub(1))
    }

    /// Takes the parts that are not kept out of their mask, with junctions that no other part meets.
    fn cut(&self, mask: &mut Array2<bool>) {
        if self.kept.iter().all(|kept| *kept) {
            return;
        }
        mask.indexed_iter_mut()
            .for_each(|(pixel, set)| *set &= self.at(pixel).is_none_or(|part| self.kept[part]));
        let Ok(components) = Mask::from_array(mask.clone()).and_then(|m| Components::of(&m)) else {
            return;
        };
        let mut held = vec![false; components.sizes().len()];
        for (pixel, piece) in components.labels().indexed_iter().filter(|(_, piece)| **piece > 0) {
            held[*piece as usize - 1] |= self.at(pixel).is_some();
        }
        mask.zip_mut_with(components.labels(), |set, piece| {
            *set &= *piece > 0 && held[*piece as usize - 1];
        });
    }
}

/// The parts of one mask as the epipolar planes see them: a step from pixel to pixel of a skeleton, as
/// the angles of its ends.
struct PartSteps {
    parts: Parts,
    steps: Vec<Vec<(f64, f64)>>,
    /// Radians per px at every skeleton pixel.
    gradients: Vec<f64>,
}

impl PartSteps {
    fn of(parts: Parts, angle: &dyn Fn(f64, f64) -> Option<(f64, f64)>) -> Self {
        let mut steps = vec![Vec::new(); parts.kept.len()];
        let mut gradients = Vec::new();
        let thin = parts.skeleton.mask();
        let set = |row: usize, column: usize| thin.get(row, column);
        for &(row, column) in parts.skeleton.pixels() {
            let Some(part) = parts.at((row, column)) else { continue };
            let Some((from, gradient)) = angle(column as f64, row as f64) else { continue };
            gradients.push(gradient);
            let (right, below) = (set(row, column + 1), set(row + 1, column));
            let left = column.checked_sub(1);
            let straight_left = left.is_some_and(|left| set(row, left));
            // A diagonal beside a straight way round would be the same step twice.
            let next = [
                right.then_some((row, column + 1)),
                below.then_some((row + 1, column)),
                (!right && !below && set(row + 1, column + 1)).then_some((row + 1, column + 1)),
                left.filter(|left| !straight_left && !below && set(row + 1, *left))
                    .map(|left| (row + 1, left)),
            ];
            for (row, column) in next.into_iter().flatten() {
                if let Some((to, _)) = angle(column as f64, row as f64) {
                    steps[part].push((from.min(to), from.max(to)));
                }
            }
        }
        Self { parts, steps, gradients }
    }

    /// How often each plane cuts each part.
    fn crossings(&self, planes: &Planes) -> Vec<Vec<i32>> {
        let of_part = |steps: &Vec<(f64, f64)>| {
            let mut counts = vec![0; planes.count];
            for (low, high) in steps {
                for count in &mut counts[planes.below(*low)..planes.below(*high)] {
                    *count += 1;
                }
            }
            counts
        };
        self.steps.iter().map(of_part).collect()
    }
}

/// Planes about the baseline, equally far apart.
struct Planes {
    first: f64,
    step: f64,
    count: usize,
}

impl Planes {
    fn through(views: &[PartSteps; 2]) -> Self {
        let steps = || views.iter().flat_map(|view| view.steps.iter().flatten());
        let first = steps().map(|(low, _)| *low).fold(f64::INFINITY, f64::min);
        let last = steps().map(|(_, high)| *high).fold(f64::NEG_INFINITY, f64::max);
        // The finer of the two images decides.
        let typical = |view: &PartSteps| median(&mut view.gradients.clone());
        let step = PLANE_DISTANCE_PX * typical(&views[0]).min(typical(&views[1]));
        // One pixel alone has no step; no image has this many planes.
        let count = ((last - first) / step).ceil().clamp(0.0, 1e5) as usize;
        Self { first, step, count }
    }

    /// Planes below an angle.
    fn below(&self, phi: f64) -> usize {
        // The cast saturates, a NaN (no plane at all) becomes 0.
        (((phi - self.first) / self.step - 0.5).ceil() as usize).min(self.count)
    }
}

/// The upper median; minus infinity of nothing.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NEG_INFINITY)
}

#[cfg(test)]
mod tests {
    use accurate_synth::{CaseOptions, Family, SynthCase, generate};

    use super::*;

    /// Maps that are equally sure of every pixel of the masks.
    fn sure(masks: &[Array2<bool>; 2]) -> [Array2<f32>; 2] {
        masks.each_ref().map(|mask| mask.mapv(|set| if set { 0.99 } else { 0.01 }))
    }

    #[test]
    fn a_small_dark_loop_does_not_make_strays_of_the_rest() {
        let case = generate(Family::Medium, 1000, 0, &CaseOptions::default()).unwrap();
        let mut masks = case.masks.clone();
        let mut maps = sure(&masks);
        let wire = masks[0].clone();
        paint(&mut masks[0], (8.0, 8.0), (40.0, 30.0));
        maps[0].zip_mut_with(&masks[0], |p, set| *p = if *set { 0.9999 } else { *p });
        maps[0].zip_mut_with(&wire, |p, set| *p = if *set { 0.99 } else { *p });
        let (kept, _) = without_strays(&masks, &maps, &case.rig, &case.id).unwrap();
        assert!(kept[0].iter().zip(&wire).all(|(kept, wire)| *kept || !*wire));
    }

    #[test]
    fn a_faint_piece_goes_also_where_the_views_agree() {
        let case = generate(Family::Carm, 1000, 0, &CaseOptions::default()).unwrap();
        let mut masks = case.masks.clone();
        let mut maps = sure(&masks);
        let painted = [0, 1].map(|v| {
            let clean = masks[v].clone();
            let count = paint(&mut masks[v], (10.0, 10.0), (80.0, 20.0));
            maps[v].zip_mut_with(&masks[v], |p, set| *p = if *set { 0.9 } else { *p });
            maps[v].zip_mut_with(&clean, |p, set| *p = if *set { 0.99 } else { *p });
            count
        });
        let (kept, left_out) = without_strays(&masks, &maps, &case.rig, &case.id).unwrap();
        assert_eq!((kept, left_out), (case.masks, painted));
    }

    fn paint(mask: &mut Array2<bool>, from: (f64, f64), to: (f64, f64)) -> usize {
        let before = mask.iter().filter(|set| **set).count();
        for k in 0..=400 {
            let t = f64::from(k) / 400.0;
            let (x, y) = (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1));
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                mask[[y as usize + dy, x as usize + dx]] = true;
            }
        }
        mask.iter().filter(|set| **set).count() - before
    }

    #[test]
    fn clean_masks_stay_as_they_are() {
        for family in [Family::Medium, Family::Carm, Family::Easy] {
            for index in 0..6 {
                let case = generate(family, 1000, index, &CaseOptions::default()).unwrap();
                let (kept, left_out) =
                    without_strays(&case.masks, &sure(&case.masks), &case.rig, &case.id).unwrap();
                assert_eq!(left_out, [0, 0], "{}", case.id);
                assert_eq!(kept, case.masks);
            }
        }
    }

    #[test]
    fn broken_masks_keep_all_but_pieces_that_face_a_gap_of_the_other_view() {
        for index in 0..6 {
            let options = CaseOptions { gaps: 1..=2, ..CaseOptions::default() };
            let case = generate(Family::Easy, 1000, index, &options).unwrap();
            let (_, left_out) =
                without_strays(&case.masks, &sure(&case.masks), &case.rig, &case.id).unwrap();
            for (mask, left_out) in case.masks.iter().zip(left_out) {
                let whole = mask.iter().filter(|set| **set).count();
                // The longest gap is 30 px; what is as long and faces one may go, no more.
                assert!(left_out < whole / 10, "{}: {left_out} of {whole}", case.id);
            }
        }
    }

    #[test]
    fn a_long_piece_of_one_view_goes() {
        let mut removed = 0;
        for index in 0..10 {
            let case = generate(Family::Carm, 1000, index, &CaseOptions::default()).unwrap();
            let mut masks = case.masks.clone();
            // Along the image's border, away from the wire.
            let rows: Vec<usize> =
                masks[1].indexed_iter().filter(|(_, set)| **set).map(|((row, _), _)| row).collect();
            let (first, last) = (rows[0], rows[rows.len() - 1]);
            let columns = masks[1].ncols();
            let clear = masks[1].indexed_iter().all(|((_, x), set)| !*set || x + 60 < columns);
            if !clear {
                continue;
            }
            let x = columns as f64 - 30.0;
            let (top, bottom) =
                if first > 200 { (20.0, 180.0) } else { (last as f64 + 20.0, last as f64 + 150.0) };
            let bottom = bottom.min(masks[1].nrows() as f64 - 20.0);
            let painted = paint(&mut masks[1], (x, top), (x + 10.0, bottom));
            let (kept, left_out) =
                without_strays(&masks, &sure(&masks), &case.rig, &case.id).unwrap();
            removed += usize::from(left_out == [0, painted] && kept == case.masks);
            assert_eq!(left_out[0], 0, "{}", case.id);
        }
        assert!(removed >= 7, "{removed} strays of ten left out");
    }

    /// A line across the middle of the wire and the epipolar planes in view 2, as sure as `probability`.
    fn crossed(index: u64, probability: f32) -> (SynthCase, [Array2<bool>; 2], [Array2<f32>; 2]) {
        let case = generate(Family::Carm, 1000, index, &CaseOptions::default()).unwrap();
        let mut masks = case.masks.clone();
        let mut maps = sure(&masks);
        let wire: Vec<_> =
            case.masks[1].indexed_iter().filter(|(_, set)| **set).map(|(at, _)| at).collect();
        let (x, y) = (wire[wire.len() / 2].1 as f64, wire[wire.len() / 2].0 as f64);
        let angles = EpipolarAngle::new(&case.rig);
        let phi = |x: f64, y: f64| angles.view2(Pixel::<View2>::new(x, y)).unwrap().phi;
        let upright = (phi(x, y + 1.0) - phi(x, y)).abs() > (phi(x + 1.0, y) - phi(x, y)).abs();
        let size = masks[1].dim();
        let at = |away: f64| {
            let (x, y) = if upright { (x, y + away) } else { (x + away, y) };
            (x.clamp(2.0, size.1 as f64 - 3.0), y.clamp(2.0, size.0 as f64 - 3.0))
        };
        paint(&mut masks[1], at(-200.0), at(200.0));
        for ((p, set), wire) in maps[1].iter_mut().zip(&masks[1]).zip(&case.masks[1]) {
            *p = if *set && !*wire { probability } else { *p };
        }
        (case, masks, maps)
    }

    #[test]
    fn a_fainter_line_across_the_wire_goes_where_the_other_view_shows_nothing() {
        let mut removed = 0;
        for index in 0..10 {
            let (case, masks, maps) = crossed(index, 0.95);
            let (kept, _) = without_strays(&masks, &maps, &case.rig, &case.id).unwrap();
            let left = |mask: &Array2<bool>| {
                mask.iter().zip(&case.masks[1]).filter(|(set, wire)| **set && !**wire).count()
            };
            // What goes goes by strands; one of them may lie where the other view shows the wire.
            removed += usize::from(left(&kept[1]) < left(&masks[1]) / 2);
            let lost = case.masks[1].iter().zip(&kept[1]).filter(|(wire, set)| **wire && !**set);
            assert!(lost.count() < 40, "{}", case.id);
            assert_eq!(kept[0], case.masks[0], "{}", case.id);
        }
        assert!(removed >= 7, "{removed} lines of ten left out");
    }

    #[test]
    fn a_line_across_the_wire_that_is_as_sure_stays() {
        for index in 0..10 {
            let (case, masks, maps) = crossed(index, 0.99);
            let (kept, left_out) = without_strays(&masks, &maps, &case.rig, &case.id).unwrap();
            assert_eq!((kept, left_out), (masks, [0, 0]), "{}", case.id);
        }
    }

    #[test]
    fn one_piece_a_view_always_stays() {
        let case = generate(Family::Easy, 1000, 0, &CaseOptions::default()).unwrap();
        let mut masks = case.masks.clone();
        masks[1].fill(false);
        paint(&mut masks[1], (5.0, 5.0), (60.0, 40.0));
        let (kept, left_out) = without_strays(&masks, &sure(&masks), &case.rig, &case.id).unwrap();
        assert_eq!((kept, left_out), (masks, [0, 0]));
        let empty = [case.masks[0].clone(), Array2::from_elem(case.masks[1].dim(), false)];
        assert!(matches!(
            without_strays(&empty, &sure(&empty), &case.rig, &case.id),
            Err(Error::Segmentation { view: 2, .. })
        ));
    }
}
