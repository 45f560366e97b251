use std::fmt;

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, Distortion, ImageSize, LengthUnit, Pixel, Point2, Rig, View1};

use crate::c_arm::{ArmPlace, arm};

/// A usual mistake in handing over cameras or pixels. The comment of each says what was done wrong;
/// [`Mistake::mend`] undoes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mistake {
    /// The data of view 1 was given with the camera of view 2 and the other way round.
    ViewsSwapped,
    /// `[R | t]` is camera to world instead of world to camera.
    InverseExtrinsics,
    /// `R` is transposed (row-major read as column-major), `t` is right.
    TransposedRotation,
    /// `t` is the camera's centre instead of `-R C`.
    CentreAsTranslation,
    /// Camera axes of graphics programs, y up and z backwards, instead of y down and z forwards.
    GraphicsAxes,
    /// World axes RAS instead of LPS, or the other way round: x and y have the wrong sign.
    WorldAxes,
    /// The image is mirrored left to right.
    MirroredColumns,
    /// The image is mirrored top to bottom.
    MirroredRows,
    /// The image is turned by half a turn.
    HalfTurn,
    /// Row and column of pixels are exchanged.
    RowsAsColumns,
    /// The primary angle of the C-arm has the wrong sign.
    PrimarySign,
    /// The secondary angle of the C-arm has the wrong sign.
    SecondarySign,
    /// Both angles of the C-arm have the wrong sign.
    BothAngleSigns,
    /// Primary and secondary angle of the C-arm are exchanged.
    AnglesExchanged,
    /// `t` is in another unit than the other view's: it is to be multiplied by this.
    UnitOfView(f64),
    /// `K` is for an image of another size: it is to be multiplied by this.
    ImageScale(f64),
    /// Pixels are counted from another corner of the first pixel than `K` says: this, px, is to be
    /// added to the principal point in both directions. +0.5 or -0.5.
    PixelOrigin(f64),
    /// The focal length in px is wrong and has to be multiplied by this: the pixel spacing was taken
    /// at the detector where it is at the isocentre, or the other way round. (The ratio is then
    /// source to detector over source to isocentre.)
    Magnification(f64),
    /// The lens distortion was not removed from the pixels, and the camera does not know it.
    LensNotRemoved {
        /// Displacement at the image's corner as a share of its distance from the middle, as `k1`
        /// alone would make it. Positive: pincushion.
        share: f64,
        /// What the displacement is about.
        about: LensCentre,
    },
    /// The pixels are free of distortion already, but the camera would have it removed again.
    LensRemovedTwice,
    /// `K`, `R` and `t` hold for other pixels: those of an undistorted picture (an image intensifier
    /// bends and shifts its picture), or of one that was cropped or moved. The number is how far, px,
    /// pixels of view 2 lie beside the epipolar lines of view 1 on average: the only part of a
    /// displacement that two curves show.
    PixelsDisplaced(f64),
}

/// The point of the image that a lens leaves where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LensCentre {
    /// The principal point, as in OpenCV's model.
    PrincipalPoint,
    /// The middle of the image: of image intensifiers, whose principal point may be elsewhere.
    Middle,
}

/// Which views a mistake is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// View 1 alone.
    View1,
    /// View 2 alone.
    View2,
    /// Both.
    Both,
}

impl Which {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Both, Self::View1, Self::View2];

    const fn has(self, index: usize) -> bool {
        matches!((self, index), (Self::Both, _) | (Self::View1, 0) | (Self::View2, 1))
    }
}

impl fmt::Display for Which {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::View1 => "view 1",
            Self::View2 => "view 2",
            Self::Both => "both views",
        })
    }
}

impl Mistake {
    /// The name in machine-readable output.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::ViewsSwapped => "views-swapped",
            Self::InverseExtrinsics => "inverse-extrinsics",
            Self::TransposedRotation => "transposed-rotation",
            Self::CentreAsTranslation => "centre-as-translation",
            Self::GraphicsAxes => "graphics-axes",
            Self::WorldAxes => "world-axes-lps-ras",
            Self::MirroredColumns => "mirrored-columns",
            Self::MirroredRows => "mirrored-rows",
            Self::HalfTurn => "half-turn",
            Self::RowsAsColumns => "rows-as-columns",
            Self::PrimarySign => "primary-angle-sign",
            Self::SecondarySign => "secondary-angle-sign",
            Self::BothAngleSigns => "both-angle-signs",
            Self::AnglesExchanged => "angles-exchanged",
            Self::UnitOfView(_) => "unit-of-one-view",
            Self::ImageScale(_) => "image-scale",
            Self::PixelOrigin(_) => "half-pixel",
            Self::Magnification(_) => "magnification",
            Self::LensNotRemoved { .. } => "lens-not-removed",
            Self::LensRemovedTwice => "lens-removed-twice",
            Self::PixelsDisplaced(_) => "pixels-displaced",
        }
    }

    /// Whether the two are the same mistake, whatever the number.
    pub fn same_kind(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// The cameras with the mistake undone; `None` where it cannot be in them: a camera is no C-arm
    /// about the isocentre, or has no lens to be removed twice.
    pub fn mend(&self, which: Which, cameras: &[Camera; 2]) -> Option<[Camera; 2]> {
        if *self == Self::ViewsSwapped {
            let [one, two] = cameras;
            return Some([two.clone(), one.clone()]);
        }
        if let Self::PixelsDisplaced(off_px) = *self {
            return moved_across(cameras, off_px);
        }
        let mut mended = cameras.clone();
        for (index, camera) in mended.iter_mut().enumerate() {
            if which.has(index) {
                *camera = self.mend_one(camera)?;
            }
        }
        Some(mended)
    }

    /// What to do about it.
    pub fn remedy(&self, which: Which) -> String {
        let of = match which {
            Which::Both => "of both views".to_owned(),
            one => format!("of {one}"),
        };
        match self {
            Self::ViewsSwapped => "exchange the two cameras, or the data of the two views".into(),
            Self::InverseExtrinsics => {
                format!("invert [R | t] {of}: R becomes its transpose, t becomes -R^T t")
            }
            Self::TransposedRotation => format!("transpose R {of} and keep t"),
            Self::CentreAsTranslation => {
                format!("what stands for t {of} is the camera's centre C: t = -R C")
            }
            Self::GraphicsAxes => format!(
                "change the signs of the second and third row of [R | t] {of} (y down, z forwards)"
            ),
            Self::WorldAxes => {
                format!("change the signs of the first two columns of R {of} (LPS and RAS)")
            }
            Self::MirroredColumns => {
                format!("un-mirror the image {of} left to right: x becomes width - 1 - x")
            }
            Self::MirroredRows => {
                format!("un-mirror the image {of} top to bottom: y becomes height - 1 - y")
            }
            Self::HalfTurn => format!("turn the image {of} by half a turn"),
            Self::RowsAsColumns => {
                format!("exchange x and y of the pixels {of}: x is the column, to the right")
            }
            Self::PrimarySign => {
                format!("change the sign of the primary angle {of} (LAO is positive)")
            }
            Self::SecondarySign => {
                format!("change the sign of the secondary angle {of} (cranial is positive)")
            }
            Self::BothAngleSigns => format!("change the signs of both angles {of}"),
            Self::AnglesExchanged => format!("exchange primary and secondary angle {of}"),
            Self::UnitOfView(factor) => format!(
                "multiply t {of} by {factor}: it is in another unit of length than the other view's"
            ),
            Self::ImageScale(factor) => format!(
                "multiply the first two rows of K {of} by {factor}: it is for an image of another \
                 size"
            ),
            Self::PixelOrigin(shift) => format!(
                "add {shift} px to the principal point {of}: pixel centres are at integers here, \
                 the first at (0, 0)"
            ),
            Self::Magnification(factor) => format!(
                "multiply the focal lengths {of} by {factor:.3}: the pixel spacing is the \
                 isocentre's where the detector's belongs, or the other way round (the ratio is \
                 source-detector over source-isocentre distance)"
            ),
            Self::LensNotRemoved { share, .. } => format!(
                "undistort the pixels {of}, or state the lens (k1 alone would move the image's \
                 corners by {:.1} % of their distance from the middle, {})",
                100.0 * share.abs(),
                if *share > 0.0 { "outwards" } else { "inwards" }
            ),
            Self::LensRemovedTwice => {
                format!("leave the distortion coefficients {of} out: the pixels are undistorted")
            }
            Self::PixelsDisplaced(off_px) => format!(
                "undistort the pixels with the lens or grid that the calibration came with (an image \
                 intensifier bends and shifts its picture): K, R and t do not hold for these, which \
                 lie {:.1} px beside their epipolar lines where the curves turn round; if they are \
                 undistorted, give K of the picture as it was cropped or moved (curves cannot tell \
                 the two apart; the mended cameras have the principal point of view 2 moved)",
                off_px.abs()
            ),
        }
    }

    fn mend_one(&self, camera: &Camera) -> Option<Camera> {
        let (k, r, t) = (*camera.k(), *camera.r(), *camera.t());
        let size = camera.size();
        let [width, height] = [f64::from(size.width), f64::from(size.height)];
        match *self {
            // Of both cameras at once, see `mend`.
            Self::ViewsSwapped | Self::PixelsDisplaced(_) => None,
            Self::InverseExtrinsics => {
                with(camera, k, *camera.r_inverse(), -(camera.r_inverse() * t))
            }
            Self::TransposedRotation => with(camera, k, r.transpose(), t),
            Self::CentreAsTranslation => with(camera, k, r, -(r * t)),
            Self::GraphicsAxes => {
                let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
                with(camera, k, flip * r, flip * t)
            }
            Self::WorldAxes => {
                let flip = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
                with(camera, k, r * flip, t)
            }
            // The camera of the mirrored image stands for un-mirrored pixels.
            Self::MirroredColumns => with(camera, mirrored(&k, 0, width), r, t),
            Self::MirroredRows => with(camera, mirrored(&k, 1, height), r, t),
            Self::HalfTurn => with(camera, mirrored(&mirrored(&k, 0, width), 1, height), r, t),
            Self::RowsAsColumns => rows_as_columns(camera),
            Self::PrimarySign => turned_arm(camera, |a, b| (-a, b)),
            Self::SecondarySign => turned_arm(camera, |a, b| (a, -b)),
            Self::BothAngleSigns => turned_arm(camera, |a, b| (-a, -b)),
            Self::AnglesExchanged => turned_arm(camera, |a, b| (b, a)),
            Self::UnitOfView(factor) => with(camera, k, r, t * factor),
            Self::ImageScale(factor) => {
                let scale = Matrix3::from_diagonal(&Vector3::new(factor, factor, 1.0));
                with(camera, scale * k, r, t)
            }
            Self::PixelOrigin(shift) => {
                let mut k = k;
                k[(0, 2)] += shift;
                k[(1, 2)] += shift;
                with(camera, k, r, t)
            }
            Self::Magnification(factor) => {
                let mut k = k;
                for at in [(0, 0), (0, 1), (1, 1)] {
                    k[at] *= factor;
                }
                with(camera, k, r, t)
            }
            Self::LensNotRemoved { share, about } => {
                if camera.distortion().is_some() {
                    return None;
                }
                let corner = Point2::new(0.5 * width / k[(0, 0)], 0.5 * height / k[(1, 1)]);
                let k1 = share / corner.coords.norm_squared();
                let (p1, p2) = match about {
                    LensCentre::PrincipalPoint => (0.0, 0.0),
                    // To first order that is Brown's decentring.
                    LensCentre::Middle => {
                        let middle = Point2::new(0.5 * (width - 1.0), 0.5 * (height - 1.0));
                        let middle = camera.k_inverse() * middle.to_homogeneous();
                        (-k1 * middle.y, -k1 * middle.x)
                    }
                };
                camera.clone().with_distortion(Distortion { k1, p1, p2, k3: 0.0, k2: 0.0 }).ok()
            }
            Self::LensRemovedTwice => {
                camera.distortion()?;
                Camera::new(k, r, t, size).ok()
            }
        }
    }
}

/// The camera with other numbers and the same lens and size.
fn with(camera: &Camera, k: Matrix3<f64>, r: Matrix3<f64>, t: Vector3<f64>) -> Option<Camera> {
    camera.with_matrices(k, r, t).ok()
}

/// `K` of the image mirrored in one direction, whose side is `side` px.
fn mirrored(k: &Matrix3<f64>, row: usize, side: f64) -> Matrix3<f64> {
    let mut k = *k;
    for column in row..3 {
        k[(row, column)] = -k[(row, column)];
    }
    k[(row, 2)] += side - 1.0;
    k
}

/// Camera 2 with its principal point moved across the epipolar line of the middle of view 1.
fn moved_across(cameras: &[Camera; 2], off_px: f64) -> Option<[Camera; 2]> {
    let [one, two] = cameras;
    let rig = Rig::new(one.clone(), two.clone(), LengthUnit::Unit).ok()?;
    let size = one.size();
    let middle = Point2::new(0.5 * f64::from(size.width), 0.5 * f64::from(size.height));
    let line = rig.fundamental().transpose().line(Pixel::<View1>::from(middle)).ok()?;
    let across = line.coefficients().xy().try_normalize(0.0)?;
    let mut k = *two.k();
    k[(0, 2)] += off_px * across.x;
    k[(1, 2)] += off_px * across.y;
    Some([one.clone(), with(two, k, *two.r(), *two.t())?])
}

/// The camera of the transposed image.
fn rows_as_columns(camera: &Camera) -> Option<Camera> {
    // A lens model is not symmetric in x and y.
    if camera.distortion().is_some() {
        return None;
    }
    let mut p = camera.projection_matrix();
    p.swap_rows(0, 1);
    let size = camera.size();
    let size = ImageSize { width: size.height, height: size.width };
    let turned = Camera::from_projection_matrix(&p, size).ok()?;
    Camera::new(*turned.k(), *turned.r(), *turned.t(), camera.size()).ok()
}

/// The C-arm at other angles; `None` if the camera is no C-arm that looks at the world's origin.
fn turned_arm(camera: &Camera, other: impl Fn(f64, f64) -> (f64, f64)) -> Option<Camera> {
    let place = ArmPlace::of(camera)?;
    let (a, b) = other(place.primary_rad, place.secondary_rad);
    with(camera, *camera.k(), place.image_from_arm * arm(a, b), *camera.t())
}

#[cfg(test)]
mod tests {
    use accurate_geom::Point3;
    use accurate_geom::nalgebra::Rotation3;

    use super::*;

    fn camera() -> Camera {
        let k = Matrix3::new(900.0, 0.4, 250.0, 0.0, 950.0, 190.0, 0.0, 0.0, 1.0);
        let r = *Rotation3::new(Vector3::new(0.3, -0.8, 0.2)).matrix();
        let size = ImageSize { width: 512, height: 400 };
        Camera::new(k, r, Vector3::new(4.0, -7.0, 600.0), size).unwrap()
    }

    #[test]
    fn cameras_of_mirrored_and_transposed_images_see_them() {
        let camera = camera();
        let x = Point3::new(20.0, -30.0, 10.0);
        let p = camera.project(&x).unwrap();
        let seen = |mistake: Mistake| {
            mistake.mend_one(&camera).unwrap().project(&x).map(|p| (p.x, p.y)).unwrap()
        };
        // A few roundings of numbers below 1000.
        let near = |(x, y): (f64, f64), (u, v): (f64, f64)| {
            assert!((x - u).abs() < 1e-9 && (y - v).abs() < 1e-9, "{x} {y} {u} {v}");
        };
        near(seen(Mistake::MirroredColumns), (511.0 - p.x, p.y));
        near(seen(Mistake::MirroredRows), (p.x, 399.0 - p.y));
        near(seen(Mistake::HalfTurn), (511.0 - p.x, 399.0 - p.y));
        near(seen(Mistake::RowsAsColumns), (p.y, p.x));
        near(seen(Mistake::ImageScale(2.0)), (2.0 * p.x, 2.0 * p.y));
        near(seen(Mistake::PixelOrigin(0.5)), (p.x + 0.5, p.y + 0.5));
    }

    #[test]
    fn a_c_arm_is_told_from_other_cameras_and_turned_by_its_angles() {
        assert!(Mistake::PrimarySign.mend_one(&camera()).is_none());
        let (a, b) = (0.5, -0.3);
        let k = Matrix3::new(2000.0, 0.0, 256.0, 0.0, -2000.0, 256.0, 0.0, 0.0, 1.0);
        let size = ImageSize { width: 512, height: 512 };
        let t = Vector3::new(0.0, 0.0, 720.0);
        let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        for image in [Matrix3::identity(), quarter] {
            let camera = Camera::new(k, image * arm(a, b), t, size).unwrap();
            for (mistake, (a, b)) in [
                (Mistake::PrimarySign, (-a, b)),
                (Mistake::SecondarySign, (a, -b)),
                (Mistake::BothAngleSigns, (-a, -b)),
                (Mistake::AnglesExchanged, (b, a)),
            ] {
                let turned = mistake.mend_one(&camera).unwrap();
                assert!((turned.r() - image * arm(a, b)).amax() < 1e-12, "{mistake:?}");
            }
        }
    }

    #[test]
    fn what_is_its_own_inverse_comes_back() {
        let cameras = [camera(), camera()];
        for mistake in [
            Mistake::InverseExtrinsics,
            Mistake::TransposedRotation,
            Mistake::GraphicsAxes,
            Mistake::WorldAxes,
            Mistake::MirroredColumns,
            Mistake::MirroredRows,
            Mistake::HalfTurn,
        ] {
            let there = mistake.mend(Which::View2, &cameras).unwrap();
            assert_eq!(there[0], cameras[0]);
            assert!(there[1] != cameras[1], "{mistake:?}");
            let back = mistake.mend(Which::View2, &there).unwrap();
            // Two products of a rotation with numbers below 1000.
            let off = back[1].projection_matrix() - cameras[1].projection_matrix();
            assert!(off.amax() < 1e-8, "{mistake:?}: {off}");
        }
    }
}
