use accurate_geom::{EpipolarAngle, Pixel, Rig, View, View1, View2};
use accurate_seg::{Components, Mask, SegError, zhang_suen};
use ndarray::Array2;

use crate::Error;

/// Distance of the epipolar planes at which strands are counted, px in the image.
const PLANE_DISTANCE_PX: f64 = 1.5;
/// A piece is a stray if so much of it disagrees with the other view, and ceases to without it.
const DISAGREEING: f64 = 0.5;
/// A piece whose median logit is this far below that of the surest piece of its view is a stray. On
/// ten generated pairs (`carm`, seed 1, whose backgrounds show vessels) most pieces of vessels lay
/// farther below the wire than that; a few did not, and are left to the other view.
const FAINTER: f64 = 2.0;
/// Nearer to 0 or 1 a probability of single precision says nothing.
const SURE: f64 = 1e-6;

/// The masks without the pieces that are fainter than the rest or that the other view speaks against,
/// and how many pixels of each mask that left out. `maps` are the probabilities that the masks were
/// made of.
///
/// Every epipolar plane cuts the body as often as it cuts either of its images. So the pieces of both
/// masks are chosen, greedily, such that the two images are cut by each plane equally often: the piece
/// goes whose removal brings the counts nearest, as long as half of the piece stood against the other
/// view. A piece of a view that is hidden in the other one goes with the strays; the last piece of a
/// view stays.
///
/// # Errors
/// [`Error::Segmentation`] for a mask without a pixel.
///
/// # Cost
/// Thinning of both masks, and O(pieces² · planes).
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
    let mut views = [
        Pieces::of(&masks[0], &maps[0], &at1).map_err(refuse(View1::NUMBER))?,
        Pieces::of(&masks[1], &maps[1], &at2).map_err(refuse(View2::NUMBER))?,
    ];
    let planes = Planes::through(&views);
    let counts = views.each_ref().map(|view| view.crossings(&planes));
    while let Some((view, piece)) = worst(&views, &counts, &planes) {
        views[view].kept[piece] = false;
    }
    Ok((views.each_ref().map(Pieces::mask), views.each_ref().map(Pieces::left_out)))
}

/// The piece that goes next.
fn worst(
    views: &[Pieces; 2],
    counts: &[Vec<Vec<i32>>; 2],
    planes: &Planes,
) -> Option<(usize, usize)> {
    let kept = |view: usize| {
        counts[view].iter().enumerate().filter(move |(piece, _)| views[view].kept[*piece])
    };
    let total = |view: usize, k: usize| kept(view).map(|(_, piece)| piece[k]).sum::<i32>();
    let surplus: Vec<i32> = (0..planes.count).map(|k| total(0, k) - total(1, k)).collect();
    let mut worst: Option<(i32, usize, usize)> = None;
    for (v, sign) in [(0, 1), (1, -1)] {
        if kept(v).count() < 2 {
            continue;
        }
        for (p, piece) in kept(v) {
            let mass: i32 = piece.iter().sum();
            let gain: i32 = surplus
                .iter()
                .zip(piece)
                .map(|(s, count)| s.abs() - (s - sign * count).abs())
                .sum();
            let stray = f64::from(gain) > DISAGREEING * f64::from(mass);
            if stray && worst.is_none_or(|(most, _, _)| gain > most) {
                worst = Some((gain, v, p));
            }
        }
    }
    worst.map(|(_, view, piece)| (view, piece))
}

/// The pieces of one mask: a step from pixel to pixel of its skeleton, as the angles of its ends.
struct Pieces {
    labels: Array2<u32>,
    kept: Vec<bool>,
    steps: Vec<Vec<(f64, f64)>>,
    /// Radians per px at every skeleton pixel.
    gradients: Vec<f64>,
}

impl Pieces {
    fn of(
        array: &Array2<bool>,
        map: &Array2<f32>,
        angle: &dyn Fn(f64, f64) -> Option<(f64, f64)>,
    ) -> Result<Self, SegError> {
        let mask = Mask::from_array(array.clone())?;
        mask.require_foreground()?;
        let components = Components::of(&mask)?;
        let thin = zhang_suen(&mask).into_array();
        let count = components.sizes().len();
        let labels = components.labels().clone();
        let mut steps = vec![Vec::new(); count];
        let mut logits = vec![Vec::new(); count];
        let mut gradients = Vec::new();
        let set = |row: usize, column: usize| thin.get([row, column]).copied().unwrap_or(false);
        for ((row, column), _) in thin.indexed_iter().filter(|(_, set)| **set) {
            let piece = labels[[row, column]] as usize - 1;
            let probability = map.get([row, column]).map_or(0.0, |p| f64::from(*p));
            let sure = probability.clamp(SURE, 1.0 - SURE);
            logits[piece].push((sure / (1.0 - sure)).ln());
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
                    steps[piece].push((from.min(to), from.max(to)));
                }
            }
        }
        let medians: Vec<f64> = logits.iter_mut().map(|of_piece| median(of_piece)).collect();
        let surest = medians.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let kept = medians.iter().map(|logit| *logit >= surest - FAINTER).collect();
        Ok(Self { labels, kept, steps, gradients })
    }

    /// How often each plane cuts each piece.
    fn crossings(&self, planes: &Planes) -> Vec<Vec<i32>> {
        let of_piece = |steps: &Vec<(f64, f64)>| {
            let mut counts = vec![0; planes.count];
            for (low, high) in steps {
                for count in &mut counts[planes.below(*low)..planes.below(*high)] {
                    *count += 1;
                }
            }
            counts
        };
        self.steps.iter().map(of_piece).collect()
    }

    fn left_out(&self) -> usize {
        self.labels.iter().filter(|label| **label > 0 && !self.kept[**label as usize - 1]).count()
    }

    fn mask(&self) -> Array2<bool> {
        self.labels.mapv(|label| label > 0 && self.kept[label as usize - 1])
    }
}

/// Planes about the baseline, equally far apart.
struct Planes {
    first: f64,
    step: f64,
    count: usize,
}

impl Planes {
    fn through(views: &[Pieces; 2]) -> Self {
        let steps = || views.iter().flat_map(|view| view.steps.iter().flatten());
        let first = steps().map(|(low, _)| *low).fold(f64::INFINITY, f64::min);
        let last = steps().map(|(_, high)| *high).fold(f64::NEG_INFINITY, f64::max);
        // The finer of the two images decides.
        let typical = |view: &Pieces| median(&mut view.gradients.clone());
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
    use accurate_synth::{CaseOptions, Family, generate};

    use super::*;

    /// Maps that are equally sure of every pixel of the masks.
    fn sure(masks: &[Array2<bool>; 2]) -> [Array2<f32>; 2] {
        masks.each_ref().map(|mask| mask.mapv(|set| if set { 0.99 } else { 0.01 }))
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
