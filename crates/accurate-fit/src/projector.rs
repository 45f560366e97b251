use accurate_geom::nalgebra::{Matrix2x3, Matrix3x4, Vector2, Vector3};
use accurate_geom::{Camera, Rig};

/// A small correction of view 2: a shift of its image and a turn about its principal point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Nuisance {
    pub(crate) shift_px: [f64; 2],
    pub(crate) roll: f64,
}

/// One camera, ready to project many points with derivatives.
#[derive(Debug, Clone)]
pub(crate) struct Projector {
    matrix: Matrix3x4<f64>,
    principal: Vector2<f64>,
    nuisance: Nuisance,
    cos_sin: [f64; 2],
}

impl Projector {
    pub(crate) fn new(camera: &Camera) -> Self {
        Self {
            matrix: camera.projection_matrix(),
            principal: Vector2::new(camera.k()[(0, 2)], camera.k()[(1, 2)]),
            nuisance: Nuisance::default(),
            cos_sin: [1.0, 0.0],
        }
    }

    pub(crate) fn pair(rig: &Rig) -> [Self; 2] {
        [Self::new(rig.camera1()), Self::new(rig.camera2())]
    }

    pub(crate) fn set_nuisance(&mut self, nuisance: Nuisance) {
        self.nuisance = nuisance;
        let (s, c) = nuisance.roll.sin_cos();
        self.cos_sin = [c, s];
    }

    /// Depth of a world point (the last row of `K` is `0 0 1`).
    #[inline]
    pub(crate) fn depth(&self, x: &Vector3<f64>) -> f64 {
        let m = &self.matrix;
        m[(2, 0)] * x.x + m[(2, 1)] * x.y + m[(2, 2)] * x.z + m[(2, 3)]
    }

    #[inline]
    fn correct(&self, p: Vector2<f64>) -> Vector2<f64> {
        let [c, s] = self.cos_sin;
        let d = p - self.principal;
        let [u, v] = self.nuisance.shift_px;
        self.principal + Vector2::new(c * d.x - s * d.y + u, s * d.x + c * d.y + v)
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
        let [c, s] = self.cos_sin;
        let mut jacobian = Matrix2x3::zeros();
        for k in 0..3 {
            let du = (m[(0, k)] - u * m[(2, k)]) * inverse;
            let dv = (m[(1, k)] - v * m[(2, k)]) * inverse;
            jacobian[(0, k)] = c * du - s * dv;
            jacobian[(1, k)] = s * du + c * dv;
        }
        (self.correct(Vector2::new(u, v)), jacobian)
    }

    /// Derivative of a projected point with respect to the roll, px per radian.
    #[inline]
    pub(crate) fn roll_derivative(&self, image: &Vector2<f64>) -> Vector2<f64> {
        let [u, v] = self.nuisance.shift_px;
        let d = image - self.principal - Vector2::new(u, v);
        Vector2::new(-d.y, d.x)
    }

    /// Pixels per world unit across the line of sight at a world point.
    pub(crate) fn px_per_unit(&self, x: &Vector3<f64>) -> f64 {
        let (_, jacobian) = self.project_with_jacobian(x);
        // The root mean square over the two image axes of the gradient lengths.
        (0.5 * jacobian.norm_squared()).sqrt()
    }
}
