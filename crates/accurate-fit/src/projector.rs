use accurate_geom::nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
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
    numbers: CameraNumbers,
    /// `K`'s upper left block: turns a roll of the camera into a map of the image.
    focal: Matrix2<f64>,
    focal_inverse: Matrix2<f64>,
}

impl Projector {
    pub(crate) fn new(camera: &Camera) -> Self {
        let (k, matrix) = (camera.k(), camera.projection_matrix());
        let row = |r: usize| [0, 1, 2, 3].map(|c| matrix[(r, c)]);
        Self {
            numbers: CameraNumbers {
                matrix: [row(0), row(1), row(2)],
                principal: [k[(0, 2)], k[(1, 2)]],
                shift: [0.0; 2],
                roll: [[1.0, 0.0], [0.0, 1.0]],
            },
            focal: k.fixed_view::<2, 2>(0, 0).into_owned(),
            // Upper triangular with a diagonal that the camera has checked.
            focal_inverse: camera.k_inverse().fixed_view::<2, 2>(0, 0).into_owned(),
        }
    }

    pub(crate) fn pair(rig: &Rig) -> [Self; 2] {
        [Self::new(rig.camera1()), Self::new(rig.camera2())]
    }

    pub(crate) fn set_nuisance(&mut self, nuisance: Nuisance) {
        let (s, c) = nuisance.roll.sin_cos();
        let roll = self.focal * Matrix2::new(c, -s, s, c) * self.focal_inverse;
        self.numbers.roll = [0, 1].map(|r| [roll[(r, 0)], roll[(r, 1)]]);
        self.numbers.shift = nuisance.shift_px;
    }

    /// The same camera for formulas that are written for [`Number`]s.
    pub(crate) fn numbers(&self) -> &CameraNumbers {
        &self.numbers
    }

    /// Depth of a world point (the last row of `K` is `0 0 1`).
    #[inline]
    pub(crate) fn depth(&self, x: &Vector3<f64>) -> f64 {
        on_row(&self.numbers.matrix[2], &[x.x, x.y, x.z])
    }

    /// The image of a world point, px. Meaningless unless its depth is positive.
    #[inline]
    pub(crate) fn project(&self, x: &Vector3<f64>) -> Vector2<f64> {
        self.numbers.project_with_jacobian(&[x.x, x.y, x.z]).0.into()
    }

    /// The image and its derivative with respect to the world point.
    #[inline]
    pub(crate) fn project_with_jacobian(&self, x: &Vector3<f64>) -> (Vector2<f64>, Matrix2x3<f64>) {
        let (image, [a, b]) = self.numbers.project_with_jacobian(&[x.x, x.y, x.z]);
        (image.into(), Matrix2x3::new(a[0], a[1], a[2], b[0], b[1], b[2]))
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

    /// Derivative with respect to the roll of the (corrected) image of a point, px per radian.
    #[inline]
    pub(crate) fn roll_derivative(&self, image: &Vector2<f64>) -> Vector2<f64> {
        let CameraNumbers { principal, shift, .. } = self.numbers;
        let turned = self.focal_inverse * (image - Vector2::from(principal) - Vector2::from(shift));
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

/// A camera without matrices: those of `nalgebra` cannot be compiled for instructions that are known at
/// run time only.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CameraNumbers {
    matrix: [[f64; 4]; 3],
    principal: [f64; 2],
    roll: [[f64; 2]; 2],
    shift: [f64; 2],
}

impl CameraNumbers {
    /// The image and its derivative with respect to the world point, by rows. Uses every entry of the
    /// projection matrix: neither `f_x = f_y` nor their signs are assumed.
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
