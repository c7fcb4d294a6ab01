//! The paper: a safe robot policy from recorded data.
//!
//! | paper | here |
//! |---|---|
//! | section 3.1, cost thresholds | [`data`] |
//! | Eqs. 2 to 4, multi-task critic | [`critic`] |
//! | Eq. 5, gradient surgery | [`pcgrad`] |
//! | Eqs. 6 and 7, trajectory weights | [`reweight::trajectory`] |
//! | Eqs. 8 and 9, counterfactual weights | [`reweight::counterfactual`] |
//! | Eq. 10, combined weights | [`reweight`] |
//! | Eqs. 11 to 15, diffusion actor | [`actor`] |
//! | Eq. 16, dual variable | [`dual`] |
//! | section 3, one training step | [`learner`], [`update`] |
//! | Table 2, hyperparameters | [`config`] |
//! | a trained policy in integers | [`quantize`] |
//! | policies from and for other runtimes | [`import`], [`onnx`] |

pub mod actor;
pub mod allocator;
pub mod batch;
pub mod calibrate;
pub mod cli;
pub mod collect;
pub mod config;
pub mod critic;
pub mod data;
pub mod dual;
pub mod export;
pub mod extraction;
pub mod import;
pub mod learner;
pub mod model;
pub mod nn;
pub mod normaliser;
pub mod onnx;
pub mod pcgrad;
pub mod phase;
pub mod pool;
pub mod quantize;
pub mod report;
pub mod reweight;
pub mod run;
pub mod sampling;
pub mod selection;
mod source;
mod stream;
pub mod study;
#[cfg(test)]
mod testing;
pub mod threshold;
pub mod update;
