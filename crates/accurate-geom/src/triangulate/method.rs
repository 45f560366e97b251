use super::solution::Solution;
use super::two_view::TwoView;
use crate::number::Number;

/// A triangulation without branches: on one pair of pixels or on several side by side.
pub(super) trait Method {
    /// `p1`, `p2`: x and y, px. What is wrong with them shows in the [`Solution`].
    fn solve<N: Number>(g: &TwoView, p1: &[N; 2], p2: &[N; 2]) -> Solution<N>;
}
