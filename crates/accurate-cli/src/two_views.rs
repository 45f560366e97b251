//! Two views given as files: their cameras, of any kind of file, and what was seen in them.

use std::path::{Path, PathBuf};

use accurate3d::InputKind;
use accurate3d::io::{
    FrameChoice, NamedView, Pair, PairParts, ViewDefaults, ViewFiles, is_dicom, pair_files,
    pair_of_views, read_cameras, read_curve,
};

use crate::args::{ReconstructArgs, ViewArgs};
use crate::dicom_child;
use crate::failure::Failure;
use crate::units::common_unit;

/// The hint where both views show the same.
pub const NEVER_THE_SAME: &str = "two cameras never see the same: is one file named twice?";

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

/// The camera of a file: the one that has this name, or the only one.
///
/// # Errors
/// [`Failure::USAGE`] without a view of the name, or without a name where there are more.
pub fn one_view(
    file: &Path,
    name: Option<&str>,
    defaults: &ViewDefaults,
) -> Result<NamedView, Failure> {
    let mut views = cameras_of(&[file.to_owned()], defaults)?;
    if let Some(name) = name {
        return named(&views, name).map_err(|failure| failure.of_file(file));
    }
    let names = names(&views);
    let only = views.pop().filter(|_| views.is_empty());
    only.ok_or_else(|| {
        let message = format!("{}: more than one view", file.display());
        Failure::new(Failure::USAGE, message)
            .with_hint(format!("name one of them with --view: {names}"))
    })
}

/// The two cameras of `files`: those that `wanted` names, in that order, or all there are.
pub fn two_cameras(
    files: &[PathBuf],
    wanted: &[String],
    defaults: &ViewDefaults,
) -> Result<[NamedView; 2], Failure> {
    let views = cameras_of(files, defaults)?;
    let chosen: Vec<NamedView> = match wanted {
        [] => views.clone(),
        wanted => wanted.iter().map(|name| named(&views, name)).collect::<Result<_, _>>()?,
    };
    if let [one, two] = wanted
        && one == two
    {
        let message = format!("--views names `{one}` twice");
        return Err(Failure::new(Failure::USAGE, message)
            .with_hint(format!("there are: {}", names(&views))));
    }
    <[NamedView; 2]>::try_from(chosen).map_err(|chosen| {
        Failure::new(
            Failure::USAGE,
            match wanted {
                [] => format!(
                    "two cameras are needed, but there are {}: {}",
                    chosen.len(),
                    names(&views)
                ),
                wanted => format!("--views names {}; expected two", wanted.len()),
            },
        )
        .with_hint("repeat --cameras for more files; choose among more with --views NAME,NAME")
    })
}

/// The one view of this name.
pub fn named(views: &[NamedView], name: &str) -> Result<NamedView, Failure> {
    let found: Vec<&NamedView> = views.iter().filter(|view| view.name == name).collect();
    match found.as_slice() {
        [one] => Ok((*one).clone()),
        [] => Err(Failure::new(Failure::USAGE, format!("no view `{name}` in the camera files"))
            .with_hint(format!("there are: {}", names(views)))),
        several => {
            let message = format!("{} views are called `{name}`", several.len());
            Err(Failure::new(Failure::USAGE, message).with_hint(
                "rename one, or give the camera files in the order of the views and no names",
            ))
        }
    }
}

fn names(views: &[NamedView]) -> String {
    views.iter().map(|view| view.name.as_str()).collect::<Vec<_>>().join(", ")
}

/// Whether the inputs are the files of two views rather than pair folders.
pub fn are_files(args: &ReconstructArgs) -> bool {
    !args.views.cameras.is_empty() || args.inputs.iter().any(|input| input.is_file())
}

/// Two views given as files, as a pair; the files it came from, cameras first.
pub fn pair_of_files(args: &ReconstructArgs) -> Result<(Pair, Vec<PathBuf>), Failure> {
    let usage = |what: String| Failure::new(Failure::USAGE, what);
    if let Some(folder) = args.inputs.iter().find(|input| input.is_dir()) {
        let file = args.inputs.iter().find(|input| input.is_file());
        let (folder, file) = (folder.display(), file.map(|file| file.display()));
        return Err(match (file, args.views.cameras.is_empty()) {
            (Some(file), true) => {
                usage(format!("{file} is no pair folder, but {folder} is a folder"))
                    .with_hint("give pair folders only, or two files, one of each view")
            }
            _ => usage(format!("{folder} is a folder, not the file of a view"))
                .with_hint("a pair folder has its own cameras: leave --cameras out, or give files"),
        });
    }
    let [one, two] = args.inputs.as_slice() else {
        let message = format!("{} files; expected two, one of each view", args.inputs.len());
        return Err(usage(message).with_hint("view 1 first; several pairs need pair folders"));
    };
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
    let frames_of = dicom.iter().filter(|is| **is).count();
    if args.frame.len() > frames_of {
        let message = format!("--frame {} times, with {frames_of} DICOM runs", args.frame.len());
        return Err(usage(message).with_hint("only DICOM runs have frames: leave --frame out"));
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
            let [first, second] = frame_choices(&args.frame);
            let frames = [
                dicom_child::read_picture(one, dicom[0], first)?,
                dicom_child::read_picture(two, dicom[1], second)?,
            ];
            ViewFiles::Frames(paths, frames)
        }
        InputKind::Image => ViewFiles::Images(paths),
    };
    let mut pair = pair_of_views(&views, files, None)?;
    if let Some(path) = &args.truth {
        let truth = read_curve(path)?;
        let name = path.display().to_string();
        common_unit(("the world of the cameras", pair.rig.unit()), (&name, truth.unit))?;
        pair.truth = Some(truth.points);
    }
    let mut sources = Vec::new();
    for path in &args.views.cameras {
        sources.extend(files_behind(path));
    }
    sources.extend(args.inputs.iter().chain(&args.truth).cloned());
    Ok((pair, sources))
}

/// The files that cameras named by one path are read from.
pub fn files_behind(path: &Path) -> Vec<PathBuf> {
    // COLMAP's two files may be named by their folder or by one of them.
    const COLMAP: [&str; 2] = ["cameras.txt", "images.txt"];
    let is_one = COLMAP.iter().any(|name| path.file_name().is_some_and(|file| file == *name));
    let folder = if is_one { path.parent().unwrap_or(path) } else { path };
    if is_one || folder.join(COLMAP[0]).is_file() {
        return COLMAP.map(|name| folder.join(name)).to_vec();
    }
    if path.is_dir() {
        return pair_files(path, PairParts::default());
    }
    vec![path.to_owned()]
}

/// How the frames are chosen, for at most two of them.
fn frame_choices(frames: &[u32]) -> [FrameChoice; 2] {
    match frames {
        [] => [FrameChoice::Mean; 2],
        [both] => [FrameChoice::One(*both); 2],
        [one, two, ..] => [FrameChoice::One(*one), FrameChoice::One(*two)],
    }
}
