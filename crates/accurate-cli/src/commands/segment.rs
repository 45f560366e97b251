use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use accurate3d::NOT_FOR_CLINICAL_USE;
use accurate3d::io::{FrameChoice, is_dicom, write_mask, write_rgb, write_u16};
use accurate3d::seg::network::{NetworkOptions, NetworkSegmenter};
use accurate3d::seg::{
    Components, Mask, Polarity, PostProcessing, RidgeParams, RidgePoint, Segmenter, Watch,
    median_ridge_width_px, median_width_px, ridge_centreline, zhang_suen,
};
use ndarray::Array2;
use serde_json::{Value, json};

use crate::args::SegmentArgs;
use crate::console::Console;
use crate::dicom_child::read_picture;
use crate::failure::Failure;
use crate::segmentation::segmenter_with;
use crate::text::{has_extension, make_folder, places, refuse_what_is_read, write_text};

/// Part of `--threshold` down to which connected pixels are taken: the default's 0.3 of 0.5.
const WEAK: f32 = 0.6;

/// `accurate segment`: one image after the other, each on all threads; one that fails does not stop
/// the others.
pub fn run(args: &SegmentArgs, console: &Console) -> Result<(), Failure> {
    let jobs = jobs(args)?;
    let read = places(&args.images);
    let mut written =
        jobs.iter().flat_map(|job| OUTPUTS.map(|output| job.output(&args.out, output)));
    written.try_for_each(|file| refuse_what_is_read(&file, &read))?;
    let polarity = args.grey.polarity();
    let segmenter = segmenter_with(&args.model, console, |options, own| NetworkOptions {
        postprocessing: args.threshold.map(|high| PostProcessing { low: WEAK * high, high, ..own }),
        ..options
    })?;
    make_folder(&args.out)?;
    let (bar, watch) = (console.progress(jobs.len(), "segmenting"), console.windows(jobs.len()));
    let (mut failed, mut first_failure) = (0, None);
    for job in &jobs {
        let image = &job.image;
        match one(job, &args.out, polarity, &segmenter, &watch) {
            Ok(report) if console.json => console.json(&report)?,
            Ok(report) => console.data(&line(&report))?,
            Err(failure) => {
                failed += 1;
                if jobs.len() > 1 {
                    console.failure_of("image", &image.display().to_string(), &failure);
                }
                first_failure.get_or_insert(failure.of_file(image));
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    console.remark(&format!("{}. {NOT_FOR_CLINICAL_USE}", segmenter.describe()));
    match first_failure {
        None => Ok(()),
        Some(failure) if jobs.len() == 1 => Err(failure),
        Some(failure) => Err(failure.about(format!("{failed} of {} images failed", jobs.len()))),
    }
}

/// An image to segment.
struct Job {
    image: PathBuf,
    /// What the names of its outputs begin with.
    name: String,
    /// What is taken of a DICOM run; none of other images.
    frame: Option<FrameChoice>,
}

/// What the names of the outputs of an image end with.
const OUTPUTS: [&str; 4] = ["mask.png", "probability.png", "overlay.png", "centreline.csv"];

impl Job {
    fn output(&self, folder: &Path, ends: &str) -> PathBuf {
        folder.join(format!("{}_{ends}", self.name))
    }
}

fn jobs(args: &SegmentArgs) -> Result<Vec<Job>, Failure> {
    let mut names: BTreeMap<String, &Path> = BTreeMap::new();
    let mut jobs = Vec::new();
    // What cannot be opened is told when its turn comes.
    let mut takes_frame = args.frame.is_none();
    for image in &args.images {
        let mut name = name_of(image).ok_or_else(|| {
            Failure::new(Failure::USAGE, format!("{} names no file", image.display()))
        })?;
        let dicom = is_dicom(image);
        takes_frame |= !matches!(dicom, Ok(false));
        let frame = dicom.is_ok_and(|dicom| dicom).then_some(match args.frame {
            Some(index) => FrameChoice::One(index),
            None => FrameChoice::Mean,
        });
        // One frame after the other may go into one folder.
        if let Some(FrameChoice::One(index)) = frame {
            name += &format!("_frame{index}");
        }
        if let Some(other) = names.insert(name.clone(), image) {
            let (a, b) = (other.display(), image.display());
            return Err(Failure::new(
                Failure::USAGE,
                format!("{a} and {b} would both write to {name}_mask.png"),
            )
            .with_hint("run them with different --out folders"));
        }
        jobs.push(Job { image: image.clone(), name, frame });
    }
    if let Some(index) = args.frame.filter(|_| !takes_frame) {
        let message = format!("--frame {index}, with no DICOM run");
        return Err(Failure::new(Failure::USAGE, message)
            .with_hint("only DICOM runs have frames: leave --frame out"));
    }
    Ok(jobs)
}

/// A file's name without the extension of a kind of image: DICOM files are often named by numbers with dots.
fn name_of(image: &Path) -> Option<String> {
    const KINDS: [&str; 12] =
        ["png", "jpg", "jpeg", "tif", "tiff", "bmp", "pnm", "pgm", "ppm", "pbm", "dcm", "dicom"];
    let is_kind = KINDS.iter().any(|kind| has_extension(image, kind));
    let name = if is_kind { image.file_stem() } else { image.file_name() };
    name.map(|name| name.to_string_lossy().into_owned())
}

fn one(
    job: &Job,
    out: &Path,
    polarity: Polarity,
    segmenter: &NetworkSegmenter,
    watch: &Watch<'_>,
) -> Result<Value, Failure> {
    let Job { image: path, frame, .. } = job;
    let image = read_picture(path, frame.is_some(), frame.unwrap_or(FrameChoice::Mean))?;
    let frame = match frame {
        None => Value::Null,
        Some(FrameChoice::Mean) => "mean".into(),
        Some(FrameChoice::One(index)) => (*index).into(),
    };
    let found = segmenter.segment(&polarity.with_body_dark(image.clone()), watch)?;
    let skeleton = zhang_suen(&found.mask);
    let width = if found.mask.is_empty() { None } else { Some(median_width_px(&found.mask)?) };
    let params = RidgeParams::for_width(width.unwrap_or(1.0));
    let ridge = ridge_centreline(&found.probability, &skeleton, &params)?;
    let pieces = Components::of(&found.mask)?.sizes().len();
    // Nothing that can fail but the disk comes after the first file.
    let [mask, probability, drawn, centreline] = OUTPUTS.map(|output| job.output(out, output));
    write_mask(&mask, found.mask.as_array())?;
    // 0 to 1 becomes 0 to 65 535.
    let sixteen = found.probability.mapv(|p| (p * 65_535.0).round() as u16);
    write_u16(&probability, &sixteen)?;
    write_rgb(&drawn, &overlay(&image, &skeleton))?;
    write_text(&centreline, &centreline_csv(&ridge))?;
    let (height, columns) = image.dim();
    Ok(json!({
        "image": path.display().to_string(),
        "frame": frame,
        "size": [columns, height],
        "body_px": found.mask.count(),
        "skeleton_px": skeleton.count(),
        "pieces": pieces,
        "median_width_px": width,
        "median_ridge_width_px": median_ridge_width_px(&ridge),
        "mask": mask.display().to_string(),
        "probability": probability.display().to_string(),
        "overlay": drawn.display().to_string(),
        "centreline": centreline.display().to_string(),
        "segmentation": segmenter.describe(),
        "note": NOT_FOR_CLINICAL_USE,
    }))
}

fn line(report: &Value) -> String {
    let width = report["median_ridge_width_px"].as_f64().map(|w| format!(", {w:.1} px wide"));
    format!(
        "{}: {} skeleton pixels in {} piece{}{}",
        report["image"].as_str().unwrap_or_default(),
        report["skeleton_px"],
        report["pieces"],
        if report["pieces"] == 1 { "" } else { "s" },
        width.unwrap_or_default()
    )
}

/// One line a point, unordered.
fn centreline_csv(ridge: &[RidgePoint]) -> String {
    let mut text = String::from("x,y,direction_x,direction_y,width_px,probability\n");
    for RidgePoint { x, y, direction: [dx, dy], width_px, value } in ridge {
        text += &format!("{x:.4},{y:.4},{dx:.4},{dy:.4},{width_px:.3},{value:.4}\n");
    }
    text
}

/// The image in grey from its darkest to its brightest pixel, the skeleton in red.
fn overlay(image: &Array2<f32>, skeleton: &Mask) -> Array2<[u8; 3]> {
    let (least, most) = image
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)));
    let range = (most - least).max(f32::MIN_POSITIVE);
    Array2::from_shape_fn(image.dim(), |at| {
        // Saturates at 255.
        let grey = ((image[at] - least) / range * 255.0).round() as u8;
        if skeleton.get(at.0, at.1) { [255, 40, 40] } else { [grey; 3] }
    })
}
