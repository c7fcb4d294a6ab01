//! The words that the trainer and the controller share.
//!
//! ARMOR learns a safe robot policy from recorded data on a workstation and
//! flies it on a microcontroller that keeps the robot's cost budget itself.
//! This crate holds what both sides must mean alike; [`image`] is the one
//! thing that passes between them. `no_std`, no allocation, no clock, no
//! panic; the same bits on every IEEE-754 machine.
//!
//! | paper | here |
//! |---|---|
//! | Eq. 1, cost limit `d` | [`units::CostLimit`] |
//! | section 3.5, kappa at run time | [`budget::Budget`] |
//! | Eq. 11, forward process | [`schedule::Schedule`] |
//! | Eq. 12, reverse process | [`schedule::ChainStep`] |
//! | Appendix B, activations | [`mish`] |
//! | Appendix B, denoiser | [`shape::Shape`] |
//! | the integer policies' arithmetic | [`fixed`] |
//!
//! Words: the *state* is what the robot senses, the *action* what it does;
//! *kappa* is the cost that may still be incurred in this episode; a *chain*
//! is a run of the denoiser from noise to an action; a *rung* is one of the
//! chains of different length that an image may carry.

#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod budget;
pub mod budget_map;
pub mod fixed;
pub mod image;
pub mod mish;
pub mod noise;
pub mod schedule;
pub mod shape;
mod turn;
pub mod units;
