//! The controller's world: what it flies, what it is flashed to, and what
//! proves that it is what was trained.
//!
//! | here | says |
//! |---|---|
//! | [`task`], [`plant`] | the tasks and their scores; robots in f64, equal to their simulators |
//! | [`calibrate`] | how far a plant is from a recording |
//! | [`image_file`], [`flash`], [`chip`] | an image in a file; flash whose power can be cut; two slots of it that boot one |
//! | [`board`] | microcontroller boards, and a model of what an action takes on them |
//! | [`host`], [`flight`], [`summary`] | the controller on this computer, in a fixed-rate loop, and its scores |
//! | [`link`] | the controller behind a wire, for a robot or its simulator |
//! | [`simulator`] | the simulators that fly the tasks of the paper, over the link |
//! | [`mcu`] | the controller on emulated microcontrollers, and its instructions counted |
//! | [`harness`], [`fault`] | a robot's day on a virtual clock: deadlines, watchdog, journal; what may break in it |
//! | [`latency`], [`telemetry`], [`page`] | what each action took; a line a control step; a flight as a page |
//! | [`latency_budget`] | a board's deadline as a test of a user's own |
//! | [`reference`](mod@reference), [`verify`](mod@verify) | a second evaluation in f64; the checks of an image |
//! | [`cli`] | the commands |
//! | [`file`](mod@file), [`memory`] | files written whole; bytes on a 64-byte boundary |
//!
//! What flies is always an image that was read back and checked, through the
//! `armor-infer` that a microcontroller runs: nothing here computes an action
//! of its own but [`reference`](mod@reference), to compare.
//!
//! Words: a *plant* is a robot and its task; a *slot* is a place for an image;
//! a *flight* is several episodes of one policy; *latency* is host time around
//! the controller's step, while the flight's own clock is virtual.

#![forbid(unsafe_code)]

pub mod board;
pub mod calibrate;
pub mod chip;
pub mod cli;
pub mod fault;
pub mod file;
#[cfg(test)]
mod fixture;
pub mod flash;
pub mod flight;
pub mod harness;
pub mod host;
pub mod image_file;
pub mod latency;
pub mod latency_budget;
pub mod link;
pub mod mcu;
pub mod memory;
pub mod page;
pub mod plant;
#[cfg(test)]
mod recorded;
pub mod reference;
pub mod simulator;
pub mod sized;
pub mod summary;
pub mod task;
pub mod telemetry;
pub mod verify;
