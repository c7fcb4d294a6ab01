//! The controller: a state and an incurred cost in, a bounded action out.
//!
//! It reads a policy image in place, keeps the episode's cost budget, and runs
//! the denoising chain from noise to an action at every control step. It never
//! allocates, never reads a clock, never panics and never sees a reward; its
//! RAM is a constant known when the firmware is built
//! ([`Controller::RAM_BYTES`]), and every machine computes the same bits.
//!
//! | paper | here |
//! |---|---|
//! | section 3.5, the control loop | `controller.rs`, `control_loop.rs` |
//! | - (the best of several actions by the critic of Eq. 2) | `best_of.rs` |
//! | Eq. 12, the reverse process | `sampler.rs` |
//! | Appendix B, the denoiser | `denoiser/` |
//! | its products and activations, bit for bit on every machine | `kernel/` |
//! | - (the wire to a robot or its simulator, `docs/link.md`) | `link/` |
//! | - (what a cost monitor reports, charged once) | `meter.rs` |
//! | - (the budget across resets, in flash) | `journal.rs`, `log.rs` |
//! | - (the controller in C, feature `capi`) | `capi/`, `include/armor.h` |
//!
//! Words: a *policy* is a trained network and its chains, in flash; *kappa* is
//! the cost that may still be incurred in this episode; a *chain* is a run of
//! the denoiser from noise to an action; a *rung* is one of the chains that an
//! image carries; the *fallback* is the action that the image names for when
//! none can be computed; the *golden trace* is an episode in the image that
//! the controller must reproduce bit for bit before it may fly ([`golden`]).
//!
//! ```no_run
//! use armor_core::{image::PolicyImage, units::CostLimit};
//! use armor_infer::{Controller, Policy, golden};
//!
//! // The largest state and action, and the widest layer, that this firmware flies.
//! const STATE: usize = 60;
//! const ACTION: usize = 2;
//! const HIDDEN: usize = 256;
//!
//! # fn sense() -> ([f32; 60], f32) { unimplemented!() }
//! # fn act(_: &[f32]) {}
//! # fn fly(flash: &'static [u8]) -> Result<(), Box<dyn core::error::Error>> {
//! let image = PolicyImage::new_checked(flash)?; // 16-byte aligned, read in place
//! golden::replay::<STATE, ACTION, HIDDEN>(&image)?;
//! let policy = Policy::load(&image)?;
//! let (limit, seed) = (CostLimit::new(20.0)?, 1);
//! let mut controller = Controller::<STATE, ACTION, HIDDEN>::new(policy, limit, seed)?;
//! loop {
//!     let (state, incurred) = sense();
//!     let step = controller.step(&state, incurred);
//!     act(step.action.as_slice());
//! }
//! # }
//! ```

#![no_std]
#![deny(unsafe_code)]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod best_of;
#[cfg(feature = "capi")]
pub mod capi;
mod control_loop;
mod controller;
mod denoiser;
#[cfg(test)]
mod fixture;
pub mod golden;
pub mod journal;
mod kernel;
pub mod link;
pub mod log;
pub mod meter;
mod policy;
mod sampler;

pub use best_of::BestOf;
pub use controller::{Controller, Fault, Step};
pub use kernel::Kernel;
pub use policy::{LoadError, Policy};
pub use sampler::STREAMS;
