//! A robot's day: a policy in flash flies a plant on a virtual clock, where
//! samples travel, actions take time, and everything breaks that breaks in the
//! field.
//!
//! ```text
//! sample --transport--> settle costs, journal, step --latency--> --transport--> actuators
//!    every control step         a rung that ends in time    |       hold until the next
//!                               watchdog <------------------+
//! ```
//!
//! The clock is virtual and every draw is seeded: a flight repeats itself bit
//! for bit. A latency is that of a board's model ([`crate::board`]), or none
//! where the host flies. The plant goes on while the controller computes; an
//! action takes effect at the next sub-step of the plant.
//!
//! Whatever the faults, two things must hold, and a referee who knows the
//! truth counts where they do not: no action out of range ever comes to the
//! actuators, and the controller never has more budget than the limit less
//! what was truly incurred by the steps that it was charged for.
//!
//! One simplification: weights that a flipped bit turns into what no image may
//! hold are taken for a network that answers no number, at once.
//!
//! Words: a *period* is the time from one sample to the next, a control step;
//! *transport* is the time that a sample or an action travels; *late* is an
//! answer that comes to the actuators after its period; a *scrub* is a check of
//! the weights in RAM.

mod actuators;
mod clock;
mod deadline;
mod device;
mod episode;
mod firmware;
mod flip;
mod flown;
mod record;
mod referee;
mod robot;
mod setup;
pub mod soak;
pub mod sweep;
mod tally;

pub use device::{Device, NotFlashed};
pub use episode::{Ended, fly};
pub use flown::{RobotFlight, fly_all};
pub use record::{Decision, Notice, NoticeSet, Record, RobotEpisode};
pub use setup::Setup;
pub use tally::Tally;

#[cfg(test)]
mod tests;
