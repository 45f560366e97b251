use std::fs;
use std::path::{Path, PathBuf};

use accurate3d::io::{
    hash_file, read_grey, remove_unfinished, write_json, write_npy_u8, write_rgb,
};
use accurate3d::synth::{
    SynthError, XRAY_VERSION, XrayDomain, XraySample, draw_xray, draw_xray_held_out,
    draw_xray_onto, draw_xray_phantom,
};
use indicatif::ProgressBar;
use ndarray::{Array2, Array4, Axis};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::args::{XrayArgs, XrayGenerator};
use crate::console::Console;
use crate::failure::Failure;
use crate::text::{has_extension, make_place_apart};

/// Name of the list of a folder of shards.
const LIST: &str = "shards.json";
/// Side of one tile of a contact sheet, px.
const TILE_PX: usize = 256;
/// Images side by side on a contact sheet; each takes two tiles.
const PER_ROW: usize = 4;
const MOST_ON_A_SHEET: u64 = 400;

/// `accurate synth xray`: shards to train on, a sheet to look at.
pub fn run(args: &XrayArgs, console: &Console) -> Result<(), Failure> {
    let domain = match args.generator {
        XrayGenerator::Pairs => XrayDomain::of_pairs(),
        _ => XrayDomain::default(),
    };
    let domain = XrayDomain { side_px: args.size, ..domain };
    domain.check()?;
    if args.first.checked_add(args.count).is_none() {
        return Err(Failure::new(Failure::USAGE, "--first plus --count is too large"));
    }
    if let Some(path) = &args.sheet {
        if !has_extension(path, "png") {
            let message = format!("a sheet is written as .png, not as {}", path.display());
            return Err(Failure::new(Failure::USAGE, message));
        }
        if args.count > MOST_ON_A_SHEET {
            let message =
                format!("--count {}: a sheet holds at most {MOST_ON_A_SHEET} images", args.count);
            return Err(Failure::new(Failure::USAGE, message));
        }
        make_place_apart(path, &args.onto)?;
    }
    let backgrounds: Vec<_> =
        args.onto.iter().map(|path| middle_of(path, args.size)).collect::<Result<_, _>>()?;
    let draw = |index: u64| match (args.generator, backgrounds.len() as u64) {
        (XrayGenerator::Training | XrayGenerator::Pairs, 0) => draw_xray(&domain, args.seed, index),
        (XrayGenerator::HeldOut, _) => draw_xray_held_out(args.size, args.seed, index),
        (XrayGenerator::Phantom, _) => draw_xray_phantom(args.size, args.seed, index),
        (XrayGenerator::Training | XrayGenerator::Pairs, files) => {
            draw_xray_onto(&domain, &backgrounds[(index % files) as usize], args.seed, index)
        }
    };
    if let Some(folder) = &args.shards {
        write_shards(folder, args, &draw, console)?;
    }
    if let Some(path) = &args.sheet {
        let last = args.first + args.count;
        let samples: Vec<_> =
            (args.first..last).into_par_iter().map(draw).collect::<Result<_, _>>()?;
        write_rgb(path, &sheet(&samples)).map_err(Failure::of_output)?;
        if !console.json {
            console.remark(&format!("{} images in {}", args.count, path.display()));
        }
    }
    if !console.json {
        return Ok(());
    }
    let place = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    console.json(&json!({
        "shards": place(&args.shards),
        "sheet": place(&args.sheet),
        "generator": generator_name(args)?,
        "seed": args.seed,
        "first": args.first,
        "images": args.count,
    }))
}

/// The square of `side` px in the middle of a grey image, as eight bits.
fn middle_of(path: &Path, side: u32) -> Result<Array2<u8>, Failure> {
    let image = read_grey(path)?;
    let ((height, width), side) = (image.values.dim(), side as usize);
    if height < side || width < side {
        let message = format!("{}: {width} x {height} px, less than {side}", path.display());
        return Err(Failure::new(Failure::BAD_INPUT, message).with_hint("give a smaller --size"));
    }
    let (top, left) = ((height - side) / 2, (width - side) / 2);
    let scale = 255.0 / image.depth.max_value();
    Ok(Array2::from_shape_fn((side, side), |(row, column)| {
        (image.values[[top + row, left + column]] * scale).round() as u8
    }))
}

/// The generator's name in a list of shards. Images that wires are drawn onto are named by their
/// hashes, so that a folder never mixes them.
fn generator_name(args: &XrayArgs) -> Result<String, Failure> {
    if args.onto.is_empty() {
        return Ok(match args.generator {
            XrayGenerator::Training => "xray".to_owned(),
            XrayGenerator::Pairs => "xray-pairs".to_owned(),
            XrayGenerator::HeldOut => "xray-held-out".to_owned(),
            XrayGenerator::Phantom => "xray-phantom".to_owned(),
        });
    }
    let hashes: Vec<_> = args.onto.iter().map(|p| hash_file(p)).collect::<Result<_, _>>()?;
    Ok(format!("xray-onto {}", hashes.join(" ")))
}

/// What a folder of shards holds, and what made it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct ShardList {
    /// The generator, with the version that changes whenever its images do.
    generator: String,
    version: u32,
    seed: u64,
    first: u64,
    size: u32,
    per_shard: u64,
    channels: [String; 3],
    /// Images of the shards below.
    count: u64,
    shards: Vec<Shard>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Shard {
    file: String,
    first: u64,
    count: u64,
}

/// Writes the shards that are not there yet, the list after each, so that a reader can start with
/// the first.
fn write_shards(
    folder: &Path,
    args: &XrayArgs,
    draw: &(impl Fn(u64) -> Result<XraySample, SynthError> + Sync),
    console: &Console,
) -> Result<(), Failure> {
    fs::create_dir_all(folder)
        .map_err(|e| Failure::new(Failure::IO, format!("{}: create: {e}", folder.display())))?;
    remove_unfinished(folder)?;
    let mut list = ShardList {
        generator: generator_name(args)?,
        version: XRAY_VERSION,
        seed: args.seed,
        first: args.first,
        size: args.size,
        per_shard: args.per_shard,
        channels: ["image", "mask", "tube"].map(str::to_owned),
        count: 0,
        shards: Vec::new(),
    };
    let done = shards_there(folder, &list)?;
    let bar = console.progress(args.count as usize, "drawing");
    for number in 0..args.count.div_ceil(args.per_shard) {
        let first = args.first + number * args.per_shard;
        let count = args.per_shard.min(args.first + args.count - first);
        let shard = Shard { file: format!("shard-{number:06}.npy"), first, count };
        let path = folder.join(&shard.file);
        if done.contains(&shard) && path.is_file() {
            bar.inc(count);
        } else {
            write_npy_u8(&path, &pack(&shard, args.size as usize, draw, &bar)?)?;
        }
        list.count += count;
        list.shards.push(shard);
        // What an earlier, longer run has beyond this point stays listed.
        let mut longer = list.clone();
        longer.shards.extend(done.iter().filter(|s| s.first > first).cloned());
        longer.count = longer.shards.iter().map(|s| s.count).sum();
        write_json(&folder.join(LIST), &longer)?;
    }
    bar.finish_and_clear();
    console.remark(&format!("{} images in {}", args.count, folder.display()));
    Ok(())
}

/// The shards of an earlier run with the same parameters; refuses a folder of another set.
fn shards_there(folder: &Path, wanted: &ShardList) -> Result<Vec<Shard>, Failure> {
    let path = folder.join(LIST);
    let text = match fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(Failure::new(Failure::IO, format!("{}: {e}", path.display()))),
    };
    let found: ShardList = serde_json::from_str(&text)
        .map_err(|e| Failure::new(Failure::BAD_INPUT, format!("{}: {e}", path.display())))?;
    let same = ShardList { count: wanted.count, shards: wanted.shards.clone(), ..found.clone() };
    if same != *wanted {
        let message = format!(
            "{} is of another set: {} version {}, seed {}, first {}, {} px, {} a shard",
            path.display(),
            found.generator,
            found.version,
            found.seed,
            found.first,
            found.size,
            found.per_shard
        );
        return Err(Failure::new(Failure::USAGE, message)
            .with_hint("give another folder, or remove this one"));
    }
    Ok(found.shards)
}

/// The images of one shard, drawn in parallel, each into its own place.
fn pack(
    shard: &Shard,
    side: usize,
    draw: &(impl Fn(u64) -> Result<XraySample, SynthError> + Sync),
    bar: &ProgressBar,
) -> Result<Array4<u8>, Failure> {
    let samples: Vec<_> = (shard.first..shard.first + shard.count)
        .into_par_iter()
        .map(|index| draw(index).inspect(|_| bar.inc(1)))
        .collect::<Result<_, _>>()?;
    let mut array = Array4::zeros((samples.len(), 3, side, side));
    for (mut channels, sample) in array.outer_iter_mut().zip(&samples) {
        channels.index_axis_mut(Axis(0), 0).assign(&sample.image);
        channels.index_axis_mut(Axis(0), 1).assign(&sample.mask.mapv(u8::from));
        channels.index_axis_mut(Axis(0), 2).assign(&sample.tube.mapv(u8::from));
    }
    Ok(array)
}

/// Every image beside itself with its mask in red.
fn sheet(samples: &[XraySample]) -> Array2<[u8; 3]> {
    let rows = samples.len().div_ceil(PER_ROW);
    let columns = 2 * PER_ROW.min(samples.len());
    let mut sheet = Array2::from_elem((rows * TILE_PX, columns * TILE_PX), [32; 3]);
    for (k, sample) in samples.iter().enumerate() {
        let (top, left) = (k / PER_ROW * TILE_PX, k % PER_ROW * 2 * TILE_PX);
        let side = sample.image.nrows();
        for y in 0..TILE_PX - 2 {
            for x in 0..TILE_PX - 2 {
                let (grey, label) = block(sample, x * side / TILE_PX, y * side / TILE_PX);
                let marked = |channel: f64, colour: f64| {
                    (channel + (colour - channel) * 0.7 * label).round() as u8
                };
                sheet[[top + y, left + x]] = [grey.round() as u8; 3];
                sheet[[top + y, left + TILE_PX + x]] =
                    [marked(grey, 255.0), marked(grey, 40.0), marked(grey, 40.0)];
            }
        }
    }
    sheet
}

/// Mean grey value and part labelled of the pixels that one pixel of a tile shows.
fn block(sample: &XraySample, x: usize, y: usize) -> (f64, f64) {
    let side = sample.image.nrows();
    let step = (side / TILE_PX).max(1);
    let (mut grey, mut label, mut count) = (0.0, 0.0, 0.0);
    for row in y..(y + step).min(side) {
        for column in x..(x + step).min(side) {
            grey += f64::from(sample.image[[row, column]]);
            label += f64::from(u8::from(sample.mask[[row, column]]));
            count += 1.0;
        }
    }
    (grey / count, label / count)
}
