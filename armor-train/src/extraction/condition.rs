//! What the actor is conditioned on.

use serde::{Deserialize, Serialize};

/// What the actor's embedding is given beside the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// The remaining budget (the paper).
    Kappa,
    /// How lenient the price of cost is: a place in a [`LambdaRange`]. The
    /// image maps the remaining budget to it.
    Lambda,
    /// Nothing: the actor is the same at every budget.
    None,
}

/// A range of prices of cost, addressed by leniency: 0 is the largest price,
/// the strictest, 1 the smallest. A uniform leniency is a log-uniform price.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LambdaRange {
    /// Smallest price, above 0.
    pub min: f64,
    /// Largest price.
    pub max: f64,
}

impl LambdaRange {
    /// `lambda = max^(1 - x) min^x` at a leniency `x` within 0 and 1.
    pub fn lambda(&self, leniency: f64) -> f64 {
        (self.max.ln() + leniency * (self.min / self.max).ln()).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leniency_is_a_place_on_the_logarithmic_range() {
        let range = LambdaRange { min: 0.5, max: 8.0 };
        for (leniency, lambda) in [(0.0, 8.0), (0.25, 4.0), (0.5, 2.0), (1.0, 0.5)] {
            assert!((range.lambda(leniency) - lambda).abs() < 1e-12);
        }
    }
}
