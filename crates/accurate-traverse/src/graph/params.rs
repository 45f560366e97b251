use crate::TraverseError;

/// How a skeleton becomes a graph. [`GraphParams::DEFAULT`] is meant to be left alone.
///
/// The first three lengths grow with the thickness `w` of the mask, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GraphParams {
    /// A side branch shorter than `spur_per_thickness * w + spur_px` is an artefact of thinning.
    pub spur_per_thickness: f64,
    /// See [`Self::spur_per_thickness`], px.
    pub spur_px: f64,
    /// A loop from a node to itself is dropped below this many spur lengths.
    pub loop_per_spur: f64,
    /// Two junctions joined by less than this, px, are one.
    pub contract_px: f64,
    /// A piece on its own that is shorter than this, px, is dropped (if longer ones are there).
    pub piece_px: f64,
    /// A stretch of an edge this much wider than the body, px, hides a second strand.
    pub step_px: f64,
    /// Such a stretch is at least this long, px.
    pub step_length_px: f64,
    /// Standard deviations of the two Gaussians that smooth an edge, px (one sample per px).
    pub smooth_sigma_px: [f64; 2],
    /// Two tips this near, px, are always linked: a gap may hide a hairpin.
    pub near_link_px: f64,
    /// The longest link, px.
    pub far_link_px: f64,
    /// Tips farther apart than [`Self::near_link_px`] are linked if both point at each other with at
    /// least this cosine.
    pub far_link_cosine: f64,
    /// A tip is linked to the body that its tangent meets: no nearer than this, px.
    pub ray_from_px: f64,
    /// Half width of the ray at the tip, px.
    pub ray_half_width_px: f64,
    /// Growth of the half width per px of the ray.
    pub ray_slope: f64,
    /// The last part of the tip's own edge that the ray does not see, px.
    pub ray_blind_px: f64,
    /// A place on an edge nearer to a node than this, px along the edge, is that node; elsewhere the edge
    /// is split for it.
    pub snap_px: f64,
}

impl GraphParams {
    /// The default, for masks of any thickness.
    pub const DEFAULT: Self = Self {
        spur_per_thickness: 0.8,
        spur_px: 1.0,
        loop_per_spur: 1.5,
        contract_px: 3.0,
        piece_px: 6.0,
        step_px: 0.8,
        step_length_px: 5.0,
        smooth_sigma_px: [1.5, 1.0],
        near_link_px: 24.0,
        far_link_px: 50.0,
        far_link_cosine: 0.2,
        ray_from_px: 3.0,
        ray_half_width_px: 1.5,
        ray_slope: 0.15,
        ray_blind_px: 25.0,
        snap_px: 6.0,
    };

    /// Area up to which a hole of a mask `mask_thickness_px` thick is filled before thinning:
    /// `2 w²`, px; 0 for a thickness that is not a positive number. See [`crate::fill_small_holes`].
    pub fn hole_area_px(mask_thickness_px: f64) -> usize {
        // The cast saturates, and NaN becomes 0.
        (2.0 * mask_thickness_px * mask_thickness_px.max(0.0)) as usize
    }

    pub(crate) fn spur_length_px(&self, mask_thickness_px: f64) -> f64 {
        self.spur_per_thickness * mask_thickness_px + self.spur_px
    }

    pub(crate) fn validate(&self) -> Result<(), TraverseError> {
        for (name, value) in [
            ("spur_per_thickness", self.spur_per_thickness),
            ("spur_px", self.spur_px),
            ("loop_per_spur", self.loop_per_spur),
            ("contract_px", self.contract_px),
            ("piece_px", self.piece_px),
            ("step_px", self.step_px),
            ("step_length_px", self.step_length_px),
            ("near_link_px", self.near_link_px),
            ("far_link_px", self.far_link_px),
            ("ray_from_px", self.ray_from_px),
            ("ray_half_width_px", self.ray_half_width_px),
            ("ray_slope", self.ray_slope),
            ("ray_blind_px", self.ray_blind_px),
            ("snap_px", self.snap_px),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                let expected = "finite and not negative";
                return Err(TraverseError::InvalidParameter { name, value, expected });
            }
        }
        if self.snap_px < 1.0 {
            let (name, value) = ("snap_px", self.snap_px);
            let expected = "1 px at least: an edge is cut between two of its points";
            return Err(TraverseError::InvalidParameter { name, value, expected });
        }
        for value in self.smooth_sigma_px {
            if !(0.0..=100.0).contains(&value) {
                let (name, expected) = ("smooth_sigma_px", "0 to 100 px");
                return Err(TraverseError::InvalidParameter { name, value, expected });
            }
        }
        if !(-1.0..=1.0).contains(&self.far_link_cosine) {
            let (name, value) = ("far_link_cosine", self.far_link_cosine);
            return Err(TraverseError::InvalidParameter { name, value, expected: "-1 to 1" });
        }
        Ok(())
    }
}

impl Default for GraphParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}
