use nalgebra::{Matrix3, Matrix3x4, Vector2, Vector3};

use crate::error::finite;
use crate::{Distortion, GeomError, Point2, Point3};

/// Width and height of an image, px.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ImageSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A pinhole camera `p ~ K (R X + t)`.
///
/// Signs on the diagonal of `K` are free: the paper's phantom rigs have f_y < 0, and nothing here
/// re-derives `K` by a decomposition that would fix them.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    k: Matrix3<f64>,
    r: Matrix3<f64>,
    t: Vector3<f64>,
    size: ImageSize,
    k_inverse: Matrix3<f64>,
    /// `R⁻¹` rather than `Rᵀ`: they differ when `R` comes from a rounded file, and only the inverse
    /// makes rays, centre and `F` agree with the projection as given.
    r_inverse: Matrix3<f64>,
    distortion: Option<Distortion>,
}

impl Camera {
    /// How far `RᵀR` may be from the identity, entry by entry, and `det R` from 1.
    ///
    /// Calibration files print 6 or more significant digits; products of two such entries are
    /// wrong by less than this.
    pub const ROTATION_TOLERANCE: f64 = 1e-5;

    /// A camera from intrinsics `k` (px), world-to-camera rotation `r` and translation `t`
    /// (world unit), and the image size.
    ///
    /// # Errors
    /// [`GeomError::NotFinite`], [`GeomError::NotUpperTriangular`], [`GeomError::ZeroFocalLength`],
    /// [`GeomError::NotARotation`] (see [`nearest_rotation`]) or [`GeomError::EmptyImage`].
    pub fn new(
        k: Matrix3<f64>,
        r: Matrix3<f64>,
        t: Vector3<f64>,
        size: ImageSize,
    ) -> Result<Self, GeomError> {
        for (name, m) in [("K", &k), ("R", &r)] {
            for row in 0..3 {
                for column in 0..3 {
                    finite(m[(row, column)], || format!("{name}[{row}][{column}]"))?;
                }
            }
        }
        for row in 0..3 {
            finite(t[row], || format!("t[{row}]"))?;
        }
        for (row, column, expected) in [(1, 0, 0.0), (2, 0, 0.0), (2, 1, 0.0), (2, 2, 1.0)] {
            if k[(row, column)] != expected {
                return Err(GeomError::NotUpperTriangular { row, column, value: k[(row, column)] });
            }
        }
        for index in 0..2 {
            if k[(index, index)] == 0.0 {
                return Err(GeomError::ZeroFocalLength { index });
            }
        }
        let orthogonality = (r.transpose() * r - Matrix3::identity()).amax();
        let determinant = r.determinant();
        let tolerance = Self::ROTATION_TOLERANCE;
        if orthogonality > tolerance || (determinant - 1.0).abs() > tolerance {
            return Err(GeomError::NotARotation { orthogonality, determinant, tolerance });
        }
        if size.width == 0 || size.height == 0 {
            return Err(GeomError::EmptyImage { width: size.width, height: size.height });
        }
        let (fx, s, cx) = (k[(0, 0)], k[(0, 1)], k[(0, 2)]);
        let (fy, cy) = (k[(1, 1)], k[(1, 2)]);
        #[rustfmt::skip]
        let k_inverse = Matrix3::new(
            1.0 / fx, -s / (fx * fy), (s * cy - cx * fy) / (fx * fy),
            0.0,      1.0 / fy,       -cy / fy,
            0.0,      0.0,            1.0,
        );
        for &value in &k_inverse {
            finite(value, || "inverse of K".into())?;
        }
        let r_inverse = r.try_inverse().unwrap_or_else(|| r.transpose());
        Ok(Self { k, r, t, size, k_inverse, r_inverse, distortion: None })
    }

    /// The same camera behind a lens with `distortion`.
    ///
    /// # Errors
    /// [`GeomError::NotFinite`] for a coefficient that is not finite.
    pub fn with_distortion(self, distortion: Distortion) -> Result<Self, GeomError> {
        distortion.check()?;
        Ok(Self { distortion: Some(distortion), ..self })
    }

    /// The camera with another `k`, `r` and `t`, and the same image size and lens.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn with_matrices(
        &self,
        k: Matrix3<f64>,
        r: Matrix3<f64>,
        t: Vector3<f64>,
    ) -> Result<Self, GeomError> {
        Ok(Self { distortion: self.distortion, ..Self::new(k, r, t, self.size)? })
    }

    /// The lens distortion, if any.
    pub fn distortion(&self) -> Option<&Distortion> {
        self.distortion.as_ref()
    }

    /// Intrinsic matrix, px.
    pub fn k(&self) -> &Matrix3<f64> {
        &self.k
    }

    /// Inverse of the intrinsic matrix.
    pub fn k_inverse(&self) -> &Matrix3<f64> {
        &self.k_inverse
    }

    /// World-to-camera rotation.
    pub fn r(&self) -> &Matrix3<f64> {
        &self.r
    }

    /// Camera-to-world rotation: the inverse of [`r`](Self::r), equal to its transpose within
    /// [`ROTATION_TOLERANCE`](Self::ROTATION_TOLERANCE).
    pub fn r_inverse(&self) -> &Matrix3<f64> {
        &self.r_inverse
    }

    /// World-to-camera translation, world unit.
    pub fn t(&self) -> &Vector3<f64> {
        &self.t
    }

    /// Image size, px.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// `P = K [R | t]`, 3 x 4.
    pub fn projection_matrix(&self) -> Matrix3x4<f64> {
        let mut rt = Matrix3x4::zeros();
        rt.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.r);
        rt.set_column(3, &self.t);
        self.k * rt
    }

    /// Camera centre in the world, `-R⁻¹ t`.
    pub fn centre(&self) -> Point3 {
        Point3::from(-(self.r_inverse * self.t))
    }

    /// z of a world point in the camera frame, world unit.
    pub fn depth(&self, point: &Point3) -> f64 {
        self.r.row(2).transpose().dot(&point.coords) + self.t.z
    }

    /// The ideal (undistorted) image of a world point, px. The lens is left out on purpose: all
    /// geometry works on points that [`undistort`](Self::undistort) has freed from it once;
    /// [`distort`](Self::distort) gives the position in the recorded image.
    ///
    /// A depth so near 0 that the image overflows is not looked for: this is the hottest call there is,
    /// and the look costs a twentieth of it. Who projects points from anywhere checks the image.
    ///
    /// # Errors
    /// [`GeomError::NotInFront`] if the depth is not positive (or NaN).
    pub fn project(&self, point: &Point3) -> Result<Point2, GeomError> {
        let x_cam = self.r * point.coords + self.t;
        if !(x_cam.z > 0.0) {
            return Err(GeomError::NotInFront { depth: x_cam.z });
        }
        let p = self.k * (x_cam / x_cam.z);
        Ok(Point2::new(p.x, p.y))
    }

    /// Where the lens puts an ideal image point, px. Without distortion the point itself.
    ///
    /// # Errors
    /// [`GeomError::NotFinite`] if the point is not finite or the polynomial overflows.
    pub fn distort(&self, ideal: &Point2) -> Result<Point2, GeomError> {
        let distorted = match &self.distortion {
            None => *ideal,
            Some(lens) => {
                self.pixel_from_normalised(&lens.distort(&self.normalised_from_pixel(ideal)))
            }
        };
        finite(distorted.x, || "distorted x".into())?;
        finite(distorted.y, || "distorted y".into())?;
        Ok(distorted)
    }

    /// The ideal position of a point of the recorded image, px: the inverse of
    /// [`distort`](Self::distort), by Newton's method. Without distortion the point itself.
    ///
    /// # Errors
    /// [`GeomError::NotFinite`], [`GeomError::NoConvergence`] if no ideal point is found, and
    /// [`GeomError::DistortionFolds`] if the model is not one to one between the principal point
    /// and there.
    pub fn undistort(&self, distorted: &Point2) -> Result<Point2, GeomError> {
        let (x, y) = (distorted.x, distorted.y);
        finite(x, || "distorted x".into())?;
        finite(y, || "distorted y".into())?;
        let Some(lens) = &self.distortion else { return Ok(*distorted) };
        match lens.undistort(&self.normalised_from_pixel(distorted))? {
            Some(ideal) => Ok(self.pixel_from_normalised(&ideal)),
            None => Err(GeomError::DistortionFolds { x, y }),
        }
    }

    fn normalised_from_pixel(&self, p: &Point2) -> Vector2<f64> {
        (self.k_inverse * Vector3::new(p.x, p.y, 1.0)).xy()
    }

    fn pixel_from_normalised(&self, x: &Vector2<f64>) -> Point2 {
        Point2::from((self.k * x.push(1.0)).xy())
    }

    /// Direction of the ray through an (undistorted) image point, in the world frame, pointing away
    /// from the centre; not normalised: its z in the camera frame is 1.
    pub fn ray(&self, image_point: &Point2) -> Vector3<f64> {
        let x_cam = self.k_inverse * Vector3::new(image_point.x, image_point.y, 1.0);
        self.r_inverse * x_cam
    }
}

/// The rotation nearest to `matrix` in the Frobenius norm (by SVD; Horn 1988), or `None` if the
/// matrix is singular, not finite, or a reflection.
///
/// Not applied silently anywhere: a caller who accepts a rounded calibration file asks for it.
pub fn nearest_rotation(matrix: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    if !matrix.iter().all(|v| v.is_finite()) || matrix.determinant() <= 0.0 {
        return None;
    }
    let svd = matrix.svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    (rotation.determinant() > 0.0).then_some(rotation)
}
