use std::path::Path;

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{ImageSize, LengthUnit};
use dicom_dictionary_std::tags;

use super::open::{number, open, word};
use crate::IoError;
use crate::cameras::{NamedView, RawView, ViewDefaults, stem};

const FRAME: &str = "C-arm isocentre, mm: x to the patient's left, y posterior, z to the head";

/// The camera of a DICOM XA file (single or multi-frame, the C-arm at rest).
///
/// World: the isocentre, mm, x to the patient's left, y posterior, z to the head. With primary angle
/// `a` (LAO positive) and secondary angle `b` (cranial positive), the central ray from the source is
/// `d = (sin a cos b, -cos a cos b, sin b)`, the columns run along `u = (cos a, sin a, 0)`, the rows
/// along `v = u x d`, and `t = (0, 0, SOD)`. The image shows the patient from the front while the rays
/// run from behind, so `(u, v, d)` is left-handed: the rows of `R` are `u`, `-v`, `d`, and `f_y` is
/// negative. The focal lengths are SID over the pixel spacing at the detector; the principal point is taken at (columns / 2, rows / 2).
///
/// Where `ImagerPixelSpacing` is absent the spacing follows from `FieldOfViewDimensions` over the
/// columns, with a note. A rotated or flipped field of view turns the camera with it.
///
/// # Errors
/// [`IoError::Field`] naming the tag that is missing or makes no sense, never quoting text of the
/// file; [`IoError::Unsupported`] for a moving C-arm; [`IoError::Malformed`].
///
/// # Source
/// DICOM PS3.3 C.8.7.5 (XA positioner), C.8.19.6.6 (field of view). The signs were verified on a real
/// acquisition of a phantom with a 3D reference; all other choices of signs and axes fail there.
pub fn read_dicom_view(path: &Path) -> Result<NamedView, IoError> {
    let object = open(path, false)?;
    let optional = |tag, name: &str| number(path, &object, tag, name, 0);
    let need = |tag, name: &str| {
        optional(tag, name)?.ok_or_else(|| {
            IoError::field(path, name, "", "the tag is missing; without it there is no geometry")
        })
    };
    let positive = |tag, name: &str| {
        let value = need(tag, name)?;
        if value > 0.0 {
            Ok(value)
        } else {
            Err(IoError::field(path, name, value.to_string(), "must be positive"))
        }
    };
    let mut notes = Vec::new();

    let a = need(tags::POSITIONER_PRIMARY_ANGLE, "PositionerPrimaryAngle")?.to_radians();
    let b = need(tags::POSITIONER_SECONDARY_ANGLE, "PositionerSecondaryAngle")?.to_radians();
    for (tag, name) in [
        (tags::POSITIONER_PRIMARY_ANGLE_INCREMENT, "PositionerPrimaryAngleIncrement"),
        (tags::POSITIONER_SECONDARY_ANGLE_INCREMENT, "PositionerSecondaryAngleIncrement"),
    ] {
        if optional(tag, name)?.is_some_and(|step| step != 0.0) {
            let what =
                format!("{name}: the C-arm moves during the run; only runs at rest are read");
            return Err(IoError::Unsupported { path: path.to_owned(), what });
        }
    }
    if word(&object, tags::POSITIONER_MOTION, &["DYNAMIC"]).is_some() {
        let what = "PositionerMotion is DYNAMIC; only runs at rest are read".into();
        return Err(IoError::Unsupported { path: path.to_owned(), what });
    }
    let sid = positive(tags::DISTANCE_SOURCE_TO_DETECTOR, "DistanceSourceToDetector")?;
    let sod = positive(tags::DISTANCE_SOURCE_TO_PATIENT, "DistanceSourceToPatient")?;
    if sod >= sid {
        let reason = format!("must be less than DistanceSourceToDetector = {sid}");
        return Err(IoError::field(path, "DistanceSourceToPatient", sod.to_string(), reason));
    }
    let side = |tag, name: &str| {
        let value = positive(tag, name)?;
        if value.fract() == 0.0 && value <= f64::from(crate::MAX_IMAGE_SIDE_PX) {
            Ok(value as u32)
        } else {
            Err(IoError::field(path, name, value.to_string(), "expected a whole number of px"))
        }
    };
    let (width, height) = (side(tags::COLUMNS, "Columns")?, side(tags::ROWS, "Rows")?);

    // Spacing between rows, then between columns.
    let spacing =
        |index| number(path, &object, tags::IMAGER_PIXEL_SPACING, "ImagerPixelSpacing", index);
    let (row_mm, column_mm) = match spacing(0)? {
        Some(row) => (row, spacing(1)?.unwrap_or(row)),
        None => {
            let field = |i| {
                let (tag, name) = (tags::FIELD_OF_VIEW_DIMENSIONS, "FieldOfViewDimensions");
                number(path, &object, tag, name, i)
            };
            let Some(first) = field(0)? else {
                let reason = "the tag is missing, and so is FieldOfViewDimensions";
                return Err(IoError::field(path, "ImagerPixelSpacing", "", reason));
            };
            let second = field(1).ok().flatten().unwrap_or(first);
            notes.push(format!(
                "ImagerPixelSpacing is missing: spacing from FieldOfViewDimensions, {first} mm over \
                 {width} columns"
            ));
            (second / f64::from(height), first / f64::from(width))
        }
    };
    for value in [row_mm, column_mm] {
        if !(value > 0.0) {
            let reason = "must be positive";
            return Err(IoError::field(path, "ImagerPixelSpacing", value.to_string(), reason));
        }
    }

    let u = Vector3::new(a.cos(), a.sin(), 0.0);
    let d = Vector3::new(a.sin() * b.cos(), -a.cos() * b.cos(), b.sin());
    let minus_v = d.cross(&u);
    let mut r = Matrix3::from_rows(&[u.transpose(), minus_v.transpose(), d.transpose()]);
    // Signs of the focal lengths: a reflection stays in K, so that R is a rotation.
    let (mut sign_x, mut sign_y) = (1.0, -1.0);

    let turn = optional(tags::FIELD_OF_VIEW_ROTATION, "FieldOfViewRotation")?.unwrap_or(0.0);
    // Clockwise on the screen: a quarter turn takes x to y, and y to -x.
    let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let quarters = match turn {
        0.0 => 0,
        90.0 => 1,
        180.0 => 2,
        270.0 => 3,
        _ => {
            let reason = "expected 0, 90, 180 or 270";
            return Err(IoError::field(path, "FieldOfViewRotation", turn.to_string(), reason));
        }
    };
    for _ in 0..quarters {
        r = quarter * r;
        std::mem::swap(&mut sign_x, &mut sign_y);
    }
    if quarters > 0 {
        notes.push(format!("the field of view is turned by {turn} degrees; so is the camera"));
    }
    if word(&object, tags::FIELD_OF_VIEW_HORIZONTAL_FLIP, &["YES"]).is_some() {
        sign_x = -sign_x;
        notes.push("the field of view is flipped: so is the sign of f_x".into());
    }
    let table = [
        (tags::TABLE_TOP_LATERAL_POSITION, "lateral"),
        (tags::TABLE_TOP_VERTICAL_POSITION, "vertical"),
        (tags::TABLE_TOP_LONGITUDINAL_POSITION, "longitudinal"),
    ];
    let mut place = Vec::new();
    for (tag, name) in table {
        if let Some(value) = optional(tag, name)? {
            place.push(format!("{name} {value} mm"));
        }
    }
    notes.push(if place.is_empty() {
        "no table position: views belong together only if the table did not move between them"
            .into()
    } else {
        format!("table {}; views belong together only if it is the same", place.join(", "))
    });
    let positions = ["HFS", "HFP", "FFS", "FFP", "HFDL", "HFDR", "FFDL", "FFDR"];
    match word(&object, tags::PATIENT_POSITION, &positions) {
        Some("HFS") => {}
        Some(other) => notes.push(format!(
            "patient position {other}: the angles are about the patient; the frame is so too"
        )),
        None => notes.push("no patient position".into()),
    }
    let corner = |index| {
        let (tag, name) = (tags::FIELD_OF_VIEW_ORIGIN, "FieldOfViewOrigin");
        number(path, &object, tag, name, index)
    };
    notes.push(match (corner(0)?, corner(1).ok().flatten()) {
        (Some(row), Some(column)) if row != 0.0 || column != 0.0 => format!(
            "principal point taken at the middle of the image, but the field of view begins at row \
             {row}, column {column} of the detector (FieldOfViewOrigin): where it is not cut evenly \
             about the central ray, the principal point is elsewhere"
        ),
        _ => "principal point taken at the middle of the image".into(),
    });

    RawView {
        name: stem(path),
        k: Matrix3::new(
            sign_x * sid / column_mm,
            0.0,
            f64::from(width) / 2.0,
            0.0,
            sign_y * sid / row_mm,
            f64::from(height) / 2.0,
            0.0,
            0.0,
            1.0,
        ),
        r,
        t: Vector3::new(0.0, 0.0, sod),
        size: Some(ImageSize { width, height }),
        distortion: None,
        unit: Some(LengthUnit::Millimetre),
        frame: FRAME.into(),
        notes,
    }
    .check(path, &ViewDefaults::default())
}
