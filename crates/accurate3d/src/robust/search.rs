use accurate_fit::OutlinePair;
use accurate_geom::Rig;

use super::RobustParams;

/// Everything that stays the same while candidates come and go.
pub(crate) struct Search<'a> {
    pub(crate) outlines: &'a OutlinePair<'a>,
    pub(crate) rig: &'a Rig,
    pub(crate) params: &'a RobustParams,
    pub(crate) case: &'a str,
    pub(crate) effort: Effort,
}

/// How much is tried before a good curve is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effort {
    /// What is right for most.
    Quick,
    /// All proposals up to [`RobustParams::max_fits`], each from every start.
    Thorough,
}
