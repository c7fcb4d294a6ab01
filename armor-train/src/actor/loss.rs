//! What the actor's update minimises (Eqs. 13 to 16).

/// What the update minimises: sums over a share of the batch, or means over all of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActorLoss {
    /// `w |eps_hat - eps|^2` (Eq. 13).
    pub cloning: f64,
    /// `Q_r(s, kappa, a_pi)`.
    pub reward: f64,
    /// `|Q_r(s, kappa, a_pi)|`.
    pub reward_size: f64,
    /// `Q_cL(s, kappa, a_pi)`.
    pub long_cost: f64,
    /// `lambda(kappa) (Q_cL - kappa)`, the negative of Eq. 16.
    pub penalty: f64,
    /// `lambda(kappa)`.
    pub lambda: f64,
}

impl std::ops::Add for ActorLoss {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            cloning: self.cloning + other.cloning,
            reward: self.reward + other.reward,
            reward_size: self.reward_size + other.reward_size,
            long_cost: self.long_cost + other.long_cost,
            penalty: self.penalty + other.penalty,
            lambda: self.lambda + other.lambda,
        }
    }
}

impl std::ops::Mul<f64> for ActorLoss {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self {
            cloning: self.cloning * factor,
            reward: self.reward * factor,
            reward_size: self.reward_size * factor,
            long_cost: self.long_cost * factor,
            penalty: self.penalty * factor,
            lambda: self.lambda * factor,
        }
    }
}
