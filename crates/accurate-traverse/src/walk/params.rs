use crate::TraverseError;

/// What a walk through a [`SkeletonGraph`](crate::SkeletonGraph) costs. Costs have no unit; only
/// their ratios count. A bend costs `(1 - cos) * (bend + bend_by_length * b)`, where `b` is the
/// length of the edge entered over [`Self::memory_px`], between [`Self::memory_min`] and 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WalkParams {
    /// Walks returned at most, 1 to 10,000.
    pub walks: usize,
    /// Partial walks kept per number of edges, 1 to 100,000.
    pub beam: usize,
    /// Edges of a walk at most, counted with repetition.
    pub max_steps: usize,
    /// The direction of an edge at a node is taken from here, px along the edge: nearer, thinning
    /// bends the skeleton into the junction.
    pub direction_from_px: f64,
    /// The direction of an edge at a node is taken up to here, px along the edge.
    pub direction_to_px: f64,
    /// An edge of this length, px, makes the walk forget where it came from; a shorter one turns the
    /// remembered direction in part. That tells the two branches behind a short common edge apart.
    pub memory_px: f64,
    /// The least part by which an edge turns the remembered direction, 0 to 1.
    pub memory_min: f64,
    /// Price of a bend into any edge.
    pub bend: f64,
    /// Price of a bend into a long edge on top of that.
    pub bend_by_length: f64,
    /// Turning round at a tip: the image of a hairpin may have merged into one strand.
    pub u_turn: f64,
    /// Turning round where the body becomes thinner.
    pub step_u_turn: f64,
    /// Turning round at a junction: a hairpin may end on another strand.
    pub inner_u_turn: f64,
    /// Starting or ending at a node that is neither a tip nor a place where the body becomes thinner.
    pub inner_end: f64,
    /// Starting or ending where the body becomes thinner.
    pub step_end: f64,
    /// Body not walked along, per px.
    pub uncovered_per_px: f64,
    /// Walking along an edge a second time, per px.
    pub reuse_per_px: f64,
    /// Length, px, beyond which a second time costs no more.
    pub reuse_max_px: f64,
    /// A third time on top of the second.
    pub third_use: f64,
    /// Taking a link.
    pub link: f64,
    /// Taking a link, per px.
    pub link_per_px: f64,
}

impl WalkParams {
    /// The default.
    pub const DEFAULT: Self = Self {
        walks: 64,
        beam: 600,
        max_steps: 400,
        direction_from_px: 2.5,
        direction_to_px: 11.0,
        memory_px: 20.0,
        memory_min: 0.05,
        bend: 0.4,
        bend_by_length: 0.6,
        u_turn: 0.6,
        step_u_turn: 1.0,
        inner_u_turn: 1.6,
        inner_end: 0.8,
        step_end: 0.6,
        uncovered_per_px: 0.1,
        reuse_per_px: 0.012,
        reuse_max_px: 60.0,
        third_use: 0.5,
        link: 0.3,
        link_per_px: 0.02,
    };

    pub(crate) fn validate(&self) -> Result<(), TraverseError> {
        for (name, value, most) in [
            ("walks", self.walks, 10_000),
            ("beam", self.beam, 100_000),
            ("max_steps", self.max_steps, 100_000),
        ] {
            if !(1..=most).contains(&value) {
                let expected = "1 to 10,000 walks, 100,000 states of the beam, 100,000 steps";
                return Err(TraverseError::InvalidParameter {
                    name,
                    value: value as f64,
                    expected,
                });
            }
        }
        for (name, value) in [
            ("direction_from_px", self.direction_from_px),
            ("memory_px", self.memory_px),
            ("bend", self.bend),
            ("bend_by_length", self.bend_by_length),
            ("u_turn", self.u_turn),
            ("step_u_turn", self.step_u_turn),
            ("inner_u_turn", self.inner_u_turn),
            ("inner_end", self.inner_end),
            ("step_end", self.step_end),
            ("uncovered_per_px", self.uncovered_per_px),
            ("reuse_per_px", self.reuse_per_px),
            ("reuse_max_px", self.reuse_max_px),
            ("third_use", self.third_use),
            ("link", self.link),
            ("link_per_px", self.link_per_px),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                let expected = "finite and not negative";
                return Err(TraverseError::InvalidParameter { name, value, expected });
            }
        }
        if !(0.0..=1.0).contains(&self.memory_min) {
            let (name, value) = ("memory_min", self.memory_min);
            return Err(TraverseError::InvalidParameter { name, value, expected: "0 to 1" });
        }
        if !(self.direction_to_px > self.direction_from_px && self.direction_to_px.is_finite()) {
            let (name, value) = ("direction_to_px", self.direction_to_px);
            let expected = "finite and above direction_from_px";
            return Err(TraverseError::InvalidParameter { name, value, expected });
        }
        Ok(())
    }
}

impl Default for WalkParams {
    fn default() -> Self {
        Self::DEFAULT
    }
}
