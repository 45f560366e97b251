use accurate_geom::{EpipolarLine, Fundamental, GeomError, Pixel, View};

/// Closer than this to the epipole, relative to the epipole's own distance from the pixel origin
/// (at least 1 px), a pixel has no epipolar line: rounding in `F` and in the pixel decides its
/// direction.
const EPIPOLE_RADIUS: f64 = 1e-9;

/// What the viewing ray of a pixel of one view looks like in view `A`.
#[derive(Debug, Clone, Copy)]
pub(crate) enum RayImage<A: View> {
    /// A line, as a rule.
    Line(EpipolarLine<A>),
    /// The ray is the baseline itself: its pixel is the epipole, and every epipolar plane contains
    /// it. The other camera sees it end on, as one point, the epipole of view `A`. A partner must
    /// lie there, so the distance to that point takes the place of the distance to a line.
    Point(Pixel<A>),
}

impl<A: View> RayImage<A> {
    pub(crate) fn distance(&self, pixel: Pixel<A>) -> f64 {
        match self {
            Self::Line(line) => line.distance(pixel),
            Self::Point(epipole) => epipole.distance(pixel),
        }
    }

    /// `None` where there is no line, hence no side of it.
    pub(crate) fn signed_distance(&self, pixel: Pixel<A>) -> Option<f64> {
        match self {
            Self::Line(line) => Some(line.signed_distance(pixel)),
            Self::Point(_) => None,
        }
    }
}

/// Turns pixels of view `B` into [`RayImage`]s of view `A`.
pub(crate) struct RayImager<A, B> {
    f: Fundamental<A, B>,
    epipole_a: Option<Pixel<A>>,
    epipole_b: Option<Pixel<B>>,
}

impl<A: View, B: View> RayImager<A, B> {
    pub(crate) fn new(f: &Fundamental<A, B>) -> Self {
        Self { f: *f, epipole_a: epipole(f), epipole_b: epipole(&f.transpose()) }
    }

    /// # Errors
    /// [`GeomError::AtEpipole`] if the ray has no image in view `A` at all: its epipolar plane is
    /// parallel to the image plane, or it is the baseline and the epipole of `A` is at infinity.
    pub(crate) fn image(&self, pixel: Pixel<B>) -> Result<RayImage<A>, GeomError> {
        if let Some(epipole_b) = self.epipole_b {
            let size = epipole_b.x.hypot(epipole_b.y).max(1.0);
            if pixel.distance(epipole_b) <= EPIPOLE_RADIUS * size {
                let nowhere = GeomError::AtEpipole { view: B::NUMBER, x: pixel.x, y: pixel.y };
                return self.epipole_a.map(RayImage::Point).ok_or(nowhere);
            }
        }
        self.f.line(pixel).map(RayImage::Line)
    }
}

/// The epipole in view `A`, the left null vector of `F`; `None` if it is at infinity.
fn epipole<A: View, B: View>(f: &Fundamental<A, B>) -> Option<Pixel<A>> {
    // It is orthogonal to every column. The columns differ in scale by the focal length, hence
    // normalise; of the three pairs take the one farthest from parallel.
    let columns: Vec<_> = f
        .matrix()
        .column_iter()
        .filter_map(|column| column.into_owned().try_normalize(0.0))
        .collect();
    let mut best = None;
    let mut best_sine = 0.0;
    for (k, a) in columns.iter().enumerate() {
        for b in &columns[k + 1..] {
            let cross = a.cross(b);
            if cross.norm() > best_sine {
                best_sine = cross.norm();
                best = Some(cross);
            }
        }
    }
    let e = best?;
    // 1e-12: beyond 1e12 px the position is rounding noise, and no pixel comes near it.
    (e.z.abs() > 1e-12 * e.norm()).then(|| Pixel::new(e.x / e.z, e.y / e.z))
}
