use accurate_geom::Point2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// What the beam or the display leaves of the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Aperture {
    /// The whole image.
    Open,
    /// Blades: centre, half sizes, turn (radians) and how far the corners are cut, px.
    Blades { centre: Point2, half: (f64, f64), turn: f64, cut_px: f64 },
    /// The round field of an image intensifier.
    Circle { centre: Point2, radius_px: f64 },
}

impl Aperture {
    pub fn draw(rng: &mut ChaCha8Rng, side: f64) -> Self {
        let mut near = || side * (0.5 + rng.random_range(-0.04..0.04));
        let centre = Point2::new(near(), near());
        match rng.random_range(0..20_u32) {
            0..8 => Self::Open,
            8..15 => Self::Blades {
                centre,
                half: (side * rng.random_range(0.36..0.52), side * rng.random_range(0.36..0.52)),
                turn: if rng.random_bool(0.3) { rng.random_range(-0.15..0.15) } else { 0.0 },
                cut_px: if rng.random_bool(0.4) {
                    side * rng.random_range(0.03..0.15)
                } else {
                    0.0
                },
            },
            _ => Self::Circle { centre, radius_px: side * rng.random_range(0.43..0.6) },
        }
    }

    /// Signed distance to the edge, px, positive inside (exact but near cut corners).
    pub fn inside_px(&self, at: &Point2) -> f64 {
        match self {
            Self::Open => f64::INFINITY,
            Self::Circle { centre, radius_px } => radius_px - (at - centre).norm(),
            Self::Blades { centre, half, turn, cut_px } => {
                let (sin, cos) = turn.sin_cos();
                let d = at - centre;
                let (u, v) = ((cos * d.x + sin * d.y).abs(), (cos * d.y - sin * d.x).abs());
                let corner = (half.0 + half.1 - cut_px - u - v) * std::f64::consts::FRAC_1_SQRT_2;
                (half.0 - u).min(half.1 - v).min(corner)
            }
        }
    }
}
