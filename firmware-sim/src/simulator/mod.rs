//! Real simulators fly a policy: Safety-Gymnasium (MuJoCo) and Bullet-Safety-Gym
//! (PyBullet), each episode over the link.
//!
//! | here | says |
//! |---|---|
//! | `environment.rs` | the Python environment that the simulators run in, made on first use |
//! | `package.rs` | `armor-plant`, the plant's side of the link, which this program carries along |
//! | `process.rs` | one simulator: a process that asks, and what it tells of its episodes |
//! | `flight.rs` | a flight: several simulators side by side, one summary |
//!
//! The controller sees what any plant tells it, states and incurred costs; the
//! rewards come on another way, from the simulator's standard output to the
//! scores.

mod environment;
mod error;
mod flight;
mod package;
mod process;

pub use environment::Environment;
pub use error::SimulatorError;
pub use flight::fly;

#[cfg(test)]
mod tests;
