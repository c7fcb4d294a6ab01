//! The dimensions of a policy network (Appendix B), and what follows from them.
//!
//! ```text
//! e(kappa) = W_3 mish(W_2 mish(W_1 (scale kappa) + b_1) + b_2) + b_3
//! h_1 = mish(W_a a + T[n] + (W_s s + W_k e(kappa) + b))      bracket: once an action
//! h_2 = mish(W h_1 + b)
//! h_3 = mish(W h_2 + b)
//! eps = W h_3 + b
//! ```
//!
//! `T` is the time embedding, folded into one bias vector for each step at export.

use serde::{Deserialize, Serialize};

/// Most entries of an action vector that an image can say.
pub const MAX_ACTION: usize = 64;

/// Dimensions of a policy network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shape {
    /// Entries of the state vector.
    pub state: u16,
    /// Entries of the action vector.
    pub action: u16,
    /// Width of the three hidden layers of the denoiser.
    pub hidden: u16,
    /// Width of the two hidden layers of the kappa embedding.
    pub kappa_hidden: u16,
    /// Width of the kappa embedding.
    pub kappa_embedding: u16,
    /// Noise levels `N` that the time table knows.
    pub steps: u16,
}

impl Shape {
    /// Whether every dimension is at least 1 and no larger than an image can say.
    pub const fn is_valid(&self) -> bool {
        const fn within(value: u16, max: u16) -> bool {
            value >= 1 && value <= max
        }
        within(self.state, 1024)
            && within(self.action, MAX_ACTION as u16)
            && within(self.hidden, 1024)
            && within(self.kappa_hidden, 1024)
            && within(self.kappa_embedding, 1024)
            && within(self.steps, crate::schedule::MAX_STEPS as u16)
    }

    /// Multiply-accumulates of one call of the denoiser inside the chain.
    pub const fn macs_per_step(&self) -> u64 {
        let (a, h) = (self.action as u64, self.hidden as u64);
        a * h + 2 * h * h + h * a
    }

    /// Multiply-accumulates of what is computed once an action: the kappa
    /// embedding and the state and budget part of layer 1.
    pub const fn macs_once(&self) -> u64 {
        let (k, e) = (self.kappa_hidden as u64, self.kappa_embedding as u64);
        k + k * k + k * e + (self.state as u64 + e) * self.hidden as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER_BALL_RUN: Shape =
        Shape { state: 7, action: 2, hidden: 256, kappa_hidden: 32, kappa_embedding: 16, steps: 20 };

    #[test]
    fn macs_of_the_paper_size() {
        assert_eq!(PAPER_BALL_RUN.macs_per_step(), 2 * 256 + 2 * 256 * 256 + 256 * 2);
        assert_eq!(PAPER_BALL_RUN.macs_once(), 32 + 32 * 32 + 32 * 16 + (7 + 16) * 256);
    }

    #[test]
    fn a_dimension_of_zero_or_beyond_the_format_is_invalid() {
        assert!(PAPER_BALL_RUN.is_valid());
        assert!(!Shape { state: 0, ..PAPER_BALL_RUN }.is_valid());
        assert!(!Shape { action: 65, ..PAPER_BALL_RUN }.is_valid());
        assert!(!Shape { steps: 65, ..PAPER_BALL_RUN }.is_valid());
        assert!(!Shape { hidden: 0, ..PAPER_BALL_RUN }.is_valid());
    }
}
