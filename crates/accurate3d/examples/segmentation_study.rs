//! A segmentation network on labelled X-ray images: its scores, and the post-processing that suits it.
//!
//! `cargo run --release -p accurate3d --features rten --example segmentation_study -- WHAT MODEL SEED COUNT [GENERATOR | IMAGE...]`
//!
//! WHAT is `score` (recall and precision at 2 px, clDice, mean distance of the skeletons' pixels both
//! ways, with the model's own post-processing: means and the median distance, with 95 % intervals),
//! `oracle` (the same without the pieces that are false by the truth, which no rule can know as well)
//! or `tune` (the same over a grid of thresholds, smallest pieces and spurs; the best are printed
//! last; seed 1500 is for this). GENERATOR is `training` (the default), `held-out`, `phantom`, or a family of
//! cases (`medium`, `carm`, ...), of whose pictures both views are taken. With images, wires are drawn
//! onto their middle squares instead of onto generated anatomy, and COUNT images are made of them in
//! turn.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::Path;
use std::str::FromStr;

use accurate3d::eval::{
    bootstrap_mean, centreline_distance, cl_dice, quantile_interval, skeleton_agreement,
};
use accurate3d::geom::Point2;
use accurate3d::io::{read_file, read_grey};
use accurate3d::seg::network::{
    MAX_MODEL_BYTES, ModelBundle, NetworkOptions, NetworkSegmenter, RtenEngine,
};
use accurate3d::seg::{Components, Mask, PostProcessing, Segmenter, unwatched, zhang_suen};
use accurate3d::synth::{
    CaseOptions, Family, XrayDomain, XrayOptions, draw_xray, draw_xray_held_out, draw_xray_onto,
    draw_xray_phantom, generate, render_xray,
};
use ndarray::Array2;
use rayon::prelude::*;

/// Side of the images, px.
const SIDE: usize = 512;
/// Tolerance of recall and precision, px.
const TOLERANCE_PX: f64 = 2.0;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [what, model, seed, count, images @ ..] = args.as_slice() else {
        return Err("give score, oracle or tune, a model, a seed and a number of images".into());
    };
    let (seed, count): (u64, u64) = (seed.parse()?, count.parse()?);
    let bundle = ModelBundle::read(read_file(Path::new(model), MAX_MODEL_BYTES)?.into())?;
    let own = bundle.manifest().postprocessing;
    let engine = Box::new(RtenEngine::new(&bundle, rayon::current_num_threads())?);
    let segmenter = NetworkSegmenter::new(&bundle, engine, NetworkOptions::DEFAULT)?;
    let images = Images::of(images)?;

    let mut seen = Vec::new();
    for index in 0..count {
        let (image, mask) = images.sample(seed, index)?;
        if mask.iter().any(|set| *set) {
            seen.push((segmenter.segment(&image, &unwatched)?.probability, mask));
        }
    }
    println!("{} of {count} images show a wire; {}", seen.len(), segmenter.describe());
    match what.as_str() {
        "score" => Scores::of(&seen, own, Pieces::AsFound)?.print()?,
        "oracle" => Scores::of(&seen, own, Pieces::True)?.print()?,
        "tune" => tune(&seen)?,
        _ => return Err(format!("`{what}` is neither score nor oracle nor tune").into()),
    }
    Ok(())
}

/// What the images are.
enum Images {
    Training,
    HeldOut,
    Phantom,
    /// Both views of cases.
    Pairs(Family),
    /// Wires on these squares.
    Onto(Vec<Array2<u8>>),
}

impl Images {
    fn of(args: &[String]) -> Result<Self, Box<dyn Error>> {
        Ok(match args.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
            [] | ["training"] => Self::Training,
            ["held-out"] => Self::HeldOut,
            ["phantom"] => Self::Phantom,
            [name] if Family::from_str(name).is_ok() => Self::Pairs(Family::from_str(name)?),
            files => {
                let squares = files.iter().map(|file| square_of(Path::new(file)));
                Self::Onto(squares.collect::<Result<_, _>>()?)
            }
        })
    }

    /// The image and its mask.
    fn sample(&self, seed: u64, index: u64) -> Result<(Array2<f32>, Array2<bool>), Box<dyn Error>> {
        let side = SIDE as u32;
        let domain = XrayDomain { side_px: side, ..XrayDomain::default() };
        let sample = match self {
            Self::Training => draw_xray(&domain, seed, index)?,
            Self::HeldOut => draw_xray_held_out(side, seed, index)?,
            Self::Phantom => draw_xray_phantom(side, seed, index)?,
            Self::Pairs(family) => {
                let case = generate(*family, seed, index / 2, &CaseOptions::default())?;
                let view = (index % 2) as usize;
                let pictures = render_xray(&case, &XrayOptions::default());
                return Ok((pictures[view].mapv(f32::from), case.masks[view].clone()));
            }
            Self::Onto(squares) => {
                let square = &squares[(index % squares.len() as u64) as usize];
                draw_xray_onto(&domain, square, seed, index)?
            }
        };
        Ok((sample.image.mapv(f32::from), sample.mask))
    }
}

/// The middle of an image, 8 bits from its darkest to its brightest pixel.
fn square_of(path: &Path) -> Result<Array2<u8>, Box<dyn Error>> {
    let values = read_grey(path)?.values;
    let (rows, columns) = values.dim();
    if rows < SIDE || columns < SIDE {
        return Err(format!("{}: smaller than {SIDE} x {SIDE}", path.display()).into());
    }
    let (top, left) = ((rows - SIDE) / 2, (columns - SIDE) / 2);
    let (least, most) =
        values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
    let scale = 255.0 / (most - least).max(f32::MIN_POSITIVE);
    Ok(Array2::from_shape_fn((SIDE, SIDE), |(y, x)| {
        ((values[[top + y, left + x]] - least) * scale).round() as u8
    }))
}

/// Which pieces of a mask are scored.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pieces {
    AsFound,
    /// Those of whose skeleton at least half lies within [`TOLERANCE_PX`] of the true one.
    True,
}

/// Recall, precision, clDice and mean distance of the centrelines, px, of each image; none of one in which
/// nothing was found: it counts as 0 in recall and clDice, and not in precision and distance.
struct Scores(Vec<Option<[f64; 4]>>);

impl Scores {
    const RECALL: usize = 0;
    const PRECISION: usize = 1;
    const CL_DICE: usize = 2;
    const CENTRELINE_PX: usize = 3;

    fn of(
        seen: &[(Array2<f32>, Array2<bool>)],
        post: PostProcessing,
        pieces: Pieces,
    ) -> Result<Self, Box<dyn Error>> {
        let each = seen
            .par_iter()
            .map(|(map, truth)| {
                let true_mask = Mask::from_array(truth.clone()).map_err(|e| e.to_string())?;
                let true_thin = zhang_suen(&true_mask);
                let mut found = post.mask_of(map).map_err(|e| e.to_string())?;
                if pieces == Pieces::True {
                    found = true_pieces(&found, &true_thin)?;
                }
                if found.is_empty() {
                    return Ok(None);
                }
                let thin = zhang_suen(&found);
                let (a, b) = (thin.as_array().view(), true_thin.as_array().view());
                let agreement =
                    skeleton_agreement(a, b, TOLERANCE_PX).map_err(|e| e.to_string())?;
                let dice = cl_dice(found.as_array().view(), truth.view(), a, b)
                    .map_err(|e| e.to_string())?;
                let distance = centreline_distance(&pixels(&thin), &pixels(&true_thin))
                    .map_err(|e| e.to_string())?;
                Ok(Some([agreement.recall, agreement.precision, dice, distance.mean]))
            })
            .collect::<Result<Vec<_>, String>>()?;
        Ok(Self(each))
    }

    /// Of each image that counts.
    fn of_each(&self, score: usize) -> Vec<f64> {
        let without = matches!(score, Self::RECALL | Self::CL_DICE).then_some(0.0);
        self.0.iter().filter_map(|found| found.map(|found| found[score]).or(without)).collect()
    }

    fn mean(&self, score: usize) -> f64 {
        let values = self.of_each(score);
        values.iter().sum::<f64>() / values.len().max(1) as f64
    }

    fn nothing_found(&self) -> usize {
        self.0.iter().filter(|found| found.is_none()).count()
    }

    /// The harmonic mean of recall and precision.
    fn f_score(&self) -> f64 {
        let (recall, precision) = (self.mean(Self::RECALL), self.mean(Self::PRECISION));
        2.0 * recall * precision / (recall + precision).max(f64::MIN_POSITIVE)
    }

    /// Means with 95 % intervals over the images, and the median distance.
    fn print(&self) -> Result<(), Box<dyn Error>> {
        println!("nothing found in {} of {}", self.nothing_found(), self.0.len());
        for (name, score) in [
            ("recall at 2 px", Self::RECALL),
            ("precision at 2 px", Self::PRECISION),
            ("clDice", Self::CL_DICE),
            ("centreline, px", Self::CENTRELINE_PX),
        ] {
            let values = self.of_each(score);
            if !values.is_empty() {
                let of = bootstrap_mean(&values, 10_000, name)?;
                println!("{name}: {:.4} [{:.4}, {:.4}]", of.mean, of.low, of.high);
            }
        }
        let distances = self.of_each(Self::CENTRELINE_PX);
        if !distances.is_empty() {
            let of = quantile_interval(&distances, 0.5)?;
            println!("centreline, median, px: {:.4} [{:.4}, {:.4}]", of.value, of.low, of.high);
        }
        Ok(())
    }
}

impl std::fmt::Display for Scores {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "recall {:.4} precision {:.4} F {:.4} clDice {:.4} centreline {:.2} px, nothing found in {}",
            self.mean(Self::RECALL),
            self.mean(Self::PRECISION),
            self.f_score(),
            self.mean(Self::CL_DICE),
            self.mean(Self::CENTRELINE_PX),
            self.nothing_found()
        )
    }
}

/// [`Pieces::True`].
fn true_pieces(found: &Mask, true_thin: &Mask) -> Result<Mask, String> {
    let components = Components::of(found).map_err(|e| e.to_string())?;
    let mut kept = Array2::from_elem(found.shape(), false);
    for number in (1..).take(components.sizes().len()) {
        let piece = components.labels().mapv(|label| label == number);
        let thin = zhang_suen(&Mask::from_array(piece.clone()).map_err(|e| e.to_string())?);
        let (a, b) = (thin.as_array().view(), true_thin.as_array().view());
        let agreement = skeleton_agreement(a, b, TOLERANCE_PX).map_err(|e| e.to_string())?;
        if agreement.precision >= 0.5 {
            kept.zip_mut_with(&piece, |kept, piece| *kept |= piece);
        }
    }
    Mask::from_array(kept).map_err(|e| e.to_string())
}

/// Each pixel of a skeleton as a point of its own.
fn pixels(thin: &Mask) -> Vec<Vec<Point2>> {
    let set = thin.as_array().indexed_iter().filter(|(_, set)| **set);
    set.map(|((row, column), _)| vec![Point2::new(column as f64, row as f64)]).collect()
}

fn tune(seen: &[(Array2<f32>, Array2<bool>)]) -> Result<(), Box<dyn Error>> {
    let mut all = Vec::new();
    for high in [0.3, 0.4, 0.5, 0.6, 0.7] {
        for share in [0.4, 0.6, 0.8, 1.0] {
            for min_length_px in [0, 12, 20, 30] {
                for max_spur_px in [0, 4, 8] {
                    let post = PostProcessing {
                        low: high * share,
                        high,
                        min_length_px,
                        max_spur_px,
                        ..PostProcessing::DEFAULT
                    };
                    all.push((Scores::of(seen, post, Pieces::AsFound)?, post));
                }
            }
        }
    }
    all.sort_by(|a, b| a.0.f_score().total_cmp(&b.0.f_score()));
    for (scores, post) in &all[all.len().saturating_sub(20)..] {
        println!(
            "low {:.2} high {:.2} smallest {:2} spur {}: {scores}",
            post.low, post.high, post.min_length_px, post.max_spur_px
        );
    }
    Ok(())
}
