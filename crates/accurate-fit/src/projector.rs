use accurate_geom::nalgebra::{Matrix2, Matrix2x3, Matrix3x4, Vector2, Vector3};
use accurate_geom::number::Number;
use accurate_geom::{Camera, Rig};

/// A small correction of view 2: a shift of its image, and a turn of the camera about its optical
/// axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Nuisance {
    pub(crate) shift_px: [f64; 2],
    pub(crate) roll: f64,
}

impl Nuisance {
    /// Shift x, shift y, roll: the order of the unknowns.
    pub(crate) fn values(&self) -> [f64; 3] {
        [self.shift_px[0], self.shift_px[1], self.roll]
    }

    /// Adds a step in the same order.
    pub(crate) fn add(&mut self, step: &[f64]) {
        self.shift_px[0] += step[0];
        self.shift_px[1] += step[1];
        self.roll += step[2];
    }
}

/// One camera, ready to project many points with derivatives.
#[derive(Debug, Clone)]
pub(crate) struct Projector {
    matrix: Matrix3x4<f64>,
    principal: Vector2<f64>,
    /// `K`'s upper left block: turns a roll of the camera into a map of the image.
    focal: Matrix2<f64>,
    focal_inverse: Matrix2<f64>,
    shift: Vector2<f64>,
    roll: Matrix2<f64>,
}

impl Projector {
    pub(crate) fn new(camera: &Camera) -> Self {
        Self {
            matrix: camera.projection_matrix(),
            principal: Vector2::new(camera.k()[(0, 2)], camera.k()[(1, 2)]),
            focal: camera.k().fixed_view::<2, 2>(0, 0).into_owned(),
            // Upper triangular with a diagonal that the camera has checked.
            focal_inverse: camera.k_inverse().fixed_view::<2, 2>(0, 0).into_owned(),
            shift: Vector2::zeros(),
            roll: Matrix2::identity(),
        }
    }

    pub(crate) fn pair(rig: &Rig) -> [Self; 2] {
        [Self::new(rig.camera1()), Self::new(rig.camera2())]
    }

    pub(crate) fn set_nuisance(&mut self, nuisance: Nuisance) {
        let (s, c) = nuisance.roll.sin_cos();
        self.roll = self.focal * Matrix2::new(c, -s, s, c) * self.focal_inverse;
        self.shift = nuisance.shift_px.into();
    }

    /// Depth of a world point (the last row of `K` is `0 0 1`).
    #[inline]
    pub(crate) fn depth(&self, x: &Vector3<f64>) -> f64 {
        let m = &self.matrix;
        m[(2, 0)] * x.x + m[(2, 1)] * x.y + m[(2, 2)] * x.z + m[(2, 3)]
    }

    #[inline]
    fn correct(&self, p: Vector2<f64>) -> Vector2<f64> {
        self.principal + self.roll * (p - self.principal) + self.shift
    }

    /// The image of a world point, px. Meaningless unless its depth is positive.
    #[inline]
    pub(crate) fn project(&self, x: &Vector3<f64>) -> Vector2<f64> {
        let m = &self.matrix;
        let inverse = 1.0 / self.depth(x);
        let u = (m[(0, 0)] * x.x + m[(0, 1)] * x.y + m[(0, 2)] * x.z + m[(0, 3)]) * inverse;
        let v = (m[(1, 0)] * x.x + m[(1, 1)] * x.y + m[(1, 2)] * x.z + m[(1, 3)]) * inverse;
        self.correct(Vector2::new(u, v))
    }

    /// The image and its derivative with respect to the world point. Uses every entry of the
    /// projection matrix: neither `f_x = f_y` nor their signs are assumed.
    #[inline]
    pub(crate) fn project_with_jacobian(&self, x: &Vector3<f64>) -> (Vector2<f64>, Matrix2x3<f64>) {
        let m = &self.matrix;
        let inverse = 1.0 / self.depth(x);
        let u = (m[(0, 0)] * x.x + m[(0, 1)] * x.y + m[(0, 2)] * x.z + m[(0, 3)]) * inverse;
        let v = (m[(1, 0)] * x.x + m[(1, 1)] * x.y + m[(1, 2)] * x.z + m[(1, 3)]) * inverse;
        let mut jacobian = Matrix2x3::zeros();
        for k in 0..3 {
            jacobian[(0, k)] = (m[(0, k)] - u * m[(2, k)]) * inverse;
            jacobian[(1, k)] = (m[(1, k)] - v * m[(2, k)]) * inverse;
        }
        let jacobian = self.roll * jacobian;
        (self.correct(Vector2::new(u, v)), jacobian)
    }

    /// Derivatives of an image point's distance with respect to shift and roll, given the unit direction
    /// `towards` the point that it is measured from.
    #[inline]
    pub(crate) fn nuisance_derivative(
        &self,
        image: &Vector2<f64>,
        towards: Vector2<f64>,
    ) -> [f64; 3] {
        [-towards.x, -towards.y, -towards.dot(&self.roll_derivative(image))]
    }

    /// The same camera for formulas that are written for [`Number`]s.
    pub(crate) fn numbers(&self) -> CameraNumbers {
        let rows = |r: usize| [0, 1, 2, 3].map(|c| self.matrix[(r, c)]);
        CameraNumbers {
            matrix: [rows(0), rows(1), rows(2)],
            principal: self.principal.into(),
            roll: [0, 1].map(|r| [self.roll[(r, 0)], self.roll[(r, 1)]]),
            shift: self.shift.into(),
        }
    }

    /// Derivative with respect to the roll of the (corrected) image of a point, px per radian.
    #[inline]
    pub(crate) fn roll_derivative(&self, image: &Vector2<f64>) -> Vector2<f64> {
        let turned = self.focal_inverse * (image - self.principal - self.shift);
        // d/da R(a) = R(a) J with J a quarter turn, and R J = J R: no need to turn back.
        self.focal * Vector2::new(-turned.y, turned.x)
    }

    /// Pixels per world unit across the line of sight at a world point.
    pub(crate) fn px_per_unit(&self, x: &Vector3<f64>) -> f64 {
        let (_, jacobian) = self.project_with_jacobian(x);
        // The root mean square over the two image axes of the gradient lengths.
        (0.5 * jacobian.norm_squared()).sqrt()
    }
}

/// A [`Projector`] without matrices: those of `nalgebra` cannot be compiled for instructions that are
/// known at run time only.
pub(crate) struct CameraNumbers {
    matrix: [[f64; 4]; 3],
    principal: [f64; 2],
    roll: [[f64; 2]; 2],
    shift: [f64; 2],
}

impl CameraNumbers {
    /// As [`Projector::project_with_jacobian`]; the Jacobian by rows.
    // No closures: they would be compiled without the instructions of the vectors.
    #[inline(always)]
    pub(crate) fn project_with_jacobian<N: Number>(&self, x: &[N; 3]) -> ([N; 2], [[N; 3]; 2]) {
        let like = x[0];
        let zero = like.all(0.0);
        let inverse = like.all(1.0) / on_row(&self.matrix[2], x);
        let mut off = [zero; 2];
        let mut pinhole = [[zero; 3]; 2];
        for axis in 0..2 {
            let at = on_row(&self.matrix[axis], x) * inverse;
            for k in 0..3 {
                let along = like.all(self.matrix[axis][k]) - at * like.all(self.matrix[2][k]);
                pinhole[axis][k] = along * inverse;
            }
            off[axis] = at - like.all(self.principal[axis]);
        }
        let mut image = [zero; 2];
        let mut jacobian = [[zero; 3]; 2];
        for axis in 0..2 {
            let (a, b) = (like.all(self.roll[axis][0]), like.all(self.roll[axis][1]));
            let turned = a * off[0] + b * off[1];
            image[axis] = like.all(self.principal[axis]) + turned + like.all(self.shift[axis]);
            for k in 0..3 {
                jacobian[axis][k] = a * pinhole[0][k] + b * pinhole[1][k];
            }
        }
        (image, jacobian)
    }
}

/// A row of a projection matrix times a point.
#[inline(always)]
fn on_row<N: Number>(row: &[f64; 4], x: &[N; 3]) -> N {
    let n = x[0];
    n.all(row[0]) * x[0] + n.all(row[1]) * x[1] + n.all(row[2]) * x[2] + n.all(row[3])
}
