use std::ops::Range;

use accurate_geom::nalgebra::Vector2;
use accurate_geom::{Curve3, Point2};

use super::drawing::each_darkness;
use super::fit::{BLUR_PX, IntensityPair, Start, amplitude};
use crate::FitError;

/// Pieces that are judged as one: one px says little beside its noise.
const TOGETHER: usize = 2;
/// What is darker or brighter than this, in standard deviations of the noise, is another body, unless the
/// curve itself is: then it may be twice as dark.
const MOST: f64 = 6.0;
/// A piece lies upon the rest of the curve where that darkens its pixels by more than this part of what it
/// does itself: lines of one width that are less than three standard deviations of it apart, about 3 px.
const UPON: f64 = 0.15;
/// Nearer to the cut, px, it is the rest of the curve that a piece continues.
const AT_CUT_PX: f64 = 3.0;

/// Which end of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurveEnd {
    /// Where the parameter is least.
    Begin,
    /// Where it is largest.
    End,
}

/// A piece of a curve, and how far the pictures show it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShownPiece {
    /// Length of the piece, px.
    pub length_px: f64,
    /// Where each view has it.
    pub images: [Point2; 2],
    /// How far each picture shows it: 1 where it is as dark as the rest of the curve, or darker, -1 where it
    /// is as bright as its surroundings, or brighter.
    pub shown: [f64; 2],
    /// Whether it lies upon the rest of the curve in each view.
    pub upon: [bool; 2],
}

/// The ends of a curve beside the pictures.
#[derive(Debug)]
pub struct CurveEnds<'a> {
    pair: &'a IntensityPair,
    start: Start,
    /// Optical depth per world unit of the curve, in standard deviations of each view's noise.
    scale: [f64; 2],
    /// Darkest that it is drawn in each view, in the same unit.
    darkest: [f64; 2],
}

impl IntensityPair {
    /// A curve, one of those that the pair is around, to ask how far the pictures show its ends. Like the
    /// start of a fit it is continued at both by
    /// [`extension_px`](crate::IntensityFitParams::extension_px).
    ///
    /// # Errors
    /// As [`fit_intensities`](crate::fit_intensities).
    pub fn ends(&self, curve: &Curve3) -> Result<CurveEnds<'_>, FitError> {
        let start = Start::new(curve, &self.projectors, &self.params)?;
        let (mut scale, mut darkest) = ([0.0; 2], [0.0; 2]);
        for view in 0..2 {
            let drawn = self.drawn(&start, 0..start.samples, view, 1.0);
            scale[view] = amplitude(&drawn, &self.bands[view].depth)
                .ok_or(FitError::NotSeenInImage { view: view as u8 + 1 })?;
            darkest[view] = scale[view] * drawn.iter().copied().fold(0.0, f64::max);
        }
        Ok(CurveEnds { pair: self, start, scale, darkest })
    }

    /// What some pieces of a curve draw into the band of a view.
    fn drawn(&self, curve: &Start, pieces: Range<usize>, view: usize, scale: f64) -> Vec<f64> {
        let mut drawn = vec![0.0; self.bands[view].depth.len()];
        self.each_darkness(curve, pieces, view, |_, n, d| drawn[n] += scale * d);
        drawn
    }

    fn each_darkness(
        &self,
        curve: &Start,
        pieces: Range<usize>,
        view: usize,
        visit: impl FnMut(usize, usize, f64),
    ) {
        let brush = (&self.projectors[view], BLUR_PX);
        each_darkness(&curve.spline, curve.samples, pieces, brush, &self.bands[view], visit);
    }
}

impl CurveEnds<'_> {
    /// Length of the curve, px.
    pub fn length_px(&self) -> f64 {
        self.start.length_px
    }

    /// How far the pictures show what of the curve lies beyond `cut_px` from one of its ends, the rest of it
    /// taken for granted; from the end inwards. None if that is all of the curve, or nothing.
    ///
    /// A piece is drawn as dark as the curve is on average. Where the picture has all of that darkness beside
    /// what the rest of the curve explains, drawing it explains as much as its own square; where it has none,
    /// it costs as much.
    ///
    /// # Cost
    /// O(length · blur²).
    pub fn beyond(&self, end: CurveEnd, cut_px: f64) -> Vec<ShownPiece> {
        let Start { spline, samples, length_px, .. } = &self.start;
        let samples = *samples;
        let cut = (cut_px / length_px * samples as f64).round();
        let cut = if cut > 0.0 { (cut as usize).min(samples) } else { 0 };
        let [rest, tail] = match end {
            CurveEnd::Begin => [cut..samples, 0..cut],
            CurveEnd::End => [0..samples - cut, samples - cut..samples],
        };
        if rest.is_empty() || tail.is_empty() {
            return Vec::new();
        }
        // Groups from the end inwards, so that the same ones come with every cut.
        let group = |piece: usize| {
            let from_end = match end {
                CurveEnd::Begin => piece,
                CurveEnd::End => samples - 1 - piece,
            };
            from_end / TOGETHER
        };
        let groups = cut.div_ceil(TOGETHER);
        let mut pieces = vec![[Sums::default(); 2]; groups];
        for view in 0..2 {
            let (pair, scale) = (self.pair, self.scale[view]);
            let depth = &pair.bands[view].depth;
            let most = MOST.max(2.0 * self.darkest[view]);
            let [by_rest, by_tail] =
                [&rest, &tail].map(|range| pair.drawn(&self.start, range.clone(), view, scale));
            pair.each_darkness(&self.start, tail.clone(), view, |k, n, d| {
                let sums = &mut pieces[group(k)][view];
                let darkness = scale * d;
                sums.left += darkness * (depth[n] - by_rest[n]).clamp(-most, most);
                sums.own += darkness * by_tail[n];
                sums.rest += darkness * by_rest[n];
            });
        }
        let each_px = length_px / samples as f64;
        pieces
            .iter()
            .enumerate()
            .map(|(k, sums)| {
                let count = TOGETHER.min(cut - k * TOGETHER);
                let from_end = (k * TOGETHER) as f64 + 0.5 * count as f64;
                let u = from_end / samples as f64 * spline.spans() as f64;
                let u = if end == CurveEnd::Begin { u } else { spline.spans() as f64 - u };
                let place = spline.point(u);
                let near_cut = (cut as f64 - from_end) * each_px < AT_CUT_PX;
                ShownPiece {
                    length_px: count as f64 * each_px,
                    images: [0, 1].map(|view| {
                        let image: Vector2<f64> = self.pair.projectors[view].project(&place);
                        image.into()
                    }),
                    shown: sums.map(Sums::shown),
                    upon: sums.map(|sums| !near_cut && sums.rest > UPON * sums.own),
                }
            })
            .collect()
    }
}

/// Products of what a piece draws, over the pixels of a view.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// With what the rest of the curve leaves of the picture.
    left: f64,
    /// With what it and its neighbours draw.
    own: f64,
    /// With what the rest of the curve draws.
    rest: f64,
}

impl Sums {
    /// What drawing it gains, in units of its own half square; what the picture does not reach is not shown.
    fn shown(self) -> f64 {
        let half = 0.5 * self.own;
        if half > 0.0 { ((self.left - half) / half).clamp(-1.0, 1.0) } else { -1.0 }
    }
}
