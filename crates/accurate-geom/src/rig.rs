use crate::{Camera, Fundamental, GeomError, LengthUnit, Pixel, Point3, View1, View2};

/// Two cameras with different centres, and the unit of their world.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    camera1: Camera,
    camera2: Camera,
    unit: LengthUnit,
    f12: Fundamental<View1, View2>,
    /// The transpose of `f12` but for rounding. Made with it, so that [`swapped`](Self::swapped) has
    /// nothing to refuse.
    f12_of_swapped: Fundamental<View1, View2>,
}

impl Rig {
    /// A rig of the cameras of view 1 and view 2.
    ///
    /// # Errors
    /// [`GeomError::ZeroBaseline`] if the centres are closer than 1e-9 of the longer translation:
    /// below that, rounding in `R` and `t` decides the direction of the baseline.
    /// [`GeomError::NotFinite`] if the entries of `F` vanish or overflow.
    pub fn new(camera1: Camera, camera2: Camera, unit: LengthUnit) -> Result<Self, GeomError> {
        let distance = (camera1.centre() - camera2.centre()).norm();
        let scale = camera1.t().norm().max(camera2.t().norm());
        if !(distance > 1e-9 * scale) {
            return Err(GeomError::ZeroBaseline { distance, scale });
        }
        let f12 = Fundamental::from_cameras(&camera1, &camera2)?;
        let f12_of_swapped = Fundamental::from_cameras(&camera2, &camera1)?;
        Ok(Self { camera1, camera2, unit, f12, f12_of_swapped })
    }

    /// The camera of view 1.
    pub fn camera1(&self) -> &Camera {
        &self.camera1
    }

    /// The camera of view 2.
    pub fn camera2(&self) -> &Camera {
        &self.camera2
    }

    /// The unit of the world.
    pub fn unit(&self) -> LengthUnit {
        self.unit
    }

    /// `F` with `p1ᵀ F p2 = 0`: pixels of view 2 to lines of view 1.
    pub fn fundamental(&self) -> &Fundamental<View1, View2> {
        &self.f12
    }

    /// The same rig with the views exchanged.
    pub fn swapped(&self) -> Self {
        Self {
            camera1: self.camera2.clone(),
            camera2: self.camera1.clone(),
            unit: self.unit,
            f12: self.f12_of_swapped,
            f12_of_swapped: self.f12,
        }
    }

    /// Both images of a world point.
    ///
    /// # Errors
    /// [`GeomError::NotInFront`] if it is behind one of the cameras. As [`Camera::project`], it does
    /// not look for images that overflow.
    pub fn project(&self, point: &Point3) -> Result<(Pixel<View1>, Pixel<View2>), GeomError> {
        Ok((self.camera1.project(point)?.into(), self.camera2.project(point)?.into()))
    }
}
