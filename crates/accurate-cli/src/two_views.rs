//! Two views given as files: their cameras, of any kind of file, and what was seen in them.

use std::path::{Path, PathBuf};

use accurate3d::InputKind;
use accurate3d::io::{
    FrameChoice, NamedView, Pair, ViewDefaults, ViewFiles, is_dicom, pair_of_views, read_cameras,
    read_grey,
};
use ndarray::Array2;

use crate::args::{ReconstructArgs, ViewArgs};
use crate::dicom_child;
use crate::failure::Failure;

/// The cameras of files of any kind; DICOM is read by a process of its own.
pub fn cameras_of(files: &[PathBuf], defaults: &ViewDefaults) -> Result<Vec<NamedView>, Failure> {
    let mut views = Vec::new();
    let mut others: Vec<PathBuf> = Vec::new();
    // Neighbours that are not DICOM go together: a stereo calibration may fill two files.
    for path in files {
        if is_dicom(path)? {
            if !others.is_empty() {
                views.extend(read_cameras(&others, defaults)?);
                others.clear();
            }
            views.push(dicom_child::read_view(path)?);
        } else {
            others.push(path.clone());
        }
    }
    if !others.is_empty() {
        views.extend(read_cameras(&others, defaults)?);
    }
    Ok(views)
}

/// The two cameras of `files`: those that `wanted` names, in that order, or all there are.
pub fn two_cameras(
    files: &[PathBuf],
    wanted: &[String],
    defaults: &ViewDefaults,
) -> Result<[NamedView; 2], Failure> {
    let views = cameras_of(files, defaults)?;
    let names = || views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>().join(", ");
    let chosen: Vec<NamedView> = match wanted {
        [] => views.clone(),
        wanted => wanted
            .iter()
            .map(|name| {
                views.iter().find(|view| &view.name == name).cloned().ok_or_else(|| {
                    Failure::new(Failure::USAGE, format!("no view `{name}` in the camera files"))
                        .with_hint(format!("there are: {}", names()))
                })
            })
            .collect::<Result<_, _>>()?,
    };
    <[NamedView; 2]>::try_from(chosen).map_err(|chosen| {
        Failure::new(
            Failure::USAGE,
            format!("two cameras are needed, but there are {}: {}", chosen.len(), names()),
        )
        .with_hint("repeat --cameras for more files; choose among more with --views NAME,NAME")
    })
}

/// Whether the inputs are the files of two views rather than pair folders.
pub fn are_files(args: &ReconstructArgs) -> bool {
    !args.views.cameras.is_empty() || args.inputs.iter().any(|input| input.is_file())
}

/// Two views given as files, as a pair; the files it came from, cameras first.
pub fn pair_of_files(args: &ReconstructArgs) -> Result<(Pair, Vec<PathBuf>), Failure> {
    let usage = |what: String| Failure::new(Failure::USAGE, what);
    let [one, two] = args.inputs.as_slice() else {
        let message = format!("{} files; expected two, one of each view", args.inputs.len());
        return Err(usage(message).with_hint("view 1 first; several pairs need pair folders"));
    };
    for input in [one, two] {
        if input.is_dir() {
            let message = format!("{} is a folder, not the file of a view", input.display());
            return Err(usage(message).with_hint(
                "a pair folder has its own cameras: leave --cameras out, or give files",
            ));
        }
    }
    let dicom = [is_dicom(one)?, is_dicom(two)?];
    if args.views.cameras.is_empty() && dicom != [true; 2] {
        let other = if dicom[0] { two } else { one };
        let message = format!("no cameras: {} is not DICOM and none are named", other.display());
        return Err(usage(message).with_hint(
            "name them: --cameras rig.toml, or --cameras a.dcm --cameras b.dcm; `accurate camera \
             show` lists what is read",
        ));
    }
    if args.input != InputKind::Image && dicom.contains(&true) {
        let message = format!("DICOM runs are images, not {} files", args.input);
        return Err(usage(message).with_hint(format!(
            "take --input image, or give the {} files with --cameras {} --cameras {}",
            args.input,
            one.display(),
            two.display()
        )));
    }
    let ViewArgs { cameras, views, stated } = &args.views;
    // A DICOM run is its own camera file.
    let camera_files = if cameras.is_empty() { &args.inputs } else { cameras };
    let views = two_cameras(camera_files, views, &stated.defaults())?;
    let paths = [one.clone(), two.clone()];
    let files = match args.input {
        InputKind::Points => ViewFiles::Points(paths),
        InputKind::Mask => ViewFiles::Masks(paths),
        InputKind::Image if dicom.contains(&true) => {
            let [first, second] = frame_choices(&args.frame)?;
            let frames = [frame_of(one, dicom[0], first)?, frame_of(two, dicom[1], second)?];
            ViewFiles::Frames(paths, frames)
        }
        InputKind::Image => ViewFiles::Images(paths),
    };
    let mut sources = args.views.cameras.clone();
    sources.extend(args.inputs.iter().cloned());
    Ok((pair_of_views(&views, files, args.truth.as_deref())?, sources))
}

fn frame_choices(frames: &[u32]) -> Result<[FrameChoice; 2], Failure> {
    match frames {
        [] => Ok([FrameChoice::Mean; 2]),
        [both] => Ok([FrameChoice::One(*both); 2]),
        [one, two] => Ok([FrameChoice::One(*one), FrameChoice::One(*two)]),
        more => {
            let message = format!("--frame {} times; there are two views", more.len());
            Err(Failure::new(Failure::USAGE, message))
        }
    }
}

fn frame_of(path: &Path, dicom: bool, choice: FrameChoice) -> Result<Array2<f32>, Failure> {
    if dicom { dicom_child::read_frame(path, choice) } else { Ok(read_grey(path)?.values) }
}
