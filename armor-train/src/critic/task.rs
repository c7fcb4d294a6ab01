//! What the critics estimate.

use crate::nn::Scalar;

/// What a pair of heads estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Discounted reward, `Q_r`.
    Reward,
    /// Long-term cost, `Q_cL`.
    LongCost,
    /// Short-term cost, `Q_cS`.
    ShortCost,
}

impl Task {
    /// All tasks, in the order of their heads.
    pub const ALL: [Self; 3] = [Self::Reward, Self::LongCost, Self::ShortCost];

    /// Whether the twin `a` is the more pessimistic one: the smaller reward, the larger cost.
    pub(super) fn is_worse<T: Scalar>(self, a: T, b: T) -> bool {
        match self {
            Self::Reward => a <= b,
            Self::LongCost | Self::ShortCost => a >= b,
        }
    }
}
