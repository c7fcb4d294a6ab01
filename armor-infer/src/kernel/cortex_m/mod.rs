//! Cortex-M4, M7, M33 and M55: the 16-bit SIMD of Armv7E-M and of Armv8-M with
//! the DSP extension, and single precision where there is an FPU.
//!
//! The loops are naked functions, for a compiler keeps neither sixteen sums in
//! the registers of the FPU nor two rows in a half-word. Each works on whole
//! blocks, and portable code on what is left over.
//! [`Kernel::check`](super::Kernel::check) compares them with the portable
//! kernel on the machine itself.
#![allow(unsafe_code)]

// Tells the assembler the processor: outside of a function's body it does not
// know the target's extensions.
#[cfg(feature = "cortex-m55")]
macro_rules! processor {
    () => {
        ".cpu cortex-m55"
    };
}
#[cfg(all(feature = "cortex-m33", not(feature = "cortex-m55")))]
macro_rules! processor {
    () => {
        ".cpu cortex-m33"
    };
}
#[cfg(not(any(feature = "cortex-m33", feature = "cortex-m55")))]
macro_rules! processor {
    () => {
        ".cpu cortex-m4"
    };
}

mod codes;
#[cfg(target_abi = "eabihf")]
mod float;
mod pairs;
#[cfg(feature = "cortex-m55")]
mod rows;

pub(super) use codes::{activate, rescale};
#[cfg(target_abi = "eabihf")]
pub(super) use float::accumulate;
pub(super) use pairs::sum_pairs;
#[cfg(feature = "cortex-m55")]
pub(super) use rows::sum_rows_short;
