//! Cameras whose images lie otherwise. `K` stays upper triangular, `R` a rotation.

use accurate3d::geom::nalgebra::{Matrix3, Vector3};
use accurate3d::geom::{Camera, ImageSize};

/// The camera whose image is the mirrored one: x becomes width - 1 - x.
pub fn mirrored(camera: &Camera) -> Camera {
    let size = camera.size();
    let mut mirror = Matrix3::identity();
    mirror[(0, 0)] = -1.0;
    mirror[(0, 2)] = f64::from(size.width) - 1.0;
    Camera::new(mirror * camera.k(), *camera.r(), *camera.t(), size).unwrap()
}

/// The camera whose image is the transposed one: x and y are exchanged.
pub fn transposed(camera: &Camera) -> Camera {
    let swap = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let flip = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
    let k = swap * camera.k() * swap * flip;
    let size = ImageSize { width: camera.size().height, height: camera.size().width };
    Camera::new(k, flip * swap * camera.r(), flip * swap * camera.t(), size).unwrap()
}
