use crate::TraverseError;

/// How a step length enters the loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Norm {
    /// `max(|dx|, |dy|)`.
    Chebyshev,
    /// `sqrt(dx² + dy²)`.
    Euclidean,
}

impl Norm {
    pub(crate) fn length(self, dx: f64, dy: f64) -> f64 {
        match self {
            Self::Chebyshev => dx.abs().max(dy.abs()),
            Self::Euclidean => (dx * dx + dy * dy).sqrt(),
        }
    }
}

/// The parameters of the traversal. [`TraverseParams::PAPER`] is the published setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TraverseParams {
    /// Points of the trace that enter the curvature, besides the candidate. Paper: `m`, value not
    /// given; 10 reproduces it. At most [`Self::MAX_CURVATURE_WINDOW`].
    pub curvature_window: usize,
    /// Half side of the square searched first, px. Paper: not mentioned; 10 reproduces it.
    pub radius_min_px: u32,
    /// Half side of the largest square searched, hence the longest gap bridged, px. Paper: r_max = 50.
    pub max_gap_px: u32,
    /// Weight of the angle penalty `1 - cos`. Paper: λ_a = 1.0.
    pub angle_weight: f64,
    /// Weight of the step length, 1/px. Paper: λ_d = 0.5.
    pub distance_weight: f64,
    /// Norm of the step length. Paper: ‖·‖, without saying which; Chebyshev reproduces it.
    pub distance_norm: Norm,
}

impl TraverseParams {
    /// The published setting.
    pub const PAPER: Self = Self {
        curvature_window: 10,
        radius_min_px: 10,
        max_gap_px: 50,
        angle_weight: 1.0,
        distance_weight: 0.5,
        distance_norm: Norm::Chebyshev,
    };

    /// The longest curvature window accepted; one table of two rows is kept per length.
    pub const MAX_CURVATURE_WINDOW: usize = 512;

    pub(crate) fn validate(&self) -> Result<(), TraverseError> {
        let refuse =
            |name, value, expected| Err(TraverseError::InvalidParameter { name, value, expected });
        if self.curvature_window > Self::MAX_CURVATURE_WINDOW {
            return refuse("curvature_window", self.curvature_window as f64, "at most 512 points");
        }
        if self.radius_min_px == 0 {
            return refuse("radius_min_px", 0.0, "at least 1 px");
        }
        if self.max_gap_px < self.radius_min_px {
            return refuse("max_gap_px", f64::from(self.max_gap_px), "at least radius_min_px");
        }
        for (name, value) in
            [("angle_weight", self.angle_weight), ("distance_weight", self.distance_weight)]
        {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(name, value, "finite and not negative");
            }
        }
        Ok(())
    }
}

impl Default for TraverseParams {
    fn default() -> Self {
        Self::PAPER
    }
}
