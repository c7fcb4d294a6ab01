//! The C interface of `armor-infer`, whole for a C linker; `armor.h` is its header.

#![no_std]

pub use armor_infer::capi::*;
