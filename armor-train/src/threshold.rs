//! What the long-term cost is held against (Eqs. 14 to 16).
//!
//! `Q_cL` is discounted and kappa is not: over a long episode the paper's
//! constraint `Q_cL <= kappa` is looser than the budget.

use serde::{Deserialize, Serialize};

/// The bound on `Q_cL`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Threshold {
    /// Kappa itself (the paper).
    Kappa,
    /// Kappa as it would be discounted if it were spent evenly over the rest of the episode.
    Discounted,
}

/// `(1 - g^n) / ((1 - g) n)`: the discounted share of a cost that is spent
/// evenly over `n >= 1` steps; 1 without discount.
pub fn ratio(discount: f64, steps: usize) -> f64 {
    let n = steps as f64;
    if discount == 1.0 { 1.0 } else { (1.0 - discount.powf(n)) / ((1.0 - discount) * n) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_an_evenly_spent_cost() {
        for (steps, expected) in [(1, 1.0), (100, 0.634), (200, 0.433), (500, 0.199), (1000, 0.100)] {
            assert!((ratio(0.99, steps) - expected).abs() < 5e-4, "{steps}");
        }
        assert_eq!(ratio(1.0, 100), 1.0);
    }
}
