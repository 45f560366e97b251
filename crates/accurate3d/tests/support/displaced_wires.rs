//! Wires in random rigs whose pixels are not those that the cameras hold for, and the same sound.

use accurate_geom::nalgebra::Vector2;
use accurate_geom::{LengthUnit, Pixel, Rig, View1, View2, sampson_distance};
use accurate3d::doctor::{Diagnosis, LEAST_PLACES, Mistake, Seen, Verdict, Which, diagnose};

use crate::mistaken_rigs::{Scene, Stream, Wire, sound, through_lens, wires};

/// Pictures of one rig.
pub const WIRES: usize = 12;

/// What was done to the pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Done {
    Nothing,
    /// The lens was not removed from them; the share that it moves the image's corner by.
    Lens(Which, f64),
    /// One picture was moved, px.
    Moved(usize, Vector2<f64>),
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    pub done: Done,
    /// Root mean square distance of true partners to their epipolar lines (Sampson), px.
    pub off_px: f64,
    pub turning_places: usize,
    pub told: Diagnosis,
}

impl Outcome {
    /// Whether it can be seen at all: partners are off by more than tracing errs, and enough places
    /// show it.
    pub fn shows(&self) -> bool {
        self.off_px > 3.0 && self.turning_places >= LEAST_PLACES
    }

    /// Whether the one finding, or one that it cannot be told from, is what was done. To have the
    /// pixels undistorted, or else the picture's place corrected, is the remedy of both kinds.
    pub fn named(&self) -> bool {
        let [finding] = self.told.findings.as_slice() else { return false };
        std::iter::once(&(finding.mistake, finding.which)).chain(&finding.or).any(
            |(mistake, which)| match (self.done, mistake) {
                (Done::Lens(made, _), Mistake::LensNotRemoved { .. }) => made == *which,
                (Done::Moved(..), Mistake::PixelsDisplaced(_)) => true,
                _ => false,
            },
        )
    }

    pub fn alarm(&self) -> bool {
        self.told.verdict != Verdict::Sound || !self.told.findings.is_empty()
    }
}

/// Nothing done to the pixels of a rig, a lens left in, a picture moved.
pub fn outcomes(seed: u64, index: u64) -> Vec<Outcome> {
    let scene = sound(seed, index);
    let wires = wires(&scene, WIRES, seed, index);
    let mut stream = Stream::of(seed ^ 0xd15, index);
    let which = Which::ALL[(index / 3 % 3) as usize];
    let sign = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
    let share = sign * stream.between(0.04, 0.15);
    let angle = stream.between(0.0, std::f64::consts::TAU);
    let moved = stream.between(5.0, 20.0) * Vector2::new(angle.cos(), angle.sin());
    [Done::Nothing, Done::Lens(which, share), Done::Moved((index % 2) as usize, moved)]
        .into_iter()
        .map(|done| outcome(&scene, &wires, done))
        .collect()
}

fn outcome(scene: &Scene, wires: &[Wire], done: Done) -> Outcome {
    let spoiled = |view: usize, p: &accurate_geom::Point2| match done {
        Done::Lens(Which::View1, _) if view == 1 => *p,
        Done::Lens(Which::View2, _) if view == 0 => *p,
        Done::Lens(_, share) => through_lens(&scene.cameras[view], share, p),
        Done::Moved(which, by) if which == view => p + by,
        _ => *p,
    };
    let seen = wires
        .iter()
        .map(|w| [0, 1].map(|view| w.traced[view].iter().map(|p| spoiled(view, p)).collect()))
        .collect();
    let [one, two] = scene.cameras.clone();
    let rig = Rig::new(one, two, LengthUnit::Millimetre).unwrap();
    let off: Vec<f64> = wires
        .iter()
        .flat_map(|w| &w.exact)
        .map(|[p, q]| {
            let (p, q) = (spoiled(0, p), spoiled(1, q));
            let (p, q) = (Pixel::<View1>::from(p), Pixel::<View2>::from(q));
            sampson_distance(rig.fundamental(), p, q).unwrap().powi(2)
        })
        .collect();
    let off_px = (off.iter().sum::<f64>() / off.len() as f64).sqrt();
    let told = diagnose(&scene.cameras, LengthUnit::Millimetre, &Seen::Curves(seen)).unwrap();
    let turning_places = told.turning_places.unwrap_or(0);
    Outcome { done, off_px, turning_places, told }
}
