//! The choice among candidates in plain f64, with the critic's first layer
//! over one concatenated vector.

use armor_core::image::{Critic, CriticHead, Dense};
use nalgebra::DVector;

use super::float::{Layer, layer, mish};

/// An image's critic in f64.
pub struct CriticReference {
    kappa_scale: f64,
    cost_unit: f64,
    trunk: [Layer; 2],
    reward: [[Layer; 2]; 2],
    cost: [[Layer; 2]; 2],
}

/// What the critic says of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The lesser twin of the reward.
    pub reward: f64,
    /// How far the larger twin of the long-term cost lies above the budget, in the critic's units.
    pub excess: f64,
}

impl CriticReference {
    /// The critic of an image.
    pub fn new(critic: &Critic<'_>) -> Self {
        let parts = [critic.trunk_state.weights, critic.trunk_kappa, critic.trunk_action];
        let first = Dense { weights: &parts.concat(), bias: critic.trunk_state.bias };
        let head = |head: &CriticHead<'_>| [layer(&head.hidden), layer(&head.output)];
        Self {
            kappa_scale: critic.kappa_scale.into(),
            cost_unit: critic.cost_unit.into(),
            trunk: [layer(&first), layer(&critic.trunk_2)],
            reward: critic.reward.each_ref().map(head),
            cost: critic.cost.each_ref().map(head),
        }
    }

    /// The estimate of an action `[A]` from a normalised state `[S]` and what is left of the budget.
    pub fn estimate(&self, state: &[f64], kappa: f64, action: &[f64]) -> Estimate {
        let input: Vec<f64> = [state, &[self.kappa_scale * kappa], action].concat();
        let trunk = self.trunk.iter().fold(DVector::from_vec(input), |h, layer| layer.apply(&h).map(mish));
        let head = |[hidden, output]: &[Layer; 2]| output.apply(&hidden.apply(&trunk).map(mish))[0];
        let ([one, two], [first, second]) = (self.reward.each_ref().map(head), self.cost.each_ref().map(head));
        Estimate { reward: one.min(two), excess: first.max(second) - self.cost_unit * kappa }
    }
}

impl Estimate {
    /// Whether this candidate may be the best of `all`, where estimates are
    /// known to `tolerance`: none of the others is better beyond doubt.
    pub fn may_win(&self, all: &[Self], tolerance: f64) -> bool {
        all.iter().all(|other| {
            let surely_within = other.excess < -tolerance;
            if self.excess > tolerance {
                !surely_within && self.excess <= other.excess + 2.0 * tolerance
            } else {
                !surely_within || self.reward >= other.reward - 2.0 * tolerance
            }
        })
    }
}
