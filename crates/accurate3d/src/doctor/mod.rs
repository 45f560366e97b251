//! What is wrong with the cameras: the usual mistakes tried one by one against what both views show.
//!
//! A mistake in handing over cameras (inverse extrinsics, mirrored images, a wrong unit) moves
//! epipolar lines by tens of pixels. Undoing the right one lets them pass through their points again.
//! Mistakes that change nothing between the two views cannot be found so; [`Diagnosis`] says which.

mod evidence;
mod hypotheses;
mod mistake;
mod scale;
mod turns;

use accurate_geom::{Camera, GeomError, LengthUnit, Point2};
use thiserror::Error;

use evidence::{Evidence, Explains};
pub use evidence::{MOST_TANGLED, Seen};
use hypotheses::{Hypothesis, displaced, plain, singles};
pub use mistake::{LensCentre, Mistake, Which};
pub use scale::Remark;
pub use turns::LEAST_PLACES;

/// Why two views could not be examined.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DoctorError {
    /// Too little was seen.
    #[error("{found} points; at least {needed} are needed to tell anything")]
    TooFewPoints {
        /// What there is.
        found: usize,
        /// What is needed.
        needed: usize,
    },
    /// A pixel is not finite.
    #[error("point {index} is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// Points that are in no order along a body.
    #[error(
        "curve {curve} of view {view} is {times:.0} times as long as the diagonal of its box: its points \
         seem to be in no order"
    )]
    Tangled {
        /// Which pair of curves, from 1.
        curve: usize,
        /// 1 or 2.
        view: u8,
        /// Its length over the diagonal of its bounding box, more than [`MOST_TANGLED`].
        times: f64,
    },
    /// The cameras as given cannot be used together, and no mistake explains it.
    #[error("the two cameras are no rig: their centres coincide or a lens cannot be undone")]
    NoRig,
    /// A curve that cannot be used.
    #[error(transparent)]
    Geometry(#[from] GeomError),
}

/// A mistake that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What was done wrong.
    pub mistake: Mistake,
    /// In which views.
    pub which: Which,
    /// Residual before it is undone, px. Of displaced pixels seen with curves: where these turn round.
    pub before_px: f64,
    /// Residual after, px.
    pub after_px: f64,
    /// Other mistakes that explain what was seen as well: these views cannot tell them apart.
    pub or: Vec<(Mistake, Which)>,
}

/// What the examination came to.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Nothing speaks against the cameras.
    Sound,
    /// One or more mistakes explain what was wrong.
    Mistaken,
    /// Something is wrong, and none of the known mistakes explains it.
    Unexplained,
}

/// The result of [`diagnose`].
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// The summary.
    pub verdict: Verdict,
    /// Residual with the cameras as given, px: root mean square Sampson distance of the best 80 % of
    /// matched points, or mean cost per point of the match of curves. `None` if they are no rig.
    pub residual_px: Option<f64>,
    /// Share of what was matched that lies in front of both cameras, as given.
    pub in_front: f64,
    /// Matched points, or samples of curves.
    pub points: usize,
    /// Of curves that fit: the places where both turn round at an epipolar line, which alone show
    /// whether the pixels are displaced (a lens, a cropped picture). Fewer than [`LEAST_PLACES`]
    /// tell nothing.
    pub turning_places: Option<usize>,
    /// The mistakes, in the order in which they are to be undone.
    pub findings: Vec<Finding>,
    /// What looks odd without being a mistake for sure.
    pub remarks: Vec<Remark>,
    /// The cameras with everything undone.
    pub mended: [Camera; 2],
}

/// What two views of the same scene can never show, however good the data.
pub const CANNOT_BE_TOLD: [&str; 3] = [
    "a unit of length that is wrong in both views alike (all residuals stay; only sizes tell)",
    "a world frame that is wrong in both views alike (LPS for RAS, another origin)",
    "a mirror image of everything, where both images and the geometry are mirrored together",
];

/// Least log likelihood ratio for a mistake to be named. Some 200 hypotheses are tried: by chance one
/// in a thousand sound rigs would get here, and the ratios of residuals below make that rarer still.
const LEAST_NATS: f64 = 12.0;
/// Hypotheses within this of the best cannot be told from it (100 to 1).
const SAME_NATS: f64 = 4.6;
/// A mistake makes the residual fall to this share at most. Those that move pixels little have a right
/// to less: a lens, a magnification, half a pixel.
const LEAST_FALL: f64 = 0.7;
const LEAST_FALL_SMALL: f64 = 0.85;
const LEAST_FALL_HALF_PIXEL: f64 = 0.95;
const LEAST_FALL_TURNS: f64 = 0.5;
/// What is left is at most this, px, unless the residual has fallen to a third. For mistakes that move
/// pixels little it has to be noise: an imprecise calibration gives way to a number as well.
const PLAUSIBLE_PX: f64 = 3.0;
const NOISE_PX: f64 = 0.5;
const TRACED_PX: f64 = 1.5;
const LARGE_FALL: f64 = 0.35;
/// Less than this share in front of both cameras makes no scene.
const LEAST_IN_FRONT: f64 = 0.9;
/// Mistakes one after the other.
const MOST_FINDINGS: usize = 3;
/// First mistakes of a pair that are followed up.
const PAIRS_FOLLOWED: usize = 12;

/// Examines two cameras (world to camera, in `unit`) by what was seen with them.
///
/// # Errors
/// [`DoctorError`] if too little was seen, or if the cameras cannot be used and nothing explains why.
///
/// # Cost
/// Some 300 evaluations of the residual, and where one mistake does not explain everything some 1,000
/// more: 5 to 50 ms for 100 matched points, a second or more for curves.
pub fn diagnose(
    cameras: &[Camera; 2],
    unit: LengthUnit,
    seen: &Seen,
) -> Result<Diagnosis, DoctorError> {
    let evidence = Evidence::of(seen)?;
    let given = evidence.explained_by(cameras);
    let mut now = given;
    let mut mended = cameras.clone();
    let mut findings: Vec<Finding> = Vec::new();
    let mut turning_places = None;
    while findings.len() < MOST_FINDINGS {
        if let Evidence::Curves { curves, px } = &evidence
            && now.is_some_and(|now| is_plausible(&now, &evidence))
        {
            let turns = turns::of_curves(curves, *px, &mended);
            turning_places = Some(turns.len());
            if !findings.iter().any(is_of_pixels)
                && let Some((finding, h)) = displaced_pixels(&mended, turns)
            {
                now = evidence.explained_by(&h.cameras);
                mended = h.cameras;
                findings.push(finding);
                continue;
            }
        }
        let Some(found) = next_findings(&mended, now.as_ref(), &evidence) else { break };
        let Some(last) = found.last() else { break };
        now = Some(last.1.explains);
        mended = last.1.cameras.clone();
        findings.extend(found.into_iter().map(|(finding, _)| finding));
    }
    let Some(after) = now else { return Err(DoctorError::NoRig) };
    let verdict = if !is_plausible(&after, &evidence) {
        Verdict::Unexplained
    } else if findings.is_empty() {
        Verdict::Sound
    } else {
        Verdict::Mistaken
    };
    Ok(Diagnosis {
        verdict,
        residual_px: given.map(|g| g.residual_px),
        in_front: given.map_or(0.0, |g| g.in_front),
        points: evidence.count(),
        turning_places,
        findings,
        remarks: scale::remarks(&mended, unit, after.depth, seen),
        mended,
    })
}

/// Whether these are other pixels than the cameras hold for, by the places where curves turn round:
/// what moves pixels little does not show in the match of curves elsewhere.
fn displaced_pixels(
    cameras: &[Camera; 2],
    turns: Vec<[Point2; 2]>,
) -> Option<(Finding, Hypothesis)> {
    if turns.len() < LEAST_PLACES {
        return None;
    }
    let turns = Evidence::Matched(turns);
    let now = turns.explained_by(cameras);
    // A half turn of both pictures, for one, only moves them where the principal points are off the
    // middle: such a mistake is named beside, or before, if it explains as much.
    let all: Vec<_> =
        plain(cameras, &turns).into_iter().chain(displaced(cameras, &turns)).collect();
    named(&all, now.as_ref(), false).filter(|(finding, _)| is_of_pixels(finding))
}

/// Whether displaced pixels are what was found, or cannot be told from it.
fn is_of_pixels(finding: &Finding) -> bool {
    is_displacement(&finding.mistake) || finding.or.iter().any(|(m, _)| is_displacement(m))
}

const fn is_displacement(mistake: &Mistake) -> bool {
    matches!(mistake, Mistake::PixelsDisplaced(_) | Mistake::LensNotRemoved { .. })
}

/// The next mistake, or the next two where one alone explains too little.
fn next_findings(
    cameras: &[Camera; 2],
    now: Option<&Explains>,
    evidence: &Evidence,
) -> Option<Vec<(Finding, Hypothesis)>> {
    let all = singles(cameras, evidence);
    let single = named(&all, now, evidence.is_matched());
    let enough = |h: &Hypothesis| is_plausible(&h.explains, evidence);
    if let Some((finding, hypothesis)) = single.clone()
        && enough(&hypothesis)
    {
        return Some(vec![(finding, hypothesis)]);
    }
    // Sound as it is: nothing to look further for.
    if now.is_some_and(|now| is_plausible(now, evidence)) {
        return None;
    }
    // Two at once: the first may not help alone.
    let mut firsts = all;
    firsts.sort_by(|a, b| a.explains.nats.total_cmp(&b.explains.nats));
    let swapped = firsts.iter().position(|h| h.mistake == Mistake::ViewsSwapped);
    let followed = if evidence.is_matched() { firsts.len() } else { PAIRS_FOLLOWED };
    let mut best: Option<[(Finding, Hypothesis); 2]> = None;
    for (index, first) in firsts.iter().enumerate() {
        if index >= followed && Some(index) != swapped {
            continue;
        }
        let seconds = plain(&first.cameras, evidence);
        let Some((second, hypothesis)) = named(&seconds, now, evidence.is_matched()) else {
            continue;
        };
        let better = best
            .as_ref()
            .is_none_or(|[_, (_, b)]| hypothesis.explains.nats < b.explains.nats - SAME_NATS);
        if enough(&hypothesis) && better {
            let begin = now.map_or(f64::INFINITY, |n| n.residual_px);
            let half = Finding {
                mistake: first.mistake,
                which: first.which,
                before_px: begin,
                after_px: first.explains.residual_px,
                or: Vec::new(),
            };
            let second = Finding { before_px: first.explains.residual_px, ..second };
            best = Some([(half, first.clone()), (second, hypothesis)]);
        }
    }
    match (best, single) {
        (Some(pair), _) => Some(pair.to_vec()),
        (None, Some(single)) => Some(vec![single]),
        (None, None) => None,
    }
}

/// The mistake among `all` that explains what was seen, if one does.
fn named(
    all: &[Hypothesis],
    now: Option<&Explains>,
    matched: bool,
) -> Option<(Finding, Hypothesis)> {
    let better: Vec<&Hypothesis> = all.iter().filter(|h| is_better(h, now, matched)).collect();
    let least = better.iter().map(|h| penalised(h)).min_by(f64::total_cmp)?;
    // In the order of the list: the likelier mistake first.
    let mut same = better.into_iter().filter(|h| penalised(h) <= least + SAME_NATS);
    let first = same.next()?;
    let finding = Finding {
        mistake: first.mistake,
        which: first.which,
        before_px: now.map_or(f64::INFINITY, |n| n.residual_px),
        after_px: first.explains.residual_px,
        or: same.map(|h| (h.mistake, h.which)).collect(),
    };
    Some((finding, first.clone()))
}

/// A number that was searched for has to earn it (2 nats: Akaike's criterion counts 1).
fn penalised(h: &Hypothesis) -> f64 {
    let free = matches!(
        h.mistake,
        Mistake::Magnification(_) | Mistake::LensNotRemoved { .. } | Mistake::PixelsDisplaced(_)
    );
    h.explains.nats + if free { 2.0 } else { 0.0 }
}

fn is_better(h: &Hypothesis, now: Option<&Explains>, matched: bool) -> bool {
    if h.explains.in_front < LEAST_IN_FRONT {
        return false;
    }
    let Some(now) = now else { return true };
    // What lies behind the cameras is wrong however small the residual.
    if now.in_front < LEAST_IN_FRONT && h.explains.nats <= now.nats + SAME_NATS {
        return true;
    }
    let fall = h.explains.residual_px / now.residual_px;
    let (share, left_px) = match h.mistake {
        Mistake::PixelOrigin(_) => (LEAST_FALL_HALF_PIXEL, NOISE_PX),
        Mistake::Magnification(_) | Mistake::LensNotRemoved { .. } | Mistake::LensRemovedTwice
            if matched =>
        {
            (LEAST_FALL_SMALL, NOISE_PX)
        }
        // Seen where curves turn round, and traced no better than to a pixel.
        mistake if is_displacement(&mistake) => (LEAST_FALL_TURNS, TRACED_PX),
        _ => (LEAST_FALL, PLAUSIBLE_PX),
    };
    let plausible = !matched || h.explains.residual_px <= left_px || fall <= LARGE_FALL;
    now.nats - penalised(h) >= LEAST_NATS && fall <= share && plausible
}

/// Whether cameras explain what was seen well enough to leave it at that.
fn is_plausible(explains: &Explains, evidence: &Evidence) -> bool {
    let residual = match evidence {
        Evidence::Matched(_) => explains.residual_px <= PLAUSIBLE_PX,
        // In samples; leaving everything out costs 0.9.
        Evidence::Curves { px, .. } => explains.residual_px / px <= 0.45,
    };
    residual && explains.in_front >= LEAST_IN_FRONT
}
