use std::path::{Path, PathBuf};

use accurate_geom::{ImageSize, Pixel, Point3, Rig, View1, View2};
use ndarray::Array2;

use crate::IoError;
use crate::calibration::{VIEWS, read_lens, read_rig_of_case};
use crate::distortion::undistort_points;
use crate::image_file::{BitDepth, GreyImage, read_grey, read_image_size, read_mask};
use crate::meta::{Meta, check_case_id};
use crate::ply::read_ply_points;
use crate::points::read_recorded_points;

/// Ordered centreline points of both views.
pub type OrderedPoints = (Vec<Pixel<View1>>, Vec<Pixel<View2>>);

/// What to do about the true 3D curve of a pair folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Truth {
    /// Do not look for it.
    #[default]
    Ignore,
    /// Read it where the file exists.
    IfPresent,
    /// A missing file is an error.
    Required,
}

/// The parts of a pair folder a caller needs. The calibration is always read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct PairParts {
    /// Ordered points of both views.
    pub points: bool,
    /// Masks of both views.
    pub masks: bool,
    /// Images of both views.
    pub images: bool,
    /// The true 3D curve.
    pub truth: Truth,
}

impl PairParts {
    /// Every part that is there for at least one view (so that the other's absence is reported).
    pub fn present_in(dir: &Path) -> Self {
        let any = |name: fn(char) -> String| VIEWS.iter().any(|v| dir.join(name(v.0)).is_file());
        Self {
            points: any(points_name),
            masks: any(mask_name),
            images: any(image_name),
            truth: Truth::IfPresent,
        }
    }
}

/// A pair folder, read.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Name of the case; usable as a folder name.
    pub case_id: String,
    /// Both cameras and the unit of the world.
    pub rig: Rig,
    /// Image size of view 1 and view 2, px; the same as the cameras have.
    pub size: [ImageSize; 2],
    /// Ordered centreline points, px, if asked for. At least one per view.
    pub points: Option<OrderedPoints>,
    /// Masks, shape `(height, width)`, `true` = foreground, if asked for. Not empty.
    pub masks: Option<[Array2<bool>; 2]>,
    /// Grey values as stored (0 to [`BitDepth::max_value`]), shape `(height, width)`, if asked for.
    pub images: Option<[Array2<f32>; 2]>,
    /// Depth of the image files, where images were read.
    pub image_depth: Option<[BitDepth; 2]>,
    /// The true curve, points in order, in the rig's unit, where read.
    pub truth: Option<Vec<Point3>>,
    /// Where the case comes from, if `meta.json` says so.
    pub source: Option<String>,
}

/// Reads a pair folder:
///
/// ```text
/// case_017/
///   images/view_L.png   images/view_R.png          grey of 8 or 16 bit, or colour (read as luma)
///   masks/mask_L.png    masks/mask_R.png           any non-zero pixel is foreground
///   calibration/K_L.txt K_R.txt RT_L.txt RT_R.txt  3 x 3 (px) and 3 x 4 [R | t], world to camera
///   annotations/guidewire_3D.ply                   the true curve, points in order
///   points/points_L.csv points/points_R.csv        ordered points, header x,y, px
///   meta.json                                      case_id, image_size [W, H], source, unit
/// ```
///
/// L is view 1, R is view 2. Only what `needs` names has to be there. `K` may lie in the set's
/// `calibration/` or in the set's own folder, per view or as one `K.txt`. Without `meta.json` the
/// folder's name is the case, the masks or images give the size, and the unit is
/// [`LengthUnit::Unit`](accurate_geom::LengthUnit::Unit).
///
/// Where `calibration/D_L.txt` or `D_R.txt` (`k1 k2 p1 p2 [k3]` of OpenCV) exists, that view's
/// points are undistorted here, once; the rig is that of the undistorted view. Masks and images are
/// not resampled: asking for them is then refused.
///
/// # Errors
/// [`IoError::Missing`] naming the first missing file; [`IoError::SizeMismatch`] if image, mask and
/// `meta.json` disagree; [`IoError::Unsupported`] for masks or images with lens distortion;
/// [`IoError::Empty`] for a mask without foreground;
/// [`IoError::Geometry`] naming the calibration file; and what the readers of the parts report.
pub fn read_pair(dir: &Path, needs: PairParts) -> Result<Pair, IoError> {
    std::fs::read_dir(dir).map_err(|e| IoError::system(dir, "open folder", e))?;
    let meta_path = dir.join("meta.json");
    let meta = if meta_path.is_file() { Meta::read(&meta_path)? } else { Meta::default() };
    let unit = meta.unit(&meta_path)?;
    let case_id = match &meta.case_id {
        Some(id) => id.clone(),
        None => folder_name(dir),
    };
    check_case_id(&meta_path, &case_id)?;

    let masks = needs.masks.then(|| read_both(dir, mask_name, read_mask)).transpose()?;
    let images = needs.images.then(|| read_both(dir, image_name, read_grey)).transpose()?;
    let (size, size_sources) = match meta.sizes(&meta_path)? {
        Some(sizes) => (sizes, [meta_path.clone(), meta_path.clone()]),
        None => sizes_from_images(dir, &meta_path)?,
    };
    for v in 0..2 {
        let other = &size_sources[v];
        if let Some(masks) = &masks {
            check_size(&dir.join(mask_name(VIEWS[v].0)), masks[v].dim(), other, size[v])?;
            if !masks[v].iter().any(|foreground| *foreground) {
                let path = dir.join(mask_name(VIEWS[v].0));
                return Err(IoError::Empty { path, what: "foreground pixel" });
            }
        }
        if let Some(images) = &images {
            check_size(&dir.join(image_name(VIEWS[v].0)), images[v].values.dim(), other, size[v])?;
        }
    }
    let rig = read_rig_of_case(dir, size, &size_sources[0], unit)?;

    let lens1 = read_lens(dir, 0, rig.camera1(), needs.masks || needs.images)?;
    let lens2 = read_lens(dir, 1, rig.camera2(), needs.masks || needs.images)?;
    let points = if needs.points {
        let [path1, path2] = VIEWS.map(|v| dir.join(points_name(v.0)));
        let points1 = undistort_points(&path1, &lens1, &read_recorded_points(&path1, size[0])?)?;
        let points2 = undistort_points(&path2, &lens2, &read_recorded_points(&path2, size[1])?)?;
        Some((points1, points2))
    } else {
        None
    };
    let truth_path = dir.join(TRUTH_NAME);
    let truth = match needs.truth {
        Truth::Ignore => None,
        Truth::IfPresent if !truth_path.is_file() => None,
        Truth::IfPresent | Truth::Required => Some(read_ply_points(&truth_path)?),
    };
    let image_depth = images.as_ref().map(|i| i.each_ref().map(|i| i.depth));
    let images = images.map(|i: [GreyImage; 2]| i.map(|i| i.values));
    let source = meta.source();
    Ok(Pair { case_id, rig, size, points, masks, images, image_depth, truth, source })
}

/// The true curve within a pair folder.
pub(crate) const TRUTH_NAME: &str = "annotations/guidewire_3D.ply";

pub(crate) fn points_name(letter: char) -> String {
    format!("points/points_{letter}.csv")
}

pub(crate) fn mask_name(letter: char) -> String {
    format!("masks/mask_{letter}.png")
}

pub(crate) fn image_name(letter: char) -> String {
    format!("images/view_{letter}.png")
}

fn read_both<T>(
    dir: &Path,
    name: fn(char) -> String,
    read: fn(&Path) -> Result<T, IoError>,
) -> Result<[T; 2], IoError> {
    let [a, b] = VIEWS.map(|v| dir.join(name(v.0)));
    Ok([read(&a)?, read(&b)?])
}

/// Sizes by the headers of the masks, else of the images, and the files they came from.
fn sizes_from_images(
    dir: &Path,
    meta_path: &Path,
) -> Result<([ImageSize; 2], [PathBuf; 2]), IoError> {
    for name in [mask_name, image_name] {
        let paths = VIEWS.map(|v| dir.join(name(v.0)));
        if paths.iter().all(|p| p.is_file()) {
            let sizes = [read_image_size(&paths[0])?, read_image_size(&paths[1])?];
            return Ok((sizes, paths));
        }
    }
    if meta_path.is_file() {
        let reason = "needed where there are no masks or images: [width, height] in px";
        return Err(IoError::field(meta_path, "image_size", "missing", reason));
    }
    let also_tried = [mask_name, image_name].map(|name| dir.join(name(VIEWS[0].0))).to_vec();
    Err(IoError::Missing { path: meta_path.to_owned(), also_tried })
}

pub(crate) fn check_size(
    path: &Path,
    (height, width): (usize, usize),
    other: &Path,
    expected: ImageSize,
) -> Result<(), IoError> {
    // The image reader has bounded both sides.
    let found = ImageSize { width: width as u32, height: height as u32 };
    if found == expected {
        return Ok(());
    }
    Err(IoError::SizeMismatch { path: path.to_owned(), found, other: other.to_owned(), expected })
}

/// The last part of the folder's name, also for `.` and `case/..`.
fn folder_name(dir: &Path) -> String {
    let name = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned());
    name(dir).or_else(|| name(&dir.canonicalize().ok()?)).unwrap_or_else(|| "pair".to_owned())
}
