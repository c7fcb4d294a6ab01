//! Simulated NOR flash, as the microcontrollers that fly a policy have it.
//!
//! Reads of bytes, writes of whole words that only clear bits, erases of whole
//! blocks, wear counted; and power that may be cut within any operation.

#[cfg(test)]
mod journal_tests;
mod nor;

pub use nor::{ERASE_BYTES, FlashFault, NorModel, WRITE_BYTES};
