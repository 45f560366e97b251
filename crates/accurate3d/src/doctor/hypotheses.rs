use accurate_geom::Camera;

use super::SAME_NATS;
use super::evidence::{Evidence, Explains};
use super::mistake::{LensCentre, Mistake, Which};

/// A mistake that may have been made, and how well everything fits if it is undone.
#[derive(Debug, Clone)]
pub(super) struct Hypothesis {
    pub mistake: Mistake,
    pub which: Which,
    pub cameras: [Camera; 2],
    pub explains: Explains,
}

/// Mistakes without a number to be found, likelier ones first: where two explain the same, the first
/// is named.
const PLAIN: [Mistake; 20] = [
    Mistake::ViewsSwapped,
    Mistake::InverseExtrinsics,
    Mistake::TransposedRotation,
    Mistake::CentreAsTranslation,
    Mistake::PrimarySign,
    Mistake::SecondarySign,
    Mistake::BothAngleSigns,
    Mistake::AnglesExchanged,
    Mistake::MirroredColumns,
    Mistake::MirroredRows,
    Mistake::HalfTurn,
    Mistake::RowsAsColumns,
    Mistake::GraphicsAxes,
    Mistake::WorldAxes,
    Mistake::UnitOfView(10.0),
    Mistake::UnitOfView(0.1),
    Mistake::UnitOfView(1000.0),
    Mistake::UnitOfView(0.001),
    Mistake::ImageScale(2.0),
    Mistake::ImageScale(0.5),
];

/// Steps of a search for a number, before it is refined.
const STEPS: i32 = 24;
/// Steps of refinement; each leaves 0.62 of the interval.
const REFINEMENTS: usize = 14;
/// Magnifications looked at are between 1 over this and this. C-arms have 1.1 to 1.8.
const MOST_MAGNIFIED: f64 = 2.0;
/// Less magnification than this is an imprecise calibration, not a wrong spacing.
const LEAST_MAGNIFIED: f64 = 1.08;
/// Largest displacement by a lens that is looked at, as a share of the distance from the middle, at
/// the image's corner.
const MOST_DISTORTED: f64 = 0.25;
/// Largest displacement of pixels across their epipolar lines that is looked at, as a share of the
/// image's width.
const MOST_DISPLACED: f64 = 0.08;
/// Less displacement than this, px, is an imprecise calibration: `--refine-calibration` is for it.
const LEAST_DISPLACED_PX: f64 = 3.0;

/// Every single mistake undone, that can be in these cameras.
pub(super) fn singles(cameras: &[Camera; 2], evidence: &Evidence) -> Vec<Hypothesis> {
    let mut all = plain(cameras, evidence);
    // Curves find partners anew under every hypothesis, and partners give way to what moves pixels
    // little: only points with known partners tell such mistakes.
    if evidence.is_matched() {
        all.extend(small(cameras, evidence));
    }
    all.extend(
        Which::ALL
            .into_iter()
            .filter_map(|which| tried(Mistake::LensRemovedTwice, which, cameras, evidence)),
    );
    all
}

/// Those that move pixels little.
fn small(cameras: &[Camera; 2], evidence: &Evidence) -> Vec<Hypothesis> {
    let mut all = Vec::new();
    for which in Which::ALL {
        for shift in [0.5, -0.5] {
            let half = tried(Mistake::PixelOrigin(shift), which, cameras, evidence);
            let whole = tried(Mistake::PixelOrigin(2.0 * shift), which, cameras, evidence);
            // Where a whole pixel is plainly better still, half a pixel is not what is wrong.
            let more = whole.map_or(f64::INFINITY, |h| h.explains.nats + SAME_NATS);
            all.extend(half.filter(|h| h.explains.nats <= more));
        }
    }
    for which in Which::ALL {
        let magnified = |x: f64| Mistake::Magnification(x.exp());
        let most = MOST_MAGNIFIED.ln();
        all.extend(searched(magnified, most, which, cameras, evidence).filter(|h| {
            matches!(h.mistake, Mistake::Magnification(m) if m.ln().abs() > LEAST_MAGNIFIED.ln())
        }));
        all.extend(lens(which, cameras, evidence).filter(|(_, px)| *px > 1.0).map(|(h, _)| h));
    }
    all
}

/// Pixels that `K`, `R` and `t` do not hold for: by a lens, or all much alike. `turns` are matched
/// points where curves turn round.
pub(super) fn displaced(cameras: &[Camera; 2], turns: &Evidence) -> Vec<Hypothesis> {
    let most = MOST_DISPLACED * f64::from(cameras[1].size().width);
    let alike = searched(Mistake::PixelsDisplaced, most, Which::Both, cameras, turns).filter(
        |h| matches!(h.mistake, Mistake::PixelsDisplaced(px) if px.abs() > LEAST_DISPLACED_PX),
    );
    let lenses = Which::ALL.into_iter().filter_map(|which| {
        lens(which, cameras, turns).filter(|(_, px)| *px > LEAST_DISPLACED_PX).map(|(h, _)| h)
    });
    lenses.chain(alike).collect()
}

/// The best lens about either centre, and by how much it moves pixels, px, at the middle of the sides
/// of the larger image.
fn lens(which: Which, cameras: &[Camera; 2], evidence: &Evidence) -> Option<(Hypothesis, f64)> {
    let about = |about: LensCentre| {
        let lens = |share: f64| Mistake::LensNotRemoved { share, about };
        searched(lens, MOST_DISTORTED, which, cameras, evidence)
    };
    let both = [about(LensCentre::PrincipalPoint), about(LensCentre::Middle)];
    let better = |a: &Hypothesis, b: &Hypothesis| a.explains.nats.total_cmp(&b.explains.nats);
    let found = both.into_iter().flatten().min_by(better)?;
    let Mistake::LensNotRemoved { share, .. } = found.mistake else { return None };
    let moved = cameras.each_ref().map(|camera| {
        let (w, h) = (f64::from(camera.size().width), f64::from(camera.size().height));
        share.abs() * 0.5 * w * (w * w) / (w * w + h * h)
    });
    Some((found, moved[0].max(moved[1])))
}

/// The mistakes without a number, alone.
pub(super) fn plain(cameras: &[Camera; 2], evidence: &Evidence) -> Vec<Hypothesis> {
    let mut all: Vec<Hypothesis> = Vec::new();
    for mistake in PLAIN {
        let views: &[Which] = match mistake {
            Mistake::ViewsSwapped => &[Which::Both],
            // Of both views alike, they change nothing that two views show.
            Mistake::WorldAxes | Mistake::UnitOfView(_) => &[Which::View1, Which::View2],
            _ => &Which::ALL,
        };
        all.extend(views.iter().filter_map(|which| tried(mistake, *which, cameras, evidence)));
    }
    all
}

fn tried(
    mistake: Mistake,
    which: Which,
    cameras: &[Camera; 2],
    evidence: &Evidence,
) -> Option<Hypothesis> {
    let mended = mistake.mend(which, cameras)?;
    let explains = evidence.explained_by(&mended)?;
    Some(Hypothesis { mistake, which, cameras: mended, explains })
}

/// The best number of a mistake, within `-most..most`: a grid, then a golden section.
fn searched(
    mistake: impl Fn(f64) -> Mistake,
    most: f64,
    which: Which,
    cameras: &[Camera; 2],
    evidence: &Evidence,
) -> Option<Hypothesis> {
    let at = |x: f64| tried(mistake(x), which, cameras, evidence);
    let cost = |h: &Option<Hypothesis>| h.as_ref().map_or(f64::INFINITY, |h| h.explains.nats);
    let step = 2.0 * most / f64::from(STEPS);
    let (mut middle, mut best) = (0.0, None);
    for i in 0..=STEPS {
        let x = -most + step * f64::from(i);
        let tried = at(x);
        if cost(&tried) < cost(&best) {
            (middle, best) = (x, tried);
        }
    }
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut low, mut high) = (middle - step, middle + step);
    let inner = |low: f64, high: f64| golden * (high - low);
    let (mut a, mut b) = (high - inner(low, high), low + inner(low, high));
    let (mut at_a, mut at_b) = (at(a), at(b));
    for _ in 0..REFINEMENTS {
        if cost(&at_a) <= cost(&at_b) {
            (high, b, at_b) = (b, a, at_a);
            a = high - inner(low, high);
            at_a = at(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + inner(low, high);
            at_b = at(b);
        }
    }
    let refined = if cost(&at_a) <= cost(&at_b) { at_a } else { at_b };
    if cost(&refined) <= cost(&best) { refined } else { best }
}
