//! Room for chains, handed from one share of a batch to the next.
//!
//! What a chain remembers for its gradient is most of the memory of an update: three
//! hidden layers of every step. As many chains as there are threads serve all shares.

use std::sync::{Mutex, PoisonError};

use super::chain::Chain;
use crate::nn::Scalar;

/// Chains that no share uses. A run of a chain writes all that its backward pass
/// reads, so it does not matter whose it was.
#[derive(Debug)]
pub struct Chains<T: Scalar>(Mutex<Vec<Chain<T>>>);

impl<T: Scalar> Chains<T> {
    /// A chain for `samples` columns: one that was given back, or else a new one.
    pub(super) fn lend(&self, samples: usize, new: impl FnOnce() -> Chain<T>) -> Chain<T> {
        let mut idle = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let fitting = idle.iter().position(|chain| chain.action.ncols() == samples);
        let chain = fitting.map(|index| idle.swap_remove(index));
        drop(idle);
        chain.unwrap_or_else(new)
    }

    pub(super) fn give_back(&self, chain: Chain<T>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(chain);
    }
}

impl<T: Scalar> Default for Chains<T> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}
