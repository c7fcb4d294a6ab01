//! The controller on emulated microcontrollers: the firmware of
//! `firmware-sim/mcu` under QEMU, with real instruction sets and exact counts.
//!
//! | here | says |
//! |---|---|
//! | `machine.rs` | the boards that QEMU emulates |
//! | `firmware.rs` | a built firmware: its sizes, its functions |
//! | `emulator.rs` | the firmware started, told what to do, heard, and ended in time |
//! | `episode.rs` | an episode over its UART, in lockstep with this host's controller |
//! | `bridge.rs` | its UART as a line for a plant of another program |
//! | `count.rs`, `class.rs` | instructions of an action, by function and by class |
//! | `survey.rs` | all of it, for a policy and a machine |
//! | [`record`], `budget.rs` | what actions took, recorded, and held to it |
//!
//! What is counted are instructions, never time: an emulator knows no cycles.
//!
//! Words: a *machine* is an emulated board; the *slot* is the part of its
//! memory that stands for the flash in which the policy lies.

mod bridge;
mod budget;
mod class;
mod count;
mod emulator;
mod episode;
mod error;
mod firmware;
mod machine;
pub mod record;
mod survey;

pub use bridge::bridge;
pub use budget::{Change, SIZES, TOLERANCE, changes, measure};
pub use class::Class;
pub use count::{Instructions, count};
pub use emulator::{Flashed, Running, Told};
pub use episode::{Episode, EpisodePlan, fly};
pub use error::McuError;
pub use firmware::Firmware;
pub use machine::{MACHINES, Machine};
pub use survey::{Survey, SurveyPlan, survey};
