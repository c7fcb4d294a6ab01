//! Simulated NOR flash, as the microcontrollers of [`armor_infer`] have it.
//!
//! Reads of bytes, writes of whole words that only clear bits, erases of whole
//! blocks, wear counted; and power that may be cut within any operation.

#[cfg(test)]
mod journal_tests;
mod nor;

pub use nor::{ERASE_BYTES, FlashFault, NorModel, WRITE_BYTES};
