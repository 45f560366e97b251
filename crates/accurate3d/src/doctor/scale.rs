use std::fmt;

use accurate_geom::{Camera, LengthUnit};

use super::Seen;

/// The width that an X-ray field of view has at the body, mm: detectors of 100 to 480 mm, magnified
/// 1.0 to 1.7 times. Less than a factor of ten from end to end, so that of mm, cm and m one fits.
const FIELD_MM: [f64; 2] = [60.0, 500.0];
/// Share of the image's side that the principal point may be off its middle.
const OFF_MIDDLE: f64 = 0.25;
/// Share of the points that may lie outside the image.
const OUTSIDE: f64 = 0.2;

/// Something odd that two views alone cannot settle.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Remark {
    /// The field of view at the body has a size that no X-ray field has, in the stated unit.
    FieldOfView {
        /// Its width, in the stated unit.
        width: f64,
        /// The stated unit.
        unit: LengthUnit,
        /// The unit in which it would be an X-ray field.
        fits: Option<LengthUnit>,
    },
    /// The principal point is far from the middle of the image.
    PrincipalPoint {
        /// 1 or 2.
        view: u8,
        /// The principal point, px.
        at: [f64; 2],
        /// The image, px.
        size: [u32; 2],
    },
    /// Pixels lie outside the image that the camera is for.
    OutsideImage {
        /// 1 or 2.
        view: u8,
        /// Their share.
        share: f64,
        /// The image, px.
        size: [u32; 2],
    },
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FieldOfView { width, unit, fits } => {
                write!(f, "the field of view at the body is {width:.3} {unit} wide; ")?;
                match fits {
                    Some(fits) => write!(
                        f,
                        "if this is an X-ray image, the translations are in {fits}, not {unit} \
                         (say --unit {fits}, or convert them)"
                    ),
                    None => write!(f, "no X-ray field is, in mm, cm or m"),
                }
            }
            Self::PrincipalPoint { view, at: [x, y], size: [w, h] } => write!(
                f,
                "view {view}: the principal point ({x:.1}, {y:.1}) is far from the middle of \
                 {w} x {h} px: was the image cropped or resized, or K made for another size?"
            ),
            Self::OutsideImage { view, share, size: [w, h] } => write!(
                f,
                "view {view}: {:.0} % of the points lie outside {w} x {h} px: were they measured \
                 in an image of another size?",
                100.0 * share
            ),
        }
    }
}

pub(super) fn remarks(
    cameras: &[Camera; 2],
    unit: LengthUnit,
    depth: f64,
    seen: &Seen,
) -> Vec<Remark> {
    let mut remarks = Vec::new();
    remarks.extend(field_of_view(&cameras[0], unit, depth));
    for (index, camera) in cameras.iter().enumerate() {
        let (k, size) = (camera.k(), camera.size());
        let [width, height] = [f64::from(size.width), f64::from(size.height)];
        let at = [k[(0, 2)], k[(1, 2)]];
        let view = if index == 0 { 1 } else { 2 };
        let size = [size.width, size.height];
        if (at[0] / width - 0.5).abs() > OFF_MIDDLE || (at[1] / height - 0.5).abs() > OFF_MIDDLE {
            remarks.push(Remark::PrincipalPoint { view, at, size });
        }
        let (mut outside, mut all) = (0, 0);
        let mut look = |x: f64, y: f64| {
            all += 1;
            let inside = (-0.5..=width - 0.5).contains(&x) && (-0.5..=height - 0.5).contains(&y);
            outside += usize::from(!inside);
        };
        match seen {
            Seen::Matched(pairs) => pairs.iter().for_each(|p| look(p[index].x, p[index].y)),
            Seen::Curves(curves) => {
                curves.iter().for_each(|curve| curve[index].iter().for_each(|p| look(p.x, p.y)))
            }
        }
        let share = f64::from(outside as u32) / f64::from(all.max(1) as u32);
        if share > OUTSIDE {
            remarks.push(Remark::OutsideImage { view, share, size });
        }
    }
    remarks
}

fn field_of_view(camera: &Camera, unit: LengthUnit, depth: f64) -> Option<Remark> {
    let in_mm = |unit: LengthUnit| match unit {
        LengthUnit::Millimetre => Some(1.0),
        LengthUnit::Centimetre => Some(10.0),
        LengthUnit::Metre => Some(1000.0),
        LengthUnit::Unit => None,
    };
    let width = f64::from(camera.size().width) / camera.k()[(0, 0)].abs() * depth;
    let is_field = |unit: LengthUnit| {
        in_mm(unit).is_some_and(|mm| (FIELD_MM[0]..=FIELD_MM[1]).contains(&(width * mm)))
    };
    if in_mm(unit).is_none() || !(width > 0.0) || is_field(unit) {
        return None;
    }
    let all = [LengthUnit::Millimetre, LengthUnit::Centimetre, LengthUnit::Metre];
    Some(Remark::FieldOfView { width, unit, fits: all.into_iter().find(|u| is_field(*u)) })
}

#[cfg(test)]
mod tests {
    use accurate_geom::ImageSize;
    use accurate_geom::nalgebra::{Matrix3, Vector3};

    use super::*;

    #[test]
    fn the_unit_that_fits_is_named_and_without_a_unit_nothing_is_said() {
        let k = Matrix3::new(2000.0, 0.0, 256.0, 0.0, 2000.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        let t = Vector3::new(0.0, 0.0, 720.0);
        let camera = Camera::new(k, Matrix3::identity(), t, size).unwrap();
        // 184 mm, whatever they are called.
        use LengthUnit::{Centimetre, Metre, Millimetre, Unit};
        for (depth, stated, fits) in [
            (720.0, Millimetre, None),
            (72.0, Millimetre, Some(Centimetre)),
            (0.72, Millimetre, Some(Metre)),
            (720.0, Centimetre, Some(Millimetre)),
            (720.0, Metre, Some(Millimetre)),
        ] {
            match field_of_view(&camera, stated, depth) {
                None => assert_eq!(fits, None),
                Some(Remark::FieldOfView { fits: found, .. }) => assert_eq!(found, fits),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(field_of_view(&camera, Unit, 0.72), None);
    }
}
