use std::fs;
use std::path::Path;

use accurate_geom::nalgebra::Matrix3x4;
use accurate_geom::{Point3, Rig};
use ndarray::Array2;

use crate::IoError;
use crate::calibration::{VIEWS, rt_path};
use crate::curve::{CurveTable, write_curve};
use crate::image_file::{BitDepth, GreyImage, write_grey, write_mask};
use crate::json::write_json;
use crate::matrix::{write_matrix3, write_matrix3x4};
use crate::meta::{Meta, check_case_id};
use crate::pair::{OrderedPoints, Pair, TRUTH_NAME, image_name, mask_name, points_name};
use crate::points::{check_points, write_points};

/// What [`write_pair`] puts into a folder. Sizes and unit are the rig's.
#[derive(Debug, Clone, PartialEq)]
pub struct PairContents {
    /// Name of the case; must be usable as a folder name.
    pub case_id: String,
    /// Both cameras and the unit of the world.
    pub rig: Rig,
    /// Ordered centreline points, px.
    pub points: Option<OrderedPoints>,
    /// Masks, shape `(height, width)`, `true` = foreground.
    pub masks: Option<[Array2<bool>; 2]>,
    /// Grey images of 8 or 16 bit.
    pub images: Option<[GreyImage; 2]>,
    /// The true curve, points in order, in the rig's unit.
    pub truth: Option<Vec<Point3>>,
    /// Where the case comes from.
    pub source: Option<String>,
}

impl From<Pair> for PairContents {
    fn from(pair: Pair) -> Self {
        let depths = pair.image_depth.unwrap_or([BitDepth::Eight; 2]);
        let images = pair.images.map(|[a, b]| {
            [(a, depths[0]), (b, depths[1])].map(|(values, depth)| GreyImage { values, depth })
        });
        Self {
            case_id: pair.case_id,
            rig: pair.rig,
            points: pair.points,
            masks: pair.masks,
            images,
            truth: pair.truth,
            source: pair.source,
        }
    }
}

/// Writes a pair folder in the layout of [`read_pair`](crate::read_pair), making the folders it
/// needs. Every file is written atomically, and `meta.json` last: a folder without it is
/// unfinished. Files of parts that are not given are left as they are.
///
/// Reading the folder gives the same bits; images are rounded to integers.
///
/// # Errors
/// Found before anything is written: [`IoError::Field`] for a case name that is no folder name,
/// [`IoError::SizeMismatch`] if a mask or image has not the camera's size, [`IoError::Empty`],
/// [`IoError::NotFinite`], [`IoError::Unsupported`] for a rig with lens distortion. Then [`IoError::System`], and [`IoError::Field`] for a grey value
/// outside its depth.
pub fn write_pair(dir: &Path, contents: &PairContents) -> Result<(), IoError> {
    check(dir, contents)?;
    let make = |name: &str| {
        let folder = dir.join(name);
        fs::create_dir_all(&folder).map_err(|e| IoError::system(&folder, "create folder", e))
    };
    make("calibration")?;
    for (v, camera) in [contents.rig.camera1(), contents.rig.camera2()].into_iter().enumerate() {
        let letter = VIEWS[v].0;
        let mut rt = Matrix3x4::zeros();
        rt.fixed_columns_mut::<3>(0).copy_from(camera.r());
        rt.set_column(3, camera.t());
        write_matrix3(&dir.join("calibration").join(format!("K_{letter}.txt")), camera.k())?;
        write_matrix3x4(&rt_path(dir, letter), &rt)?;
    }
    if let Some((points1, points2)) = &contents.points {
        make("points")?;
        write_points(&dir.join(points_name(VIEWS[0].0)), points1)?;
        write_points(&dir.join(points_name(VIEWS[1].0)), points2)?;
    }
    if let Some(masks) = &contents.masks {
        make("masks")?;
        for (mask, view) in masks.iter().zip(VIEWS) {
            write_mask(&dir.join(mask_name(view.0)), mask)?;
        }
    }
    if let Some(images) = &contents.images {
        make("images")?;
        for (image, view) in images.iter().zip(VIEWS) {
            write_grey(&dir.join(image_name(view.0)), image)?;
        }
    }
    if let Some(truth) = &contents.truth {
        make("annotations")?;
        let truth = CurveTable::from_points(truth.clone(), contents.rig.unit());
        write_curve(&dir.join(TRUTH_NAME), &truth)?;
    }
    let num_points = match (&contents.truth, &contents.points) {
        (Some(truth), _) => Some(truth.len()),
        (None, Some((points1, _))) => Some(points1.len()),
        (None, None) => None,
    };
    let meta = Meta::new(
        contents.case_id.clone(),
        num_points,
        [contents.rig.camera1().size(), contents.rig.camera2().size()],
        contents.source.clone(),
        contents.rig.unit(),
    );
    write_json(&dir.join("meta.json"), &meta)
}

fn check(dir: &Path, contents: &PairContents) -> Result<(), IoError> {
    check_case_id(&dir.join("meta.json"), &contents.case_id)?;
    if let Some((points1, points2)) = &contents.points {
        check_points(&dir.join(points_name(VIEWS[0].0)), points1)?;
        check_points(&dir.join(points_name(VIEWS[1].0)), points2)?;
    }
    if contents.truth.as_ref().is_some_and(Vec::is_empty) {
        return Err(IoError::Empty { path: dir.join(TRUTH_NAME), what: "points" });
    }
    for (v, camera) in [contents.rig.camera1(), contents.rig.camera2()].into_iter().enumerate() {
        if camera.distortion().is_some() {
            let what = "a pair folder holds undistorted pixels; give the rig without distortion";
            return Err(IoError::Unsupported { path: dir.to_owned(), what: what.into() });
        }
        let expected = camera.size();
        let same = |path: std::path::PathBuf, (height, width): (usize, usize)| {
            if (height, width) == (expected.height as usize, expected.width as usize) {
                return Ok(());
            }
            let side = |px| u32::try_from(px).unwrap_or(u32::MAX);
            let found = accurate_geom::ImageSize { width: side(width), height: side(height) };
            Err(IoError::SizeMismatch { path, found, other: dir.join("meta.json"), expected })
        };
        if let Some(masks) = &contents.masks {
            same(dir.join(mask_name(VIEWS[v].0)), masks[v].dim())?;
        }
        if let Some(images) = &contents.images {
            same(dir.join(image_name(VIEWS[v].0)), images[v].values.dim())?;
        }
    }
    Ok(())
}
