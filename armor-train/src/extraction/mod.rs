//! How the actor takes up what the critics know.

pub mod advantage;
pub mod cloning;
pub mod condition;
pub(crate) mod risk;
pub mod trace;
pub mod weight;

use serde::{Deserialize, Serialize};

/// How the actor takes up what the critics know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extraction {
    /// By the gradient of the critics at the policy's actions (Eq. 15, the paper).
    Guidance,
    /// By cloning the recorded actions, each with the weight that its advantages earn it.
    Weighted,
}

/// By what the weights of cloning judge a recorded action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Advantage {
    /// The critics' `Q - V`.
    Critics,
    /// What the trajectory went on with, against the state values ([`trace`]).
    Recorded,
}
