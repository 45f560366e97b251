use std::path::{Path, PathBuf};

use accurate_geom::{Camera, Rig, View1, View2};
use ndarray::Array2;

use crate::cameras::NamedView;
use crate::distortion::undistort_points;
use crate::image_file::{read_grey, read_mask};
use crate::meta::check_case_id;
use crate::pair::Pair;
use crate::points::read_recorded_points;
use crate::{IoError, read_curve};

/// What the files of both views hold.
#[derive(Debug, Clone, PartialEq)]
pub enum ViewFiles {
    /// Ordered centreline points, CSV with the columns `x` and `y`.
    Points([PathBuf; 2]),
    /// Masks; any non-zero pixel is foreground.
    Masks([PathBuf; 2]),
    /// Grey images.
    Images([PathBuf; 2]),
    /// Grey images that were read elsewhere, and the files they came from.
    Frames([PathBuf; 2], [Array2<f32>; 2]),
}

/// A pair of two cameras and a file for each view, view 1 first: what a pair folder holds, from
/// wherever it lies.
///
/// The case is called `A_B` after the names of the two files. Points are freed from their lens here,
/// once; the rig is that of the undistorted views. `truth` is any curve file.
///
/// # Errors
/// [`IoError::Unsupported`] if the cameras are in different units, or for masks or images behind a
/// lens; [`IoError::SizeMismatch`] if a mask or image has not its camera's size;
/// [`IoError::Empty`] for a mask without foreground; [`IoError::Geometry`] for two cameras in one
/// place, or if the lens cannot be undone; and what the readers report.
pub fn pair_of_views(
    views: &[NamedView; 2],
    files: ViewFiles,
    truth: Option<&Path>,
) -> Result<Pair, IoError> {
    let (ViewFiles::Points(paths)
    | ViewFiles::Masks(paths)
    | ViewFiles::Images(paths)
    | ViewFiles::Frames(paths, _)) = &files;
    let paths = paths.clone();
    let case_id = case_id(&paths);
    check_case_id(&paths[0], &case_id)?;
    let unsupported = |what: String| IoError::Unsupported { path: paths[1].clone(), what };
    let unit = views[0].unit;
    if views[1].unit != unit {
        let what =
            format!("camera 1 is in {unit}, camera 2 in {}; state one with --unit", views[1].unit);
        return Err(unsupported(what));
    }
    let geometry =
        |path: &Path, part, source| IoError::Geometry { path: path.to_owned(), part, source };
    let camera = |index: usize| {
        let camera = &views[index].camera;
        let part = ["view 1", "view 2"][index];
        Camera::new(*camera.k(), *camera.r(), *camera.t(), camera.size())
            .map_err(|source| geometry(&paths[index], part, source))
    };
    let rig = Rig::new(camera(0)?, camera(1)?, unit)
        .map_err(|source| geometry(&paths[1], "rig", source))?;
    let size = [views[0].camera.size(), views[1].camera.size()];
    let mut pair = Pair {
        case_id,
        rig,
        size,
        points: None,
        masks: None,
        images: None,
        image_depth: None,
        truth: truth.map(read_curve).transpose()?.map(|curve| curve.points),
        source: None,
    };
    let picture_fits = |index: usize, dim: (usize, usize)| {
        if views[index].camera.distortion().is_some() {
            let what = "its camera has lens distortion, which is removed from points only; \
                        undistort the picture and give its camera without the lens"
                .to_owned();
            return Err(IoError::Unsupported { path: paths[index].clone(), what });
        }
        views[index].check_size(&paths[index], dim)
    };
    match files {
        ViewFiles::Points(_) => {
            let points1 = read_recorded_points::<View1>(&paths[0], size[0])?;
            let points2 = read_recorded_points::<View2>(&paths[1], size[1])?;
            pair.points = Some((
                undistort_points(&paths[0], &views[0].camera, &points1)?,
                undistort_points(&paths[1], &views[1].camera, &points2)?,
            ));
        }
        ViewFiles::Masks(_) => {
            let masks = [read_mask(&paths[0])?, read_mask(&paths[1])?];
            for (index, mask) in masks.iter().enumerate() {
                picture_fits(index, mask.dim())?;
                if !mask.iter().any(|foreground| *foreground) {
                    let path = paths[index].clone();
                    return Err(IoError::Empty { path, what: "foreground pixel" });
                }
            }
            pair.masks = Some(masks);
        }
        ViewFiles::Images(_) => {
            let [a, b] = [read_grey(&paths[0])?, read_grey(&paths[1])?];
            picture_fits(0, a.values.dim())?;
            picture_fits(1, b.values.dim())?;
            pair.image_depth = Some([a.depth, b.depth]);
            pair.images = Some([a.values, b.values]);
        }
        ViewFiles::Frames(_, frames) => {
            picture_fits(0, frames[0].dim())?;
            picture_fits(1, frames[1].dim())?;
            pair.images = Some(frames);
        }
    }
    Ok(pair)
}

/// Both files' names; one name if they are the same.
fn case_id(paths: &[PathBuf; 2]) -> String {
    let name = |path: &Path| -> String {
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let usable = |c: char| !(c.is_control() || matches!(c, '/' | '\\' | ':'));
        stem.chars().filter(|c| usable(*c)).take(90).collect()
    };
    let [a, b] = [name(&paths[0]), name(&paths[1])];
    if a == b { a } else { format!("{a}_{b}") }
}

#[cfg(test)]
mod tests {
    use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
    use accurate_geom::{Distortion, ImageSize, LengthUnit, Pixel};

    use super::*;
    use crate::{write_mask, write_points};

    fn views() -> [NamedView; 2] {
        [0.0, 1.2].map(|angle| {
            let k = Matrix3::new(400.0, 0.0, 20.0, 0.0, -400.0, 15.0, 0.0, 0.0, 1.0);
            let r = *Rotation3::from_axis_angle(&Vector3::z_axis(), angle).matrix();
            let r = Rotation3::from_axis_angle(&Vector3::y_axis(), angle).matrix() * r;
            let size = ImageSize { width: 40, height: 30 };
            NamedView {
                name: format!("{angle}"),
                camera: Camera::new(k, r, Vector3::new(0.0, 0.0, 500.0), size).unwrap(),
                unit: LengthUnit::Millimetre,
                frame: String::new(),
                notes: Vec::new(),
            }
        })
    }

    #[test]
    fn points_lose_their_lens_and_pictures_behind_one_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a.csv", "b.csv"].map(|name| folder.path().join(name));
        let seen = [Pixel::<View1>::new(31.0, 7.0), Pixel::new(30.0, 9.0)];
        for path in &paths {
            write_points(path, &seen).unwrap();
        }
        let plain = pair_of_views(&views(), ViewFiles::Points(paths.clone()), None).unwrap();
        assert_eq!(plain.case_id, "a_b");
        assert_eq!(plain.points.unwrap().0, seen);
        let lens = Distortion { k1: -50.0, ..Distortion::default() };
        let [one, two] = views();
        let camera = one.camera.with_distortion(lens).unwrap();
        let behind = [NamedView { camera: camera.clone(), ..one }, two];
        let pair = pair_of_views(&behind, ViewFiles::Points(paths), None).unwrap();
        let freed = pair.points.unwrap().0;
        let again = camera.distort(&freed[0].point()).unwrap();
        assert!((again - seen[0].point()).norm() < 1e-9 && freed[0] != seen[0]);
        assert!(pair.rig.camera1().distortion().is_none());
        let masks = ["m1.png", "m2.png"].map(|name| folder.path().join(name));
        for path in &masks {
            write_mask(path, &Array2::from_elem((30, 40), true)).unwrap();
        }
        let refused = pair_of_views(&behind, ViewFiles::Masks(masks.clone()), None).unwrap_err();
        assert!(refused.to_string().contains("lens distortion"), "{refused}");
        assert!(pair_of_views(&views(), ViewFiles::Masks(masks.clone()), None).is_ok());
        write_mask(&masks[1], &Array2::from_elem((29, 40), true)).unwrap();
        let refused = pair_of_views(&views(), ViewFiles::Masks(masks), None).unwrap_err();
        assert!(matches!(refused, IoError::SizeMismatch { .. }), "{refused}");
    }

    #[test]
    fn cameras_of_different_units_or_in_one_place_are_no_pair() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a", "b"].map(|name| folder.path().join(name));
        let [one, two] = views();
        let metres = NamedView { unit: LengthUnit::Metre, ..two };
        let error = pair_of_views(&[one.clone(), metres], ViewFiles::Points(paths.clone()), None);
        assert!(error.unwrap_err().to_string().contains("camera 2 in m"));
        let error = pair_of_views(&[one.clone(), one], ViewFiles::Points(paths), None);
        assert!(matches!(error, Err(IoError::Geometry { part: "rig", .. })));
    }
}
