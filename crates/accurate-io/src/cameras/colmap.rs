use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use accurate_geom::nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use accurate_geom::{Distortion, ImageSize};

use super::named_view::RawView;
use super::{NamedView, ViewDefaults};
use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_POINTS_BYTES, MAX_SMALL_BYTES};
use crate::matrix::parse_number;

/// COLMAP puts the centre of the top-left pixel at (0.5, 0.5), we at (0, 0).
const PIXEL_ORIGIN: f64 = 0.5;
const FORMAT: &str = "COLMAP text";

/// The two files of a COLMAP model that hold cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// `cameras.txt`: what each lens is like.
    Cameras,
    /// `images.txt`: where each picture was taken.
    Images,
}

impl Part {
    /// The name COLMAP gives it.
    pub(crate) const fn file_name(self) -> &'static str {
        match self {
            Self::Cameras => "cameras.txt",
            Self::Images => "images.txt",
        }
    }

    /// Largest accepted file, bytes; points of pictures may be many.
    pub(crate) const fn max_bytes(self) -> u64 {
        match self {
            Self::Cameras => MAX_SMALL_BYTES,
            Self::Images => MAX_POINTS_BYTES,
        }
    }

    /// Which of them a text is, by its first line that is no comment.
    pub(crate) fn of(text: &str) -> Option<Self> {
        let (_, fields) = rows(text).find(|(_, fields)| !fields.is_empty())?;
        let whole = |field: &str| field.parse::<u32>().is_ok();
        let model =
            |name: &str| name.chars().all(|c| c.is_ascii_uppercase() || "_0123456789".contains(c));
        match fields[..] {
            [id, name, width, height, _, ..]
                if [id, width, height].map(whole) == [true; 3] && !whole(name) && model(name) =>
            {
                Some(Self::Cameras)
            }
            [id, .., _] if whole(id) && fields.len() >= IMAGE_FIELDS && !are_points(&fields) => {
                numbers(&fields[1..IMAGE_FIELDS - 1]).then_some(Self::Images)
            }
            _ => None,
        }
    }
}

/// `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`; a name with blanks fills more.
const IMAGE_FIELDS: usize = 10;

/// Lines that are no comments, numbered from 1, in fields. An empty line has none.
fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    text.lines()
        .enumerate()
        .filter(|(_, line)| !line.trim_start().starts_with('#'))
        .map(|(index, line)| (index + 1, line.split_whitespace().collect()))
}

fn numbers(fields: &[&str]) -> bool {
    fields.iter().all(|field| field.parse::<f64>().is_ok())
}

/// Whether a line is the 2D points of the image above: `X Y POINT3D_ID` again and again, or nothing.
///
/// The line may be left out. An image line is never taken for it: it ends in a name, and with a name
/// that is a number it has ten fields.
fn are_points(fields: &[&str]) -> bool {
    fields.len().is_multiple_of(3) && numbers(fields)
}

/// Reads `cameras.txt` and `images.txt`, given as path and text, in the order of `images.txt`.
///
/// World to camera, quaternion `w x y z` before the translation. Models: `SIMPLE_PINHOLE`,
/// `PINHOLE`, `SIMPLE_RADIAL`, `RADIAL`, `OPENCV`.
pub(crate) fn read(
    (path, cameras): (&Path, &str),
    images: (&Path, &str),
    defaults: &ViewDefaults,
) -> Result<Vec<NamedView>, IoError> {
    let cameras = lenses(path, cameras)?;
    let (path, text) = images;
    let mut lines = rows(text).peekable();
    let mut views = Vec::new();
    while let Some((line, fields)) = lines.next() {
        if fields.is_empty() {
            continue;
        }
        views.push(view(path, line, &fields, &cameras)?.check(path, defaults)?);
        lines.next_if(|(_, fields)| are_points(fields));
    }
    if views.is_empty() {
        return Err(IoError::Empty { path: path.to_owned(), what: "images" });
    }
    Ok(views)
}

/// What `cameras.txt` says of each camera, by its id.
type Lenses = BTreeMap<String, (Matrix3<f64>, Option<Distortion>, ImageSize)>;

fn lenses(path: &Path, text: &str) -> Result<Lenses, IoError> {
    let mut cameras = Lenses::new();
    for (line, fields) in rows(text).filter(|(_, fields)| !fields.is_empty()) {
        if fields.len() < 5 {
            let reason = "expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS";
            return Err(IoError::malformed(path, FORMAT, Some(line), reason));
        }
        let side = |column: usize| -> Result<u32, IoError> {
            fields[column].parse().map_err(|_| {
                let reason = format!("field {} is not a number of px", column + 1);
                IoError::malformed(path, FORMAT, Some(line), reason)
            })
        };
        let size = ImageSize { width: side(2)?, height: side(3)? };
        let params = fields[4..]
            .iter()
            .enumerate()
            .map(|(i, field)| parse_number(path, line, 5 + i, field))
            .collect::<Result<Vec<f64>, _>>()?;
        let (k, lens) = model(path, line, fields[1], &params)?;
        cameras.insert(fields[0].to_owned(), (k, lens, size));
    }
    Ok(cameras)
}

fn view(path: &Path, line: usize, fields: &[&str], cameras: &Lenses) -> Result<RawView, IoError> {
    if fields.len() < IMAGE_FIELDS {
        let reason = "expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
        return Err(IoError::malformed(path, FORMAT, Some(line), reason));
    }
    let mut v = [0.0; 7];
    for (i, value) in v.iter_mut().enumerate() {
        *value = parse_number(path, line, i + 2, fields[i + 1])?;
    }
    let q = Quaternion::new(v[0], v[1], v[2], v[3]);
    // Printed with six digits or more, a unit quaternion is off by less than this.
    if (q.norm() - 1.0).abs() > 1e-4 {
        let last = (v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]).sqrt();
        let guess = if (last - 1.0).abs() < 1e-4 {
            "; the last four are: the translation seems to stand before the quaternion"
        } else {
            ""
        };
        let reason = format!("QW QX QY QZ has length {}, not 1{guess}", q.norm());
        return Err(IoError::malformed(path, FORMAT, Some(line), reason));
    }
    let Some((k, lens, size)) = cameras.get(fields[8]) else {
        let reason = format!("no camera {} in cameras.txt", crate::error::cut(fields[8], 20));
        return Err(IoError::malformed(path, FORMAT, Some(line), reason));
    };
    Ok(RawView {
        name: fields[9..].join(" "),
        k: *k,
        r: *UnitQuaternion::from_quaternion(q).to_rotation_matrix().matrix(),
        t: Vector3::new(v[4], v[5], v[6]),
        size: Some(*size),
        distortion: *lens,
        unit: None,
        frame: "as in the file".into(),
        notes: vec![
            "half a pixel taken off the principal point: COLMAP's first pixel centre is (0.5, 0.5)"
                .into(),
        ],
    })
}

type Model = (Matrix3<f64>, Option<Distortion>);

fn model(path: &Path, line: usize, name: &str, p: &[f64]) -> Result<Model, IoError> {
    let zero = Distortion::default();
    let ([fx, fy, cx, cy], lens) = match (name, p) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], None),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], None),
        ("SIMPLE_RADIAL", &[f, cx, cy, k1]) => ([f, f, cx, cy], Some(Distortion { k1, ..zero })),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], Some(Distortion { k1, k2, ..zero })),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
            ([fx, fy, cx, cy], Some(Distortion { k1, k2, p1, p2, k3: 0.0 }))
        }
        _ => {
            let reason = format!(
                "camera model {} with {} parameters; read are SIMPLE_PINHOLE 3, PINHOLE 4, \
                 SIMPLE_RADIAL 4, RADIAL 5, OPENCV 8",
                crate::error::cut(name, 30),
                p.len()
            );
            return Err(IoError::malformed(path, FORMAT, Some(line), reason));
        }
    };
    let (cx, cy) = (cx - PIXEL_ORIGIN, cy - PIXEL_ORIGIN);
    Ok((Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0), lens))
}

/// Writes `cameras.txt`, `images.txt` and an empty `points3D.txt` into a folder.
pub(crate) fn write(folder: &Path, views: &[NamedView]) -> Result<(), IoError> {
    let mut cameras = String::from("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n");
    let mut images = String::from("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n");
    for (index, view) in views.iter().enumerate() {
        let id = index + 1;
        let (k, size) = (view.camera.k(), view.camera.size());
        let unsupported = |what: &str| IoError::Unsupported {
            path: folder.to_owned(),
            what: format!("view `{}`: {what}", view.name),
        };
        if k[(0, 1)] != 0.0 {
            return Err(unsupported("COLMAP's models have no skew"));
        }
        let (cx, cy) = (k[(0, 2)] + PIXEL_ORIGIN, k[(1, 2)] + PIXEL_ORIGIN);
        let _ = write!(
            cameras,
            "{id} {} {} {} {:?} {:?} {cx:?} {cy:?}",
            if view.camera.distortion().is_some() { "OPENCV" } else { "PINHOLE" },
            size.width,
            size.height,
            k[(0, 0)],
            k[(1, 1)]
        );
        if let Some(d) = view.camera.distortion() {
            if d.k3 != 0.0 {
                return Err(unsupported("COLMAP's model OPENCV has no k3"));
            }
            let _ = write!(cameras, " {:?} {:?} {:?} {:?}", d.k1, d.k2, d.p1, d.p2);
        }
        cameras.push('\n');
        let rotation = Rotation3::from_matrix_unchecked(*view.camera.r());
        let q = UnitQuaternion::from_rotation_matrix(&rotation);
        let t = view.camera.t();
        let name = view.name.split_whitespace().collect::<Vec<_>>().join("_");
        let _ = writeln!(
            images,
            "{id} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {id} {name}\n",
            q.w, q.i, q.j, q.k, t.x, t.y, t.z
        );
    }
    std::fs::create_dir_all(folder).map_err(|e| IoError::system(folder, "make folder", e))?;
    write_atomically(&folder.join("cameras.txt"), |w| w.write_all(cameras.as_bytes()))?;
    write_atomically(&folder.join("points3D.txt"), |w| w.write_all(b"# no points\n"))?;
    write_atomically(&folder.join("images.txt"), |w| w.write_all(images.as_bytes()))
}
